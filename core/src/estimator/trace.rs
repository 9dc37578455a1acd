//! A flight with bit-identical results on every machine, summarised by a hash.
//!
//! The posture kinematics, dynamics, filter and trigonometry of the crate run in single precision over a script, and
//! every resulting number enters a hash. Host tests pin the hash for the reference body; the unit runs the same
//! function on the same body and must obtain the same hash.

use nalgebra::Vector3;

use super::measurement::Measurement;
use super::preset::{Preset, TRACKING_ON_BACK};
use super::status::Estimate;
use super::unscented::SettingsError;
use super::{Estimator, inputs_of};
use crate::body::pattern;
use crate::body::posture::{Posture, joint_rotation};
use crate::body::{Body, Segment};
use crate::dynamics::step::TIME_STEP;
use crate::dynamics::{Dynamics, Motion, State};
use crate::estimator::propagation::Propagation;
use crate::frame::{Rotation, Vector};
use crate::math::{Lanes, small_rotation};

/// Offset and prime of the 64-bit Fowler-Noll-Vo hash (FNV-1a).
const FNV: [u64; 2] = [0xcbf2_9ce4_8422_2325, 0x0000_0100_0000_01b3];

/// Hash of a sequence of numbers, computed from their bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TraceHash(u64);

impl Default for TraceHash {
    fn default() -> Self {
        Self(FNV[0])
    }
}

impl TraceHash {
    /// Adds a number to the hash.
    pub fn add(&mut self, value: f32) {
        for byte in value.to_bits().to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(FNV[1]);
        }
    }

    /// Returns the hash of all numbers added so far.
    pub fn value(self) -> u64 {
        self.0
    }
}

/// Posture of the script at sample `k`: arms and legs swing with different periods.
fn posture(k: u16) -> Posture<f32> {
    let time = f32::from(k) * f32::of(TIME_STEP);
    let swing = |rate: f32, size: f32| (rate * time).sine_cosine().0 * size;
    pattern::posture::<f32>(pattern::TRACK)
        .with(
            Segment::LeftUpperArm,
            joint_rotation(swing(0.9, 0.2), 0.6, swing(1.7, 0.3)),
        )
        .with(
            Segment::RightThigh,
            joint_rotation(0.0, -0.1, swing(2.3, 0.2)),
        )
}

/// Runs an estimator for `updates` updates over the script and returns the hash of everything it published.
///
/// The measurements come from a second run of the model with different inputs. The stack holds a single estimator.
///
/// # Errors
/// Returns an error if the estimator cannot start on this body.
pub fn hash<P: Propagation<f32>, const INTERVALS: usize>(
    body: &Body<f32>,
    updates: u16,
) -> Result<u64, SettingsError> {
    let preset = Preset {
        prediction_window: INTERVALS * P::STRIDE,
        ..TRACKING_ON_BACK
    };
    let dynamics = Dynamics::paper(*body, 1.0);
    let step = f32::of(TIME_STEP);
    let attitude = Rotation::from_quaternion(
        small_rotation(&Vector3::new(0.45, 0.05, 0.0))
            * small_rotation(&Vector3::new(0.4, 0.0, 0.0))
            * small_rotation(&Vector3::new(0.45, 0.0, 0.1)),
    );
    let start = Motion {
        inertial_from_body: attitude,
        position: Vector::zero(),
        velocity: attitude.inverse() * Vector::new(4.0, -6.0, -45.0),
        angular_velocity: Vector::new(0.1, -0.2, 0.05),
    };
    // The estimator is not moved, since a move would take the stack of two.
    let mut made = Estimator::<f32, P, INTERVALS>::new(&preset, &dynamics, &start, &posture(0));
    let estimator = made.as_mut().map_err(|error| *error)?;
    let mut flown = State::from_motion(&start, &dynamics.hold(&posture(0)));
    let mut hash = TraceHash::default();
    let (mut k, mut done) = (0u16, 0u16);
    while done < updates && k < u16::MAX {
        let ends = [posture(k), posture(k + 1)];
        let sample = dynamics.between(&ends[0], &ends[1], step);
        let wave = (f32::from(k) * 0.01).sine_cosine();
        let inputs =
            inputs_of(&[0.6 + 0.3 * wave.0, 0.3, 0.4, 5.0 + 2.0 * wave.1, 3.0, 8.0].into());
        flown = dynamics.step(&flown, &sample, &inputs, step);
        let motion = flown.motion(&sample);
        let velocities = [
            motion.velocity.to_array(),
            motion.angular_velocity.to_array(),
        ];
        for component in velocities.into_iter().flatten() {
            hash.add(component);
        }
        let seen = Measurement::of(&motion);
        if let Some(estimate) = estimator.push(&ends[1], &seen) {
            add(&mut hash, &estimate);
            done += 1;
        }
        k += 1;
    }
    Ok(hash.value())
}

/// Adds all published numbers of an estimate.
fn add(hash: &mut TraceHash, estimate: &Estimate<f32>) {
    let numbers = estimate.state.iter().chain(&estimate.deviation);
    let numbers = numbers.chain(&estimate.innovation_covariance);
    for value in numbers {
        hash.add(*value);
    }
    for channel in &estimate.channels {
        hash.add(channel.predicted);
        hash.add(channel.innovation);
        hash.add(channel.test_ratio);
    }
    for value in estimate.motion.inertial_from_body.wxyz() {
        hash.add(value);
    }
    hash.add(estimate.normalised_innovation);
    hash.add(f32::from(estimate.faults.bits()));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::full::Full;
    use crate::estimator::reduced::Reduced;
    use crate::test_body::reference_body;

    #[test]
    fn the_trace_keeps_its_bits() {
        // If these numbers change, so do the results of every unit: update them only on purpose.
        let body = reference_body().cast();
        let reduced = hash::<Reduced, 30>(&body, 100).unwrap();
        let full = hash::<Full, 60>(&body, 8).unwrap();
        assert_eq!((reduced, full), GOLDEN, "{reduced:#018x} {full:#018x}");
    }

    const GOLDEN: (u64, u64) = (0x83a060019ce4512d, 0x38899e99ce811544);
}
