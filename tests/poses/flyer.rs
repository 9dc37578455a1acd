//! A flyer who holds a pose by small corrections, delayed and limited like a person's.
//!
//! The flyer knows the aerodynamics of the pose: how the body tips, and how much each limb turns it. But the flyer sees
//! the body's motion late and has slow limbs. Nothing is tuned to a pose or a person.

use std::collections::VecDeque;

use bodyflight_core::aerodynamics::Flow;
use bodyflight_core::body::pattern::{self, JointAngles};
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Motion, PostureSample};
use bodyflight_core::frame::{Rotation, Vector, facing_north};
use bodyflight_core::{Posture, Segment};
use nalgebra::Vector3;

/// Limbs used for corrections: in the sagittal plane, and sideways.
const LIMBS: [[&JointAngles; 3]; 2] = [
    [THIGHS_FORWARD, pattern::ARMS_DOWN, pattern::STRETCH],
    [LEGS_LEFT, LEFT_ARM_UP, pattern::TURN],
];
const THIGHS_FORWARD: &JointAngles = &[
    (Segment::LeftThigh, [0.0, 0.0, 1.0]),
    (Segment::RightThigh, [0.0, 0.0, 1.0]),
];
const LEGS_LEFT: &JointAngles = &[
    (Segment::LeftThigh, [0.0, 1.0, 0.0]),
    (Segment::RightThigh, [0.0, 1.0, 0.0]),
];
const LEFT_ARM_UP: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, 1.0, 0.0]),
    (Segment::RightUpperArm, [0.0, 1.0, 0.0]),
];

/// Largest correction (rad): 20 degrees.
const REACH: f64 = 0.35;
/// Reaction time, and time constant of the limbs (s).
const LATE: f64 = 0.2;
const LAG: f64 = 0.15;
/// Natural frequency of the controlled body without delay (rad/s), and damping ratio.
const SWING: f64 = 1.7;
const DAMPED: f64 = 1.1;
/// Time constant for removing a constant tilt (s).
const PATIENCE: f64 = 4.0;
/// Angle over which the effect of a limb is measured (rad), and the smallest effect that is used (N m/rad).
const SMALL: f64 = 0.15;
const LEAST_EFFECT: f64 = 10.0;

/// Controller for tilt about one axis.
#[derive(Debug, Clone)]
struct Answer {
    axis: Vector3<f64>,
    /// Moment for a tilt (N m/rad) and for its rate (N m s/rad).
    stiffness: f64,
    damping: f64,
    /// Moment that compensates for the imbalance of the pose and for constant tilts (N m).
    trim: f64,
    limbs: [&'static JointAngles; 3],
    /// Angle of each limb per moment (rad/N m): together the limbs produce the moment with the smallest angles.
    shares: [f64; 3],
    /// Current angles (rad).
    angles: [f64; 3],
}

/// A flyer who holds a pose.
#[derive(Debug, Clone)]
pub(crate) struct Flyer {
    /// The upward direction in the attitude to be held, body axes.
    up: Vector3<f64>,
    answers: Vec<Answer>,
    /// Recent tilts and angular velocities, body axes.
    seen: VecDeque<[Vector3<f64>; 2]>,
}

/// The upward direction in body axes.
fn upwards(
    attitude: &Rotation<f64, bodyflight_core::frame::Inertial, bodyflight_core::frame::Body>,
) -> Vector3<f64> {
    (attitude.inverse() * Vector::new(0.0, 0.0, 1.0)).components
}

/// Aerodynamic moment about the centre of gravity (N m), body axes.
fn turned_by(sample: &PostureSample<f64>, stream: &Flow<f64>) -> Vector3<f64> {
    let load = sample.aerodynamics.total_load(stream);
    load.moment - sample.mass.cg.cross(&load.force)
}

impl Flyer {
    /// Creates a flyer for a posture that falls straight down, rotated from standing by `pitch` (rad) about its left
    /// axis.
    pub(crate) fn of(dynamics: &Dynamics<f64>, posture: &Posture<f64>, pitch: f64) -> Self {
        let up = upwards(&facing_north(pitch));
        let sample = dynamics.hold(posture);
        let mut stream = Flow {
            direction: -up,
            dynamic_pressure: 1.0,
        };
        let drag = sample.aerodynamics.total_load(&stream).force.dot(&up);
        stream.dynamic_pressure = sample.mass.mass * dynamics.gravity / drag;
        let axes = [Vector3::x(), up.cross(&Vector3::x())];
        let moments = 0..(LATE / TIME_STEP).round() as usize;
        Self {
            up,
            answers: axes
                .into_iter()
                .zip(LIMBS)
                .filter_map(|(axis, limbs)| answer(dynamics, posture, &stream, axis, limbs))
                .collect(),
            seen: moments.map(|_| [Vector3::zeros(); 2]).collect(),
        }
    }

