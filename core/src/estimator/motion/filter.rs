//! The motion filter's state, and what it says of it.

use nalgebra::{SMatrix, SVector, Vector3};

use super::activity::Activity;
use super::airflow::Airflow;
use super::assumed::Assumed;
use super::climb::Climb;
use super::constants::Constants;
use super::covariance::Factors;
use super::estimate::ChannelEstimate;
use super::held::Held;
use super::lasting::Lasting;
use super::measurement::{CHANNELS, Noise};
use super::pace::Pace;
use super::posture_error::PostureError;
use super::process::Process;
use super::recovery::Recovery;
use super::rejection::Rejection;
use super::repeats::Repeats;
use super::scale::Scale;
use super::settings::{MotionPreset, Slopes};
use super::state::{Covariance, FlightState, inputs_of};
use super::support::Support;
use super::trail::Trail;
use super::transition::MotionSlope;
use super::turned_back::TurnedBack;
use super::watch::Watch;
use crate::body::posture::Posture;
use crate::dynamics::applied_load::AppliedLoads;
use crate::dynamics::{Dynamics, Motion, PostureSample, State};
use crate::estimator::propagation::Propagation;
use crate::estimator::status::Faults;
use crate::estimator::unscented::SettingsError;
use crate::math::Real;

/// Time (s) after which a posture that has not changed by a bit is taken as assumed rather than measured.
pub(super) const STILL: f32 = 5.0;

/// A filter of the whole motion that takes one posture and one measurement at a time.
#[derive(Debug, Clone)]
pub struct MotionFilter<T: Real, P: Propagation<T>> {
    pub(super) dynamics: Dynamics<T>,
    pub(super) process: Process<T>,
    pub(super) noise: Noise<T>,
    /// Squared number of standard deviations beyond which a channel is rejected.
    pub(super) gate: T,
    pub(super) activity: Activity<T>,
    pub(super) duration: T,
    /// Number of intervals from one estimate to the next.
    pub(super) intervals: usize,
    pub(super) state: FlightState<T>,
    pub(super) factors: Factors<T>,
    /// The product of the factors when it was last asked for.
    pub(super) covariance: Covariance<T>,
    pub(super) constants: Constants<T>,
    pub(super) scale: Scale<T>,
    pub(super) assumed: Assumed<T>,
    pub(super) slope: MotionSlope<T>,
    pub(super) posture_error: PostureError<T>,
    pub(super) interval: Option<P::Interval>,
    /// Motion to start from, until the first interval gives the joint rates.
    pub(super) start: Option<Motion<T>>,
    /// The last interval in full, kept here because it is too large for the stack of an update.
    pub(super) sample: PostureSample<T>,
    pub(super) posture: Posture<T>,
    pub(super) slopes: Slopes,
    /// Samples since the last interval ended.
    pub(super) waiting: usize,
    /// Intervals since the last estimate.
    pub(super) since: usize,
    pub(super) samples: u32,
    pub(super) watch: Watch<T>,
    pub(super) repeats: Repeats<T>,
    pub(super) held: Held<T>,
    pub(super) lasting: Lasting<T>,
    pub(super) turned_back: TurnedBack<T>,
    pub(super) trail: Trail<T>,
    pub(super) climb: Climb<T>,
    pub(super) airflow: Airflow<T>,
    pub(super) support: Support<T>,
    pub(super) pace: Pace<T>,
    pub(super) rejections: [Rejection<T>; CHANNELS],
    pub(super) recovery: Recovery<T>,
    /// Time since the posture changed (s).
    pub(super) still: T,
    /// Channels since the last estimate: for each the last measurement.
    pub(super) channels: [ChannelEstimate<T>; CHANNELS],
    /// Sum and number of the normalised innovations squared since the last estimate.
    pub(super) squares: [T; 2],
    pub(super) faults: Faults,
}

impl<T: Real, P: Propagation<T>> MotionFilter<T, P> {
    /// Checks a preset and returns what follows from it for each interval.
    ///
    /// # Errors
    /// Returns an error if the settings are invalid.
    pub fn process(preset: &MotionPreset) -> Result<Process<T>, SettingsError> {
        let duration = preset.duration(P::STRIDE);
        if !(duration > T::zero() && duration <= T::of(0.05)) {
            return Err(SettingsError::TimeStep);
        }
        if preset.solution_window < P::STRIDE || !preset.solution_window.is_multiple_of(P::STRIDE) {
            return Err(SettingsError::SolutionWindow);
        }
        Process::new(preset, duration)
    }

