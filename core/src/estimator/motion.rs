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
pub mod airflow;
mod assumed;
mod calm;
mod climb;
pub mod constants;
pub mod covariance;
mod crossing;
pub mod estimate;
mod filter;
mod fusion;
mod held;
mod lasting;
pub mod measurement;
mod pace;
pub mod posture_error;
pub mod process;
mod publish;
mod recovery;
mod rejection;
pub mod repeats;
mod scale;
pub mod sensors;
pub mod settings;
mod start;
pub mod state;
pub mod support;
pub mod trail;
pub mod transition;
mod turned_back;
pub mod update;
pub mod watch;

use super::full::Full;
use super::propagation::Propagation;
use super::reduced::Reduced;
use super::unscented::SettingsError;
use crate::body::posture::Posture;
use crate::dynamics::{Dynamics, Motion};
use crate::math::Real;
use estimate::{MotionEstimate, Recorder};
pub use filter::MotionFilter;
use measurement::{MotionMeasurement, SensorMeasurement};
use settings::MotionPreset;
use support::Situation;

/// The motion filter with the whole model and one step per sample.
pub type FullMotionFilter<T> = MotionFilter<T, Full>;

/// The motion filter for the unit, with one step for every two samples.
pub type ReducedMotionFilter<T> = MotionFilter<T, Reduced>;

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
        let mut filter = Self::unstarted(preset, Self::process(preset)?, dynamics);
        filter.restart(motion, posture)?;
        Ok(filter)
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
        self.push_sensors(posture, &(*measured).into())
    }

    /// Same as [`MotionFilter::push`], with the measurements of other sensors too.
    pub fn push_sensors(
        &mut self,
        posture: &Posture<T>,
        measured: &SensorMeasurement<T>,
    ) -> Option<MotionEstimate<T>> {
        self.push_recorded(posture, measured, &mut ())
    }

    /// Same as [`MotionFilter::push_sensors`], with a recorder that is called for each update.
    pub fn push_recorded(
        &mut self,
        posture: &Posture<T>,
        measured: &SensorMeasurement<T>,
        recorder: &mut impl Recorder<T>,
    ) -> Option<MotionEstimate<T>> {
        if !self.is_started() {
            return None;
        }
        self.samples = self.samples.wrapping_add(1);
        self.waiting += 1;
        if self.waiting < P::STRIDE {
            let stride = T::of(P::STRIDE as f64);
            let remaining = self.duration * (T::of((P::STRIDE - self.waiting) as f64) / stride);
            self.held.hold(measured, remaining);
            return None;
        }
        self.waiting = 0;
        self.cross(posture);
        for rejection in &mut self.rejections {
            rejection.pass(self.duration);
        }
        self.take(measured, recorder);
        if self.support.situation() == Situation::Supported {
            self.forget_inputs();
        }
        self.since += 1;
        if self.since < self.intervals {
            return None;
        }
        self.since = 0;
        Some(self.publish())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::pattern;
    use crate::dynamics::muscle_input::{BACK_TRACKING, MuscleForces};
    use crate::dynamics::step::TIME_STEP;
    use crate::dynamics::{Inputs, State};
    use crate::frame::{Rotation, Vector};
    use crate::test_body::reference_body;
    use nalgebra::{UnitQuaternion, Vector3};
    use settings::MOTION;
    use state::DAMPING;
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
    fn without_measurements_an_estimate_is_doubtful_and_then_lost() {
        for (blind_from, expected) in [
            (1200, Consistency::Consistent),
            (1000, Consistency::Doubtful),
            (480, Consistency::Lost),
        ] {
            let (filter, estimate) = filtered(5, 0.3, |k, seen, _| {
                if k >= blind_from {
                    *seen = MotionMeasurement::none();
                }
            });
            assert_eq!(estimate.unwrap().consistency, expected, "{blind_from}");
            assert!(filter.state().is_finite());
        }
    }

    #[test]
    fn a_wrong_rate_is_named() {
        let dynamics = dynamics();
        let posture = pattern::neutral();
        let interval = dynamics.hold(&posture);
        for (rate, named) in [(200.0, true), (240.0, false), (300.0, true), (400.0, true)] {
            let preset = MotionPreset {
                sample_rate: rate,
                ..MOTION
            };
            let mut flown = State::from_motion(&falling(), &interval);
            let mut filter =
                MotionFilter::<f64, Full>::new(&preset, &dynamics, &falling(), &posture).unwrap();
            let mut last = None;
            for k in 0..2400 {
                let mut inputs = Inputs::belly_turn();
                inputs.muscle.pitch = 2.5 * libm::sin(0.02 * f64::from(k));
                flown = dynamics.step(&flown, &interval, &inputs, TIME_STEP);
                let seen = MotionMeasurement::of(&flown.motion(&interval));
                last = filter.push(&posture, &seen).or(last);
            }
            let estimate = last.unwrap();
            assert_eq!(estimate.faults.rate, named, "{rate}");
            assert_eq!(estimate.watch.pace.is_some(), named);
            assert_eq!(estimate.consistency == Consistency::Consistent, !named);
        }
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
        assert!(filter.factors().is_finite());
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
