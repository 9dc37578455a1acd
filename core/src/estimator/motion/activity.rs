//! Detects which axes the skydiver moves deliberately, and when an angular velocity is informative about damping.
//!
//! Muscle input is mostly zero, with occasional pushes within a tenth of a second, which no single spread fits. Inputs
//! are therefore quiet until the innovations of an axis's angular velocity have the same sign for several samples, or a
//! mean over a second that differs from zero by more than chance allows.

use nalgebra::Vector3;

use super::measurement::RATE_CHANNELS;
use super::settings::MotionPreset;
use crate::math::{Real, clamp, flushed};

/// Time over which innovations are averaged (s); a longer one detects smaller inputs, but later.
const WINDOW: f64 = 0.05;
/// Averaging time for inputs that start slowly (s).
const LONG_WINDOW: f64 = 1.0;
/// Number of standard deviations of the mean over [`LONG_WINDOW`] at which an axis wakes up.
const LONG_THRESHOLD: f64 = 4.5;
/// Time constant of the smoothed angular velocity used by [`Activity::damping_trust`] (s).
const SLOW: f64 = 0.3;

/// Activity of each axis: pitch, yaw, roll.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Activity<T: Real> {
    mean: [T; 3],
    long: [T; 3],
    level: [T; 3],
    /// Weight of one innovation in the means.
    share: T,
    long_share: T,
    decay: T,
    /// Squared means at which an axis wakes up.
    threshold: T,
    long_threshold: T,
    slow: Vector3<T>,
    slow_share: T,
    damping_threshold: T,
}

impl<T: Real> Activity<T> {
    /// Creates the state with no axis active, for intervals of `duration` (s).
    pub fn new(preset: &MotionPreset, duration: T) -> Self {
        let within = |share: T| clamp(share, T::zero(), T::of(0.9));
        let share = within(duration / T::of(WINDOW));
        let long_share = within(duration / T::of(LONG_WINDOW));
        // The variance of the mean of normalised innovations is share / (2 - share).
        let square =
            |deviations: T, share: T| deviations * deviations * share / (T::of(2.0) - share);
        let damping = T::single(preset.damping_threshold);
        Self {
            mean: [T::zero(); 3],
            long: [T::zero(); 3],
            level: [T::zero(); 3],
            share,
            long_share,
            decay: T::one() - within(duration / T::single(preset.awake_time)),
            threshold: square(T::single(preset.awake_threshold), share),
            long_threshold: square(T::of(LONG_THRESHOLD), long_share),
            slow: Vector3::zeros(),
            slow_share: within(duration / T::of(SLOW)),
            damping_threshold: damping * damping,
        }
    }

    /// Initialises the smoothed angular velocity (rad/s, body axes).
    pub fn start(&mut self, spin: &Vector3<T>) {
        self.slow = *spin;
    }

    /// Takes every axis as quiet: a motion that was wrong, and not the skydiver, caused the innovations so far.
    pub fn calm(&mut self) {
        let quiet = [T::zero(); 3];
        (self.mean, self.long, self.level) = (quiet, quiet, quiet);
    }

    /// Degree to which each axis is moved deliberately, 0 to 1.
    pub fn level(&self) -> [T; 3] {
        self.level
    }

    /// Processes an innovation divided by its standard deviation; only channels of the angular velocity have an
    /// effect.
    pub fn take(&mut self, channel: usize, normalised: T) {
        if !RATE_CHANNELS.contains(&channel) || !normalised.is_finite() {
            return;
        }
        let axis = channel - RATE_CHANNELS.start;
        let value = clamp(normalised, T::of(-5.0), T::of(5.0));
        let [mean, long] = [self.mean[axis], self.long[axis]];
        self.mean[axis] = flushed(mean + (value - mean) * self.share);
        self.long[axis] = flushed(long + (value - long) * self.long_share);
        let [mean, long] = [self.mean[axis], self.long[axis]];
        let awake = mean * mean > self.threshold || long * long > self.long_threshold;
        self.level[axis] = if awake {
            T::one()
        } else {
            flushed(self.level[axis] * self.decay)
        };
    }

    /// Degree to which an angular velocity (rad/s, with its variance) is trusted to inform the damping, 0 to 1.
    ///
    /// Damping is inferred from the decay of the angular velocity. If that is mostly noise, the noise enters both
    /// sides of the comparison and slowly biases the damping. A quiet axis is therefore judged by a smoothed earlier
    /// angular velocity, which is independent of the present noise, and only if the present one is well above its
    /// standard deviation.
    pub fn damping_trust(&mut self, spin: &Vector3<T>, variance: &Vector3<T>) -> [T; 3] {
        let mut trust = [T::zero(); 3];
        for (axis, trust) in trust.iter_mut().enumerate() {
            let (now, slow) = (spin[axis], self.slow[axis]);
            let instrument = slow + (now - slow) * self.level[axis];
            let share = now * instrument / (now * now + variance[axis] * self.damping_threshold);
            *trust = clamp(share, T::zero(), T::one());
            self.slow[axis] = flushed(slow + (now - slow) * self.slow_share);
        }
        trust
    }
}
