//! Order statistics, significance, and the noise of a series.

use core::ops::{Add, Mul, Sub};

/// The quantile at `share`, without interpolation: the index is rounded down. Zero if there are no values.
pub fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    quantile_of_sorted(&values, share)
}

/// Same as [`quantile`], for values in ascending order.
pub fn quantile_of_sorted(values: &[f64], share: f64) -> f64 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of a length"
    )]
    let index = (values.len() as f64 * share) as usize;
    values
        .get(index.min(values.len().saturating_sub(1)))
        .copied()
        .unwrap_or(0.0)
}

/// The quantile of ascending values, interpolated linearly. Returns `None` if there are no values.
pub fn interpolated_quantile(values: &[f64], share: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    let place = share * last as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "an index within the list"
    )]
    let below = (place as usize).min(last);
    let (from, to) = (values[below], values[(below + 1).min(last)]);
    Some(from + (to - from) * (place - below as f64))
}

/// The normal deviate equivalent to a chi-squared value with `freedom` degrees (Wilson and Hilferty).
///
/// For one to three degrees it is within 5 % up to 4 standard deviations. Beyond, it grows with the cube root of the value
/// instead of the square root, and so understates: 4.5 stands for 4.7 to 4.8, 7 for 7.6 to 8.2 and 9 for 10.2 to 11.2. The
/// thresholds of the searches are on this scale, which keeps the order at values whose tail probability is too small for
/// a floating-point number.
pub fn z_score(chi_squared: f64, freedom: f64) -> f64 {
    let share = 2.0 / (9.0 * freedom);
    ((chi_squared / freedom).cbrt() - (1.0 - share)) / share.sqrt()
}

/// Median magnitude of a normal variable (standard deviations).
const MEDIAN_MAGNITUDE: f64 = 0.6745;

/// Variance of a third difference of white noise, relative to that of the noise: the sum of the squared weights 1, 3, 3, 1.
pub const THIRD_DIFFERENCE_VARIANCE: f64 = 20.0;

/// Standard deviation of a normal variable with this median magnitude, which a few outliers hardly change.
pub fn deviation_of(median_magnitude: f64) -> f64 {
    median_magnitude / MEDIAN_MAGNITUDE
}

/// Third difference of four successive values, numbers or vectors: a motion that is smooth over them cancels, and noise
/// remains.
pub fn third_difference<V>([a, b, c, d]: [V; 4]) -> V
where
    V: Add<Output = V> + Sub<Output = V> + Mul<f64, Output = V>,
{
    d - c * 3.0 + b * 3.0 - a
}

/// The same of three successive values that are first differences already.
pub fn second_difference<V>([a, b, c]: [V; 3]) -> V
where
    V: Add<Output = V> + Sub<Output = V> + Mul<f64, Output = V>,
{
    c - b * 2.0 + a
}

/// Standard deviation of the white noise in a series whose third differences have this median magnitude.
pub fn noise_from_third_differences(median_magnitude: f64) -> f64 {
    deviation_of(median_magnitude) / THIRD_DIFFERENCE_VARIANCE.sqrt()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    use super::*;

    #[test]
    fn quantiles_are_elements() {
        let values = vec![3.0, 1.0, 2.0, 5.0, 4.0];
        for (share, expected) in [(0.0, 1.0), (0.39, 2.0), (0.5, 3.0), (0.84, 5.0), (1.0, 5.0)] {
            assert!((quantile(values.clone(), share) - expected).abs() < 1e-12);
        }
        assert!(quantile(Vec::new(), 0.5).abs() < 1e-12);
    }

    #[test]
    fn interpolated_quantiles_lie_between_elements() {
        let values = [1.0, 2.0, 4.0];
        assert_eq!(interpolated_quantile(&[], 0.5), None);
        assert_eq!(interpolated_quantile(&values, 0.5), Some(2.0));
        assert_eq!(interpolated_quantile(&values, 0.75), Some(3.0));
        assert_eq!(interpolated_quantile(&values, 1.0), Some(4.0));
    }

    #[test]
    fn a_chi_squared_number_is_at_its_mean_without_deviations() {
        // The median of chi-squared with one degree of freedom is 0.455.
        assert!(z_score(0.455, 1.0).abs() < 0.03);
        // The one-sided normal quantile with the same probability is 2.78.
        assert!((z_score(9.0, 1.0) - 2.78).abs() < 0.05);
        // As documented, far out.
        assert!((z_score(67.8, 1.0) - 7.0).abs() < 0.01);
        assert!((z_score(68.1, 3.0) - 7.0).abs() < 0.01);
    }

    #[test]
    fn the_noise_of_a_parabola_is_read_from_its_third_differences() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let values: Vec<Vector3<f64>> = (0..20_000)
            .map(|k| {
                let time = 0.01 * f64::from(k);
                let smooth = Vector3::new(3.0, time, 2.0 * time * time);
                smooth + Vector3::from_fn(|_, _| 0.2 * random.sample::<f64, _>(StandardNormal))
            })
            .collect();
        let each = values.windows(4).flat_map(|four| {
            let third = third_difference([four[0], four[1], four[2], four[3]]);
            [third.x.abs(), third.y.abs(), third.z.abs()]
        });
        let noise = noise_from_third_differences(quantile(each.collect(), 0.5));
        assert!((noise - 0.2).abs() < 0.004, "{noise}");
    }
}
