//! Judges from about a second of innovations of each channel whether the filter's error bars are right.
//!
//! If model and noise match reality, normalised innovations have a mean square of one and are independent of each
//! other. A mean square above one means that an error bar is too small; correlation means that the filter lacks
//! something that acts on the body. Both are tracked by exponential means. A sensor that keeps repeating its value
//! ([`repeats`](super::repeats)) measures nothing.

use super::calm::{Calm, SELDOM};
use super::measurement::CHANNELS;
use super::repeats::BELIEVED;
use crate::math::Real;

/// Time constant of the means (s).
pub const WINDOW: f64 = 1.0;

/// Largest weight of one measurement in the means, for sensors that measure seldom: by time, in time constants, and that of
/// a few measurements a second.
const LARGEST_SHARE: [f32; 2] = [0.2, 0.1];

/// Time between two measurements (s) beyond which their innovations are independent, whatever acts on the body.
const INDEPENDENT: f64 = 0.5;

/// Number of measurements in a row within the gate after which the filter follows a channel.
const FOLLOWED: u16 = 4;

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
/// Time (s) without any measurement after which the estimate is doubtful, and after which it is lost.
const BLIND: [f32; 2] = [0.4, 2.0];
/// Time (s) without a measurement of the attitude or of the angular velocity after which the estimate is doubtful.
const WITHOUT_ROTATION: f32 = 1.0;
/// Time (s) without a measurement of the velocity or of the air's force after which the estimate is doubtful: attitude
/// and rates alone cannot tell a fall from lying on the ground.
const WITHOUT_VELOCITY: f32 = 3.0;
/// Standard deviations of attitude (rad), velocity (m/s) and angular velocity (rad/s) above which the estimate is
/// doubtful, and above which it is lost.
const DEVIATIONS: [[f32; 2]; 3] = [[0.3, 1.0], [6.0, 20.0], [1.0, 5.0]];
/// Mean square and share of rejections of a channel that has just been reset: doubtful for half a second.
const RESTARTED: [f32; 2] = [1.5, 0.08];
/// Share of rejections of each channel after a recovery: doubtful for a tenth of a second more.
const RECOVERED: f32 = 0.055;

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
    /// Time since the last rejection, in time constants of the means, up to one, and number of measurements.
    clean: T,
    followed: u16,
    /// Shares of the mean square and of the product since the last rejection, their weight, and whether they will replace
    /// the means.
    clean_sums: [T; 3],
    renewing: bool,
    /// Time since the last measurement (s).
    since: T,
    calm: Calm<T>,
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
            clean: T::zero(),
            followed: 0,
            clean_sums: [T::zero(); 3],
            renewing: false,
            since: T::zero(),
            calm: Calm::new(),
            streak: 0,
            seen: false,
        }
    }

    /// Processes an innovation divided by its standard deviation, at least `duration` (s) after the last one. One beyond
    /// the gate counts as rejected and enters no mean.
    fn take(&mut self, normalised: T, rejected: bool, duration: T) {
        let [share, since] = self.take_rejection(rejected, duration);
        if rejected || !normalised.is_finite() {
            return;
        }
        let one = T::one();
        let square = normalised * normalised;
        let product = if since <= T::of(INDEPENDENT) {
            normalised * self.last
        } else {
            T::zero()
        };
        self.mean_square += (square - self.mean_square) * share;
        self.product += (product - self.product) * share;
        if self.clean < one {
            self.clean_sums[0] += square * share;
            self.clean_sums[1] += product * share;
            self.clean_sums[2] += share;
        } else if self.renewing {
            // For as long as the means last nothing was rejected, so they are those of that time, as far as a sensor
            // that measures seldom tells.
            let [squares, products, weight] = self.clean_sums;
            (self.mean_square, self.product) = (squares + (one - weight), products);
            self.renewing = false;
        }
        if since > T::of(SELDOM)
            && let Some([squares, products]) = self.calm.take([square, product], since)
        {
            (self.mean_square, self.product) = (squares, products);
        }
        let floor = if self.mean_square > one {
            self.mean_square
        } else {
            one
        };
        self.correlation = self.product / floor;
        self.last = normalised;
    }

    /// Begins the means that will replace the present ones.
    fn begin_again(&mut self) {
        self.clean = T::zero();
        self.clean_sums = [T::zero(); 3];
        self.calm = Calm::new();
        self.renewing = true;
    }

    /// Returns the weight of a measurement in the means, and the time since the last one (s).
    fn take_rejection(&mut self, rejected: bool, duration: T) -> [T; 2] {
        let since = core::mem::replace(&mut self.since, T::zero());
        let elapsed = if since > duration { since } else { duration } / T::of(WINDOW);
        let [few, many] = LARGEST_SHARE.map(T::single);
        let largest = if elapsed * few > many {
            elapsed * few
        } else {
            many
        };
        let share = if elapsed < largest { elapsed } else { largest };
        self.seen = true;
        if rejected {
            self.rejected += (T::one() - self.rejected) * share;
            self.streak = self.streak.saturating_add(1);
            self.followed = 0;
            self.begin_again();
            return [share, since];
        }
        self.streak = 0;
        self.followed = self.followed.saturating_add(1);
        self.clean += elapsed;
        if self.clean < T::one() {
            self.rejected -= self.rejected * elapsed;
        } else {
            // Nothing was rejected for as long as the mean lasts.
            self.clean = T::one();
            self.rejected = T::zero();
        }
        [share, since]
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
    /// Time since attitude or angular velocity was measured, and since the velocity or the force of the air was (s).
    pub unseen: [T; 2],
    /// Whether a sensor jumped, as no body can, and has not jumped back.
    pub suspect: bool,
    /// Time that passes per configured time, if samples certainly do not arrive at the configured rate.
    pub pace: Option<T>,
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
            unseen: [T::zero(), T::single(WITHOUT_VELOCITY)],
            suspect: false,
            pace: None,
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
                clean: scalar(channel.clean),
                followed: channel.followed,
                clean_sums: channel.clean_sums.map(scalar),
                renewing: channel.renewing,
                since: scalar(channel.since),
                calm: channel.calm.cast(),
                streak: channel.streak,
                seen: channel.seen,
            }),
            residual: scalar(self.residual),
            unseen: self.unseen.map(scalar),
            suspect: self.suspect,
            pace: self.pace.map(scalar),
        }
    }

    /// Processes an innovation divided by its standard deviation, `duration` (s) after the last one.
    pub fn take(&mut self, channel: usize, normalised: T, rejected: bool, duration: T) {
        self.channels[channel].take(normalised, rejected, duration);
    }

    /// Processes a measurement that is not finite or not plausible.
    pub fn take_unusable(&mut self, channel: usize, duration: T) {
        self.channels[channel].take_rejection(true, duration);
    }

    /// Starts the statistics of a channel again, after the filter has given up what it believed of it.
    pub fn restart(&mut self, channel: usize) {
        let [mean_square, rejected] = RESTARTED.map(T::single);
        self.channels[channel] = ChannelWatch {
            mean_square,
            rejected,
            seen: true,
            ..ChannelWatch::new()
        };
        // The residual load was given up too.
        let doubtful = T::single(RESIDUAL[0]);
        if self.residual > doubtful {
            self.residual = doubtful;
        }
    }

    /// Lets the means of all channels be replaced, in a second, by those since now: what was measured before was compared with
    /// a motion that has been given up.
    pub fn begin_again(&mut self) {
        for channel in &mut self.channels {
            channel.begin_again();
        }
    }

    /// Starts the statistics of all channels again, after the filter has recovered from a loss.
    pub fn renew(&mut self) {
        for channel in 0..CHANNELS {
            if self.channels[channel].seen {
                self.restart(channel);
                self.channels[channel].rejected = T::single(RECOVERED);
            }
        }
    }

    /// Passes an interval of `duration` (s); `fused` says whether attitude or angular velocity was fused, and whether
    /// the velocity or the force of the air was.
    pub fn pass(&mut self, fused: [bool; 2], duration: T) {
        for channel in &mut self.channels {
            // Bounded, so that it stays exact.
            if channel.since < T::of(WINDOW) {
                channel.since += duration;
            }
        }
        for (time, fused) in self.unseen.iter_mut().zip(fused) {
            if fused {
                *time = T::zero();
            } else if *time < T::of(1e4) {
                *time += duration;
            }
        }
    }

    /// Returns the consistency of an estimate with these standard deviations, in the order of
    /// [`state`](super::state): an error bar may be right and too large to be of use.
    pub fn of_deviations(deviations: &[T]) -> Consistency {
        let groups = deviations.chunks(3).zip(DEVIATIONS);
        groups
            .flat_map(|(group, limits)| group.iter().map(move |value| above(*value, limits)))
            .fold(Consistency::Consistent, Ord::max)
    }

    /// Returns the consistency that follows from what is not measured.
    fn blindness(&self, is_suspect: bool) -> Consistency {
        let [rotation, velocity] = self.unseen;
        let anything = if rotation < velocity {
            rotation
        } else {
            velocity
        };
        let without =
            velocity >= T::single(WITHOUT_VELOCITY) || rotation >= T::single(WITHOUT_ROTATION);
        let least = if without || is_suspect || self.pace.is_some() {
            Consistency::Doubtful
        } else {
            Consistency::Consistent
        };
        above(anything, BLIND).max(least)
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

    /// Returns whether a channel was fused within the last second.
    pub fn is_heard(&self, channel: usize) -> bool {
        let channel = &self.channels[channel];
        channel.followed > 0 && channel.since < T::of(WINDOW)
    }

    /// Returns whether the filter followed a channel.
    pub fn follows(&self, channel: usize) -> bool {
        self.channels[channel].followed >= FOLLOWED
    }

    /// Returns whether the filter followed its sensors so far, so that one that jumps is at fault: apart from a sensor that
    /// jumped before, and from a residual load that may have been learned wrongly.
    pub fn is_trusted(&self) -> bool {
        let [_, lost] = RESIDUAL;
        self.residual <= T::single(lost) && self.measured(false) == Consistency::Consistent
    }

    /// Returns the worst consistency of all channels and of the residual load.
    pub fn consistency(&self) -> Consistency {
        self.measured(self.suspect).max(self.residual_consistency())
    }

    /// Returns the worst consistency of all channels, if a sensor may be suspect. Out of line, for the stack of the unit.
    #[inline(never)]
    fn measured(&self, is_suspect: bool) -> Consistency {
        let blindness = self.blindness(is_suspect);
        self.channels
            .iter()
            .filter(|channel| channel.seen)
            .map(ChannelWatch::consistency)
            .fold(blindness, Ord::max)
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
        watch.pass([true; 2], 1.0 / 240.0);
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
        watch.pass([true; 2], 1.0 / 240.0);
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

    #[test]
    fn what_was_compared_with_a_motion_that_was_given_up_counts_for_a_second_at_most() {
        let mut watch = Watch::<f64>::new();
        let take = |watch: &mut Watch<f64>, offset: f64, measurements: usize| {
            for value in noise().take(measurements) {
                watch.take(8, value + offset, false, 1.0 / 60.0);
                watch.pass([true; 2], 1.0 / 60.0);
            }
            watch.consistency()
        };
        assert_ne!(take(&mut watch, 4.0, 24), Consistency::Consistent);
        let mut kept = watch;
        assert_ne!(take(&mut kept, 0.0, 66), Consistency::Consistent);
        watch.begin_again();
        assert_ne!(take(&mut watch, 0.0, 30), Consistency::Consistent);
        assert_eq!(take(&mut watch, 0.0, 36), Consistency::Consistent);
    }

    #[test]
    fn a_residual_load_alone_excuses_no_sensor() {
        let mut watch = Watch::<f64>::new();
        watch.pass([true; 2], 1.0 / 240.0);
        watch.residual = 9.0;
        assert!(watch.is_trusted() && watch.consistency() == Consistency::Doubtful);
        watch.residual = 40.0;
        assert!(!watch.is_trusted());
    }
}
