//! Which axes the skydiver moves on purpose, and when an angular velocity tells of the damping.
//!
//! Muscle input is mostly nothing, and sometimes a push that comes within a tenth of a second. One spread for
//! both is wrong for both: so inputs are quiet until the innovations of an axis' angular velocity have the
//! same sign for some samples, by more than chance allows.

use nalgebra::Vector3;

use super::measurement::RATE_CHANNELS;
use super::settings::MotionPreset;
use crate::math::{Real, clamp};

/// Time over which innovations are averaged (s).
const WINDOW: f64 = 0.05;
/// Time constant of the angular velocity that damping is looked for in (s).
const SLOW: f64 = 0.3;

/// What is known of each axis: pitch, yaw, roll.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Activity<T: Real> {
    mean: [T; 3],
    level: [T; 3],
    /// Weight of one innovation in the mean.
    share: T,
    decay: T,
    /// Square of the mean at which an axis wakes up.
    threshold: T,
    slow: Vector3<T>,
    slow_share: T,
    damping_threshold: T,
}

impl<T: Real> Activity<T> {
    /// Nothing moves, in intervals of `duration` (s).
    pub fn new(preset: &MotionPreset, duration: T) -> Self {
        let within = |share: T| clamp(share, T::zero(), T::of(0.9));
        let share = within(duration / T::of(WINDOW));
        let threshold = T::single(preset.awake_threshold);
        let damping = T::single(preset.damping_threshold);
        Self {
            mean: [T::zero(); 3],
            level: [T::zero(); 3],
            share,
            decay: T::one() - within(duration / T::single(preset.awake_time)),
            // The variance of the mean of normalised innovations is share / (2 - share).
            threshold: threshold * threshold * share / (T::of(2.0) - share),
            slow: Vector3::zeros(),
            slow_share: within(duration / T::of(SLOW)),
            damping_threshold: damping * damping,
        }
    }

    /// Starts at an angular velocity (rad/s, body axes).
    pub fn start(&mut self, spin: &Vector3<T>) {
        self.slow = *spin;
    }

    /// How much each axis is moved, 0 to 1.
    pub fn level(&self) -> [T; 3] {
        self.level
    }

    /// Takes in an innovation over its deviation; only those of the angular velocity count.
    pub fn take(&mut self, channel: usize, normalised: T) {
        if !RATE_CHANNELS.contains(&channel) || !normalised.is_finite() {
            return;
        }
        let axis = channel - RATE_CHANNELS.start;
        let value = clamp(normalised, T::of(-5.0), T::of(5.0));
        self.mean[axis] += (value - self.mean[axis]) * self.share;
        self.level[axis] = if self.mean[axis] * self.mean[axis] > self.threshold {
            T::one()
        } else {
            self.level[axis] * self.decay
        };
    }

    /// By how much to believe what an angular velocity (rad/s, with its variance) says of the damping, 0 to 1.
    ///
    /// Damping is found from how the angular velocity falls. Where that is mostly noise, the noise stands on both
    /// sides of the comparison and pulls the damping away, slowly and for ever. So a quiet axis is looked at by
    /// an angular velocity of some time before, which does not know of the noise of now, and only where it is
    /// well above its own deviation.
    pub fn damping_trust(&mut self, spin: &Vector3<T>, variance: &Vector3<T>) -> [T; 3] {
        let mut trust = [T::zero(); 3];
        for (axis, trust) in trust.iter_mut().enumerate() {
            let (now, slow) = (spin[axis], self.slow[axis]);
            let instrument = slow + (now - slow) * self.level[axis];
            let share = now * instrument / (now * now + variance[axis] * self.damping_threshold);
            *trust = clamp(share, T::zero(), T::one());
            self.slow[axis] += (now - slow) * self.slow_share;
        }
        trust
    }
}
