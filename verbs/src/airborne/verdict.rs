//! What the phases say of the capture.

use bodyflight_core::Segment;
use bodyflight_core::air::GRAVITY;
use bodyflight_mvnx::recording::{Mounting, Warning};
use nalgebra::Vector3;
use serde::Serialize;

use super::physics::{Fall, Momentum};
use super::steps::Step;

/// Faults are named if they exceed these many standard errors, and these sizes: a tilt (rad), and a relative difference
/// of g, within which the mass distribution of a default person leaves it. By chance 27 of 10,000 captures exceed the
/// errors: g is one number, and a tilt has two, whose length follows Rayleigh's distribution.
const SURE: f64 = 3.0;
const SURE_OF_TILT: f64 = 3.44;
const LEAST_TILT: f64 = 0.0105;
const LEAST_G: f64 = 0.025;
/// Median drift of the angular momentum over a phase that measurement does not explain: in percent, and (kg m2/s) where
/// the body hardly rotates. The mass distribution of a default person gives up to 4.6 in jumps.
const LEAST_DRIFT: f64 = 20.0;
const LEAST_DRIFT_NMS: f64 = 6.0;
/// Lowest frame rate whose differences hold the momentum of limbs (Hz).
const SLOW: f64 = 50.0;
/// Most faults that the sentence tells.
const TOLD: usize = 12;
/// Distance from the median acceleration, in standard errors, beyond which a phase counts less.
const FAR: f64 = 3.0;

/// A fault of the capture.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Fault {
    /// `tilt`, `rate`, `step`, `mounting`, `recording`, `delay` or `momentum`.
    pub kind: &'static str,
    /// In a sentence, with size and error bar.
    pub message: String,
    /// The segments concerned.
    pub segments: Vec<&'static str>,
    /// When it happens (s), if it does not last.
    pub time_s: Option<f64>,
}

/// What a capture is worth.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Verdict {
    /// Its faults.
    pub faults: Vec<Fault>,
    /// Gravity from all phases (m/s2); null without a phase.
    pub g_mps2: Option<f64>,
    /// Its standard error (m/s2), from the differences between phases if they are larger than their own errors.
    pub g_standard_error_mps2: Option<f64>,
    /// Angle between the vertical of the capture and that of the fall (rad); null without a phase.
    pub tilt_rad: Option<f64>,
    /// Its standard error (rad).
    pub tilt_standard_error_rad: Option<f64>,
    /// The verdict in a sentence.
    pub sentence: String,
}

/// Weighted mean of the accelerations (m/s2), and the standard error of a component.
pub(crate) fn combined(falls: &[Fall]) -> Option<(Vector3<f64>, f64)> {
    let middle = median(falls);
    // A phase with a glitch or a touch in it must not decide.
    let weight = |fall: &Fall| {
        let error = fall.standard_error_mps2;
        let apart = (Vector3::from(fall.acceleration_mps2) - middle).norm() / error;
        (FAR / apart.max(FAR)).powi(2) / (error * error)
    };
    let total: f64 = falls.iter().map(weight).sum();
    if falls.is_empty() || !total.is_normal() {
        return None;
    }
    let of = |fall: &Fall| Vector3::from(fall.acceleration_mps2);
    let mean = falls
        .iter()
        .map(|fall| of(fall) * weight(fall))
        .sum::<Vector3<f64>>()
        / total;
    let misfit: f64 = (falls.iter())
        .map(|fall| (of(fall) - mean).norm_squared() * weight(fall))
        .sum();
    let free = 3.0 * (falls.len() as f64 - 1.0);
    let inflation = if free > 0.0 {
        (misfit / free).max(1.0)
    } else {
        1.0
    };
    Some((mean, (inflation / total).sqrt()))
}

/// Median of each component of the accelerations (m/s2).
fn median(falls: &[Fall]) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| {
        let mut parts: Vec<f64> = falls
            .iter()
            .map(|fall| fall.acceleration_mps2[axis])
            .collect();
        parts.sort_by(f64::total_cmp);
        let middle = parts.len() / 2;
        let upper = parts.get(middle).copied().unwrap_or(0.0);
        let lower = parts
            .get(parts.len().saturating_sub(1) / 2)
            .copied()
            .unwrap_or(upper);
        0.5 * (lower + upper)
    })
}

/// Drifts of the angular momentum (percent) in ascending order; small ones count as no more than the limit.
fn drifts(momenta: &[Momentum]) -> Vec<f64> {
    let mut drifts: Vec<f64> = momenta
        .iter()
        .map(|momentum| {
            let percent = momentum.drift_percent.unwrap_or(0.0);
            if momentum.drift_nms > LEAST_DRIFT_NMS {
                percent
            } else {
                percent.min(LEAST_DRIFT)
            }
        })
        .collect();
    drifts.sort_by(f64::total_cmp);
    drifts
}

