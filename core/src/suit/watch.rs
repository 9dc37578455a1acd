//! Faults of a sensor that it shows in use.

use super::strapdown::Reading;
use crate::math::Real;

/// Time without a new reading after which a sensor is dead (s).
const DEAD: f64 = 0.5;
/// Share of the range from which a rate is saturated.
const SATURATED: f64 = 0.98;
/// Time constant over which mismatches with the neighbour are averaged (s), and the mean from which the sensor slipped.
const SLIP_TIME: f64 = 4.0;
const SLIPPED: f64 = 5.0;
/// Mean from which a neighbour is suspected of the slip.
const SUSPECT: f64 = 3.0;
/// Largest mismatch that counts for the mean: a single blow is no slip.
const LARGEST_MISMATCH: f64 = 15.0;

/// What is wrong with a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// No new readings.
    Dead,
    /// Its rate went beyond its range: the turn in between is lost.
    Saturated,
    /// It feels another force than its neighbour: it slipped or was turned since the first pose.
    Slipped,
}

/// Watches one sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Watch<T: Real> {
    /// Angular velocity from which it is saturated (rad/s); infinite if that is not known.
    limit: T,
    /// Sum of the last reading's numbers, each with a weight of its own, by which a frozen one shows; not a number before the
    /// first.
    last: T,
    silent: T,
    has_saturated: bool,
    mismatch: T,
}

/// Two readings with the same sum differ once in a while, but not for as long as it takes to be dead.
fn sum<T: Real>(reading: &Reading<T>) -> T {
    let numbers = reading
        .angular_velocity
        .iter()
        .chain(&reading.specific_force);
    let weighted = numbers.zip([1.0, 1.37, 1.91, 0.61, 0.83, 0.29]);
    weighted.fold(T::zero(), |sum, (number, weight)| {
        sum + *number * T::single(weight)
    })
}

impl<T: Real> Watch<T> {
    /// Watches a sensor of this range (rad/s).
    pub fn new(range: Option<T>) -> Self {
        Self {
            limit: range.map_or(T::of(f64::INFINITY), |range| range * T::of(SATURATED)),
            last: T::of(f64::NAN),
            silent: T::zero(),
            has_saturated: false,
            mismatch: T::one(),
        }
    }

    /// Takes a reading, or its loss.
    pub fn take(&mut self, reading: Option<&Reading<T>>, duration: T) {
        let sum = reading.map(sum);
        let is_new = sum.is_some_and(|sum| sum != self.last);
        if is_new {
            self.silent = T::zero();
        } else if duration > T::zero() && self.silent < T::of(DEAD) {
            self.silent += duration;
        }
        if let Some(reading) = reading {
            let is_beyond = |rate: &T| rate.abs() >= self.limit;
            self.has_saturated |= reading.angular_velocity.iter().any(is_beyond);
        }
        self.last = sum.unwrap_or(self.last);
    }

    /// Takes the mismatch with the neighbour (1 is expected) after `duration` (s).
    pub fn mismatched(&mut self, mismatch: T, duration: T) {
        let mismatch = Self::counted(mismatch);
        let share = duration / (duration + T::of(SLIP_TIME));
        if share > T::zero() {
            self.mismatch += (mismatch - self.mismatch) * share;
        }
    }

    /// A mismatch as it counts for a mean.
    pub(super) fn counted(mismatch: T) -> T {
        let most = T::of(LARGEST_MISMATCH);
        if mismatch < most { mismatch } else { most }
    }

    /// Whether the last reading was lost so long ago that the sensor is dead.
    pub fn is_dead(&self) -> bool {
        self.silent >= T::of(DEAD)
    }

    /// Whether it feels another force than its neighbour; either of them slipped.
    pub fn disagrees(&self) -> bool {
        self.mismatch > T::of(SLIPPED)
    }

    /// Whether it did so too often for its neighbour's sake alone.
    pub fn is_suspect(&self) -> bool {
        self.mismatch > T::of(SUSPECT)
    }

    /// The worst fault that the sensor shows by itself.
    pub fn fault(&self) -> Option<Fault> {
        if self.is_dead() {
            return Some(Fault::Dead);
        }
        self.has_saturated.then_some(Fault::Saturated)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    fn reading(rate: f32) -> Reading<f32> {
        Reading {
            angular_velocity: Vector3::new(rate, 0.0, 0.0),
            specific_force: Vector3::z(),
        }
    }

    #[test]
    fn lost_and_frozen_readings_are_dead_until_the_next() {
        for lost in [None, Some(reading(0.5))] {
            let mut watch = Watch::new(None);
            watch.take(Some(&reading(0.5)), 0.01);
            for _ in 0..60 {
                watch.take(lost.as_ref(), 0.01);
            }
            assert_eq!(watch.fault(), Some(Fault::Dead));
            watch.take(Some(&reading(0.6)), 0.01);
            assert_eq!(watch.fault(), None);
        }
    }

    #[test]
    fn saturation_stays_and_a_slip_needs_more_than_a_blow() {
        let mut watch = Watch::new(Some(17.4));
        watch.take(Some(&reading(17.3)), 0.01);
        watch.take(Some(&reading(1.0)), 0.01);
        assert_eq!(watch.fault(), Some(Fault::Saturated));
        watch.mismatched(1e9, 0.2);
        assert!(!watch.disagrees() && !watch.is_suspect());
        for _ in 0..20 {
            watch.mismatched(12.0, 0.2);
        }
        assert!(watch.disagrees() && watch.is_suspect());
    }
}
