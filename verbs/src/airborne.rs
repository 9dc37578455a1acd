//! `bodyflight airborne`: the parts of a recording in which nothing touches the body, and what its motion there says of
//! the capture.
//!
//! In the air the centre of mass falls with g and the angular momentum is constant, whatever the limbs do. [`phases`]
//! finds such parts, [`physics`] measures g and the angular momentum in each, and [`verdict`] says what is wrong if they
//! are not what they must be. The model predicts each phase as `validate` does.

mod blocks;
mod delay;
pub mod figure;
pub mod phases;
pub mod physics;
mod steps;
pub mod verdict;

use std::path::Path;

pub use blocks::Part;
use blocks::{Blocks, Heights};
use bodyflight_core::air::{Density, GRAVITY};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvnx::recording::{Mounting, Options, Warning};
use bodyflight_replay::flight::Flight;
use serde::Serialize;

use crate::validate::windows::{self, Row, predicted};
use physics::{Fall, Momentum};
use verdict::{Verdict, combined};

/// Lengths over which the attitude is predicted (s), besides the whole phase.
pub const LENGTHS: [f64; 3] = [0.1, 0.25, 0.5];
/// Difference of time within which a phase has a length (s).
const SLACK: f64 = 2e-3;
/// Relative difference of frame rates below which they are one, and faults that all phases of a set show together.
const SAME_RATE: f64 = 1e-3;
const OF_FALLS: [&str; 4] = ["tilt", "rate", "momentum", "delay"];
/// Relative change of gravity beyond which phases are looked for again, and how often. Unless it is sure by so many standard
/// errors, what is found then must have at most this part of the error, or pushes would be taken for falls.
const SETTLED: f64 = 0.1;
const SURE: f64 = 3.0;
const SURER: f64 = 0.5;
const PASSES: usize = 4;

/// The result for one recording.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// The parts in the air.
    pub phases: Vec<Phase>,
    /// What they say of the capture.
    pub verdict: Verdict,
    /// Frames per second (Hz).
    pub frame_rate_hz: f64,
    /// Whether a subject was given; otherwise the mass distribution is that of a default person.
    pub has_subject: bool,
}

/// A part in which nothing touches the body.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Phase {
    /// Its begin (s since frame 0).
    pub begin_s: f64,
    /// Its length (s).
    pub length_s: f64,
    /// The fall of the centre of mass.
    pub fall: Fall,
    /// The angular momentum about the centre of mass.
    pub momentum: Momentum,
    /// Errors of the predicted attitude, by model and length; the last length is the whole phase.
    pub predictions: Vec<Row>,
}

/// What a recording says of its parts in the air. Its frames are read in blocks, so memory does not grow with its length.
pub struct Capture {
    parts: Vec<Part>,
    steps: Vec<steps::Step>,
    mountings: Vec<Mounting>,
    contradictions: Vec<Warning>,
    heights: Heights,
    rate: f64,
    has_subject: bool,
}

impl Capture {
    /// Reads a recording or a flight. Velocities that it lacks are differences of positions and attitudes.
    ///
    /// # Errors
    /// Returns an error if a file is unusable or has fewer than three frames.
    pub fn read(path: &Path) -> Result<Self> {
        Self::of(&Flight::read(path)?)
    }

    /// Reads the recording of a flight.
    ///
    /// # Errors
    /// Returns an error if it is unusable or has fewer than three frames.
    pub fn of(flight: &Flight) -> Result<Self> {
        let mut capture = Self::pass(flight, GRAVITY)?;
        // A wrong rate or scale moves gravity towards the limit of what counts as falling, and only the part of the phases
        // below it would be seen: they are looked for again around what was found.
        let mut around = GRAVITY;
        for _ in 0..PASSES {
            let Some((gravity, error)) = capture.gravity() else {
                break;
            };
            let off = (gravity - around).abs();
            if off < SETTLED * around {
                break;
            }
            around = gravity;
            let again = Self::pass(flight, around)?;
            let most = if off > SURE * error {
                f64::INFINITY
            } else {
                SURER * error
            };
            if again.gravity().is_none_or(|(_, error)| error > most) {
                break;
            }
            capture = again;
        }
        Ok(capture)
    }

