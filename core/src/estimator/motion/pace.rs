//! Whether samples arrive at the configured rate.
//!
//! Over a fraction of a second, the measured angular velocity must turn the body as the measured attitudes say. If the
//! rate is not the configured one, both differ by the ratio of the rates, as long as the body turns. A sensor that is
//! late or filtered changes less of the one than it adds to the other, and is not taken for a wrong rate.

use nalgebra::{UnitQuaternion, Vector3};

use super::state::turned_by;
use crate::math::{Real, renormalized, small_rotation};

/// Rotation (rad) or time (s) after which attitudes are compared.
const SPAN: [f32; 2] = [0.3, 0.5];
/// Largest rotation in one interval (rad).
const LARGEST: f32 = 0.5;
/// Time over which comparisons are averaged (s).
const WINDOW: f32 = 10.0;
/// Largest share of the rotation by which a comparison may differ to be one: more is a sensor that jumped.
const PLAUSIBLE: f32 = 0.7;
/// Share by which a gyroscope may be wrong, and number of standard deviations beyond it at which the rate is.
const TOLERANCE: (f32, f32) = (0.08, 5.0);

/// Compares the rotation of attitudes with that of the angular velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pace<T: Real> {
    /// Variance of a difference of two attitudes, each axis (rad2).
    variance: T,
    start: UnitQuaternion<T>,
    spin: Option<Vector3<T>>,
    turned: UnitQuaternion<T>,
    elapsed: T,
    /// Sums of the squares of attitude's rotations, of their products with the angular velocity's, and of the squares
    /// of those (rad2).
    sums: [T; 3],
}

impl<T: Real> Pace<T> {
    /// Starts with nothing compared; `attitude_variance` is that of the sensor, each axis (rad2).
    pub(super) fn new(attitude_variance: T) -> Self {
        Self {
            variance: attitude_variance * T::of(2.0),
            start: UnitQuaternion::identity(),
            spin: None,
            turned: UnitQuaternion::identity(),
            elapsed: T::zero(),
            sums: [T::zero(); 3],
        }
    }

    /// Takes the attitude and the angular velocity (rad/s, body axes) measured at the end of an interval of `duration`
    /// (s).
    #[inline(never)]
    pub(super) fn take(
        &mut self,
        attitude: Option<&UnitQuaternion<T>>,
        spin: Option<Vector3<T>>,
        duration: T,
    ) {
        let measured = attitude.zip(spin.filter(|spin| spin.iter().all(|v| v.is_finite())));
        let Some((attitude, spin)) = measured else {
            self.spin = None;
            return;
        };
        let last = self.spin.replace(spin);
        let turn = last.map(|last| (last + spin) * (duration * T::of(0.5)));
        let largest = T::single(LARGEST);
        let Some(turn) = turn.filter(|turn| turn.norm_squared() <= largest * largest) else {
            self.begin(attitude);
            return;
        };
        self.turned = renormalized(*self.turned * *small_rotation(&turn));
        self.elapsed += duration;
        let by_rates = turned_by(&self.turned);
        let [far, long] = SPAN.map(T::single);
        if by_rates.norm_squared() >= far * far || self.elapsed >= long {
            let by_attitudes = turned_by(&(self.start.inverse() * attitude));
            self.compare(&by_attitudes, &by_rates);
            self.begin(attitude);
        }
    }

    /// Begins anew after a gap.
    pub(super) fn interrupt(&mut self) {
        self.spin = None;
    }

    fn begin(&mut self, attitude: &UnitQuaternion<T>) {
        self.start = *attitude;
        self.turned = UnitQuaternion::identity();
        self.elapsed = T::zero();
    }

    fn compare(&mut self, by_attitudes: &Vector3<T>, by_rates: &Vector3<T>) {
        let square = by_rates.norm_squared();
        let noise = self.variance * T::of(3.0);
        let largest = square * T::single(PLAUSIBLE * PLAUSIBLE) + noise * T::of(8.0);
        // False for NaN.
        if (by_attitudes - by_rates).norm_squared() <= largest {
            let kept = T::one() - self.elapsed / T::single(WINDOW);
            let added = [
                by_attitudes.norm_squared() - noise,
                by_attitudes.dot(by_rates),
                square,
            ];
            for (sum, added) in self.sums.iter_mut().zip(added) {
                *sum = *sum * kept + added;
            }
        }
    }

    /// Returns the time that passes per configured time, if that is certainly not one.
    pub(super) fn wrong(&self) -> Option<T> {
        let [attitudes, products, rates] = self.sums;
        let (one, zero) = (T::one(), T::zero());
        let deviation = (self.variance / rates).root();
        let (tolerance, deviations) = TOLERANCE;
        let allowed = T::single(tolerance) + deviation * T::single(deviations);
        let (ratio, other) = (products / rates, attitudes / products);
        let beyond = |ratio: T, sign: T| (ratio - one) * sign > allowed;
        let wrong = |sign: T| beyond(ratio, sign) && beyond(other, sign);
        (rates > zero && (wrong(one) || wrong(-one))).then_some(ratio)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Takes ten seconds of a body that rocks about two axes; its samples arrive at 240 Hz with this noise (rad) and
    /// the angular velocity `late` samples late.
    fn rocking(configured: f64, noise: f64, late: u32) -> Option<f64> {
        let mut pace = Pace::new(0.01 * 0.01);
        let mut attitude = UnitQuaternion::identity();
        let spin_at = |k: f64| {
            let time = k / 240.0;
            Vector3::new(libm::sin(3.0 * time), 1.2 * libm::cos(2.0 * time), 0.1)
        };
        for k in 0..2400_u32 {
            let now = f64::from(k);
            attitude *= small_rotation(&(spin_at(now - 0.5) / 240.0));
            let error = noise * libm::sin(37.0 * now * now);
            let seen = attitude * small_rotation(&Vector3::new(error, -error, 0.5 * error));
            let spin = spin_at(now - f64::from(late));
            pace.take(Some(&seen), Some(spin), 1.0 / configured);
        }
        pace.wrong()
    }

    #[test]
    fn a_wrong_rate_is_found_with_its_ratio() {
        for configured in [150.0, 200.0, 300.0, 400.0] {
            let ratio = rocking(configured, 0.01, 0).unwrap();
            assert!(
                (ratio - configured / 240.0).abs() < 0.04,
                "{configured}: {ratio}"
            );
        }
        assert_eq!(rocking(240.0, 0.01, 0), None);
    }

    #[test]
    fn what_is_not_a_wrong_rate_is_not_called_one() {
        for late in [12, 60, 120] {
            assert_eq!(rocking(240.0, 0.01, late), None, "{late}");
        }
        // A gyroscope's scale of five percent is no rate.
        assert_eq!(rocking(252.0, 0.01, 0), None);
        // Without rotation nothing can be told.
        let mut still = Pace::<f32>::new(1e-4);
        for _ in 0..2400 {
            still.take(
                Some(&UnitQuaternion::identity()),
                Some(Vector3::zeros()),
                1.0 / 60.0,
            );
        }
        assert_eq!(still.wrong(), None);
    }
}
