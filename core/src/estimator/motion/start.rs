//! Starting and restarting a motion filter.

use super::MotionFilter;
use super::state::{MOTION_STATES, STATES};
use super::watch::Watch;
use crate::body::mass_properties::PostureRate;
use crate::body::posture::Posture;
use crate::dynamics::{Motion, State};
use crate::estimator::propagation::Propagation;
use crate::estimator::unscented::SettingsError;
use crate::math::Real;

impl<T: Real, P: Propagation<T>> MotionFilter<T, P> {
    /// Starts from a motion, either for the first time or again after a gap in the recording. A restart keeps the
    /// estimated inputs. Motion and posture must be those of the sample pushed last.
    ///
    /// # Errors
    /// Returns an error if motion or posture is not finite; the filter is then unchanged.
    pub fn restart(
        &mut self,
        motion: &Motion<T>,
        posture: &Posture<T>,
    ) -> Result<(), SettingsError> {
        let renewed = if self.is_started() {
            MOTION_STATES
        } else {
            STATES
        };
        self.start(motion, posture)?;
        let start = self.process.start(&self.noise);
        for column in 0..STATES {
            for row in 0..STATES {
                if row < renewed || column < renewed {
                    self.covariance[(row, column)] = start[(row, column)];
                }
            }
        }
        self.watch = Watch::new();
        self.waiting = 0;
        Ok(())
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
        self.process
            .set_sensitivity(self.posture_error.covariance());
        let turning = self
            .posture_error
            .turning_covariance(&self.dynamics, motion);
        self.process.set_turning(&turning);
        Ok(())
    }
}
