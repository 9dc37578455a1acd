//! `bodyflight technique`: the movement patterns of a maneuver, and what each does to the fall of this body.
//!
//! The approach is that of A. Clarke and P.-O. Gutman, "Skydiving Technique Analysis from a Control Engineering
//! Perspective", arXiv 2201.05917: principal components of the joint angles, and the response of the turn rate to each
//! from the linearised model.

pub mod against;
pub mod agreement;
pub mod axes;
pub mod figure;
pub mod linear;
mod part;
pub mod patterns;
mod recorded;
pub mod report;
pub mod response;

use bodyflight_core::Posture;
use bodyflight_core::dynamics::Dynamics;
use bodyflight_core::dynamics::trim::TrimError;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::{FlightFrame, Options, faults};
use bodyflight_replay::flight::{DensityChoice, Flight};
use nalgebra::DVector;

use against::{Expert, TURN, against};
use agreement::agreement;
use axes::deviation;
use bodyflight_core::body::joint_angle::JointAngle;
use linear::{Linear, OUTPUTS, Single};
pub use part::Settings;
use part::used;
use patterns::{Component, State, components, floor};
use report::{Answer, Fall, Pattern, Report, Weight};
use response::{Response, growth, response};

/// Angle to belly to earth (rad) up to which a frame counts as such.
const BELLY: f64 = 0.8;
/// Share of frames belly to earth, and of the fall rate, below which the response is not that of the recording.
const LIKE: f64 = 0.5;

/// A flight analysed, with what figures need.
#[derive(Debug, Clone)]
pub struct Technique {
    /// The numbers.
    pub report: Report,
    /// Time of each frame used (s since frame 0).
    pub time: Vec<f64>,
    /// The components in the order of the report's patterns.
    pub components: Vec<Component>,
    /// The coordinates.
    pub axes: Vec<JointAngle>,
    /// The posture that pictures show the patterns on.
    pub posture: Posture<f64>,
}

/// Analyses a flight, also against the turn patterns of `experts`.
///
/// # Errors
/// Returns an error if a file cannot be used, or the part asked for is too short.
pub fn technique(
    flight: &Flight,
    settings: &Settings,
    experts: &[Expert],
    options: Options,
) -> Result<Technique> {
    analysed(flight, settings, Some(experts), options)
}

/// Analyses a flight; without `experts`, only as far as its own use as an expert needs.
fn analysed(
    flight: &Flight,
    settings: &Settings,
    experts: Option<&[Expert]>,
    options: Options,
) -> Result<Technique> {
    let used = used(flight, settings, options)?;
    let axes: Vec<JointAngle> = JointAngle::all().collect();
    let postures: Vec<Posture<f64>> = used.frames.iter().map(|frame| frame.posture).collect();
    let middle = Posture::mean(postures.iter());
    let rows: Vec<DVector<f64>> = postures
        .iter()
        .map(|posture| deviation(&axes, &middle, posture))
        .collect();
    let joint_error = settings
        .joint_error
        .unwrap_or(flight.tolerances.joint_deg.to_radians());
    let components = components(&rows, used.duration, joint_error);
    interrupt::check()?;
    let dynamics = still(flight, first_height(&used.frames));
    let linear = Linear::of(&dynamics, &flight.constant_inputs(), &axes);
    let fall = linear
        .as_ref()
        .ok()
        .map(|linear| fall(linear, &used.frames));
    let mut doubts: Vec<String> = faults(&used.warnings).into_iter().collect();
    doubts.extend(doubts_of(linear.as_ref().err(), fall.as_ref(), &components));
    let judged = experts.is_some();
    let patterns = patterns_of(&axes, &components, linear.as_ref().ok(), &dynamics, judged)?;
    let recorded = match (&linear, settings.turns) {
        (Ok(linear), false) => recorded::recorded(linear, &used.frames, &rows),
        _ => None,
    };
    if doubts.is_empty() {
        doubts.extend(recorded.as_ref().and_then(recorded::doubt));
    }
    let turning = turning(&patterns);
    let comparison = match (&linear, turning, experts) {
        (Ok(linear), Some(place), Some(experts)) => {
            let found = &components[place];
            Some(against(
                linear,
                &dynamics,
                &axes,
                &found.told,
                experts,
                found.rms,
            ))
        }
        _ => None,
    };
    let times: Vec<f64> = used.frames.iter().map(|frame| frame.time).collect();
    let report = Report {
        frames: used.frames.len() as u64,
        from_s: times.first().copied().unwrap_or(0.0),
        to_s: times.last().copied().unwrap_or(0.0),
        duration_s: used.duration,
        joint_error_rad: joint_error,
        floor_rad: floor(joint_error, axes.len(), used.duration),
        below_errors: components
            .iter()
            .filter(|found| found.state == State::BelowErrors)
            .count() as u64,
        patterns,
        turning: turning.map(|place| place as u64 + 1),
        fall,
        recorded,
        against: comparison,
        doubts,
        warnings: used.warnings,
    };
    let posture = linear.map_or(middle, |linear| linear.posture);
    Ok(Technique {
        report,
        time: times,
        components,
        axes,
        posture,
    })
}

