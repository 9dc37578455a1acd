//! An autopilot that holds the attitude of a start with the limbs, where the air alone would turn the body over.
//!
//! It moves patterns of joints as a flyer does, at the speed of the keys and within 0.8 rad, but it feels tilt and
//! turning at once and without error, which no person does. What it holds are the attitudes in which a flight begins, not
//! those that the air balances.

use bodyflight_core::Posture;
use bodyflight_core::Segment;
use bodyflight_core::body::pattern::{self, JointAngles};
use bodyflight_core::dynamics::Motion;
use bodyflight_core::frame::{Body, Inertial, Rotation, Vector};
use bodyflight_core::math::Real;
use nalgebra::Vector3;

/// Largest amount of a pattern (rad).
const REACH: f32 = 0.8;

/// Fastest change of a pattern (rad/s).
const SPEED: f32 = 3.0;

/// One thigh forward, the other back.
pub const SCISSORS: &JointAngles = &[
    (Segment::LeftThigh, [0.0, 0.0, 1.0]),
    (Segment::RightThigh, [0.0, 0.0, -1.0]),
];

/// As [`pattern::moved`], once in the page's code.
#[inline(never)]
pub(crate) fn moved(
    posture: &Posture<f32>,
    pattern: &'static JointAngles,
    amount: f32,
) -> Posture<f32> {
    pattern::moved(posture, pattern, amount)
}

/// What answers a tilt: a pattern, and how much of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// What moves.
    pub pattern: &'static JointAngles,
    /// Amount for a tilt of one radian.
    pub tilt: f32,
    /// Amount for a turn of one radian a second.
    pub rate: f32,
    /// Growth of the amount, a second, for a tilt of one radian.
    pub growth: f32,
}

/// Answers to a tilt forwards and aside, and to a turn about the vertical.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answers {
    /// About the left axis.
    pub pitch: Answer,
    /// About the other level axis.
    pub aside: Answer,
    /// About the vertical.
    pub turn: Answer,
}

/// Holds an attitude; the heading is free, only its change is slowed.
#[derive(Debug, Clone, Copy)]
pub struct Autopilot {
    answers: &'static Answers,
    /// The vertical in the body where it is held.
    up: Vector3<f32>,
    sums: [f32; 3],
    amounts: [f32; 3],
}

fn vertical(inertial_from_body: &Rotation<f32, Inertial, Body>) -> Vector3<f32> {
    (inertial_from_body.inverse() * Vector::new(0.0, 0.0, 1.0)).components
}

/// The angle between the vertical in the body where it is held and where it is (rad): the heading is free.
pub fn tilt(held: &Rotation<f32, Inertial, Body>, motion: &Motion<f32>) -> f32 {
    let (wanted, up) = (vertical(held), vertical(&motion.inertial_from_body));
    up.cross(&wanted).norm().arctangent2(up.dot(&wanted))
}

impl Autopilot {
    /// One that holds the attitude of a motion.
    pub fn new(answers: &'static Answers, held: &Rotation<f32, Inertial, Body>) -> Self {
        Self {
            answers,
            up: vertical(held),
            sums: [0.0; 3],
            amounts: [0.0; 3],
        }
    }

    /// Feels the motion, and moves for `duration` (s).
    pub fn feel(&mut self, motion: &Motion<f32>, duration: f32) {
        let off = vertical(&motion.inertial_from_body).cross(&self.up);
        let turning = motion.angular_velocity.components;
        // About the level axis that is not the left one.
        let aside = self.up.cross(&Vector3::x());
        let seen = [
            (off.x, turning.x),
            (off.dot(&aside), turning.dot(&aside)),
            (0.0, turning.dot(&self.up)),
        ];
        let Answers { pitch, aside, turn } = self.answers;
        for (((answer, (tilt, rate)), sum), amount) in [pitch, aside, turn]
            .into_iter()
            .zip(seen)
            .zip(&mut self.sums)
            .zip(&mut self.amounts)
        {
            *sum = (*sum + answer.growth * tilt * duration).clamp(-REACH, REACH);
            let wanted = (answer.tilt * tilt - answer.rate * rate + *sum).clamp(-REACH, REACH);
            let step = SPEED * duration;
            *amount += (wanted - *amount).clamp(-step, step);
        }
    }

    /// A posture with its answers.
    pub fn moved(&self, posture: &Posture<f32>) -> Posture<f32> {
        let Answers { pitch, aside, turn } = self.answers;
        [pitch, aside, turn]
            .into_iter()
            .zip(self.amounts)
            .fold(*posture, |posture, (answer, amount)| {
                moved(&posture, answer.pattern, amount)
            })
    }
}
