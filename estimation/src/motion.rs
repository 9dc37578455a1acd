//! Estimation with the motion filter, and with a solution for the whole flight that starts from the filter's result.

use std::time::Instant;

use bodyflight_core::Real;
use bodyflight_core::body::{SEGMENT_COUNT, SegmentArray};
use bodyflight_core::dynamics::Dynamics;
use bodyflight_core::estimator::full::Full;
use bodyflight_core::estimator::motion::settings::{MOTION, MotionPreset};
use bodyflight_core::estimator::reduced::Reduced;

use crate::joint_errors::{JointErrors, joint_errors};
use crate::measured::MeasuredFlight;
use crate::replayed::Replayed;

use crate::run::{Points, Run};
use crate::size::Sizes;
use crate::verdict::Doubts;
use crate::{Estimation, Filter};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::progress;
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision::{self, Double, Single};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::subject::Subject;

/// How a flight is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Forward in time, as on the unit.
    Filter,
    /// The whole flight at once.
    Smooth,
}

/// Tuning of an estimation with the motion filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The preset; its sample rate and sensor noise are replaced by those of the recording.
    pub preset: MotionPreset,
    /// Whether to keep the preset's sensor noise even if the recording shows a different one.
    pub keep_noise: bool,
    /// Whether to find the joint error from the innovations.
    pub find_joint_error: bool,
    /// The full model or the reduced one.
    pub filter: Filter,
    /// Forward or the whole flight.
    pub method: Method,
}

impl Settings {
    /// Those of `estimate` without options, in a flight of this subject.
    pub fn usual(subject: &Subject) -> Self {
        Self {
            preset: about_damping_of(subject, MOTION),
            keep_noise: false,
            find_joint_error: true,
            filter: Filter::Paper,
            method: Method::Filter,
        }
    }
}

/// The preset with the damping of a subject as its mean.
pub fn about_damping_of(subject: &Subject, preset: MotionPreset) -> MotionPreset {
    #[expect(clippy::cast_possible_truncation, reason = "a coefficient")]
    let damping = subject.damping().map(|value| value as f32);
    MotionPreset {
        damping: damping.to_array(),
        ..preset
    }
}

/// Runs the filter over a recording and, for comparison, the model with constant coefficients.
///
/// # Errors
/// Returns an error if a file is unusable or the preset is refused.
pub fn estimate(
    flight: &Flight,
    settings: &Settings,
    options: Options,
    precision: Precision,
    reached: &mut dyn FnMut(f64),
) -> Result<Estimation> {
    with_each(flight, settings, options, precision, reached, |by| {
        by(settings.method)
    })
}

/// Same as [`estimate`] by the filter and by the whole flight, instead of the method of the settings: what both need to know
/// before is found once.
///
/// # Errors
/// Returns an error if a file is unusable or the preset is refused.
pub fn estimate_both(
    flight: &Flight,
    settings: &Settings,
    options: Options,
    precision: Precision,
) -> Result<[Estimation; 2]> {
    with_each(flight, settings, options, precision, &mut |_| (), |by| {
        Ok([by(Method::Filter)?, by(Method::Smooth)?])
    })
}

