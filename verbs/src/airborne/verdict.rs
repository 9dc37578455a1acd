//! What the phases say of the capture.

use bodyflight_core::air::GRAVITY;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Serialize;

use super::physics::{Fall, Momentum};
use super::steps::Step;

/// Faults are named if they exceed this many standard errors, and these sizes: a tilt (rad), and a relative difference
/// of g, within which the mass distribution of a default person leaves it.
const SURE: f64 = 3.0;
const LEAST_TILT: f64 = 0.0105;
const LEAST_G: f64 = 0.025;
/// Median drift of the angular momentum over a phase (percent) that measurement does not explain.
const LEAST_DRIFT: f64 = 20.0;

/// A fault of the capture.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Fault {
    /// `tilt`, `rate`, `step` or `momentum`.
    pub kind: &'static str,
    /// In a sentence, with size and error bar.
    pub message: String,
    /// The segments concerned.
    pub segments: Vec<&'static str>,
    /// When it happens (s), if it does not last.
    pub time_s: Option<f64>,
}

/// What a capture is worth.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
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
    let weight = |fall: &Fall| fall.standard_error_mps2.powi(-2);
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

impl Verdict {
    /// Judges the falls and angular momenta of all phases, and jumps of segments, in a capture of that frame rate (Hz).
    pub(super) fn of(falls: &[Fall], momenta: &[Momentum], steps: Vec<Step>, rate: f64) -> Self {
        let mut faults: Vec<Fault> = steps.into_iter().map(step).collect();
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
        if tilt > LEAST_TILT.max(SURE * tilt_error) {
            faults.push(tilted(&mean, tilt, tilt_error));
        }
        let ratio = g / GRAVITY;
        if (ratio - 1.0).abs() > LEAST_G.max(SURE * error / GRAVITY) {
            faults.push(Fault {
                kind: "rate",
                message: format!(
                    "g = {g:.2} +- {error:.2} m/s2: the frame rate is {:.1} % off ({:.1} Hz instead of {rate:.1}), or lengths are by {:+.1} %",
                    100.0 * (ratio.sqrt() - 1.0).abs(),
                    rate / ratio.sqrt(),
                    100.0 * (ratio - 1.0)
                ),
                segments: Vec::new(),
                time_s: None,
            });
        }
        let mut drifts: Vec<f64> = momenta
            .iter()
            .filter_map(|momentum| momentum.drift_percent)
            .collect();
        drifts.sort_by(f64::total_cmp);
        if let Some(drift) = drifts
            .get(drifts.len() / 2)
            .filter(|drift| **drift > LEAST_DRIFT)
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

fn sentence(faults: &[Fault]) -> String {
    faults
        .iter()
        .map(|fault| format!("; {}", fault.message))
        .collect()
}

fn step(step: Step) -> Fault {
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
