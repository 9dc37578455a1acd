//! The motion filter: a Kalman filter of the whole motion and of the inputs and loads that cause it.
//!
//! The paper's filter ([`Estimator`](super::Estimator)) estimates six coefficients and lets the motion run open loop,
//! so every model error ends up in the coefficients. This filter also has the motion in its state and, besides muscle
//! input and damping, a residual load: the effect of small errors in the recorded joints. The size of that load follows
//! from the model ([`posture_error`]) and from the joint error, which is a setting. Inputs decay to a mean about which
//! they vary with a given spread, so one that no measurement observes stays at its mean, and no bounds are needed near
//! plausible values. An axis whose angular velocity departs from its prediction is awake ([`activity`]): its inputs may
//! then change quickly.
//!
//! The error of the state has 21 coordinates ([`state`]). They are propagated over an interval by derivatives that the
//! model supplies ([`transition`]) and updated channel by channel ([`measurement`], [`update`]), each channel behind a
//! gate. [`watch`] compares the innovations with their error bars and reports when the error bars cannot be trusted.

pub mod activity;
pub mod estimate;
pub mod measurement;
pub mod posture_error;
pub mod repeats;
pub mod settings;
mod start;
pub mod state;
pub mod transition;
pub mod update;
pub mod watch;

use nalgebra::{SMatrix, Vector3};

use super::factor::Cholesky;
use super::full::Full;
use super::propagation::Propagation;
use super::reduced::Reduced;
use super::status::Faults;
use super::unscented::SettingsError;
use crate::body::posture::Posture;
use crate::dynamics::applied_load::AppliedLoads;
use crate::dynamics::{Dynamics, Motion, PostureSample, State};
use crate::frame::Vector;
use crate::math::Real;
use activity::Activity;
use estimate::{ChannelEstimate, MotionEstimate, Recorder};
use measurement::{CHANNELS, MotionMeasurement, Noise, Prediction};
use posture_error::PostureError;
use repeats::{BELIEVED, Repeats};
use settings::{MotionPreset, Process};
use state::{
    Covariance, DAMPING, Difference, FlightState, MOTION_STATES, RESIDUAL_FORCE, SPIN, input_vector,
};
use transition::MotionSlope;
use watch::Watch;

/// The motion filter with the whole model and one step per sample.
pub type FullMotionFilter<T> = MotionFilter<T, Full>;

/// The motion filter for the unit, with one step for every two samples.
pub type ReducedMotionFilter<T> = MotionFilter<T, Reduced>;

/// Number of consecutive innovations beyond the gate after which a channel is accepted again, because then the filter
/// is wrong rather than the sensor.
const LONGEST_REJECTION: u16 = 60;

/// A filter of the whole motion that takes one posture and one measurement at a time.
#[derive(Debug, Clone)]
pub struct MotionFilter<T: Real, P: Propagation<T>> {
    dynamics: Dynamics<T>,
    process: Process<T>,
    noise: Noise<T>,
    /// Squared number of standard deviations beyond which a channel is rejected.
    gate: T,
    activity: Activity<T>,
    duration: T,
    /// Number of intervals from one estimate to the next.
    intervals: usize,
    state: FlightState<T>,
    covariance: Covariance<T>,
    slope: MotionSlope<T>,
    posture_error: PostureError<T>,
    interval: Option<P::Interval>,
    /// Motion to start from, until the first interval gives the joint rates.
    start: Option<Motion<T>>,
    /// The last interval in full, kept here because it is too large for the stack of an update.
    sample: PostureSample<T>,
    posture: Posture<T>,
    /// Samples since the last interval ended.
    waiting: usize,
    /// Intervals since the last estimate.
    since: usize,
    samples: u32,
    watch: Watch<T>,
    repeats: Repeats<T>,
    /// Sum and number of the normalised innovations squared since the last estimate.
    squares: [T; 2],
    faults: Faults,
}

impl<T: Real, P: Propagation<T>> MotionFilter<T, P> {
    /// Creates a filter that starts with the motion and posture of sample 0, taken to be as accurate as the sensors.
    ///
    /// # Errors
    /// Returns an error if the settings are invalid or the start is not finite.
    pub fn new(
        preset: &MotionPreset,
        dynamics: &Dynamics<T>,
        motion: &Motion<T>,
        posture: &Posture<T>,
    ) -> Result<Self, SettingsError> {
        let mut filter = Self::unstarted(preset, dynamics)?;
        filter.restart(motion, posture)?;
        Ok(filter)
    }