    /// Gravity from all phases (m/s2), and its standard error.
    fn gravity(&self) -> Option<(f64, f64)> {
        let falls: Vec<Fall> = self.parts.iter().map(|part| part.fall).collect();
        combined(&falls).map(|(mean, error)| (mean.norm(), error))
    }

    /// Reads the frames, and looks for phases with an acceleration near `gravity` (m/s2).
    fn pass(flight: &Flight, gravity: f64) -> Result<Self> {
        let mut recording = flight.open(Options::default())?;
        let rate = recording.header().frame_rate;
        let mut dynamics = flight.dynamics(0.0);
        // The air does nothing in a jump, and is far below the noise in a short one from a tower.
        dynamics.air.density = Density::Constant(0.0);
        let mut blocks = Blocks::new(dynamics, flight.constant_inputs(), gravity);
        for frame in recording.by_ref() {
            blocks.see(frame?)?;
        }
        if blocks.seen < 3 {
            return Err(
                Problem::bad_input("expected at least three frames").in_file(&flight.recording)
            );
        }
        blocks.end()?;
        Ok(Self {
            parts: blocks.parts,
            steps: blocks.steps,
            mountings: recording.mountings(),
            // A capture is on the ground too, and its person may be assumed.
            contradictions: (recording.of_import().into_iter())
                .filter(|warning| warning.is_fault)
                .collect(),
            heights: blocks.heights,
            rate,
            has_subject: flight.has_subject,
        })
    }

    /// The same with faults that its source shows, which the recording made of it no longer does.
    #[must_use]
    pub fn with_faults(mut self, faults: impl IntoIterator<Item = Warning>) -> Self {
        self.contradictions.extend(faults);
        self
    }

    /// The parts in which nothing touches the body.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// The same, for those who need nothing else.
    pub fn into_parts(self) -> Vec<Part> {
        self.parts
    }
}

/// Finds and judges the phases of a recording.
///
/// # Errors
/// Returns an error if Ctrl-C was pressed.
pub fn airborne(capture: &Capture) -> Result<Report> {
    let verdict = judged(capture);
    let mut phases = Vec::new();
    for part in &capture.parts {
        let length = part.length_s;
        let mut predictions = Vec::new();
        for window in LENGTHS
            .into_iter()
            .filter(|window| *window < length - SLACK)
            .chain([length])
        {
            for model in windows::MODELS {
                predictions.extend(predicted(&[&part.recorded], window, model)?);
            }
        }
        phases.push(Phase {
            begin_s: part.begin_s,
            length_s: length,
            fall: part.fall,
            momentum: part.momentum,
            predictions,
        });
    }
    Ok(Report {
        verdict,
        phases,
        frame_rate_hz: capture.rate,
        has_subject: capture.has_subject,
    })
}

/// What the parts of a capture in the air say of it.
pub fn judged(capture: &Capture) -> Verdict {
    let falls: Vec<Fall> = capture.parts.iter().map(|part| part.fall).collect();
    let momenta: Vec<Momentum> = capture.parts.iter().map(|part| part.momentum).collect();
    let faults = (capture.contradictions.iter().map(verdict::contradiction))
        .chain(capture.mountings.iter().map(verdict::mounted))
        .chain(capture.steps.iter().map(verdict::step))
        .chain(delay::found(&capture.parts.iter().collect::<Vec<_>>()));
    Verdict::of(&falls, &momenta, faults.collect(), capture.rate)
}

