//! Two flights for the page: both bodies in one picture at the times that belong together.

use bodyflight_core::body::SEGMENT_COUNT;
use bodyflight_core::dynamics::Dynamics;
use bodyflight_core::frame::{Inertial, Rotation};
use bodyflight_core::math::wrap_angle;
use bodyflight_io::diagnostic::Result;
use bodyflight_mvnx::recording::{FlightFrame, faults};
use bodyflight_replay::comparison::{CHANNELS, Channel};
use bodyflight_viewer::frame::frame;
use nalgebra::{UnitQuaternion, Vector3};
use serde::Serialize;

use super::figure::drawn;
use super::track::whole;
use super::words::joint;
use super::{Compared, Track};
use crate::view::run::of_segments;
use crate::view::series::{Packed, RATE, Series};
use crate::view::shape::{Shape, Worn, shapes};

/// Columns of one flight: of A, whose names begin with `a_`, and of B.
const SIDE: [(&str, usize, f64); 6] = [
    ("position_m", 3, 1e-2),
    ("attitude", 4, 2e-4),
    ("channels", CHANNELS, 1e-3),
    ("segment_attitude", 4 * SEGMENT_COUNT, 5e-4),
    ("segment_cg_m", 3 * SEGMENT_COUNT, 2e-3),
    ("segment_force_n", 3 * SEGMENT_COUNT, 0.5),
];

/// A flight of a comparison.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Person {
    /// Readable name.
    pub name: String,
    /// How segments are drawn.
    pub shapes: Vec<Shape>,
    /// What the skydiver wears.
    pub worn: Worn,
    /// Why the recording should not be trusted.
    pub doubt: Option<String>,
}

/// An angle drawn over time.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Angle {
    /// Name of joint and angle, in words and as for `simulate --joint`.
    pub name: String,
    /// Difference from which it is named (rad).
    pub least_named_rad: f64,
}

/// Two flights beside each other.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Beside {
    /// A, then B.
    pub people: [Person; 2],
    /// What the comparison says, paragraph by paragraph.
    pub words: Vec<String>,
    /// The angles in the columns `a_angles` and `b_angles`.
    pub angles: Vec<Angle>,
    /// Times at which differences begin (s), for marks.
    pub begins_s: Vec<f64>,
    /// Velocity of the air of A (m/s), north, west, up.
    pub air_velocity_mps: [f64; 3],
    /// The data over time: `time_s` relative to the event, both flights, and the angles. B is turned and moved so that it has
    /// the heading and place of A at the beginning.
    pub series: Packed,
}

/// One flight at its recorded motion.
struct Flown<'a> {
    track: &'a Track,
    dynamics: Dynamics<f64>,
    /// Rotation about the vertical and position with which it is drawn.
    turn: UnitQuaternion<f64>,
    from: Vector3<f64>,
    to: Vector3<f64>,
}

impl<'a> Flown<'a> {
    fn new(track: &'a Track) -> Result<Self> {
        let height = track.frames[0].pelvis.position.up();
        let model = track
            .flight
            .effects
            .applied(track.flight.dynamics(height), height)?;
        Ok(Self {
            track,
            dynamics: model.dynamics,
            turn: UnitQuaternion::identity(),
            from: Vector3::zeros(),
            to: Vector3::zeros(),
        })
    }

    /// The recorded frame nearest to a time.
    fn nearest(&self, time: f64) -> &FlightFrame {
        let frames = &self.track.frames;
        let after =
            frames.partition_point(|frame| frame.time < time - 0.5 * self.track.intervals[1]);
        &frames[after.min(frames.len() - 1)]
    }

