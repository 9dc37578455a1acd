//! Judges from about a second of innovations of each channel whether the filter's error bars are right.
//!
//! If model and noise match reality, normalised innovations have a mean square of one and are independent of each
//! other. A mean square above one means that an error bar is too small; correlation means that the filter lacks
//! something that acts on the body. Both are tracked by exponential means. A sensor that keeps repeating its value
//! ([`repeats`](super::repeats)) measures nothing.

use super::measurement::CHANNELS;
use super::repeats::BELIEVED;
use crate::math::Real;

/// Time constant of the means (s).
pub const WINDOW: f64 = 1.0;

/// Agreement of the filter's error bars with the measurements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Consistency {
    /// As far as measurements show, estimates lie within their error bars.
    #[default]
    Consistent,
    /// Error bars are too small, or the filter lacks something that acts on the body: use with care.
    Doubtful,
    /// Predictions do not follow the measurements: do not use.
    Lost,
}

impl Consistency {
    /// Name used in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Consistent => "consistent",
            Self::Doubtful => "doubtful",
            Self::Lost => "lost",
        }
    }

    /// Returns the consistency for a mean normalised innovation squared per channel, of any filter.
    pub fn of_mean_square<T: Real>(mean_square: T) -> Self {
        above(mean_square, MEAN_SQUARE)
    }
}

/// Mean normalised innovation squared above which a channel is doubtful, and above which it is lost.
pub const MEAN_SQUARE: [f32; 2] = [2.0, 6.0];
/// Correlation of consecutive innovations above which a channel is doubtful, and above which it is lost.
const CORRELATION: [f32; 2] = [0.4, 0.8];
/// Share of rejected innovations above which a channel is doubtful, and above which it is lost.
const REJECTED: [f32; 2] = [0.05, 0.3];
/// Time (s) after which a channel whose sensor repeats its value is doubtful, and after which it is lost.
const REPEATED: [f32; 2] = [BELIEVED, 1.0];

/// Statistics of one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelWatch<T> {
    /// Mean normalised innovation squared; one if the error bars are right.
    pub mean_square: T,
    /// Correlation of consecutive innovations; zero if the filter is complete.
    pub correlation: T,
    /// Share of innovations beyond the gate.
    pub rejected: T,
    product: T,
    last: T,
    /// Time for which the sensor has repeated its value (s).
    pub repeated: T,
    /// Number of consecutive innovations beyond the gate.
    pub streak: u16,
    /// Whether anything has been measured yet.
    pub seen: bool,
}

impl<T: Real> ChannelWatch<T> {
    fn new() -> Self {
        Self {
            mean_square: T::one(),
            correlation: T::zero(),
            rejected: T::zero(),
            repeated: T::zero(),
            product: T::zero(),
            last: T::zero(),
            streak: 0,
            seen: false,
        }
    }

    /// Processes an innovation divided by its standard deviation; `share` is its weight in the means.
    fn take(&mut self, normalised: T, rejected: bool, share: T) {
        self.seen = true;
        let one = T::one();
        // An outlier counts no more than a value ten standard deviations off.
        let limit = T::of(10.0);
        let value = crate::math::clamp(normalised, -limit, limit);
        self.mean_square += (value * value - self.mean_square) * share;
        self.product += (value * self.last - self.product) * share;
        let floor = if self.mean_square > one {
            self.mean_square
        } else {
            one
        };
        self.correlation = self.product / floor;
        self.last = value;
        self.rejected += (if rejected { one } else { T::zero() } - self.rejected) * share;
        self.streak = if rejected {
            self.streak.saturating_add(1)
        } else {
            0
        };
    }

    /// Returns the consistency of the channel.
    pub fn consistency(&self) -> Consistency {
        Consistency::of_mean_square(self.mean_square)
            .max(above(self.correlation, CORRELATION))
            .max(above(self.rejected, REJECTED))
            .max(above(self.repeated, REPEATED))
    }
}

/// Statistics of all channels and of the residual load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Watch<T> {
    /// Statistics by channel.
    pub channels: [ChannelWatch<T>; CHANNELS],
    /// Mean square of the residual load relative to its expected covariance, by component; one is expected.
    pub residual: T,
}

