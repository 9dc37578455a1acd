//! An autopilot that holds the initial attitude with the limbs in poses that are otherwise unstable.
//!
//! It moves patterns of joints at the speed of the keys and by up to 0.8 rad. Unlike a person it senses tilt without
//! delay or error, and the turn rate through a filter of 2 Hz. It holds the attitude in which a flight begins, which need not be in equilibrium.

use bodyflight_core::Posture;
use bodyflight_core::Segment;
use bodyflight_core::body::pattern::{self, JointAngles};
use bodyflight_core::dynamics::Motion;
use bodyflight_core::dynamics::equations_of_motion::LowPass;
use bodyflight_core::frame::{Body, Inertial, Rotation, Vector};
use bodyflight_core::math::Lanes;
use nalgebra::Vector3;

/// Largest amplitude of a pattern (rad).
const REACH: f32 = 0.8;

/// Largest rate of a pattern (rad/s).
const SPEED: f32 = 3.0;

/// One thigh forward, the other back.
pub const SCISSORS: &JointAngles = &[
    (Segment::LeftThigh, [0.0, 0.0, 1.0]),
    (Segment::RightThigh, [0.0, 0.0, -1.0]),
];

/// [`pattern::moved`], not inlined, to keep the page small.
#[inline(never)]
pub(crate) fn moved(
    posture: &Posture<f32>,
    pattern: &'static JointAngles,
    amount: f32,
) -> Posture<f32> {
    pattern::moved(posture, pattern, amount)
}

/// A pattern as feedback, with its gains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// Pattern that moves.
    pub pattern: &'static JointAngles,
    /// Proportional gain on the tilt.
    pub tilt: f32,
    /// Gain on the angular rate (s).
    pub rate: f32,
    /// Integral gain on the tilt (1/s).
    pub growth: f32,
}

/// Feedback on tilt forwards and sideways, and on the turn rate about the vertical.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answers {
    /// About the left axis.
    pub pitch: Answer,
    /// About the other level axis.
    pub aside: Answer,
    /// About the vertical.
    pub turn: Answer,
}

/// Holds an attitude. The heading is free; its rate is damped.
#[derive(Debug, Clone, Copy)]
pub struct Autopilot {
    answers: &'static Answers,
    /// Vertical in body axes at the held attitude.
    up: Vector3<f32>,
    /// Angular velocity as sensed. Unfiltered, it contains the pelvis's recoil from the limbs' own last movement, and
    /// a limit cycle of some 17 Hz results.
    turning: LowPass<f32>,
    sums: [f32; 3],
    amounts: [f32; 3],
}

fn vertical(inertial_from_body: &Rotation<f32, Inertial, Body>) -> Vector3<f32> {
    (inertial_from_body.inverse() * Vector::new(0.0, 0.0, 1.0)).components
}

/// Angle between the held and the current vertical in body axes (rad), independent of the heading.
pub fn tilt(held: &Rotation<f32, Inertial, Body>, motion: &Motion<f32>) -> f32 {
    let (wanted, up) = (vertical(held), vertical(&motion.inertial_from_body));
    up.cross(&wanted).norm().arctangent2(up.dot(&wanted))
}

impl Autopilot {
    /// Creates an autopilot that holds the attitude of a motion.
    pub fn new(answers: &'static Answers, held: &Rotation<f32, Inertial, Body>) -> Self {
        Self {
            answers,
            up: vertical(held),
            turning: LowPass::at_rest(),
            sums: [0.0; 3],
            amounts: [0.0; 3],
        }
    }

    /// Responds to the motion for `duration` (s).
    pub fn feel(&mut self, motion: &Motion<f32>, duration: f32) {
        let off = vertical(&motion.inertial_from_body).cross(&self.up);
        let turning = self
            .turning
            .follow(&motion.angular_velocity.components, duration);
        // About the horizontal axis normal to the left axis.
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

    /// Adds the feedback to a posture.
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