/// What captures say of their faults, those of one frame rate together.
pub(crate) fn judged_by_rate(captures: &[&Capture]) -> Vec<Verdict> {
    let alike = |a: &&Capture, b: &&Capture| (a.rate / b.rate - 1.0).abs() < SAME_RATE;
    let sets = captures.chunk_by(alike);
    sets.map(|set| {
        let parts = || set.iter().flat_map(|capture| &capture.parts);
        let falls: Vec<Fall> = parts().map(|part| part.fall).collect();
        let momenta: Vec<Momentum> = parts().map(|part| part.momentum).collect();
        let faults = set.iter().flat_map(|capture| judged(capture).faults);
        let mut lasting: Vec<_> = faults
            .filter(|fault| !OF_FALLS.contains(&fault.kind))
            .collect();
        lasting.dedup();
        lasting.extend(delay::found(&parts().collect::<Vec<_>>()));
        let rate = set.first().map_or(0.0, |capture| capture.rate);
        Verdict::of(&falls, &momenta, lasting, rate)
    })
    .collect()
}

/// Judges recordings of one set-up together: its vertical, and its clock or scale. Errors fall with the number of phases,
/// so a set of jumps shows what none shows alone. `None` unless at least two recordings are in the air, all of the same
/// frame rate.
pub fn together(reports: &[&Report]) -> Option<Verdict> {
    let flown = || reports.iter().filter(|report| !report.phases.is_empty());
    let rate = flown().next()?.frame_rate_hz;
    let alike = flown().all(|report| (report.frame_rate_hz / rate - 1.0).abs() < SAME_RATE);
    if !alike || flown().count() < 2 {
        return None;
    }
    let phases = flown().flat_map(|report| &report.phases);
    let falls: Vec<Fall> = phases.map(|phase| phase.fall).collect();
    Some(Verdict::of(&falls, &[], Vec::new(), rate))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    /// A recording of one jump of 0.4 s, whose acceleration is off by `off` (m/s2).
    fn jump(off: Vector3<f64>) -> Report {
        let acceleration = Vector3::new(0.0, 0.0, -GRAVITY) + off;
        let fall = Fall {
            acceleration_mps2: acceleration.into(),
            g_mps2: acceleration.norm(),
            standard_error_mps2: 0.2,
            residual_m: 0.003,
        };
        let momentum = Momentum {
            mean_nms: [0.0; 3],
            drift_nms: 0.0,
            drift_percent: None,
        };
        Report {
            phases: vec![Phase {
                begin_s: 1.0,
                length_s: 0.4,
                fall,
                momentum,
                predictions: Vec::new(),
            }],
            verdict: Verdict::of(&[fall], &[], Vec::new(), 100.0),
            frame_rate_hz: 100.0,
            has_subject: false,
        }
    }

    /// Jumps with errors of their own, of a set-up that is off by `off` (m/s2).
    fn set(off: Vector3<f64>) -> Vec<Report> {
        let errors = (0..40).map(|k| {
            let turn = 2.4 * f64::from(k);
            Vector3::new(turn.cos(), turn.sin(), (1.7 * turn).cos()) * 0.2
        });
        errors.map(|error| jump(off + error)).collect()
    }

    fn kinds(verdict: &Verdict) -> Vec<&str> {
        verdict.faults.iter().map(|fault| fault.kind).collect()
    }

    #[test]
    fn a_set_of_short_jumps_shows_what_none_shows_alone() {
        let tilt = Vector3::x() * (GRAVITY * 1.0_f64.to_radians());
        let fast = Vector3::z() * (-0.04 * GRAVITY);
        for (off, expected) in [
            (Vector3::zeros(), vec![]),
            (tilt, vec!["tilt"]),
            (fast, vec!["rate"]),
        ] {
            let reports = set(off);
            for report in &reports {
                assert!(
                    kinds(&report.verdict).is_empty(),
                    "{}",
                    report.verdict.sentence
                );
            }
            let all: Vec<&Report> = reports.iter().collect();
            let verdict = together(&all).unwrap();
            assert_eq!(kinds(&verdict), expected, "{}", verdict.sentence);
        }
    }

    #[test]
    fn recordings_of_different_rates_are_not_one_set() {
        let mut reports = set(Vector3::zeros());
        reports[3].frame_rate_hz = 120.0;
        assert!(together(&reports.iter().collect::<Vec<_>>()).is_none());
        assert!(together(&[&reports[0]]).is_none());
    }
}