    /// A row of [`SIDE`].
    fn row(&self, time: f64) -> Result<Vec<f64>> {
        let near = self.nearest(time);
        let mut motion = near.motion()?;
        motion.inertial_from_body = Rotation::<f64, Inertial, _>::from_quaternion(
            self.turn * motion.inertial_from_body.quaternion(),
        );
        let inputs = self.track.flight.inputs_at(time);
        let frame = frame(&self.dynamics, &inputs, &near.posture, &motion, time);
        let position = self.turn * (near.pelvis.position.components - self.from) + self.to;
        let attitude = motion.inertial_from_body.quaternion();
        let channels = Channel::ALL.map(|channel| self.track.channel(channel, time));
        Ok((position.iter().copied())
            .chain([attitude.w, attitude.i, attitude.j, attitude.k])
            .chain(channels)
            .chain(of_segments(&frame))
            .collect())
    }
}

/// The columns over time, see [`Beside::series`].
fn series(
    [a, b]: [&Track; 2],
    flown: [&Flown<'_>; 2],
    compared: &Compared,
    angles: &[usize],
) -> Result<Series> {
    let matched = &compared.matched;
    let [begin, end] = matched.span();
    let origin = matched.alignment.a_s;
    let sides = ["a", "b"]
        .map(|side| SIDE.map(|(name, width, step)| (format!("{side}_{name}"), width, step)));
    let mut columns: Vec<(&str, usize, f64)> = vec![("time_s", 1, 1e-4)];
    columns.extend(
        sides
            .iter()
            .flatten()
            .map(|(name, width, step)| (name.as_str(), *width, *step)),
    );
    columns.extend([
        ("a_angles", angles.len(), 1e-3),
        ("b_angles", angles.len(), 1e-3),
    ]);
    let mut series = Series::new(&columns);
    let count = whole((end - begin) * RATE).max(1);
    let first = a.posture(begin);
    for k in 0..=count {
        let time = begin + (end - begin) * k as f64 / count as f64;
        let other = matched.b_at(time);
        let postures = [a.posture(time), b.posture(other)];
        let all = angles
            .iter()
            .map(|angle| compared.differences.angles[*angle]);
        let own: Vec<f64> = all
            .clone()
            .map(|angle| angle.since(&first, &postures[0]))
            .collect();
        let apart: Vec<f64> = (all.zip(&own))
            .map(|(angle, own)| own + angle.difference(&postures[0], &postures[1]))
            .collect();
        let row = std::iter::once(time - origin)
            .chain(flown[0].row(time)?)
            .chain(flown[1].row(other)?)
            .chain(own)
            .chain(apart);
        series.push(row);
    }
    Ok(series)
}

/// Collects what the page shows of a comparison.
///
/// # Errors
/// Returns an error if the effects of a flight cannot be applied.
pub fn beside([a, b]: [&Track; 2], compared: &Compared) -> Result<Beside> {
    let matched = &compared.matched;
    let [begin, _] = matched.span();
    let (one, mut two) = (Flown::new(a)?, Flown::new(b)?);
    let headings = [
        a.channel(Channel::Heading, begin),
        b.channel(Channel::Heading, matched.b_at(begin)),
    ];
    let turn = wrap_angle(headings[0] - headings[1]);
    two.turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
    two.from = two.nearest(matched.b_at(begin)).pelvis.position.components;
    two.to = one.nearest(begin).pelvis.position.components;
    let angles = drawn(compared);
    let series = series([a, b], [&one, &two], compared, &angles)?;
    let pair = &compared.pair;
    let told = pair
        .by_effect
        .iter()
        .map(|place| pair.differences[*place].words.clone());
    let person = |track: &Track| Person {
        name: track.name.clone(),
        shapes: shapes(&track.flight.subject),
        worn: Worn::of(&track.flight.subject),
        doubt: faults(&track.warnings),
    };
    let angle = |place: &usize| {
        let angle = compared.differences.angles[*place];
        Angle {
            name: format!("{} ({angle})", joint(angle.segment)),
            least_named_rad: pair.joints[*place].least_named_rad,
        }
    };
    Ok(Beside {
        people: [person(a), person(b)],
        words: std::iter::once(pair.first.clone()).chain(told).collect(),
        angles: angles.iter().map(angle).collect(),
        begins_s: pair.differences.iter().map(|told| told.time_s[0]).collect(),
        air_velocity_mps: one.dynamics.air.velocity.to_array(),
        series: series.packed(),
    })
}
