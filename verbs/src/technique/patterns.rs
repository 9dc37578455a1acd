//! Movement patterns: principal components of the joint angles, with what errors of the suit do to them.

use nalgebra::{DMatrix, DVector};

/// Frequency below which joint errors wander (Hz); they are independent twice as often.
const WANDER_HZ: f64 = 0.5;
/// Most patterns considered.
const MOST: usize = 8;
/// Share of the length of a pattern that the errors may turn towards others for it to be named.
const MIXED: f64 = 0.5;

/// Whether a pattern can be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum State {
    /// It stands out.
    Named,
    /// Another pattern has nearly the same share, so joint errors decide how the two are divided.
    Mixed,
    /// Joint errors make as much.
    BelowErrors,
}

/// A principal component.
#[derive(Debug, Clone)]
pub struct Component {
    /// Change of each angle per unit of the pattern; of length 1, the largest is positive.
    pub weights: DVector<f64>,
    /// Standard deviation of the weights due to joint errors.
    pub deviations: DVector<f64>,
    /// The weights above what errors make, of length 1: the movement whose response is computed.
    ///
    /// Over a few seconds any sway of another joint happens to go along with the pattern. Its weight is small, but limbs that
    /// are heavier or faster than those of the pattern would rule the response to quick movements.
    pub told: DVector<f64>,
    /// Share of the variance.
    pub share: f64,
    /// Root mean square of its amplitude (rad).
    pub rms: f64,
    /// Amplitude in each frame (rad).
    pub amplitude: Vec<f64>,
    /// Whether it can be told.
    pub state: State,
}

/// Root mean square of the largest pattern that joint errors alone of `error` (rad per axis) make in `duration` (s).
///
/// It is the edge of the spectrum of random covariances (Marchenko and Pastur): with as few independent values as a wandering
/// error has in a maneuver, chance makes patterns.
pub fn floor(error: f64, axes: usize, duration: f64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "45 axes")]
    let axes = axes as f64;
    error * (1.0 + (axes / independent(duration)).sqrt())
}

/// A component with the sign that makes its largest weight positive.
fn signed(weights: DVector<f64>) -> DVector<f64> {
    let larger = |most: f64, w: &f64| if w.abs() > most.abs() { *w } else { most };
    let largest = weights.iter().fold(0.0, larger);
    if largest < 0.0 { -weights } else { weights }
}

/// The weights larger than the largest that chance makes of as many, scaled to length 1; all of them if none is.
fn told(weights: &DVector<f64>, blur: &DVector<f64>) -> DVector<f64> {
    #[expect(clippy::cast_precision_loss, reason = "45 axes")]
    let chance = (2.0 * (weights.len() as f64).ln()).sqrt();
    let above = weights.zip_map(blur, |weight, blur| {
        if weight.abs() > chance * blur {
            weight
        } else {
            0.0
        }
    });
    above.try_normalize(0.0).unwrap_or_else(|| weights.clone())
}

/// Number of independent values of a wandering error.
fn independent(duration: f64) -> f64 {
    1.0 + 2.0 * WANDER_HZ * duration
}