/// The model of a flight in still air of the density at its first frame, for a steady fall.
fn still(flight: &Flight, height: f64) -> Dynamics<f64> {
    let mut dynamics = flight.dynamics(height);
    // A trim is that of still air of one density: its own wind carries a body along.
    dynamics.air.velocity = bodyflight_core::frame::Vector::zero();
    if let DensityChoice::FirstFrameAltitude(_) = flight.density {
        let density = dynamics.air.density.at(height);
        dynamics.air.density = bodyflight_core::air::Density::Constant(density);
    }
    dynamics
}

/// The patterns above joint errors, with what the body answers; how far that holds only if it is `judged`.
fn patterns_of(
    axes: &[JointAngle],
    components: &[Component],
    linear: Option<&Linear>,
    dynamics: &Dynamics<f64>,
    judged: bool,
) -> Result<Vec<Pattern>> {
    let named = components
        .iter()
        .filter(|found| found.state != State::BelowErrors);
    let mut patterns = Vec::new();
    for found in named {
        let answer = linear.map(|linear| {
            let single = linear.of_pattern(&found.told);
            let errors: Vec<Single> = (0..axes.len())
                .map(|axis| {
                    let mut error = DVector::zeros(axes.len());
                    error[axis] = found.deviations[axis];
                    linear.of_pattern(&error)
                })
                .collect();
            let responses: Vec<Response> = (0..OUTPUTS)
                .map(|output| response(&single, output, &errors))
                .collect();
            Answer {
                turn_share_radps: found.rms * responses[TURN].gain.abs(),
                responses,
                agreement: if judged {
                    agreement(linear, dynamics, axes, &found.told)
                } else {
                    Vec::new()
                },
            }
        });
        patterns.push(pattern(axes, found, answer));
        interrupt::check()?;
    }
    Ok(patterns)
}

/// Reasons not to trust the result.
fn doubts_of(
    error: Option<&TrimError>,
    fall: Option<&Fall>,
    components: &[Component],
) -> Vec<String> {
    let mut doubts = Vec::new();
    if let Some(error) = error {
        doubts.push(match error {
            TrimError::NoSupport => {
                "no linear response: without air that carries the body there is no fall to trim"
                    .to_owned()
            }
            TrimError::NoBalance => {
                "no linear response: no bend of the knees balances the neutral pose of this subject"
                    .to_owned()
            }
        });
    }
    if let Some(fall) = fall {
        doubts.extend(fall.doubt());
    }
    if !components
        .iter()
        .any(|found| found.state != State::BelowErrors)
    {
        doubts.push(
            "cannot tell: no movement is above what the assumed joint errors make".to_owned(),
        );
    }
    doubts
}

