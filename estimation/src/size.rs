//! The size of the joint errors, which is not known beforehand and follows from the flight.
//!
//! Between sizes that a flight allows there is no need to choose: what follows from each is weighted by its probability,
//! so that error bars contain the doubt about the size too.

/// Sizes to weigh (rad), as standard deviations of each joint axis, with the logarithm of the prior probability of each.
#[derive(Debug, Clone, PartialEq)]
pub struct Sizes(Vec<[f64; 2]>);

/// A size with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// Expected standard deviation of each joint axis (rad).
    pub mean: f64,
    /// Standard deviation of that (rad).
    pub deviation: f64,
}

/// Smallest and largest size (deg), and the ratio of neighbours.
const RANGE: [f64; 2] = [0.02, 16.0];
const RATIO: f64 = 1.25;
/// Before a flight, each size below this one (deg) is about as probable as another; larger ones are less so, as the larger
/// half of a normal distribution.
const USUAL: f64 = 4.0;

impl Sizes {
    /// All sizes, of which nothing is known.
    pub fn any() -> Self {
        let [least, most] = RANGE;
        let number = ((most / least).ln() / RATIO.ln()).round();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few dozen"
        )]
        let sizes = (0..=number as u32).map(|k| least * RATIO.powi(k.cast_signed()));
        Self(
            sizes
                .map(|degrees| {
                    let beyond = degrees / USUAL;
                    // Sizes are equally spaced by ratio, so each stands for a share of itself.
                    [degrees.to_radians(), degrees.ln() - 0.5 * beyond * beyond]
                })
                .collect(),
        )
    }

    /// A size that is given (rad): the flight decides between half and one and a half of it.
    pub fn about(given: f64) -> Self {
        let shares = (2..=6).map(|quarters| 0.25 * f64::from(quarters));
        Self(shares.map(|share| [share * given, 0.0]).collect())
    }

    /// The sizes (rad).
    pub fn each(&self) -> impl Iterator<Item = f64> {
        self.0.iter().map(|[size, _]| *size)
    }

    /// The sizes (rad) and the probability of each, by the logarithms of their likelihoods in the same order.
    pub fn weighed(&self, log_likelihoods: impl Iterator<Item = f64>) -> Vec<(f64, f64)> {
        let priors = self.0.iter().map(|[_, prior]| prior);
        let logarithms: Vec<f64> = priors.zip(log_likelihoods).map(|(a, b)| a + b).collect();
        let most = logarithms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = logarithms.iter().map(|l| (l - most).exp()).collect();
        let sum: f64 = weights.iter().sum();
        self.each()
            .zip(weights.into_iter().map(|weight| weight / sum))
            .collect()
    }
}

impl Size {
    /// Mean and deviation of weighed sizes.
    pub fn of(weighed: &[(f64, f64)]) -> Self {
        let mean: f64 = weighed.iter().map(|(size, weight)| weight * size).sum();
        let square = weighed.iter().map(|(size, w)| w * (size - mean).powi(2));
        Self {
            mean,
            deviation: square.sum::<f64>().sqrt(),
        }
    }

    /// What is known before a flight.
    pub fn unknown() -> Self {
        Self::of(&Sizes::any().weighed(std::iter::repeat(0.0)))
    }

    /// Whether the flight says more of it than was known before.
    pub fn is_seen(&self) -> bool {
        self.deviation < 0.5 * Self::unknown().deviation
    }

    /// Root of the expected square (rad): errors of an unknown size are as large as this on average.
    pub fn root_mean_square(&self) -> f64 {
        self.mean.hypot(self.deviation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A likelihood with its top at `top` degrees, as sharp as `number` independent errors of that size make it.
    fn found(top: f64, number: f64) -> Size {
        let sizes = Sizes::any();
        let likelihoods = sizes.each().map(|size| {
            let ratio = top / size.to_degrees();
            number * (ratio.ln() - 0.5 * ratio * ratio)
        });
        Size::of(&sizes.weighed(likelihoods))
    }

    #[test]
    fn a_size_is_as_uncertain_as_the_flight_leaves_it() {
        for top in [0.25, 1.0, 4.0] {
            let [few, many] = [5.0, 50.0].map(|number| found(top, number));
            for (size, share) in [(few, 0.45), (many, 0.1)] {
                let gap = size.mean.to_degrees() / top - 1.0;
                assert!(gap.abs() < share, "{size:?}");
            }
            assert!(many.is_seen(), "{many:?}");
            // The deviation of a deviation that is estimated from n values is 1 / sqrt(2 n) of it.
            let share = many.deviation / many.mean;
            assert!((share * 10.0 - 1.0).abs() < 0.2, "{share}");
            assert!(few.deviation > 2.5 * many.deviation, "{few:?} {many:?}");
        }
    }

    #[test]
    fn without_a_flight_nothing_is_seen_and_exact_joints_are_possible() {
        let unknown = Size::unknown();
        assert!(!unknown.is_seen());
        // The mean of half a normal distribution.
        assert!(
            (unknown.mean.to_degrees() / (0.8 * USUAL) - 1.0).abs() < 0.02,
            "{unknown:?}"
        );
        let sizes = Sizes::any();
        let exact = sizes.each().map(|size| -40.0 * size.to_degrees());
        let exact = Size::of(&sizes.weighed(exact));
        assert!(
            exact.mean.to_degrees() < 0.05 && exact.is_seen(),
            "{exact:?}"
        );
    }
}