/// The components of `rows`, one row of angles (rad) for each frame, largest first; at most eight.
pub fn components(rows: &[DVector<f64>], duration: f64, error: f64) -> Vec<Component> {
    let Some(axes) = rows.first().map(DVector::len) else {
        return Vec::new();
    };
    #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
    let count = rows.len() as f64;
    let mean = rows.iter().fold(DVector::zeros(axes), |sum, row| sum + row) / count;
    let mut covariance = DMatrix::<f64>::zeros(axes, axes);
    for row in rows {
        let apart = row - &mean;
        covariance.ger(1.0 / count, &apart, &apart, 1.0);
    }
    let eigen = covariance.symmetric_eigen();
    let mut order: Vec<usize> = (0..axes).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let sizes: Vec<f64> = order
        .iter()
        .map(|k| eigen.eigenvalues[*k].max(0.0))
        .collect();
    let total: f64 = sizes.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let least = floor(error, axes, duration);
    let component = |(place, column): (usize, &usize)| {
        let weights = signed(eigen.eigenvectors.column(*column).into_owned());
        let size = sizes[place];
        // First order: errors turn a component towards each of the others.
        let turns = sizes.iter().enumerate().map(|(other, of_other)| {
            if other == place {
                return 0.0;
            }
            let apart = (size - of_other).powi(2).max(f64::MIN_POSITIVE);
            error * error * (size + of_other + error * error) / (independent(duration) * apart)
        });
        let turns: Vec<f64> = turns.map(|turn| turn.min(1.0)).collect();
        // Turns towards patterns that errors make only blur; those towards a real one exchange the two.
        let real = |other: &usize| sizes[*other].sqrt() > least;
        let deviations_by = |counts: &dyn Fn(&usize) -> bool| {
            DVector::from_fn(axes, |axis, _| {
                let parts = (0..axes).filter(counts);
                parts
                    .map(|other| turns[other] * eigen.eigenvectors[(axis, order[other])].powi(2))
                    .sum::<f64>()
                    .sqrt()
            })
        };
        let deviations = deviations_by(&|_| true);
        let exchanged = (0..axes)
            .filter(real)
            .map(|other| turns[other])
            .fold(0.0, f64::max);
        let is_mixed = exchanged.sqrt() > MIXED;
        let told = if is_mixed {
            told(&weights, &deviations_by(&|other| !real(other)))
        } else {
            told(&weights, &deviations)
        };
        let rms = size.sqrt();
        let state = if rms <= least {
            State::BelowErrors
        } else if is_mixed {
            State::Mixed
        } else {
            State::Named
        };
        Component {
            amplitude: rows.iter().map(|row| (row - &mean).dot(&weights)).collect(),
            weights,
            deviations,
            told,
            share: size / total,
            rms,
            state,
        }
    };
    order.iter().enumerate().take(MOST).map(component).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    /// Rows of two patterns of 0.3 and `second` rad RMS, at 60 Hz.
    fn rows(second: f64, seconds: u32) -> Vec<DVector<f64>> {
        let at = |k: u32| {
            let time = f64::from(k) / 60.0;
            let mut row = DVector::zeros(45);
            let one = 0.3 * 2.0_f64.sqrt() * (2.0 * time).sin();
            let two = second * 2.0_f64.sqrt() * (2.0 * time).cos();
            (row[3], row[4]) = (0.8 * one, -0.6 * one);
            row[10] = two;
            row
        };
        (0..60 * seconds).map(at).collect()
    }

    #[test]
    fn known_patterns_are_found_and_equal_ones_are_not_told_apart() {
        let error = 2.0_f64.to_radians();
        let found = components(&rows(0.12, 60), 60.0, error);
        assert!(
            (found[0].weights[3] - 0.8).abs() < 0.02 && (found[0].weights[4] + 0.6).abs() < 0.02
        );
        assert!((found[0].share - 0.09 / (0.09 + 0.0144)).abs() < 0.02);
        assert_eq!(found[0].state, State::Named);
        assert_eq!(found[1].state, State::Named);
        assert_eq!(found[2].state, State::BelowErrors);
        // What chance adds to a pattern is left out of the movement whose response is computed.
        let told = found[0].told.iter().filter(|weight| weight.abs() > 0.0);
        assert_eq!(told.count(), 2);
        assert!((found[0].told.norm() - 1.0).abs() < 1e-12);
        let found = components(&rows(0.3, 60), 60.0, error);
        assert_eq!(found[0].state, State::Mixed);
    }

    #[test]
    fn errors_alone_are_not_named() {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let error = 2.0_f64.to_radians();
        for seconds in [10, 30, 100] {
            // One independent value a second, held.
            let mut rows = Vec::new();
            for _ in 0..seconds {
                let row = DVector::from_fn(45, |_, _| {
                    let normal: f64 = random.sample(rand_distr::StandardNormal);
                    normal * error
                });
                rows.extend(std::iter::repeat_n(row, 20));
            }
            let found = components(&rows, f64::from(seconds), error);
            assert!(
                found[0].rms < 1.1 * floor(error, 45, f64::from(seconds)),
                "{seconds}"
            );
            assert!(found[0].rms > 0.6 * floor(error, 45, f64::from(seconds)));
        }
    }
}
