//! Recognises a body that something other than the air supports: one that stands, walks or sits, on the ground or in
//! an aircraft.
//!
//! Such a body measures one g upward, as in a steady fall, but descends slower through the air than any fall in which
//! the air could give it that. The specific force comes from an accelerometer, or else from the change of a measured
//! velocity. A body under a canopy is supported too.

use nalgebra::Vector3;

use super::measurement::SensorMeasurement;
use crate::air::STANDARD_GRAVITY;
use crate::dynamics::Motion;
use crate::math::{Real, clamp};

/// Time constant of the means (s).
const WINDOW: f64 = 0.7;
/// Largest difference of the mean specific force from one g upward (m/s2).
const UPWARD: f64 = 2.5;
/// Vertical speed through the air (m/s) that no steady fall remains below; wingsuits descend at 12 m/s and more.
const SLOWEST_FALL: f64 = 8.0;
/// Time (s) for which both must hold.
const LASTING: f32 = 0.8;

/// What carries the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Situation {
    /// The air and gravity, as far as measurements show.
    #[default]
    Flying,
    /// The ground, or the floor or seat of an aircraft: the model does not apply.
    Supported,
}

/// Means by which a support is recognised.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Support<T: Real> {
    /// Mean specific force (m/s2, inertial axes) and mean vertical velocity through the air (m/s).
    measured: Vector3<T>,
    up: T,
    /// Last measured velocity, and the time since.
    velocity: Option<Vector3<T>>,
    since: T,
    lasting: T,
}

impl<T: Real> Support<T> {
    /// Before anything is measured.
    pub fn new() -> Self {
        Self {
            measured: Vector3::zeros(),
            up: T::zero(),
            velocity: None,
            since: T::zero(),
            lasting: T::zero(),
        }
    }

    /// What carries the body.
    pub fn situation(&self) -> Situation {
        if self.lasting >= T::single(LASTING) {
            Situation::Supported
        } else {
            Situation::Flying
        }
    }

    /// Processes the measurement at the end of an interval of `duration` (s), in air that rises at `updraft` (m/s).
    pub fn take(
        &mut self,
        measured: &SensorMeasurement<T>,
        motion: &Motion<T>,
        updraft: T,
        duration: T,
    ) {
        self.since += duration;
        let Some((force, share)) = self.force(measured, motion) else {
            // Without any measurement nothing is known of a support.
            if self.since > T::of(3.0) {
                *self = Self::new();
            }
            return;
        };
        let largest = T::of(100.0);
        let bounded = |v: T| clamp(v, -largest, largest);
        self.measured += (force.map(bounded) - self.measured) * share;
        let rising = self
            .velocity
            .map_or_else(T::zero, |velocity| velocity.z - updraft);
        self.up += (bounded(rising) - self.up) * share;
        let up = Vector3::new(T::zero(), T::zero(), T::of(STANDARD_GRAVITY));
        let upward = (self.measured - up).norm_squared() <= T::of(UPWARD * UPWARD);
        let holds = upward && self.up.abs() <= T::of(SLOWEST_FALL);
        let passed = share * T::of(WINDOW);
        self.lasting = if holds {
            let longer = self.lasting + passed;
            if longer < T::one() { longer } else { T::one() }
        } else {
            T::zero()
        };
    }

    /// Specific force of the measurement in inertial axes, and the weight of it in the means.
    fn force(
        &mut self,
        measured: &SensorMeasurement<T>,
        motion: &Motion<T>,
    ) -> Option<(Vector3<T>, T)> {
        let receiver = measured.receiver.map(|receiver| receiver.velocity);
        let velocity = measured.motion.velocity.or(receiver)?.components;
        let elapsed = core::mem::replace(&mut self.since, T::zero());
        let last = self.velocity.replace(velocity);
        let attitude = measured.motion.inertial_from_body;
        let attitude = attitude.unwrap_or(motion.inertial_from_body);
        let up = Vector3::new(T::zero(), T::zero(), T::of(STANDARD_GRAVITY));
        let force = match measured.specific_force {
            Some(sensor) => (attitude * sensor.force).components,
            None => (velocity - last?) / elapsed + up,
        };
        let share = clamp(elapsed / T::of(WINDOW), T::zero(), T::one());
        force
            .iter()
            .all(|v| v.is_finite())
            .then_some((force, share))
    }
}

impl<T: Real> Default for Support<T> {
    fn default() -> Self {
        Self::new()
    }
}
