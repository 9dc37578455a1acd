//! The initial motion of a free run: from one frame, or fitted to the first tenth of a second.
//!
//! A free run never corrects itself: an error in its initial angular velocity becomes an attitude error that grows in
//! proportion to time. The angular velocity at a single frame carries all of that frame's noise, from the pelvis and
//! from the joints, whose rates enter the angular momentum. So the initial motion is fitted by least squares: its run
//! over the recorded postures comes as close as possible to the attitudes, angular velocities and velocities recorded
//! in the first tenth of a second.

use bodyflight_core::dynamics::Motion;
use bodyflight_core::dynamics::free_run::Equations;
use bodyflight_core::frame::Rotation;
use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};

use super::recorded::{Recorded, Variant};
use crate::flight::Start;

/// Time over which a start is smoothed (s).
pub const SMOOTHED_OVER: f64 = 0.1;

/// Assumed standard deviations of the recorded values, apart from errors that all of them have in common.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Of the attitude (rad).
    pub attitude: f64,
    /// Of the angular velocity (rad/s).
    pub angular_velocity: f64,
    /// Of the velocity (m/s).
    pub velocity: f64,
}

impl Default for Noise {
    fn default() -> Self {
        Self {
            attitude: 0.01,
            angular_velocity: 0.1,
            velocity: 0.1,
        }
    }
}

/// Parameters of a start: rotation, angular velocity, velocity.
const NUMBERS: usize = 9;

/// Gauss-Newton iterations; three are enough from a measured start.
const STEPS: usize = 6;

/// Steps of the finite differences (rad, rad/s, m/s).
const DIFFERENCE: f64 = 1e-5;

/// A motion perturbed by small changes of attitude, angular velocity and velocity (body axes).
fn changed(motion: &Motion<f64>, numbers: &[f64]) -> Motion<f64> {
    let part = |from: usize| Vector3::new(numbers[from], numbers[from + 1], numbers[from + 2]);
    let turn = UnitQuaternion::from_scaled_axis(part(0));
    let mut motion = *motion;
    motion.inertial_from_body =
        Rotation::from_quaternion(motion.inertial_from_body.quaternion() * turn);
    motion.angular_velocity.components += part(3);
    motion.velocity.components += part(6);
    motion
}

/// Recorded minus simulated, in units of the standard deviations.
fn residuals(
    recorded: &Recorded,
    [first, last]: [usize; 2],
    simulated: &[Motion<f64>],
    noise: Noise,
) -> DVector<f64> {
    let rows = simulated
        .iter()
        .zip(&recorded.samples[first..=last])
        .flat_map(|(simulated, sample)| {
            let measured = &sample.motion;
            let turn = simulated.inertial_from_body.quaternion().inverse()
                * measured.inertial_from_body.quaternion();
            let spin = measured.angular_velocity.components - simulated.angular_velocity.components;
            let velocity =
                measured.velocity_inertial().components - simulated.velocity_inertial().components;
            let [turn, spin, velocity] = [
                turn.scaled_axis() / noise.attitude,
                spin / noise.angular_velocity,
                velocity / noise.velocity,
            ];
            [
                turn.x, turn.y, turn.z, spin.x, spin.y, spin.z, velocity.x, velocity.y, velocity.z,
            ]
        });
    DVector::from_iterator(simulated.len() * NUMBERS, rows)
}

/// The motion at frame `first` whose run best fits the frames up to `last`.
pub fn fitted(
    recorded: &Recorded,
    [first, last]: [usize; 2],
    variant: Variant,
    noise: Noise,
) -> Motion<f64> {
    let mut start = recorded.samples[first].motion;
    let frames = [first, last];
    let shared = match variant {
        Variant::Whole(equations) => Some(recorded.shared(frames, equations)),
        Variant::WithoutLimbMomentum | Variant::FrozenPosture => None,
    };
    let off = |start: &Motion<f64>| {
        let run = match &shared {
            Some(shared) => shared.run(start),
            None => recorded.run(first, last, start, variant),
        };
        residuals(recorded, frames, &run, noise)
    };
    let mut here = off(&start);
    for _ in 0..STEPS {
        let columns: Vec<DVector<f64>> = (0..NUMBERS)
            .map(|number| {
                let mut numbers = [0.0; NUMBERS];
                numbers[number] = DIFFERENCE;
                (&here - off(&changed(&start, &numbers))) / DIFFERENCE
            })
            .collect();
        let slopes = DMatrix::from_columns(&columns);
        let Some(normal) = (slopes.transpose() * &slopes).cholesky() else {
            break;
        };
        let step = normal.solve(&(slopes.transpose() * &here));
        let there = changed(&start, step.as_slice());
        let again = off(&there);
        let gained = here.norm_squared() - again.norm_squared();
        if gained.is_nan() || gained <= 0.0 {
            break;
        }
        (start, here) = (there, again);
        if gained < 1e-6 * here.norm_squared() {
            break;
        }
    }
    start
}

/// The motion at frame `first` from which a run of this variant starts.
pub fn first_motion(
    start: Start,
    recorded: &Recorded,
    first: usize,
    equations: Equations,
) -> Motion<f64> {
    match start {
        Start::First => recorded.samples[first].motion,
        Start::Smoothed => {
            let last = recorded.frame_at(first, SMOOTHED_OVER);
            fitted(
                recorded,
                [first, last],
                Variant::Whole(equations),
                Noise::default(),
            )
        }
    }
}
