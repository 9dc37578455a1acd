//! What a difference of a joint does, by the model: a run of A with the joint as in B, against its own run.

use bodyflight_core::Segment;
use bodyflight_core::body::joint_angle::JointAngle;
use bodyflight_core::dynamics::Motion;
use bodyflight_core::math::wrap_angle;
use bodyflight_core::observation::Observation;
use bodyflight_core::tolerances::Tolerances;
use bodyflight_io::diagnostic::Result;
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::joint_change::JointChange;
use bodyflight_replay::recorded::Recorded;
use bodyflight_replay::start::first_motion;
use bodyflight_replay::steps::{Divergence, Replay};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;

/// Runs with other errors of the joints, from which error bars follow.
pub(crate) const DRAWS: usize = 12;

/// What is told of a motion, averaged over a time.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Means {
    /// Turn rate about the vertical, positive to the left (rad/s).
    pub turn_radps: f64,
    /// Fall rate (m/s).
    pub fall_mps: f64,
    /// Horizontal speed (m/s).
    pub drift_mps: f64,
    /// Pitch (rad).
    pub pitch_rad: f64,
}

impl Means {
    /// The numbers in order.
    pub const fn numbers(&self) -> [f64; 4] {
        [
            self.turn_radps,
            self.fall_mps,
            self.drift_mps,
            self.pitch_rad,
        ]
    }

    /// From numbers in order.
    pub const fn from_numbers([turn_radps, fall_mps, drift_mps, pitch_rad]: [f64; 4]) -> Self {
        Self {
            turn_radps,
            fall_mps,
            drift_mps,
            pitch_rad,
        }
    }

    /// The means of observations.
    pub fn of(seen: impl Iterator<Item = Observation<f64>>) -> Self {
        let (mut sums, mut count) = ([0.0; 4], 0.0);
        let mut reference = None;
        for seen in seen {
            // Pitch is averaged around its first value, since it wraps.
            let from: f64 = *reference.get_or_insert(seen.angles.pitch);
            let pitch = from + wrap_angle(seen.angles.pitch - from);
            let numbers = [
                seen.yaw_rate,
                -seen.vertical_velocity,
                seen.horizontal_speed,
                pitch,
            ];
            for (sum, number) in sums.iter_mut().zip(numbers) {
                *sum += number;
            }
            count += 1.0;
        }
        Self::from_numbers(sums.map(|sum| sum / f64::max(count, 1.0)))
    }

    /// The difference to other means.
    pub fn minus(&self, other: &Self) -> Self {
        let [one, two] = [self.numbers(), other.numbers()];
        let [turn, fall, drift, pitch] = [0, 1, 2, 3].map(|k: usize| one[k] - two[k]);
        Self::from_numbers([turn, fall, drift, wrap_angle(pitch)])
    }
}

/// A part of a recording, and the motion with which the model begins.
pub struct Part<'a> {
    flight: &'a Flight,
    frames: &'a [FlightFrame],
    start: Motion<f64>,
    /// Means are from here on (s since frame 0).
    from: f64,
}

impl<'a> Part<'a> {
    /// The frames of a part; means are taken from a time (s since frame 0) on.
    ///
    /// # Errors
    /// Returns an error if the effects of the flight cannot be applied.
    pub fn new(flight: &'a Flight, frames: &'a [FlightFrame], from: f64) -> Result<Self> {
        let height = frames
            .first()
            .map_or(0.0, |frame| frame.pelvis.position.up());
        let model = flight.effects.applied(flight.dynamics(height), height)?;
        let inputs = model.inputs(&flight.inputs_at(from));
        let recorded = Recorded::new(frames, model.dynamics, inputs)?.under(&model.applied);
        let start = first_motion(flight.start, &recorded, 0, flight.equations);
        Ok(Self {
            flight,
            frames,
            start,
            from,
        })
    }

    /// What was recorded.
    ///
    /// # Errors
    /// Returns an error if the recording lacks velocities.
    pub fn measured(&self) -> Result<Means> {
        let after = self.frames.iter().filter(|frame| frame.time >= self.from);
        let seen = after.map(|frame| Ok(Observation::of(&frame.motion()?)));
        Ok(Means::of(seen.collect::<Result<Vec<_>>>()?.into_iter()))
    }

    /// What the model does with changes of joints.
    ///
    /// # Errors
    /// Returns an error if the recording cannot be replayed.
    pub fn run(&self, changes: &[JointChange]) -> Result<Means> {
        let frames = self.frames.iter().copied().map(Ok);
        let replay = Replay::changed(self.flight, frames, changes, &self.start)?;
        let replay = replay.on_divergence(Divergence::Held);
        let mut seen = Vec::new();
        for step in replay {
            let step = step?;
            if step.time >= self.from {
                seen.push(step.pair.simulated);
            }
        }
        Ok(Means::of(seen.into_iter()))
    }
}

/// The effect of a change of one joint along a curve (rad over s since frame 0) on the run of the part without changes,
/// and its standard deviation.
///
/// The deviation comprises errors of all joints of the recording, the error of the difference itself (rad), and what is
/// uncertain about the person's body.
///
/// # Errors
/// Same as [`Part::run`].
pub fn effect(
    part: &Part<'_>,
    unchanged: &Means,
    angle: JointAngle,
    curve: &[(f64, f64)],
    deviation: f64,
    seed: u64,
) -> Result<[Means; 2]> {
    let along = |more: f64| {
        let points = curve.iter().map(|(time, by)| (*time, by + more));
        JointChange::along(angle, points.collect())
    };
    let nominal = part.run(&[along(0.0)])?.minus(unchanged);
    let tolerances = &part.flight.tolerances;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut squares = [0.0; 4];
    for _ in 0..DRAWS {
        let mut changes = joint_errors(tolerances, &mut random);
        let own = part.run(&changes)?;
        let normal: f64 = StandardNormal.sample(&mut random);
        changes.push(along(normal * deviation));
        let apart = part.run(&changes)?.minus(&own).minus(&nominal);
        for (square, apart) in squares.iter_mut().zip(apart.numbers()) {
            *square += apart * apart / DRAWS as f64;
        }
    }
    let body = body_deviation(tolerances);
    let effect = nominal.numbers();
    let [turn, fall, drift, pitch] =
        [0, 1, 2, 3].map(|k: usize| squares[k].sqrt().hypot(body * effect[k]));
    Ok([nominal, Means::from_numbers([turn, fall, drift, pitch])])
}

/// Errors of all joints, constant, as a suit may have them.
pub(crate) fn joint_errors(tolerances: &Tolerances, random: &mut ChaCha8Rng) -> Vec<JointChange> {
    let deviation = tolerances
        .joint_deg
        .hypot(tolerances.wander_deg)
        .to_radians();
    let joints = Segment::ALL.into_iter().skip(1);
    joints
        .flat_map(|segment| JointAngle::of_joint(segment).filter(|angle| !angle.is_bend()))
        .map(|angle| {
            let normal: f64 = StandardNormal.sample(random);
            JointChange::by(angle, normal * deviation)
        })
        .collect()
}

/// What is uncertain about mass, inertia, areas and coefficients (fraction of an effect).
pub(crate) fn body_deviation(tolerances: &Tolerances) -> f64 {
    let parts = [
        tolerances.mass,
        tolerances.inertia,
        tolerances.area,
        tolerances.coefficients,
    ];
    parts.iter().map(|part| part * part).sum::<f64>().sqrt()
}
