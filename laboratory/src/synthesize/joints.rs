//! Slow motion of the joints, and slow errors of those that are recorded.

use bodyflight_core::Segment;
use bodyflight_core::body::posture::{Posture, joint_rotation};
use bodyflight_core::math::small_rotation;
use nalgebra::Vector3;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

use super::request::JointError;

/// Slow involuntary motion of every joint: three sines per axis, with seeded frequencies and phases.
pub(super) struct Sway {
    waves: Vec<(Segment, [[Wave; 3]; 3])>,
}

#[derive(Clone, Copy)]
struct Wave {
    /// Largest angle (rad).
    amplitude: f64,
    /// Angular frequency (rad/s).
    frequency: f64,
    phase: f64,
}

impl Sway {
    pub(super) fn new(random: &mut ChaCha8Rng, size: f64) -> Self {
        let mut wave = || Wave {
            amplitude: size * random.random_range(0.3..0.8),
            frequency: std::f64::consts::TAU * random.random_range(0.1..0.9),
            phase: random.random_range(0.0..std::f64::consts::TAU),
        };
        let mut axis = || [wave(), wave(), wave()];
        let joints = Segment::ALL.into_iter().skip(1);
        Self {
            waves: joints
                .map(|segment| (segment, [axis(), axis(), axis()]))
                .collect(),
        }
    }

    pub(super) fn on(&self, posture: &Posture<f64>, time: f64) -> Posture<f64> {
        self.waves
            .iter()
            .fold(*posture, |posture, (segment, axes)| {
                let [psi, theta, phi] = axes.map(|waves| {
                    waves
                        .iter()
                        .map(|w| w.amplitude * (w.frequency * time + w.phase).sin())
                        .sum()
                });
                let joint = posture.parent_from_segment(*segment) * joint_rotation(psi, theta, phi);
                posture.with(*segment, joint)
            })
    }
}

/// Errors of the recorded joints that are slower than noise.
pub(super) struct JointErrors {
    errors: Vec<(Segment, [AxisError; 3])>,
}

#[derive(Clone, Copy)]
struct AxisError {
    constant: f64,
    waves: [Wave; 2],
}

impl JointErrors {
    /// Uses a separate random generator, so that a flight without joint errors stays bit-identical.
    pub(super) fn new(seed: u64, size: JointError) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x6a6f_696e_7473);
        let mut axis = || AxisError {
            constant: size.calibration * random.sample::<f64, _>(StandardNormal),
            waves: [(); 2].map(|()| Wave {
                amplitude: size.wander * random.sample::<f64, _>(StandardNormal),
                frequency: std::f64::consts::TAU * random.random_range(0.08..0.5),
                phase: random.random_range(0.0..std::f64::consts::TAU),
            }),
        };
        let mut axes = || [axis(), axis(), axis()];
        let joints = Segment::ALL.into_iter().skip(1);
        Self {
            errors: joints.map(|segment| (segment, axes())).collect(),
        }
    }

    pub(super) fn on(&self, posture: &Posture<f64>, time: f64) -> Posture<f64> {
        self.errors.iter().fold(*posture, |seen, (segment, axes)| {
            let turn = axes.map(|error| {
                let waves = error.waves.iter();
                let wander: f64 = waves
                    .map(|w| w.amplitude * (w.frequency * time + w.phase).sin())
                    .sum();
                error.constant + wander
            });
            if turn.iter().all(|angle| angle.abs() == 0.0) {
                return seen;
            }
            let error = small_rotation(&Vector3::from(turn));
            seen.with(*segment, seen.parent_from_segment(*segment) * error)
        })
    }
}
