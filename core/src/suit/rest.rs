//! Rest: a sensor that does not move shows the bias of its gyroscope and where up is.

use nalgebra::Vector3;

use super::strapdown::Reading;
use crate::air::STANDARD_GRAVITY;
use crate::math::Real;

/// Largest standard deviation of the angular velocity about an axis of a person who stands still (rad/s).
pub const STILL_RATE: f64 = 0.12;
/// Largest angular velocity of a sensor that rests: its bias (rad/s).
pub const LARGEST_BIAS: f64 = 0.2;
/// Largest difference of the mean specific force from gravity at rest (m/s2).
pub const STILL_FORCE: f64 = 0.6;

/// Mean and spread of the readings of a window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rest<T: Real> {
    count: u32,
    rate: Vector3<T>,
    force: Vector3<T>,
    rate_squares: Vector3<T>,
}

impl<T: Real> Default for Rest<T> {
    fn default() -> Self {
        Self {
            count: 0,
            rate: Vector3::zeros(),
            force: Vector3::zeros(),
            rate_squares: Vector3::zeros(),
        }
    }
}

impl<T: Real> Rest<T> {
    /// Takes a reading; those with numbers that are not finite are left out.
    pub fn take(&mut self, reading: &Reading<T>) {
        if !reading.is_finite() || self.count == u32::MAX {
            return;
        }
        self.count += 1;
        let share = T::one() / T::of(f64::from(self.count));
        let off = reading.angular_velocity - self.rate;
        self.rate += off * share;
        let after = reading.angular_velocity - self.rate;
        self.rate_squares += off.component_mul(&after);
        self.force += (reading.specific_force - self.force) * share;
    }

    /// Adds another window.
    pub fn merge(&mut self, other: &Self) {
        let Some(count) = self.count.checked_add(other.count).filter(|all| *all > 0) else {
            return;
        };
        let share = T::of(f64::from(other.count)) / T::of(f64::from(count));
        let off = other.rate - self.rate;
        let own = T::of(f64::from(self.count));
        self.rate_squares += other.rate_squares + off.component_mul(&off) * (own * share);
        self.rate += off * share;
        self.force += (other.force - self.force) * share;
        self.count = count;
    }

    /// Readings taken.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Mean angular velocity (rad/s, sensor axes): the bias of a gyroscope at rest.
    pub fn rate(&self) -> Vector3<T> {
        self.rate
    }

    /// Mean specific force (m/s2, sensor axes).
    pub fn force(&self) -> Vector3<T> {
        self.force
    }

    /// Direction of up in sensor axes, `None` if no force was felt.
    pub fn up(&self) -> Option<Vector3<T>> {
        let size = self.force.norm_squared().root();
        (size > T::one()).then(|| self.force / size)
    }

    /// Largest standard deviation of the angular velocity about an axis (rad/s).
    pub fn rate_deviation(&self) -> T {
        let count = T::of(f64::from(self.count.max(1)));
        let most = |a: T, b: T| if b > a { b } else { a };
        (self.rate_squares.iter().copied().fold(T::zero(), most) / count).root()
    }

    /// Whether the sensor rested: hardly any rate, and a force like gravity's.
    pub fn is_still(&self) -> bool {
        let force = self.force.norm_squared().root() - T::of(STANDARD_GRAVITY);
        self.count > 1
            && self.rate_deviation() < T::of(STILL_RATE)
            && self.rate.norm_squared() < T::of(LARGEST_BIAS * LARGEST_BIAS)
            && force.abs() < T::of(STILL_FORCE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Lanes;

    #[test]
    fn bias_and_up_are_those_at_rest_and_motion_is_no_rest() {
        let (mut still, mut moving) = (Rest::<f32>::default(), Rest::<f32>::default());
        for k in 0..400_u16 {
            let noise = if k.is_multiple_of(2) { 0.02 } else { -0.02 };
            let mut reading = Reading {
                angular_velocity: Vector3::new(0.01 + noise, -0.02, 0.005),
                specific_force: Vector3::new(0.0, 9.8, noise),
            };
            still.take(&reading);
            reading.angular_velocity.y += (0.1 * f32::from(k)).sine_cosine().0;
            moving.take(&reading);
        }
        still.take(&Reading {
            angular_velocity: Vector3::new(f32::NAN, 0.0, 0.0),
            specific_force: Vector3::zeros(),
        });
        assert_eq!(still.count(), 400);
        let mut joined = still;
        joined.merge(&moving);
        joined.merge(&Rest::default());
        let mut twice = still;
        for k in 0..400_u16 {
            let noise = if k.is_multiple_of(2) { 0.02 } else { -0.02 };
            twice.take(&Reading {
                angular_velocity: Vector3::new(
                    0.01 + noise,
                    -0.02 + (0.1 * f32::from(k)).sine_cosine().0,
                    0.005,
                ),
                specific_force: Vector3::new(0.0, 9.8, noise),
            });
        }
        assert_eq!(joined.count(), twice.count());
        assert!((joined.rate() - twice.rate()).norm() < 1e-5);
        assert!((joined.rate_deviation() - twice.rate_deviation()).abs() < 1e-4);
        assert!((still.rate() - Vector3::new(0.01, -0.02, 0.005)).norm() < 1e-5);
        assert!((still.up().unwrap() - Vector3::y()).norm() < 1e-3);
        assert!(still.is_still() && !moving.is_still());
        let mut turning = Rest::<f32>::default();
        for _ in 0..100 {
            turning.take(&Reading {
                angular_velocity: Vector3::new(0.0, 3.0, 0.0),
                specific_force: Vector3::new(0.0, 9.8, 0.0),
            });
        }
        assert!(!turning.is_still(), "it turns steadily about the vertical");
        assert!(!Rest::<f32>::default().is_still());
    }
}