    /// Creates a filter that ignores samples until [`MotionFilter::restart`] gives it a motion. Two filters do not fit
    /// on a unit's stack, so the unit creates one in place first and starts it there.
    ///
    /// # Errors
    /// Returns an error if the settings are invalid.
    pub fn unstarted(preset: &MotionPreset, dynamics: &Dynamics<T>) -> Result<Self, SettingsError> {
        let duration = preset.duration(P::STRIDE);
        if !(duration > T::zero() && duration <= T::of(0.05)) {
            return Err(SettingsError::TimeStep);
        }
        if preset.solution_window < P::STRIDE || !preset.solution_window.is_multiple_of(P::STRIDE) {
            return Err(SettingsError::SolutionWindow);
        }
        let process = Process::new(preset, duration)?;
        Ok(Self {
            dynamics: *dynamics,
            process,
            noise: preset.noise.of(),
            gate: T::single(preset.gate * preset.gate),
            activity: Activity::new(preset, duration),
            duration,
            intervals: preset.solution_window / P::STRIDE,
            state: FlightState {
                motion: State::at_rest(),
                inputs: state::inputs_of(&process.centre()),
            },
            covariance: SMatrix::zeros(),
            slope: SMatrix::zeros(),
            posture_error: PostureError::none(),
            interval: None,
            start: None,
            sample: PostureSample::blank(),
            posture: Posture::default(),
            waiting: 0,
            since: 0,
            samples: 0,
            watch: Watch::new(),
            repeats: Repeats::new(),
            squares: [T::zero(); 2],
            faults: Faults::default(),
        })
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

    /// Returns the covariance of the state's errors.
    pub fn covariance(&self) -> &Covariance<T> {
        &self.covariance
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

    /// Processes the next sample: a posture and the measurement of the same instant. Returns an estimate for that
    /// instant once per solution window.
    ///
    /// An invalid posture is replaced by the last good one; channels that were not measured or lie beyond the gate are
    /// left out. [`MotionEstimate::faults`] and the channels report it.
    pub fn push(
        &mut self,
        posture: &Posture<T>,
        measured: &MotionMeasurement<T>,
    ) -> Option<MotionEstimate<T>> {
        self.push_recorded(posture, measured, &mut ())
    }

    /// Same as [`MotionFilter::push`], with a recorder that is called for each update.
    pub fn push_recorded(
        &mut self,
        posture: &Posture<T>,
        measured: &MotionMeasurement<T>,
        recorder: &mut impl Recorder<T>,
    ) -> Option<MotionEstimate<T>> {
        if !self.is_started() {
            return None;
        }
        self.samples = self.samples.wrapping_add(1);
        self.waiting += 1;
        if self.waiting < P::STRIDE {
            return None;
        }
        self.waiting = 0;
        self.cross(posture);
        let channels = self.take(measured, recorder);
        self.since += 1;
        if self.since < self.intervals {
            return None;
        }
        self.since = 0;
        Some(self.publish(channels))
    }

    /// Advances to the next posture: first the posture's data, then the motion. They are separate functions so that
    /// their stack frames do not add up.
    fn cross(&mut self, posture: &Posture<T>) {
        let motion = self.motion();
        self.follow_posture(posture, &motion);
        self.fly(&motion);
    }

    /// Updates the interval and the effect of joint errors for the next posture.
    #[inline(never)]
    fn follow_posture(&mut self, posture: &Posture<T>, motion: &Motion<T>) {
        let good = posture.is_valid();
        self.faults.posture |= !good;
        // Once per estimate on the unit, so that every update costs the same.
        if self.since == 0 || P::STRIDE == 1 {
            let next = if good { posture } else { &self.posture };
            self.posture_error
                .renew_next(&self.dynamics, next, motion, &mut self.sample);
        }
        let next = if good { posture } else { &self.posture };
        self.dynamics
            .between_into(&self.posture, next, self.duration, &mut self.sample);
        if good {
            self.posture = *posture;
        }
    }

    /// Propagates state and covariance over the interval.
    #[inline(never)]
    fn fly(&mut self, motion: &Motion<T>) {
        let velocity = self.velocity_through_air(motion);
        self.follow_joints(motion, &velocity);
        let interval = P::keep(
            &self.dynamics,
            &self.sample,
            &Vector::from_components(velocity),
        );
        if let Some(start) = self.start.take() {
            self.state.motion = State::from_motion(&start, &interval);
        }
        let end = transition::fly(
            &self.dynamics,
            &interval,
            &self.process,
            &self.state,
            self.duration,
            &mut self.slope,
        );
        let spin = &motion.angular_velocity.components;
        let variance = Vector3::from_fn(|axis, _| self.covariance[(SPIN + axis, SPIN + axis)]);
        let trust = self.activity.damping_trust(spin, &variance);
        for (axis, trust) in trust.into_iter().enumerate() {
            for row in 0..MOTION_STATES {
                self.slope[(row, DAMPING + axis)] *= trust;
            }
        }
        if end.is_finite() && self.slope.iter().all(|v| v.is_finite()) {
            self.state = end;
            transition::spread(&mut self.covariance, &self.slope, &self.process);
        } else {
            self.faults.motion = true;
        }
        self.interval = Some(interval);
    }

    /// Updates the process noise for the effect of joint errors in this interval.
    #[inline(never)]
    fn follow_joints(&mut self, motion: &Motion<T>, velocity: &Vector3<T>) {
        let length = |vector: Vector3<T>| vector.norm_squared().root();
        let across = length(motion.angular_velocity.components.cross(velocity));
        let turn = across * self.duration / length(*velocity);
        self.process
            .set_turn(if turn.is_finite() { turn } else { T::zero() });
        self.process
            .set_sensitivity(self.posture_error.covariance());
        let turning = self
            .posture_error
            .turning_covariance(&self.dynamics, motion);
        self.process.set_turning(&turning);
    }

    /// Fuses a measurement.
    #[inline(never)]
    fn take(
        &mut self,
        measured: &MotionMeasurement<T>,
        recorder: &mut impl Recorder<T>,
    ) -> [ChannelEstimate<T>; CHANNELS] {
        let nothing = ChannelEstimate {
            innovation: T::zero(),
            variance: T::zero(),
            fused: false,
            rejected: false,
        };
        let mut channels = [nothing; CHANNELS];
        let Some(interval) = &self.interval else {
            return channels;
        };
        self.repeats.take(measured, self.duration);
        let prediction = Prediction::of(&self.state, interval);
        let spin = prediction.motion.angular_velocity.components;
        let mut moved = Difference::zeros();
        for (k, channel) in channels.iter_mut().enumerate() {
            let repeated = self.repeats.time(k);
            self.watch.channels[k].repeated = repeated;
            let row = prediction.row(k, measured);
            let Some(row) = row.filter(|_| repeated <= T::single(BELIEVED)) else {
                continue;
            };
            let noise = self.noise.variance(k, &spin);
            let (innovation, spread) = update::innovation(&self.covariance, &moved, &row, noise);
            let normalised = innovation.value / innovation.variance.root();
            let square = normalised * normalised;
            let within = square <= self.gate;
            // NaN is not within the gate either, so it is rejected.
            let rejected = !within;
            self.watch.take(k, normalised, rejected, self.duration);
            self.activity.take(k, normalised);
            self.squares[0] += if within { square } else { self.gate };
            self.squares[1] += T::one();
            let lost = self.watch.channels[k].streak >= LONGEST_REJECTION && square.is_finite();
            *channel = ChannelEstimate {
                innovation: innovation.value,
                variance: innovation.variance,
                fused: within || lost,
                rejected,
            };
            if channel.fused {
                recorder.taken(&row, &innovation, &spread);
                update::take(&mut self.covariance, &mut moved, &innovation, &spread);
            }
        }
        self.faults.covariance |= update::keep_positive(&mut self.covariance);
        let mut next = self.state.moved(&moved, interval);
        next.limit_inputs();
        if next.is_finite() {
            self.state = next;
        } else {
            self.faults.update = true;
        }
        self.process.set_activity(self.activity.level());
        self.watch_residual();
        channels
    }

    /// Compares the residual load with the load that joint errors can cause.
    fn watch_residual(&mut self) {
        let inputs = input_vector(&self.state.inputs);
        let residual = inputs.fixed_rows::<6>(RESIDUAL_FORCE - MOTION_STATES);
        let factor = Cholesky::new(&self.process.residual_covariance());
        let whitened = factor.solve_transposed(&residual.transpose());
        let mean = whitened.norm_squared() / T::of(6.0);
        self.watch.take_residual(mean, self.duration);
    }

    fn motion(&self) -> Motion<T> {
        match (&self.start, &self.interval) {
            (Some(start), _) => *start,
            (None, Some(interval)) => self.state.motion.motion(interval),
            (None, None) => self.state.motion.motion(&self.sample),
        }
    }

    fn velocity_through_air(&self, motion: &Motion<T>) -> Vector3<T> {
        let air = self.dynamics.air.velocity_at(&motion.position);
        (motion.velocity - motion.inertial_from_body.inverse() * air).components
    }

    fn publish(&mut self, channels: [ChannelEstimate<T>; CHANNELS]) -> MotionEstimate<T> {
        let [sum, number] = core::mem::replace(&mut self.squares, [T::zero(); 2]);
        self.faults.measurement |= channels.iter().any(|channel| channel.rejected);
        MotionEstimate {
            sample: self.samples,
            inputs: self.state.inputs,
            deviation: self.process.stated(&self.covariance),
            motion: self.motion(),
            channels,
            normalised_innovation: if number > T::zero() {
                sum / number
            } else {
                T::one()
            },
            watch: self.watch,
            consistency: self.watch.consistency(),
            faults: core::mem::take(&mut self.faults),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::pattern;
    use crate::dynamics::Inputs;
    use crate::dynamics::muscle_input::{BACK_TRACKING, MuscleForces};
    use crate::dynamics::step::TIME_STEP;
    use crate::frame::Rotation;
    use crate::test_body::reference_body;
    use nalgebra::UnitQuaternion;
    use settings::MOTION;
    use watch::Consistency;

    fn dynamics() -> Dynamics<f64> {
        Dynamics {
            muscles: BACK_TRACKING.with_forces(MuscleForces::Moment),
            ..Dynamics::paper(reference_body(), 1.0)
        }
    }

    fn falling() -> Motion<f64> {
        let belly = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 1.5);
        Motion {
            inertial_from_body: Rotation::from_quaternion(belly),
            position: Vector::zero(),
            velocity: Vector::new(0.0, -46.0, 3.0),
            angular_velocity: Vector::zero(),
        }
    }

    /// Flies for `seconds` with a pitch input that starts after one second, and filters noise-free measurements of the
    /// flight.
    fn filtered(
        seconds: u32,
        pitch: f64,
        mut change: impl FnMut(u32, &mut MotionMeasurement<f64>, &mut Posture<f64>),
    ) -> (MotionFilter<f64, Full>, Option<MotionEstimate<f64>>) {
        let dynamics = dynamics();
        let posture = pattern::neutral();
        let interval = dynamics.hold(&posture);
        let mut flown = State::from_motion(&falling(), &interval);
        let mut filter =
            MotionFilter::<f64, Full>::new(&MOTION, &dynamics, &falling(), &posture).unwrap();
        let mut last = None;
        for k in 0..240 * seconds {
            let mut inputs = Inputs::belly_turn();
            inputs.muscle.pitch = if k > 240 { pitch } else { 0.0 };
            flown = dynamics.step(&flown, &interval, &inputs, TIME_STEP);
            let mut seen = MotionMeasurement::of(&flown.motion(&interval));
            let mut recorded = posture;
            change(k, &mut seen, &mut recorded);
            last = filter.push(&recorded, &seen).or(last);
        }
        (filter, last)
    }

    #[test]
    fn what_the_model_explains_leaves_inputs_at_zero() {
        let (_, estimate) = filtered(5, 0.0, |_, _, _| ());
        let estimate = estimate.unwrap();
        assert!(estimate.inputs.muscle.to_vector().norm() < 1e-6);
        assert_eq!(estimate.consistency, Consistency::Consistent);
        // Nothing moves in roll, so its damping is not observed: it stays at its mean with its initial spread.
        let damping = estimate.inputs.damping.roll - f64::from(MOTION.damping[2]);
        assert!(damping.abs() < 1e-3, "{damping}");
        assert!(estimate.deviation[DAMPING + 2] > 0.9 * f64::from(MOTION.damping_deviation[2]));
    }

    #[test]
    fn an_input_is_found_within_its_error_bar() {
        for pitch in [1.5, -0.8] {
            let (_, estimate) = filtered(4, pitch, |_, _, _| ());
            let estimate = estimate.unwrap();
            let found = estimate.inputs.muscle.pitch;
            let deviation = estimate.deviation[state::MUSCLE];
            assert!(
                (found - pitch).abs() < 2.0 * deviation,
                "{found} {deviation}"
            );
            assert!(deviation < 0.5 && found * pitch > 0.0);
        }
    }

    #[test]
    fn a_wrong_sensor_is_gated_and_reported() {
        let (filter, estimate) = filtered(4, 0.0, |k, seen, _| {
            if k > 480 && k % 8 == 0 {
                seen.velocity = seen.velocity.map(|v| v + Vector::new(30.0, 0.0, 0.0));
            }
        });
        let estimate = estimate.unwrap();
        assert!(filter.state().motion.is_finite());
        assert!(estimate.inputs.muscle.to_vector().norm() < 0.05);
        assert!(estimate.watch.channels[6].rejected > 0.05);
        assert_ne!(estimate.consistency, Consistency::Consistent);
    }

    #[test]
    fn a_sensor_that_repeats_itself_is_reported_and_ignored() {
        let mut held = None;
        let (filter, estimate) = filtered(6, 0.3, |k, seen, _| {
            // Sensor noise that affects the last bits only.
            let jitter = 1e-9 * f64::from(k % 7);
            seen.velocity = seen.velocity.map(|v| v + Vector::new(jitter, 0.0, 0.0));
            if k > 480 {
                seen.angular_velocity = *held.get_or_insert(seen.angular_velocity);
            }
        });
        let estimate = estimate.unwrap();
        assert_eq!(estimate.consistency, Consistency::Lost);
        assert!(estimate.watch.channels[3].repeated > 3.0);
        assert!(!estimate.channels[3].fused && estimate.channels[0].fused);
        assert!(estimate.watch.channels[0].repeated < 0.1);
        assert!(filter.state().motion.is_finite());
    }

    #[test]
    fn unusable_input_leaves_a_finite_state() {
        let nowhere = Vector::new(f64::NAN, f64::INFINITY, 1e300);
        let (filter, estimate) = filtered(3, 0.0, |k, seen, posture| {
            if k > 240 && k % 3 == 0 {
                seen.velocity = Some(nowhere);
                seen.angular_velocity = Some(Vector::new(f64::NAN, 0.0, 1e30));
            }
            if k > 240 && k % 5 == 0 {
                *posture = posture.with(
                    crate::body::Segment::Head,
                    UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(
                        f64::NAN,
                        0.0,
                        0.0,
                        1.0,
                    )),
                );
            }
        });
        assert!(filter.state().is_finite());
        assert!(filter.covariance().iter().all(|v| v.is_finite()));
        assert!(estimate.unwrap().inputs.muscle.to_vector().norm() < 1.0);
    }

    #[test]
    fn invalid_settings_are_refused() {
        let posture = pattern::neutral();
        let refused = |preset: MotionPreset| {
            MotionFilter::<f64, Full>::new(&preset, &dynamics(), &falling(), &posture).err()
        };
        let rate = MotionPreset {
            sample_rate: 0.0,
            ..MOTION
        };
        assert_eq!(refused(rate), Some(SettingsError::TimeStep));
        let window = MotionPreset {
            solution_window: 0,
            ..MOTION
        };
        assert_eq!(refused(window), Some(SettingsError::SolutionWindow));
        let joints = MotionPreset {
            joint_error: f32::NAN,
            ..MOTION
        };
        assert_eq!(refused(joints), Some(SettingsError::Variance));
        assert_eq!(refused(MOTION), None);
    }
}