/// Prepares an estimation, and lets `of` estimate by any method.
fn with_each<R>(
    flight: &Flight,
    settings: &Settings,
    options: Options,
    precision: Precision,
    reached: &mut dyn FnMut(f64),
    of: impl FnOnce(&dyn Fn(Method) -> Result<Estimation>) -> Result<R>,
) -> Result<R> {
    let mut measured = MeasuredFlight::read(flight, options)?;
    let height = measured
        .samples
        .first()
        .map_or(0.0, |first| first.motion.position.up());
    let model = flight.effects.applied(flight.dynamics(height), height)?;
    measured.correct(&model.sensors);
    if settings.filter == Filter::Reduced {
        model_is_plain(&model.dynamics)?;
    }
    let mut preset = preset_for(settings, &measured);
    // What a preset or an option says of all joints replaces what the flight says of each segment.
    let segments = flight.segment_errors.filter(|_| settings.find_joint_error);
    let find_joint_error = settings.find_joint_error && segments.is_none();
    if let Some(errors) = &segments {
        preset.joint_error = root_mean_square(errors);
    }
    let begin = Instant::now();
    let run = Run {
        flight,
        samples: &measured.samples,
        velocities: &measured.velocities,
        warnings: &measured.warnings,
        rate: measured.rate,
        dynamics: model.dynamics,
        applied: model.applied,
        segments,
    };
    let found = if find_joint_error {
        Some(find_joint_errors(&run, &mut preset)?)
    } else {
        None
    };
    reached(0.0);
    let doubts = found.as_ref().map_or(Doubts::NONE, JointErrors::doubts);
    let about = Sizes::about(f64::from(preset.joint_error));
    let sizes = found.as_ref().map_or(about, |_| Sizes::any());
    // If joint errors wander in the first minute, the whole flight has no solution with constant ones.
    let wanders = found.is_some_and(|errors| errors.wanders);
    let has_whole = measured.velocities.are_sampled() && !wanders;
    let whole = has_whole.then_some((sizes, preset));
    if let Some(errors) = &found {
        preset.damping_deviation = errors.damping;
    }
    let found_s = begin.elapsed().as_secs_f64();
    let by = |method: Method| {
        let begin = Instant::now();
        let smooth = whole.clone().filter(|_| method == Method::Smooth);
        let estimates = match precision {
            Single => points::<f32>(&run, settings.filter, &preset, smooth, doubts)?,
            Double => points::<f64>(&run, settings.filter, &preset, smooth, doubts)?,
        };
        let seconds = found_s + begin.elapsed().as_secs_f64();
        progress::stage("simulating with the estimates");
        let replayed = Replayed {
            flight,
            measured: &measured,
        };
        let mut estimation = replayed.report(estimates, &preset, seconds)?;
        if let Some(errors) = found {
            errors.tell(&mut estimation.report);
        }
        estimation.report.warn(measured.warnings.clone());
        estimation.report.doubt_sensors(&flight.doubted);
        Ok(estimation)
    };
    of(&by)
}

/// Finds the joint errors of a flight and sets their size in the preset.
fn find_joint_errors(run: &Run<'_>, preset: &mut MotionPreset) -> Result<JointErrors> {
    let errors = joint_errors(run, preset)?;
    #[expect(clippy::cast_possible_truncation, reason = "an angle")]
    let counted = errors.size.root_mean_square() as f32;
    preset.joint_error = counted;
    Ok(errors)
}

/// Estimates in a precision with a form of the model.
fn points<T: Real>(
    run: &Run<'_>,
    filter: Filter,
    preset: &MotionPreset,
    smooth: Option<(Sizes, MotionPreset)>,
    doubts: Doubts,
) -> Result<Points> {
    match filter {
        Filter::Paper => run.points::<T, Full>(preset, smooth, doubts),
        Filter::Reduced => run.points::<T, Reduced>(preset, smooth, doubts),
    }
}

/// Root of the mean square of the errors of all segments but the pelvis (rad).
#[expect(clippy::cast_possible_truncation, reason = "a deviation")]
fn root_mean_square(errors: &SegmentArray<f64>) -> f32 {
    let squares = errors.values().skip(1).map(|error| error * error);
    let joints = (SEGMENT_COUNT - 1) as f64;
    (squares.sum::<f64>() / joints).sqrt() as f32
}

/// The preset with the sensor noise and the rate of a recording.
fn preset_for(settings: &Settings, measured: &MeasuredFlight) -> MotionPreset {
    let mut preset = settings.preset;
    if !settings.keep_noise {
        preset.noise = measured.noise(&preset.noise);
    }
    set_rate(&mut preset, measured.rate);
    preset
}

/// Sets the rate of the recording, keeping the preset's number of estimates a second.
fn set_rate(preset: &mut MotionPreset, rate: f64) {
    let per_estimate = rate * preset.solution_window as f64 / f64::from(preset.sample_rate);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a rate of a recording"
    )]
    {
        preset.sample_rate = rate as f32;
        preset.solution_window = (per_estimate / 2.0).round().max(1.0) as usize * 2;
    }
}

/// Checks that the reduced model suffices: its airflow is the same for all segments, and its air everywhere.
fn model_is_plain(dynamics: &Dynamics<f64>) -> Result<()> {
    if dynamics.stream.is_uniform() && dynamics.air.profile == 0.0 {
        return Ok(());
    }
    Err(
        Problem::bad_input("an effect of the model acts on the airflow at single segments, which the reduced filter does not represent")
            .help("use --filter paper, which uses the full model"),
    )
}
