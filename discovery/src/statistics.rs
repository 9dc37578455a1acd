//! Order statistics, significance and correlation.

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
pub fn deviations(chi_squared: f64, freedom: f64) -> f64 {
    let share = 2.0 / (9.0 * freedom);
    ((chi_squared / freedom).cbrt() - (1.0 - share)) / share.sqrt()
}

/// Correlation of two series; zero if one of them is constant.
pub fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let count = a.len().min(b.len()).max(1) as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        let (x, y) = (x - mean_a, y - mean_b);
        ab += x * y;
        aa += x * x;
        bb += y * y;
    }
    if aa > 0.0 && bb > 0.0 {
        ab / (aa * bb).sqrt()
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
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
        assert!(deviations(0.455, 1.0).abs() < 0.03);
        // The one-sided normal quantile with the same probability is 2.78.
        assert!((deviations(9.0, 1.0) - 2.78).abs() < 0.05);
    }

    #[test]
    fn series_that_are_proportional_correlate_fully() {
        let (rising, falling) = ([1.0, 2.0, 4.0], [-1.0, -2.0, -4.0]);
        assert!((correlation(&rising, &falling) + 1.0).abs() < 1e-12);
        assert!(correlation(&rising, &[1.0; 3]).abs() < 1e-12);
    }
}