impl Verdict {
    /// Judges the falls and angular momenta of all phases in a capture of that frame rate (Hz), with other faults that were
    /// found.
    pub(super) fn of(
        falls: &[Fall],
        momenta: &[Momentum],
        mut faults: Vec<Fault>,
        rate: f64,
    ) -> Self {
        let Some((mean, error)) = combined(falls) else {
            let jumps = sentence(&faults);
            return Self {
                faults,
                g_mps2: None,
                g_standard_error_mps2: None,
                tilt_rad: None,
                tilt_standard_error_rad: None,
                sentence: format!(
                    "nothing in the air was found, so physics cannot judge this capture{jumps}"
                ),
            };
        };
        let g = mean.norm();
        let tilt = mean.angle(&-Vector3::z());
        let tilt_error = error / g;
        if tilt > LEAST_TILT.max(SURE_OF_TILT * tilt_error) {
            faults.push(tilted(&mean, tilt, tilt_error));
        }
        let ratio = g / GRAVITY;
        if (ratio - 1.0).abs() > LEAST_G.max(SURE * error / GRAVITY) {
            faults.push(Fault {
                kind: "rate",
                message: format!(
                    "g = {g:.2} +- {error:.2} m/s2: the frame rate is {:.1} % off ({:.1} +- {:.1} Hz instead of {rate:.1}), or lengths are by {:+.1} %",
                    100.0 * (ratio.sqrt() - 1.0).abs(),
                    rate / ratio.sqrt(),
                    0.5 * error / g * rate / ratio.sqrt(),
                    100.0 * (ratio - 1.0)
                ),
                segments: Vec::new(),
                time_s: None,
            });
        }
        let drifts = drifts(momenta);
        // Late postures are the reason where they are told.
        let is_late = faults.iter().any(|fault| fault.kind == "delay");
        if let Some(drift) = drifts
            .get(drifts.len() / 2)
            .filter(|drift| **drift > LEAST_DRIFT && rate >= SLOW && !is_late)
        {
            faults.push(Fault {
                kind: "momentum",
                message: format!(
                    "the angular momentum changes by {drift:.0} % in a phase: the mass distribution or the attitude of a segment is off"
                ),
                segments: Vec::new(),
                time_s: None,
            });
        }
        let told = sentence(&faults);
        Self {
            sentence: if faults.is_empty() {
                format!(
                    "consistent with free fall: g = {g:.2} +- {error:.2} m/s2 in {} phases",
                    falls.len()
                )
            } else {
                format!("{} phases{told}", falls.len())
            },
            faults,
            g_mps2: Some(g),
            g_standard_error_mps2: Some(error),
            tilt_rad: Some(tilt),
            tilt_standard_error_rad: Some(tilt_error),
        }
    }
}

fn tilted(mean: &Vector3<f64>, tilt: f64, error: f64) -> Fault {
    let part = |along: f64| (-along / mean.norm()).asin().to_degrees();
    Fault {
        kind: "tilt",
        message: format!(
            "the vertical is tilted by {:.1} +- {:.1} degrees ({:+.1} towards north, {:+.1} towards west)",
            tilt.to_degrees(),
            error.to_degrees(),
            part(mean.x),
            part(mean.y)
        ),
        segments: Vec::new(),
        time_s: None,
    }
}

/// The faults in a sentence; of many, the first.
fn sentence(faults: &[Fault]) -> String {
    let told: String = (faults.iter().take(TOLD))
        .map(|fault| format!("; {}", fault.message))
        .collect();
    match faults.len().saturating_sub(TOLD) {
        0 => told,
        more => format!("{told}; and {more} more"),
    }
}

pub(super) fn mounted(mounting: &Mounting) -> Fault {
    Fault {
        kind: "mounting",
        message: mounting.message(),
        segments: vec![mounting.segment],
        time_s: None,
    }
}

/// A fault that the recording shows by itself.
pub(super) fn contradiction(warning: &Warning) -> Fault {
    let known = |segment: &Segment| Some(segment.name()) == warning.segment.as_deref();
    Fault {
        kind: "recording",
        message: warning.message.clone(),
        segments: (Segment::ALL.iter().filter(|segment| known(segment)))
            .map(|segment| segment.name())
            .collect(),
        time_s: warning.span_s.map(|[begin, _]| begin),
    }
}

pub(super) fn step(step: &Step) -> Fault {
    let names: Vec<&'static str> = step
        .segments
        .iter()
        .map(|(segment, _)| segment.name())
        .collect();
    let largest = step.segments.first().map_or(0.0, |(_, jump)| *jump);
    Fault {
        kind: "step",
        message: format!(
            "{} exchanged or slipping at {:.2} s: a jump of {:.0} degrees in one frame",
            names.join(", "),
            step.time,
            largest.to_degrees()
        ),
        segments: names,
        time_s: Some(step.time),
    }
}
