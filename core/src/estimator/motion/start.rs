//! Starting and restarting a motion filter.

use super::assumed::Assumed;
use super::climb::Climb;
use super::covariance;
use super::filter::MotionFilter;
use super::held::Held;
use super::measurement::CHANNELS;
use super::recovery::Recovery;
use super::rejection::Rejection;
use super::state::{VELOCITY, inputs_of};
use super::support::Support;
use super::trail::Trail;
use super::turned_back::TurnedBack;
use super::watch::{Consistency, Watch};
use crate::body::SegmentArray;
use crate::body::mass_properties::PostureRate;
use crate::body::posture::Posture;
use crate::dynamics::{Motion, State};
use crate::estimator::propagation::Propagation;
use crate::estimator::unscented::SettingsError;
use crate::math::Real;

/// Largest muscle input that a restart keeps; nothing that a person does needs more.
const PLAUSIBLE_INPUT: f64 = 6.0;

impl<T: Real, P: Propagation<T>> MotionFilter<T, P> {
    /// Starts from a motion, either for the first time or again after a gap in the recording. A restart keeps the
    /// estimated inputs, unless the filter was lost or they are not plausible. Motion and posture must be those of the
    /// sample pushed last.
    ///
    /// # Errors
    /// Returns an error if motion or posture is not finite; the filter is then unchanged.
    pub fn restart(
        &mut self,
        motion: &Motion<T>,
        posture: &Posture<T>,
    ) -> Result<(), SettingsError> {
        self.restart_assuming(motion, posture, T::zero())
    }

    /// Same as [`MotionFilter::restart`], from a motion whose velocity is not measured but assumed, with this standard
    /// deviation of each component (m/s).
    ///
    /// # Errors
    /// Same as [`MotionFilter::restart`].
    pub fn restart_assuming(
        &mut self,
        motion: &Motion<T>,
        posture: &Posture<T>,
        velocity_deviation: T,
    ) -> Result<(), SettingsError> {
        let is_first = !self.is_started();
        // What led to a loss may be in the inputs too.
        let sound = self.factors.is_finite() && self.is_plausible();
        self.start(motion, posture)?;
        let is_fresh = is_first || !sound;
        if is_fresh {
            self.forget_inputs();
        }
        let mut variances = self.noise.motion_variances();
        for variance in variances.iter_mut().skip(VELOCITY).take(3) {
            *variance += velocity_deviation * velocity_deviation;
        }
        covariance::renew_motion(&mut self.factors, &variances);
        self.assumed = Assumed::new(velocity_deviation, is_fresh);
        self.constants.disconnect();
        self.trail = Trail::new();
        self.held = Held::none();
        self.climb = Climb::new();
        self.lasting = self.lasting.restarted(is_fresh);
        self.turned_back = TurnedBack::Nowhere;
        self.rejections = [Rejection::new(); CHANNELS];
        self.recovery = Recovery::new();
        self.support = Support::new();
        self.pace.interrupt();
        self.watch = Watch::new();
        self.waiting = 0;
        Ok(())
    }

    /// Whether the inputs are finite and none has run to its limits, and the filter was not lost.
    fn is_plausible(&self) -> bool {
        let largest = T::of(PLAUSIBLE_INPUT);
        let inputs = &self.state.inputs;
        let within = inputs.muscle.to_vector().iter().all(|v| v.abs() <= largest);
        within && self.state.is_finite() && self.watch.consistency() != Consistency::Lost
    }

    /// Takes the inputs as unknown, with their long-run spread: what was learned of them while the filter was wrong, or
    /// while something other than the air supported the body, means nothing.
    #[inline(never)]
    pub(super) fn forget_inputs(&mut self) {
        self.state.inputs = inputs_of(&self.process.centre());
        covariance::renew_inputs(&mut self.factors, &self.process);
        self.constants.disconnect();
    }

    /// Takes errors of segments, each on its own, in place of the preset's error of all joints: standard deviations
    /// relative to the pelvis, each axis (rad). Call it before the first sample; inputs are unknown afterwards.
    pub fn set_segment_errors(&mut self, deviations: &SegmentArray<T>) {
        self.change_segment_errors(deviations);
        let (motion, posture) = (self.motion(), self.posture);
        self.posture_error
            .renew(&self.dynamics, &posture, &motion, &mut self.sample);
        self.take_joint_errors(&motion);
        self.forget_inputs();
    }

    /// Replaces the errors of segments that [`MotionFilter::set_segment_errors`] took, for example because gyroscopes have
    /// drifted since. They act once all axes were computed anew, about [`JOINT_AXES`](super::posture_error::JOINT_AXES)
    /// intervals later; estimates are kept.
    pub fn change_segment_errors(&mut self, deviations: &SegmentArray<T>) {
        let one = self.process.joint_deviation();
        self.posture_error
            .set_segments(&deviations.map(|_, deviation| *deviation / one));
    }

    pub(super) fn is_started(&self) -> bool {
        self.start.is_some() || self.interval.is_some()
    }

    fn start(&mut self, motion: &Motion<T>, posture: &Posture<T>) -> Result<(), SettingsError> {
        self.dynamics
            .sample_into(posture, &PostureRate::zero(), &mut self.sample);
        let state = State::from_motion(motion, &self.sample);
        if !posture.is_valid() || !state.is_finite() {
            return Err(SettingsError::Start);
        }
        let is_first = !self.is_started();
        self.state.motion = state;
        self.start = Some(*motion);
        self.posture = *posture;
        self.interval = None;
        self.activity.start(&motion.angular_velocity.components);
        // All axes at once take a unit longer than the time between two estimates, so a restart leaves them to be
        // renewed one by one.
        if is_first {
            self.posture_error
                .renew(&self.dynamics, posture, motion, &mut self.sample);
        }
        self.take_joint_errors(motion);
        Ok(())
    }
}
