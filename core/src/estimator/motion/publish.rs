//! What an estimate says of itself: deviations, situation and consistency.

use super::estimate::{ChannelEstimate, MotionEstimate};
use super::filter::{MotionFilter, STILL};
use super::measurement::CHANNELS;
use super::state::{Difference, MUSCLE, RESIDUAL_MOMENT, SPIN};
use super::support::Situation;
use super::watch::{Consistency, Watch};
use crate::estimator::propagation::Propagation;
use crate::math::Real;

impl<T: Real, P: Propagation<T>> MotionFilter<T, P> {
    /// Returns the standard deviations of the present state's errors, in the order of [`state`](super::state), as an
    /// estimate states them.
    pub fn deviation(&self) -> Difference<T> {
        let mut variances = self.factors.variances();
        self.constants.add_variances(&mut variances);
        let spin = self.motion().angular_velocity.components;
        let by_scale = self.scale.variance(&spin);
        for (k, variance) in by_scale.iter().enumerate() {
            variances[SPIN + k] += *variance;
        }
        self.lasting.add_to(&mut variances);
        let unknown_posture = self.still >= T::single(STILL);
        let mut stated = self.process.stated(&variances, unknown_posture);
        // Errors of a calibration stay for the whole flight, unlike those of joints.
        if self.posture_error.is_of_segments() {
            for axis in 0..3 {
                let [by_moment, by_muscle] =
                    [RESIDUAL_MOMENT, MUSCLE].map(|input| self.slope[(SPIN + axis, input + axis)]);
                let deviation = stated[MUSCLE + axis];
                let hidden = self.process.hidden(axis, by_moment / by_muscle);
                stated[MUSCLE + axis] = (deviation * deviation + hidden).root();
            }
        }
        stated
    }

    /// Returns the estimate of the present state, and begins the counts of the next one.
    #[inline(never)]
    pub(super) fn publish(&mut self) -> MotionEstimate<T> {
        let nothing = [ChannelEstimate::nothing(); CHANNELS];
        let channels = core::mem::replace(&mut self.channels, nothing);
        let [sum, number] = core::mem::replace(&mut self.squares, [T::zero(); 2]);
        let situation = self.support.situation();
        let motion = self.motion();
        self.faults.rate |= self.watch.pace.is_some();
        let deviation = self.deviation();
        let least = match situation {
            Situation::Flying => Consistency::Consistent,
            Situation::Supported => Consistency::Doubtful,
        };
        let consistency = self
            .watch
            .consistency()
            .max(Watch::of_deviations(deviation.as_slice()))
            .max(least);
        MotionEstimate {
            sample: self.samples,
            inputs: self.state.inputs,
            deviation,
            motion,
            channels,
            normalised_innovation: if number > T::zero() {
                sum / number
            } else {
                T::one()
            },
            watch: self.watch,
            consistency,
            situation,
            faults: core::mem::take(&mut self.faults),
        }
    }
}
