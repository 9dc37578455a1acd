//! A recording and its simulation, with all data that the page shows.

use bodyflight_core::Posture;
use bodyflight_core::body::SEGMENT_COUNT;
use bodyflight_core::body::joint_angle::JointAngle;
use bodyflight_core::dynamics::Dynamics;
use bodyflight_core::effect::Model;
use bodyflight_viewer::frame::{SEGMENT_NUMBERS, frame, normalised, place};
use serde::Serialize;

use super::estimated::Estimated;
use super::full_rate::{Collected, FullRate};
use super::series::{Packed, RATE, Recorded, Series};
use super::shape::{Shape, Worn, shapes};
use crate::compare::words::joint;
use bodyflight_io::diagnostic::Result;
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision;
use bodyflight_replay::comparison::{Channel, Comparison, PerChannel};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::steps::{Replay, Step};

/// The columns of a run, with the count of numbers in a row and their step.
///
/// Axes and units as in [`bodyflight_viewer::frame::LAYOUT`]; `measured` and `simulated` are the channels in the
/// order of [`Channel::ALL`].
const COLUMNS: [(&str, usize, f64); 15] = [
    ("time_s", 1, 1e-4),
    ("simulated_position_m", 3, 1e-2),
    ("simulated_attitude", 4, 2e-4),
    ("measured_position_m", 3, 1e-2),
    ("measured_attitude", 4, 2e-4),
    ("simulated", 7, 1e-3),
    ("measured", 7, 1e-3),
    ("inputs", 6, 1e-3),
    ("cg_m", 3, 2e-3),
    ("segment_attitude", 4 * SEGMENT_COUNT, 5e-4),
    ("segment_cg_m", 3 * SEGMENT_COUNT, 2e-3),
    ("segment_force_n", 3 * SEGMENT_COUNT, 0.5),
    ("load_factor", 1, 1e-3),
    // Measured, simulated.
    ("normalised_fall_rate_mps", 2, 1e-2),
    // In the order of `JointAngle::all`.
    ("joint_angles_rad", JOINT_ANGLES, 1e-3),
];

/// Number of joint angles.
const JOINT_ANGLES: usize = 3 * (SEGMENT_COUNT - 1);

/// Name of a joint angle.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct AngleName {
    /// As for `simulate --joint`, such as `l_shank.bend`.
    pub name: String,
    /// What a coach calls the joint.
    pub joint: &'static str,
}

/// A run as the page shows it.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Run {
    /// Readable name.
    pub name: String,
    /// How segments are drawn.
    pub shapes: Vec<Shape>,
    /// What the skydiver wears.
    pub worn: Worn,
    /// Root mean square of measured minus simulated, over all frames.
    #[cfg_attr(test, ts(type = "Record<string, number>"))]
    pub rms: PerChannel,
    /// Largest absolute value of the measured channel.
    #[cfg_attr(test, ts(type = "Record<string, number>"))]
    pub amplitude: PerChannel,
    /// Number of frames in the recording.
    pub frames: u64,
    /// Velocity of the air (m/s), north, west, up.
    pub air_velocity_mps: [f64; 3],
    /// The data over time.
    pub series: Packed,
    /// Names of the joint angles.
    pub angles: Vec<AngleName>,
    /// The data at the rate of the recording, unless left out.
    pub full_rate: Option<FullRate>,
    /// Estimated inputs, if requested.
    pub estimated: Option<Estimated>,
    /// Why the recording should not be trusted.
    pub doubt: Option<String>,
}

/// A recording and its simulation, and how they compare.
pub struct Flown {
    /// The data to show, [`RATE`] rows a second.
    pub series: Series,
    /// The comparison of all frames.
    pub comparison: Comparison,
    /// Why the recording should not be trusted.
    pub doubt: Option<String>,
}

/// Simulates a recording for the page, with or without the data at the rate of the recording.
///
/// # Errors
/// Same as [`crate::simulate::simulate`].
pub fn fly(
    name: &str,
    flight: &Flight,
    options: Options,
    is_full: bool,
    progress: &mut dyn FnMut(f64),
) -> Result<Run> {
    let mut full = None;
    let mut series = Recorded::new(&COLUMNS);
    let (comparison, doubt) = fly_with(
        flight,
        options,
        progress,
        &mut |model, step| match &mut full {
            None if is_full => full = Some(Collected::new(flight, model, step)),
            None => {}
            Some(full) => full.push(flight, step),
        },
        &mut |row| series.push(row),
    )?;
    let air = flight
        .effects
        .applied(flight.dynamics(0.0), 0.0)?
        .dynamics
        .air;
    Ok(Run {
        name: name.to_owned(),
        shapes: shapes(&flight.subject),
        worn: Worn::of(&flight.subject),
        rms: comparison.rms(),
        amplitude: comparison.amplitude(),
        frames: comparison.count(),
        air_velocity_mps: air.velocity.to_array(),
        series: series.packed(),
        angles: JointAngle::all().map(angle_name).collect(),
        full_rate: full.map(Collected::finished),
        estimated: None,
        doubt,
    })
}