/// Mean square of the residual load by component above which the model is doubtful, and above which it is lost.
const RESIDUAL: [f32; 2] = [4.0, 16.0];

/// Compares a number with its two limits; NaN is above both.
fn above<T: Real>(value: T, [doubtful, lost]: [f32; 2]) -> Consistency {
    if value <= T::single(doubtful) {
        Consistency::Consistent
    } else if value <= T::single(lost) {
        Consistency::Doubtful
    } else {
        Consistency::Lost
    }
}

impl<T: Real> Watch<T> {
    /// Creates statistics without any data.
    pub fn new() -> Self {
        Self {
            channels: [ChannelWatch::new(); CHANNELS],
            residual: T::zero(),
        }
    }

    /// Converts the statistics to another precision.
    pub fn cast<U: Real>(&self) -> Watch<U> {
        let scalar = |value: T| U::of(value.to_f64());
        Watch {
            channels: self.channels.map(|channel| ChannelWatch {
                mean_square: scalar(channel.mean_square),
                correlation: scalar(channel.correlation),
                rejected: scalar(channel.rejected),
                repeated: scalar(channel.repeated),
                product: scalar(channel.product),
                last: scalar(channel.last),
                streak: channel.streak,
                seen: channel.seen,
            }),
            residual: scalar(self.residual),
        }
    }

    /// Processes an innovation divided by its standard deviation, `duration` (s) after the last one.
    pub fn take(&mut self, channel: usize, normalised: T, rejected: bool, duration: T) {
        let share = duration / T::of(WINDOW);
        self.channels[channel].take(normalised, rejected, share);
    }

    /// Processes the mean square of the residual load by component.
    pub fn take_residual(&mut self, mean_square: T, duration: T) {
        if mean_square.is_finite() {
            self.residual += (mean_square - self.residual) * (duration / T::of(WINDOW));
        }
    }

    /// Returns the consistency of the residual load.
    pub fn residual_consistency(&self) -> Consistency {
        above(self.residual, RESIDUAL)
    }

    /// Returns the worst consistency of all channels and of the residual load.
    pub fn consistency(&self) -> Consistency {
        self.channels
            .iter()
            .filter(|channel| channel.seen)
            .map(ChannelWatch::consistency)
            .fold(self.residual_consistency(), Ord::max)
    }
}

impl<T: Real> Default for Watch<T> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;

    /// Numbers with mean zero and variance one, the same in each run.
    fn noise() -> impl Iterator<Item = f64> {
        let mut state = 1u64;
        std::iter::repeat_with(move || {
            let mut sum = 0.0;
            for _ in 0..12 {
                state = state
                    .wrapping_mul(6364136223846793005)
                    .wrapping_add(1442695040888963407);
                sum += f64::from((state >> 33) as u32) / f64::from(1u32 << 31);
            }
            sum - 6.0
        })
    }

    fn watched(change: impl Fn(f64) -> f64) -> Consistency {
        let mut watch = Watch::<f64>::new();
        for value in noise().take(1000) {
            let value = change(value);
            watch.take(3, value, value.abs() > 5.0, 1.0 / 240.0);
        }
        watch.consistency()
    }

    #[test]
    fn realistic_innovations_are_consistent_and_others_are_flagged() {
        assert_eq!(watched(|value| value), Consistency::Consistent);
        assert_eq!(watched(|value| 0.1 * value), Consistency::Consistent);
        assert_eq!(watched(|value| 1.7 * value), Consistency::Doubtful);
        assert_eq!(watched(|value| 4.0 * value), Consistency::Lost);
        // A steady disturbance hardly raises the mean square, but makes consecutive innovations correlate.
        assert_eq!(watched(|value| value + 0.95), Consistency::Doubtful);
    }

    #[test]
    fn a_residual_load_beyond_joint_errors_is_flagged() {
        let mut watch = Watch::<f64>::new();
        for (load, expected) in [
            (1.0, Consistency::Consistent),
            (9.0, Consistency::Doubtful),
            (40.0, Consistency::Lost),
        ] {
            for _ in 0..2000 {
                watch.take_residual(load, 1.0 / 240.0);
            }
            assert_eq!(watch.consistency(), expected, "{load}");
        }
    }
}
