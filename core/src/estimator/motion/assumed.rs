//! A velocity that is assumed rather than measured: at the start, and wherever something other than the air carries the
//! body.
//!
//! The model is not linear over tens of metres a second, so what attitude, rates and specific force seem to tell of such a
//! velocity means little. Until a receiver or a suit tells it, its deviation is at least that of the assumption, which
//! decays as the air would slow the body down: not while the body is supported or its sensor still.

use super::measurement::SensorMeasurement;
use crate::math::Real;

/// Time in which the air takes a deviation from the steady fall away (s): half of its speed divided by gravity.
const SLOWED: f32 = 2.5;

/// Change of the velocity in a second of somebody who is carried (m/s).
const CARRIED: f32 = 10.0;

/// Largest deviation that is kept up (m/s): with it an estimate is doubtful, and not lost.
const MOST: f32 = 18.0;

/// Deviation below which an assumption does not matter any more (m/s).
const LEAST: f32 = 0.5;

/// Deviation above which what was learned under an assumption is forgotten once the velocity is measured (m/s).
const MISLEADING: f32 = 6.0;

/// Least standard deviation of each component of the velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Assumed<T> {
    /// North, west, up (m/s).
    deviation: [T; 3],
    /// Whether inputs were learned under it.
    misleads: bool,
}

impl<T: Real> Assumed<T> {
    /// A velocity that is measured, if `deviation` (m/s) is zero, or assumed with it. It `misleads` if the inputs are to
    /// be learned from now on.
    pub(super) fn new(deviation: T, misleads: bool) -> Self {
        let most = T::single(MOST);
        Self {
            deviation: [if deviation < most { deviation } else { most }; 3],
            misleads,
        }
    }

    /// Takes what is measured in an interval of `duration` (s), in which something other than the air may carry the body.
    /// Returns whether a component has just been measured of which little was known, so that inputs were learned wrongly.
    pub(super) fn take(
        &mut self,
        measured: &SensorMeasurement<T>,
        is_carried: bool,
        duration: T,
    ) -> bool {
        let mut is_news = false;
        self.misleads |= is_carried;
        for (component, deviation) in self.deviation.iter_mut().enumerate() {
            let before = *deviation;
            let sensor = measured.receiver.map(|receiver| {
                if component < 2 {
                    receiver.horizontal_deviation
                } else {
                    receiver.vertical_deviation
                }
            });
            let is_better = measured.motion.velocity.is_some()
                || sensor.is_some_and(|sensor| sensor < T::single(MISLEADING));
            if is_better {
                *deviation = T::zero();
                is_news |= before > T::single(MISLEADING);
            } else if is_carried {
                let (grown, most) = (before + T::single(CARRIED) * duration, T::single(MOST));
                *deviation = if grown < most { grown } else { most };
            } else if before > T::single(LEAST) {
                *deviation -= before * (duration / T::single(SLOWED));
            } else {
                *deviation = T::zero();
            }
        }
        is_news && core::mem::take(&mut self.misleads)
    }

    /// Least variance of each component (m2/s2).
    pub(super) fn variances(&self) -> [T; 3] {
        self.deviation.map(|deviation| deviation * deviation)
    }
}

#[cfg(test)]
mod tests {
    use super::super::measurement::MotionMeasurement;
    use super::super::sensors::ReceiverVelocity;
    use super::*;
    use crate::frame::Vector;

    fn receiver(deviation: f64) -> SensorMeasurement<f64> {
        SensorMeasurement {
            receiver: Some(ReceiverVelocity {
                velocity: Vector::zero(),
                horizontal_deviation: deviation,
                vertical_deviation: 0.4,
                age: 0.1,
                arm: Vector::zero(),
            }),
            ..MotionMeasurement::none().into()
        }
    }

    #[test]
    fn an_assumption_ends_with_a_measurement_or_slowly() {
        let nothing = SensorMeasurement::none();
        let mut assumed = Assumed::new(25.0, true);
        for _ in 0..250 {
            assert!(!assumed.take(&nothing, false, 0.01));
        }
        let [north, _, up] = assumed.variances().map(f64::sqrt);
        assert!((north - 6.6).abs() < 0.1 && (up - north).abs() < 1e-9);
        // A receiver in unknown axes tells the vertical velocity.
        assert!(assumed.take(&receiver(60.0), false, 0.01));
        let [north, _, up] = assumed.variances();
        assert!(north > 40.0 && up <= 0.0);
        // What was learned is forgotten once.
        assert!(!assumed.take(&receiver(0.3), false, 0.01));
        assert_eq!(assumed, Assumed::new(0.0, false));
    }

    #[test]
    fn whoever_is_carried_may_become_faster_unnoticed() {
        let nothing = SensorMeasurement::none();
        let mut assumed = Assumed::<f64>::new(0.0, false);
        for _ in 0..100 {
            assumed.take(&nothing, true, 0.01);
        }
        assert!((assumed.variances()[0].sqrt() - 10.0).abs() < 1e-9);
        for _ in 0..1000 {
            assumed.take(&nothing, true, 0.01);
        }
        assert!((assumed.variances()[1].sqrt() - 18.0).abs() < 1e-9);
        assert!(assumed.clone().take(&receiver(0.3), true, 0.01));
        for _ in 0..2000 {
            assumed.take(&nothing, false, 0.01);
        }
        assert_eq!(assumed, Assumed::new(0.0, true));
    }

    /// Nobody slows down who rests: the deviation is that of the assumption until the rest ends, and decays from then on.
    #[test]
    fn a_rest_does_not_make_an_assumption_better() {
        let nothing = SensorMeasurement::none();
        let mut assumed = Assumed::<f64>::new(25.0, true);
        for _ in 0..6000 {
            assumed.take(&nothing, true, 0.01);
        }
        assert!((assumed.variances()[0].sqrt() - 18.0).abs() < 1e-9);
        for _ in 0..250 {
            assumed.take(&nothing, false, 0.01);
        }
        assert!((assumed.variances()[0].sqrt() - 6.6).abs() < 0.1);
    }

    /// After a gap the inputs are still those from before it.
    #[test]
    fn inputs_from_before_a_gap_are_kept() {
        let mut assumed = Assumed::new(25.0, false);
        assert!(!assumed.take(&receiver(0.3), false, 0.01));
    }
}
