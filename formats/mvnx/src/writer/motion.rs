//! Velocities and accelerations of all segments from a frame and its two neighbours.

use bodyflight_core::body::posture::near;
use nalgebra::{UnitQuaternion, Vector3};

use crate::recording::FlightFrame;
use crate::xsens::MVN_SEGMENT_COUNT;
use crate::xsens::skeleton::Placed;

type PerSegment<V> = [V; MVN_SEGMENT_COUNT];

/// A frame with its velocities and accelerations, in the global axes of MVN.
pub struct MovingFrame {
    /// Number of the frame.
    pub index: u64,
    /// Time (s).
    pub time: f64,
    /// Attitudes and positions of the segments.
    pub placed: PerSegment<Placed>,
    /// Velocity of each segment's origin (m/s).
    pub velocity: PerSegment<Vector3<f64>>,
    /// Acceleration of each segment's origin (m/s2).
    pub acceleration: PerSegment<Vector3<f64>>,
    /// Angular velocity of each segment (rad/s).
    pub angular_velocity: PerSegment<Vector3<f64>>,
    /// Angular acceleration of each segment (rad/s2).
    pub angular_acceleration: PerSegment<Vector3<f64>>,
    /// Position (m), velocity (m/s) and acceleration (m/s2), if the flight has the first.
    pub centre_of_mass: Option<[Vector3<f64>; 3]>,
}

/// A frame waiting for its neighbour.
#[derive(Debug, Clone, Copy)]
struct Sample {
    index: u64,
    time: f64,
    placed: PerSegment<Placed>,
    /// Velocity and angular velocity of the pelvis, if the flight has them.
    pelvis: [Option<Vector3<f64>>; 2],
    centre_of_mass: Option<Vector3<f64>>,
}

/// The last two frames.
#[derive(Debug, Default)]
pub struct Differences {
    before: Option<Sample>,
    here: Option<Sample>,
}

impl Differences {
    /// Takes a frame and returns the previous one, whose neighbours are now both known.
    pub fn push(
        &mut self,
        frame: &FlightFrame,
        time: f64,
        placed: PerSegment<Placed>,
    ) -> Option<MovingFrame> {
        let pelvis = &frame.pelvis;
        let next = Sample {
            index: frame.index,
            time,
            placed,
            pelvis: [pelvis.velocity, pelvis.angular_velocity]
                .map(|rate| rate.map(|rate| rate.components)),
            centre_of_mass: frame.centre_of_mass.map(|place| place.components),
        };
        let moving = self
            .here
            .map(|here| moving(self.before.as_ref(), &here, Some(&next)));
        self.before = self.here.replace(next);
        moving
    }

    /// The last frame, which has no successor.
    pub fn last(&mut self) -> Option<MovingFrame> {
        let here = self.here.take()?;
        Some(moving(self.before.as_ref(), &here, None))
    }
}

/// Mean angular velocity (rad/s) that takes one orientation to another in `duration` (s), in the axes in which both are
/// given; zero if no time passes.
pub fn rotation_rate(
    from: &UnitQuaternion<f64>,
    to: &UnitQuaternion<f64>,
    duration: f64,
) -> Vector3<f64> {
    if duration > 0.0 {
        (near(to, from) * from.inverse()).scaled_axis() / duration
    } else {
        Vector3::zeros()
    }
}

fn turning(from: &Sample, to: &Sample, at: usize) -> Vector3<f64> {
    let orientation = |sample: &Sample| sample.placed[at].orientation;
    rotation_rate(&orientation(from), &orientation(to), to.time - from.time)
}

fn moving(before: Option<&Sample>, here: &Sample, next: Option<&Sample>) -> MovingFrame {
    let ends = [before.unwrap_or(here), next.unwrap_or(here)];
    let duration = ends[1].time - ends[0].time;
    let rate = |change: Vector3<f64>| {
        if duration > 0.0 {
            change / duration
        } else {
            Vector3::zeros()
        }
    };
    let acceleration = |point: &dyn Fn(&Sample) -> Vector3<f64>| match (before, next) {
        (Some(before), Some(next)) => {
            let arriving = (point(here) - point(before)) / (here.time - before.time);
            let leaving = (point(next) - point(here)) / (next.time - here.time);
            (leaving - arriving) * (2.0 / duration)
        }
        _ => Vector3::zeros(),
    };
    let segments: PerSegment<usize> = core::array::from_fn(|segment| segment);
    let mut velocity =
        segments.map(|at| rate(ends[1].placed[at].position - ends[0].placed[at].position));
    let mut angular_velocity = segments.map(|at| turning(ends[0], ends[1], at));
    let angular_acceleration = |at: usize| match (before, next) {
        (Some(before), Some(next)) => {
            (turning(here, next, at) - turning(before, here, at)) * (2.0 / duration)
        }
        _ => Vector3::zeros(),
    };
    velocity[0] = here.pelvis[0].unwrap_or(velocity[0]);
    angular_velocity[0] = here.pelvis[1].unwrap_or(angular_velocity[0]);
    let centre = |sample: &Sample| sample.centre_of_mass.unwrap_or_default();
    let all_centres = ends.iter().all(|end| end.centre_of_mass.is_some());
    MovingFrame {
        index: here.index,
        time: here.time,
        placed: here.placed,
        velocity,
        acceleration: segments.map(|at| acceleration(&|sample| sample.placed[at].position)),
        angular_velocity,
        angular_acceleration: segments.map(angular_acceleration),
        centre_of_mass: here.centre_of_mass.filter(|_| all_centres).map(|position| {
            let velocity = rate(centre(ends[1]) - centre(ends[0]));
            [position, velocity, acceleration(&centre)]
        }),
    }
}
