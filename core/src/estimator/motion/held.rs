//! Measurements that fall within an interval: they are held and fused at its end, at their own time.
//!
//! An interval of the unit has two samples, and sensors that measure less often than once per sample know nothing of
//! that. Where both samples of an interval measure the same quantity, the later one is used.

use super::measurement::{MotionMeasurement, SensorMeasurement};
use super::sensors::ReceiverVelocity;
use super::trail::Trail;
use crate::dynamics::Motion;
use crate::frame::{Rotation, Vector};
use crate::math::{Real, small_rotation};

/// Acceleration by which a velocity may have changed before the trail, for the error of older measurements (m/s2).
const UNKNOWN_ACCELERATION: f64 = 10.0;

/// A measurement waiting for the end of its interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Held<T: Real> {
    measured: SensorMeasurement<T>,
    /// Time since the measurement (s).
    age: T,
}

impl<T: Real> Held<T> {
    /// Nothing held.
    pub(super) fn none() -> Self {
        Self {
            measured: SensorMeasurement::none(),
            age: T::zero(),
        }
    }

    /// Holds a measurement until the end of the interval, `remaining` (s) later.
    pub(super) fn hold(&mut self, measured: &SensorMeasurement<T>, remaining: T) {
        self.measured = *measured;
        self.age = remaining;
    }

    /// Returns the measurement at the end of an interval together with what was held, all of it brought to that
    /// instant, at which the body moves as `motion` after its velocity changed along `trail`, in intervals of
    /// `duration` (s). Nothing is held afterwards.
    pub(super) fn joined(
        &mut self,
        measured: &SensorMeasurement<T>,
        motion: &Motion<T>,
        trail: &Trail<T>,
        duration: T,
    ) -> SensorMeasurement<T> {
        let held = core::mem::replace(self, Self::none());
        let (earlier, age) = (held.measured, held.age);
        let (change, _) = trail.since(age / duration);
        let turn = motion.angular_velocity.components * age;
        let turned = |attitude: Rotation<T, _, _>| {
            Rotation::from_quaternion(*attitude.quaternion() * small_rotation(&turn))
        };
        let later = |velocity: Vector<T, _>| velocity + Vector::from_components(change);
        let receiver = measured
            .receiver
            .or(earlier.receiver.map(|receiver| ReceiverVelocity {
                age: receiver.age + age,
                ..receiver
            }));
        let (now, before) = (&measured.motion, &earlier.motion);
        SensorMeasurement {
            motion: MotionMeasurement {
                inertial_from_body: now
                    .inertial_from_body
                    .or(before.inertial_from_body.map(turned)),
                angular_velocity: now.angular_velocity.or(before.angular_velocity),
                velocity: now.velocity.or(before.velocity.map(later)),
                horizontal_speed: now.horizontal_speed.or(before.horizontal_speed),
            },
            attitude_error: if now.inertial_from_body.is_some() {
                measured.attitude_error
            } else {
                earlier.attitude_error
            },
            is_still: measured.is_still || earlier.is_still,
            receiver: receiver.map(|receiver| at_present(&receiver, trail, duration)),
            barometer: measured.barometer.or(earlier.barometer),
            gyroscope: measured.gyroscope.or(earlier.gyroscope),
            specific_force: measured.specific_force.or(earlier.specific_force),
        }
    }
}

/// Brings a receiver's velocity to the present: what the model says changed since is added, and what it no longer
/// remembers adds to the error.
fn at_present<T: Real>(
    receiver: &ReceiverVelocity<T>,
    trail: &Trail<T>,
    duration: T,
) -> ReceiverVelocity<T> {
    let (change, forgotten) = trail.since(receiver.age / duration);
    let added = forgotten * duration * T::of(UNKNOWN_ACCELERATION);
    let grown = |deviation: T| (deviation * deviation + added * added).root();
    ReceiverVelocity {
        velocity: receiver.velocity + Vector::from_components(change),
        horizontal_deviation: grown(receiver.horizontal_deviation),
        vertical_deviation: grown(receiver.vertical_deviation),
        age: T::zero(),
        arm: receiver.arm,
    }
}