    /// Creates a filter that ignores samples until [`MotionFilter::restart`] gives it a motion; `process` is that of
    /// the preset. Two filters do not fit on a unit's stack, so the unit creates one in place first and starts it
    /// there.
    #[inline(always)]
    pub fn unstarted(preset: &MotionPreset, process: Process<T>, dynamics: &Dynamics<T>) -> Self {
        let duration = preset.duration(P::STRIDE);
        Self {
            dynamics: *dynamics,
            process,
            noise: preset.noise.of(),
            gate: T::single(preset.gate * preset.gate),
            activity: Activity::new(preset, duration),
            duration,
            intervals: preset.solution_window / P::STRIDE,
            state: FlightState {
                motion: State::at_rest(),
                inputs: inputs_of(&process.centre()),
            },
            factors: Factors::diagonal(&SVector::zeros()),
            covariance: SMatrix::zeros(),
            constants: Constants::new(preset, duration),
            scale: Scale::new(preset),
            assumed: Assumed::new(T::zero(), false),
            slope: SMatrix::zeros(),
            posture_error: PostureError::none(),
            interval: None,
            start: None,
            sample: PostureSample::blank(),
            posture: Posture::default(),
            slopes: preset.slopes,
            waiting: 0,
            since: 0,
            samples: 0,
            watch: Watch::new(),
            repeats: Repeats::new(),
            held: Held::none(),
            lasting: Lasting::new(),
            turned_back: TurnedBack::Nowhere,
            trail: Trail::new(),
            climb: Climb::new(),
            airflow: Airflow::none(),
            support: Support::new(),
            pace: Pace::new(T::single(preset.noise.attitude * preset.noise.attitude)),
            rejections: [Rejection::new(); CHANNELS],
            recovery: Recovery::new(),
            still: T::zero(),
            channels: [ChannelEstimate::nothing(); CHANNELS],
            squares: [T::zero(); 2],
            faults: Faults::default(),
        }
    }

    /// Returns the model.
    pub fn dynamics(&self) -> &Dynamics<T> {
        &self.dynamics
    }

    /// Returns the model mutably, so that the limb groups can be changed during a flight.
    pub fn dynamics_mut(&mut self) -> &mut Dynamics<T> {
        &mut self.dynamics
    }

    /// Returns motion and inputs after the last interval.
    pub fn state(&self) -> &FlightState<T> {
        &self.state
    }

    /// Computes and returns the covariance of the state's errors, apart from the share of the
    /// [`constants`](super::constants). The filter itself keeps it in [factors](super::covariance).
    pub fn covariance(&mut self) -> &Covariance<T> {
        self.covariance = self.factors.product();
        &self.covariance
    }

    /// Returns the covariance as the filter keeps it.
    pub fn factors(&self) -> &Factors<T> {
        &self.factors
    }

    /// Returns the derivatives of the motion over the last interval.
    pub fn transition(&self) -> &MotionSlope<T> {
        &self.slope
    }

    /// Returns the wind and the gyroscope's bias as estimated, and their effect on the state's errors.
    pub fn constants(&self) -> &Constants<T> {
        &self.constants
    }

    /// Degree to which each axis is moved deliberately, 0 to 1: pitch, yaw, roll.
    pub fn activity(&self) -> [T; 3] {
        self.activity.level()
    }

    /// Applies known loads to the present state for `duration` (s); `time` (s since the start of the flight) is the
    /// middle of that period. Has no effect before the first interval.
    pub fn apply(&mut self, loads: &AppliedLoads<T>, time: T, duration: T) {
        if let Some(interval) = &self.interval {
            let body = (&self.posture, interval);
            loads.push(&self.dynamics, &mut self.state.motion, body, time, duration);
        }
    }

    pub(super) fn motion(&self) -> Motion<T> {
        match (&self.start, &self.interval) {
            (Some(start), _) => *start,
            (None, Some(interval)) => self.state.motion.motion(interval),
            (None, None) => self.state.motion.motion(&self.sample),
        }
    }

    pub(super) fn velocity_through_air(&self, motion: &Motion<T>) -> Vector3<T> {
        let air = self.dynamics.air.velocity_at(&motion.position);
        (motion.velocity - motion.inertial_from_body.inverse() * air).components
    }

    /// Sets the process noise to the effect of joint errors in the present posture and this motion.
    pub(super) fn take_joint_errors(&mut self, motion: &Motion<T>) {
        self.process
            .set_sensitivity(self.posture_error.covariance());
        let turning = self
            .posture_error
            .turning_covariance(&self.dynamics, motion);
        self.process.set_turning(&turning);
    }
}