/// The turn pattern of a flight, for use as an expert's.
///
/// # Errors
/// Returns an error if a file cannot be used, or the flight has no such pattern.
pub fn expert(
    name: String,
    flight: &Flight,
    settings: &Settings,
    options: Options,
) -> Result<Expert> {
    let found = analysed(flight, settings, None, options)?;
    let place = turning_place(&found.report);
    let component = place.and_then(|place| found.components.get(place));
    let component = component.ok_or_else(|| {
        Problem::bad_input(
            "found no movement pattern that turns the body in this flight of an expert",
        )
        .in_file(&flight.recording)
        .help("leave it out of the flights compared with")
    })?;
    Ok(Expert {
        name,
        weights: component.told.clone(),
    })
}

/// A joint error given as an option (degrees), in rad.
///
/// # Errors
/// Returns an error that names `option` if it is not above 0 and at most 45.
pub fn joint_error(option: &str, degrees: Option<f64>) -> Result<Option<f64>> {
    match degrees {
        Some(degrees) if !(degrees > 0.0 && degrees <= 45.0) => Err(Problem::bad_input(format!(
            "expected {option} above 0 and up to 45, found {degrees}"
        ))),
        _ => Ok(degrees.map(f64::to_radians)),
    }
}

fn turning_place(report: &Report) -> Option<usize> {
    report
        .turning
        .and_then(|k| usize::try_from(k).ok()?.checked_sub(1))
}

/// The pattern that contributes most to the turn rate.
fn turning(patterns: &[Pattern]) -> Option<usize> {
    let share = |pattern: &Pattern| pattern.answer.as_ref().map(|a| a.turn_share_radps);
    let shares = patterns.iter().enumerate();
    shares
        .filter_map(|(k, pattern)| Some((k, share(pattern)?)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(k, _)| k)
}

fn pattern(axes: &[JointAngle], found: &Component, answer: Option<Answer>) -> Pattern {
    let mut weights: Vec<Weight> = axes
        .iter()
        .enumerate()
        .map(|(k, axis)| Weight {
            angle: axis.to_string(),
            weight: found.weights[k],
            told: found.told[k],
            deviation: found.deviations[k],
        })
        .collect();
    weights.sort_by(|a, b| b.weight.abs().total_cmp(&a.weight.abs()));
    Pattern {
        state: found.state,
        share: found.share,
        rms_rad: found.rms,
        largest_rad: found
            .amplitude
            .iter()
            .fold(0.0, |most, a| a.abs().max(most)),
        weights,
        answer,
    }
}

fn first_height(frames: &[FlightFrame]) -> f64 {
    frames
        .first()
        .map_or(0.0, |frame| frame.pelvis.position.up())
}

/// What the recording has of the fall about which the model is linearised.
fn fall(linear: &Linear, frames: &[FlightFrame]) -> Fall {
    let mut belly = 0.0;
    let mut speeds = (0.0, 0.0);
    for frame in frames {
        // Belly to earth, the ventral side is down: the dorsal axis up.
        let back =
            frame.pelvis.inertial_from_body * bodyflight_core::frame::Vector::new(0.0, 1.0, 0.0);
        if back.up() > BELLY.cos() {
            belly += 1.0;
        }
        if let Some(velocity) = frame.pelvis.velocity {
            speeds = (speeds.0 - velocity.up(), speeds.1 + 1.0);
        }
    }
    #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
    let count = frames.len().max(1) as f64;
    let found = growth(&linear.states);
    Fall {
        fall_rate_mps: linear.fall.fall_rate,
        body_pitch_rad: linear.fall.body_pitch,
        knee_rad: linear.fall.knee,
        glide: linear.fall.glide,
        growth_per_s: found,
        belly_share: belly / count,
        mean_fall_mps: (speeds.1 > 0.0).then(|| speeds.0 / speeds.1),
    }
}

impl Fall {
    fn doubt(&self) -> Option<String> {
        let slow = self
            .mean_fall_mps
            .filter(|speed| *speed < LIKE * self.fall_rate_mps);
        if self.belly_share < LIKE {
            return Some(format!(
                "the linear response is that of a belly fall, not of this maneuver: the body is belly to earth in {:.0} % of the frames",
                100.0 * self.belly_share
            ));
        }
        slow.map(|speed| {
            format!(
                "the linear response is that of a fall at {:.0} m/s, not of this maneuver: it falls at {speed:.1} m/s",
                self.fall_rate_mps
            )
        })
    }
}
