//! Integration of one gyroscope.

use nalgebra::{UnitQuaternion, Vector3};

use crate::math::{Real, renormalized, rotation_by};

/// Longest interval over which a rate is integrated (s); after a longer gap the turn in between is unknown.
pub const LONGEST_INTERVAL: f64 = 0.5;

/// One sample of a sensor, in its own axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading<T: Real> {
    /// Angular velocity (rad/s).
    pub angular_velocity: Vector3<T>,
    /// Specific force: acceleration without gravity's (m/s2); at rest it points up.
    pub specific_force: Vector3<T>,
}

impl<T: Real> Reading<T> {
    /// Whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        let all = self.angular_velocity.iter().chain(&self.specific_force);
        all.fold(T::zero(), |sum, v| sum + v.abs()).is_finite()
    }
}

/// Attitude of a sensor by integration of its rates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strapdown<T: Real> {
    /// Attitude.
    pub reference_from_sensor: UnitQuaternion<T>,
    rate: Option<Vector3<T>>,
}

impl<T: Real> Strapdown<T> {
    /// Starts at an attitude.
    pub fn new(reference_from_sensor: UnitQuaternion<T>) -> Self {
        Self {
            reference_from_sensor,
            rate: None,
        }
    }

    /// Turns by the angular velocity (rad/s, sensor axes, corrected) at the end of an interval (s). The rate changes
    /// linearly in between; the turn of its direction (coning) is allowed for to first order. An interval longer than
    /// [`LONGEST_INTERVAL`] or numbers that are not finite change nothing.
    pub fn advance(&mut self, rate: &Vector3<T>, duration: T) {
        let is_usable = duration > T::zero()
            && duration <= T::of(LONGEST_INTERVAL)
            && rate.norm_squared().is_finite();
        if !is_usable {
            self.rate = None;
            return;
        }
        let before = self.rate.unwrap_or(*rate);
        let mean = (before + rate) * (T::of(0.5) * duration);
        let coning = before.cross(rate) * (duration * duration / T::of(12.0));
        let turn = rotation_by(&(mean + coning));
        let turned = self.reference_from_sensor.into_inner() * turn.into_inner();
        self.reference_from_sensor = renormalized(turned);
        self.rate = Some(*rate);
    }

    /// The last angular velocity (rad/s, sensor axes); zero before the first.
    pub fn rate(&self) -> Vector3<T> {
        self.rate.unwrap_or_else(Vector3::zeros)
    }

    /// Takes an error of the attitude back (rad, reference axes).
    pub fn correct(&mut self, error: &Vector3<T>) {
        let back = rotation_by(&-error).into_inner();
        self.reference_from_sensor = renormalized(back * self.reference_from_sensor.into_inner());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Lanes;
    use proptest::prelude::*;

    /// Error after 10 s of coning, whose axis moves around a cone, at `rate_hz`, in both precisions.
    fn coning(rate_hz: f64) -> [f64; 2] {
        let (half, spin) = (0.3_f64, 12.0_f64);
        let exact = |time: f64| {
            let (sine, cosine) = (spin * time).sine_cosine();
            UnitQuaternion::from_scaled_axis(Vector3::new(cosine, sine, 0.0) * half)
        };
        let rate = |time: f64| {
            let step = 1e-5;
            (exact(time - step).inverse() * exact(time + step)).scaled_axis() / (2.0 * step)
        };
        let mut double = Strapdown::new(exact(0.0));
        let mut single = Strapdown::new(exact(0.0).cast::<f32>());
        double.advance(&rate(0.0), 1e-9);
        single.advance(&rate(0.0).map(f32::of), 1e-9);
        let mut k = 0.0;
        while k < 10.0 * rate_hz {
            k += 1.0;
            let now = rate(k / rate_hz);
            double.advance(&now, 1.0 / rate_hz);
            single.advance(&now.map(f32::of), f32::of(1.0 / rate_hz));
        }
        let end = exact(10.0);
        let of_single = single.reference_from_sensor.cast::<f64>();
        [double.reference_from_sensor, of_single].map(|found| found.angle_to(&end).to_degrees())
    }

    /// A cone of 34 degrees at two turns a second.
    #[test]
    fn coning_is_followed_at_the_rates_of_sensors_in_either_precision() {
        for (rate_hz, most) in [(60.0, 2.5), (120.0, 0.7), (240.0, 0.2)] {
            for error in coning(rate_hz) {
                assert!(error < most, "{rate_hz} Hz: {error} degrees");
            }
        }
    }

    proptest! {
        #[test]
        fn no_input_breaks_an_attitude(bits in prop::array::uniform4(any::<u32>())) {
            let [x, y, z, duration] = bits.map(f32::from_bits);
            let mut attitude = Strapdown::<f32>::new(UnitQuaternion::identity());
            attitude.advance(&Vector3::new(x, y, z), duration);
            attitude.advance(&Vector3::new(z, x, y), 0.01);
            let norm = attitude.reference_from_sensor.coords.norm_squared();
            prop_assert!((norm - 1.0).abs() < 1e-3, "{norm}");
        }
    }
}