    /// Angle between the body and the attitude to be held (rad).
    pub(crate) fn tilt(&self, motion: &Motion<f64>) -> f64 {
        upwards(&motion.inertial_from_body).angle(&self.up)
    }

    /// Largest current correction of a limb (rad).
    pub(crate) fn correction(&self) -> f64 {
        let angles = self.answers.iter().flat_map(|answer| answer.angles);
        angles.fold(0.0, |most, angle| most.max(angle.abs()))
    }

    /// Observes a motion and returns the posture one step later.
    pub(crate) fn hold(&mut self, posture: &Posture<f64>, motion: &Motion<f64>) -> Posture<f64> {
        let tilt = upwards(&motion.inertial_from_body).cross(&self.up);
        self.seen
            .push_back([tilt, motion.angular_velocity.components]);
        let [tilt, rate] = self.seen.pop_front().unwrap_or_default();
        self.answers.iter_mut().fold(*posture, |posture, answer| {
            let held = answer.stiffness * answer.axis.dot(&tilt);
            let turn = answer.trim - held - answer.damping * answer.axis.dot(&rate);
            // The trim does not accumulate a moment that the limbs cannot produce.
            if answer.shares.iter().all(|s| (s * turn).abs() < REACH) {
                answer.trim -= held * TIME_STEP / PATIENCE;
            }
            let limbs = answer.limbs.iter().zip(answer.shares);
            limbs
                .zip(&mut answer.angles)
                .fold(posture, |posture, ((limb, share), angle)| {
                    let wanted = (share * turn).clamp(-REACH, REACH);
                    *angle += (wanted - *angle) * TIME_STEP / LAG;
                    pattern::moved(&posture, limb, *angle)
                })
        })
    }
}

/// Creates the controller for tilt about `axis`, whose limbs add the missing stiffness; `None` if none is missing.
fn answer(
    dynamics: &Dynamics<f64>,
    posture: &Posture<f64>,
    stream: &Flow<f64>,
    axis: Vector3<f64>,
    limbs: [&'static JointAngles; 3],
) -> Option<Answer> {
    let sample = dynamics.hold(posture);
    let rest = turned_by(&sample, stream).dot(&axis);
    // A limb may turn the body more in one direction than in the other; the smaller effect is used.
    let effects = limbs.map(|limb| {
        let [one, other] = [SMALL, -SMALL].map(|angle| {
            let moved = dynamics.hold(&pattern::moved(posture, limb, angle));
            (turned_by(&moved, stream).dot(&axis) - rest) / angle
        });
        let least = if one.abs() < other.abs() { one } else { other };
        if one * other > 0.0 && least.abs() >= LEAST_EFFECT {
            least
        } else {
            0.0
        }
    });
    // When the body turns by a small angle, the flow turns the other way in body axes.
    let [low, high] = [-SMALL, SMALL].map(|angle| {
        let turned = Flow {
            direction: stream.direction - axis.cross(&stream.direction) * angle,
            ..*stream
        };
        turned_by(&sample, &turned).dot(&axis)
    });
    let inertia = axis.dot(&(sample.inertia * axis));
    let stiffness = inertia * SWING * SWING - (low - high) / (2.0 * SMALL);
    let square: f64 = effects.iter().map(|effect| effect * effect).sum();
    (square > 0.0 && stiffness > 0.0).then(|| Answer {
        axis,
        stiffness,
        damping: 2.0 * DAMPED * inertia * SWING,
        trim: -rest,
        limbs,
        shares: effects.map(|effect| effect / square),
        angles: [0.0; 3],
    })
}
