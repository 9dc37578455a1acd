//! Calibration of a gyroscope in its tray: bias at rest, scale by full turns.

use nalgebra::Vector3;

use super::rest::Rest;
use super::strapdown::LONGEST_INTERVAL;
use crate::math::Real;

/// Standard deviation of a scale that was not calibrated: data sheets of small sensors state 0.5 to 1 %.
pub const UNKNOWN_GAIN: f64 = 0.005;
/// Standard deviation of the bias that returns after a rest: temperature and wander (rad/s).
const RETURNING_BIAS: f64 = 0.000_35;
/// Standard deviation of a bias that no rest has shown (rad/s).
pub const UNKNOWN_BIAS: f64 = 0.01;
/// By how much the tray is off its first direction after full turns, standard deviation (rad).
const RETURN: f64 = 0.017;
/// Largest error of a scale, as a share, to be believed: beyond it, the turns were not full.
pub const LARGEST_ERROR: f64 = 0.04;
/// Share of a turn that must be about one axis of the sensor to calibrate it.
const ALONG: f64 = 0.9;

/// Correction of a gyroscope: bias and scale of each axis, with their standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gyroscope<T: Real> {
    /// Bias (rad/s).
    pub bias: Vector3<T>,
    /// Factor on each axis after the bias is taken off.
    pub gain: Vector3<T>,
    /// Standard deviation of the bias (rad/s), each axis.
    pub bias_deviation: T,
    /// Standard deviations of the factors.
    pub gain_deviation: Vector3<T>,
}

impl<T: Real> Default for Gyroscope<T> {
    fn default() -> Self {
        Self {
            bias: Vector3::zeros(),
            gain: Vector3::repeat(T::one()),
            bias_deviation: T::of(UNKNOWN_BIAS),
            gain_deviation: Vector3::repeat(T::of(UNKNOWN_GAIN)),
        }
    }
}

impl<T: Real> Gyroscope<T> {
    /// A gyroscope whose rates are the turns of attitudes by a fusion of its own: that has taken the bias off, and a person
    /// who sways while standing shows none.
    pub fn of_fusion() -> Self {
        Self {
            bias_deviation: T::of(RETURNING_BIAS),
            ..Self::default()
        }
    }

    /// Angular velocity (rad/s) from a reading.
    pub fn corrected(&self, read: &Vector3<T>) -> Vector3<T> {
        (read - self.bias).component_mul(&self.gain)
    }

    /// Takes the bias from a window at rest that lasted `duration` (s).
    pub fn set_bias(&mut self, rest: &Rest<T>, duration: T) {
        let count = T::of(f64::from(rest.count()));
        let has_lasted = duration > T::zero();
        if rest.count() < 2 || !has_lasted {
            return;
        }
        let mean = rest.rate_deviation() / count.root();
        let returning = T::of(RETURNING_BIAS);
        self.bias = rest.rate();
        self.bias_deviation = (mean * mean + returning * returning).root();
    }

    /// Takes the scale of one axis from full turns. Returns the axis and its error as a share.
    ///
    /// # Errors
    /// Returns an error, and changes nothing, if the turn does not show a scale.
    pub fn set_gain(&mut self, turns: &Turns<T>) -> Result<(usize, T), TurnError<T>> {
        let (axis, seen) = turns.along().ok_or(TurnError::NoAxis)?;
        let full = (seen / T::two_pi()).nearest() * T::two_pi();
        if full.abs() < T::pi() {
            return Err(TurnError::NoTurn);
        }
        let error = full / seen - T::one();
        if error.abs() > T::of(LARGEST_ERROR) {
            return Err(TurnError::NotFull(seen));
        }
        self.gain[axis] *= T::one() + error;
        let drifted = self.bias_deviation * turns.duration;
        let off = T::of(RETURN);
        self.gain_deviation[axis] = (off * off + drifted * drifted).root() / full.abs();
        Ok((axis, error))
    }
}

/// Why turns show no scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TurnError<T: Real> {
    /// They were not about one axis of the sensor.
    NoAxis,
    /// There was less than half a turn.
    NoTurn,
    /// The angle (rad) is too far from full turns.
    NotFull(T),
}

/// The angle through which a sensor turned between two rests, about its own axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turns<T: Real> {
    angle: Vector3<T>,
    duration: T,
}

impl<T: Real> Default for Turns<T> {
    fn default() -> Self {
        Self {
            angle: Vector3::zeros(),
            duration: T::zero(),
        }
    }
}

impl<T: Real> Turns<T> {
    /// Takes a rate (rad/s, corrected) that lasts `duration` (s).
    pub fn take(&mut self, rate: &Vector3<T>, duration: T) {
        if rate.norm_squared().is_finite()
            && duration > T::zero()
            && duration <= T::of(LONGEST_INTERVAL)
        {
            self.angle += rate * duration;
            self.duration += duration;
        }
    }

    /// The axis of the sensor about which it turned, and the angle (rad); `None` if there is no such axis.
    pub fn along(&self) -> Option<(usize, T)> {
        let size = self.angle.norm_squared().root();
        (0..3)
            .map(|axis| (axis, self.angle[axis]))
            .find(|(_, angle)| angle.abs() > T::of(ALONG) * size)
    }
}

#[cfg(test)]
mod tests {
    use super::super::strapdown::Reading;
    use super::*;

    #[test]
    fn a_tray_shows_bias_and_scale_and_half_turns_are_refused() {
        let (bias, gain) = (
            Vector3::new(0.01, -0.02, 0.004),
            Vector3::new(1.01, 0.993, 1.0),
        );
        let read = |rate: Vector3<f32>| rate.component_div(&gain) + bias;
        let mut rest = Rest::default();
        for _ in 0..1000 {
            rest.take(&Reading {
                angular_velocity: read(Vector3::zeros()),
                specific_force: Vector3::new(0.0, 0.0, 9.81),
            });
        }
        let mut gyroscope = Gyroscope::<f32>::default();
        gyroscope.set_bias(&rest, 10.0);
        let turned = |gyroscope: &Gyroscope<f32>, axis: usize, turns: f32| {
            let mut seen = Turns::default();
            let mut rate = Vector3::zeros();
            rate[axis] = turns * core::f32::consts::TAU / 6.0;
            for _ in 0..600 {
                seen.take(&gyroscope.corrected(&read(rate)), 0.01);
            }
            seen
        };
        for axis in 0..2 {
            let seen = turned(&gyroscope, axis, 3.0);
            assert_eq!(gyroscope.set_gain(&seen).unwrap().0, axis);
        }
        assert!((gyroscope.gain - gain).norm() < 2e-4, "{}", gyroscope.gain);
        assert!(gyroscope.gain_deviation.x < 0.0012 && gyroscope.gain_deviation.z > 0.004);
        let half = turned(&gyroscope, 2, 2.5);
        assert!(matches!(
            gyroscope.set_gain(&half),
            Err(TurnError::NotFull(_))
        ));
        assert_eq!(
            gyroscope.set_gain(&Turns::default()),
            Err(TurnError::NoAxis)
        );
    }
}