fn angle_name(angle: JointAngle) -> AngleName {
    AngleName {
        name: angle.to_string(),
        joint: joint(angle.segment),
    }
}

/// Simulates a recording.
///
/// # Errors
/// Same as [`crate::simulate::simulate`].
pub fn fly_series(
    flight: &Flight,
    options: Options,
    progress: &mut dyn FnMut(f64),
) -> Result<Flown> {
    let mut series = Series::new(&COLUMNS);
    let (comparison, doubt) = fly_with(flight, options, progress, &mut |_, _| {}, &mut |row| {
        series.push(row);
    })?;
    Ok(Flown {
        series,
        comparison,
        doubt,
    })
}

/// Simulates a recording; `each` is called with the model and every step, the start included, `shown` with the rows to
/// show. Returns the comparison, and why the recording should not be trusted.
fn fly_with(
    flight: &Flight,
    options: Options,
    progress: &mut dyn FnMut(f64),
    each: &mut dyn FnMut(&Model<f64>, &Step),
    shown: &mut dyn FnMut(Vec<f64>),
) -> Result<(Comparison, Option<String>)> {
    let mut replay = Replay::open(flight, options, Precision::Double)?;
    let model = *replay.model();
    let dynamics = model.dynamics;
    let mut comparison = Comparison::default();
    let start = *replay.start();
    shown(row(&dynamics, &start, &start.posture));
    each(&model, &start);
    let mut due = start.time + 1.0 / RATE;
    let mut steps = replay.by_ref().peekable();
    while let Some(step) = steps.next() {
        let step = step?;
        comparison.push(step.pair);
        each(&model, &step);
        // Some slack, since the rates need not divide evenly.
        if step.time >= due - 1e-3 || steps.peek().is_none() {
            due = (due + 1.0 / RATE).max(step.time);
            shown(row(&dynamics, &step, &start.posture));
            progress(step.time);
            interrupt::check()?;
        }
    }
    Ok((comparison, replay.doubt()))
}

/// A row of [`COLUMNS`]; joint angles continue from the `first` posture.
fn row(dynamics: &Dynamics<f64>, step: &Step, first: &Posture<f64>) -> Vec<f64> {
    let (inputs, measured) = (&step.inputs, &step.measured);
    let frame = frame(dynamics, inputs, &step.posture, &step.simulated, step.time);
    let part = |name: &str, count: usize| part(&frame, name, count);
    let attitude = measured.inertial_from_body.quaternion();
    let [simulated, measured_channels] = [&step.pair.simulated, &step.pair.measured]
        .map(|seen| Channel::ALL.map(|channel| channel.value(seen)));
    part("time_s", 1)
        .chain(part("position_m", 3))
        .chain(part("inertial_from_body", 4))
        .chain(measured.position.to_array())
        .chain([attitude.w, attitude.i, attitude.j, attitude.k])
        .chain(simulated)
        .chain(measured_channels)
        .chain(inputs.muscle.to_array())
        .chain(inputs.damping.to_array())
        .chain(part("cg_m", 3))
        .chain(of_segments(&frame))
        .chain(part("load_factor", 1))
        .chain([normalised(dynamics, measured, &step.pair.measured)])
        .chain(part("normalised_fall_rate_mps", 1))
        .chain(JointAngle::all().map(|angle| angle.since(first, &step.posture)))
        .collect()
}

/// A part of a frame.
fn part<'a>(frame: &'a [f32], name: &str, count: usize) -> impl Iterator<Item = f64> + use<'a> {
    let from = place(name).unwrap_or(0);
    frame[from..from + count].iter().copied().map(f64::from)
}

/// Attitudes, centres of gravity and forces of all segments in a frame: the last three of [`COLUMNS`].
pub(crate) fn of_segments(frame: &[f32]) -> Vec<f64> {
    let segments: Vec<f64> = part(frame, "segments", SEGMENT_COUNT * SEGMENT_NUMBERS).collect();
    let columns = [(4, 4), (8, 3), (11, 3)].into_iter();
    columns
        .flat_map(|(from, count)| {
            let each = segments.chunks_exact(SEGMENT_NUMBERS);
            each.flat_map(move |segment| segment[from..from + count].iter().copied())
        })
        .collect()
}
