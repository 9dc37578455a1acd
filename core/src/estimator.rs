//! Estimation of a skydiver's conscious inputs from recorded motion: the paper's modified unscented Kalman filter, and
//! a reduced form of it for the unit.
//!
//! Both are an [`Estimator`]; they differ in how they predict a measurement for each sigma point ([`propagation`]).
//! [`PaperFilter`] runs the whole model thirteen times ([`full`]); [`ReducedFilter`] runs a smaller model seven times
//! ([`reduced`]) and checks the result ([`check`]). The algebra is in [`unscented`], the measured quantities in
//! [`measurement`], named tunings in [`preset`], and the published results in [`status`]. [`ranges`] declares the
//! range of every number and the fixed-point format it fits; [`trace`] is a flight with bit-identical results on every
//! machine. [`motion`] is a different filter, which estimates the whole motion.
//!
//! ```text
//!      coefficients of k, motion of k                          measurement of k + N_pred
//!                  |--- prediction window, N_pred samples ---------------|
//!                  |--- solution window, N_solve ---|   then k becomes k + N_solve
//! ```
//!
//! No call allocates or panics, and the execution time does not depend on the data.

pub mod check;
pub mod coefficients;
pub mod factor;
pub mod full;
mod limits;
pub mod measurement;
pub mod motion;
pub mod preset;
pub mod propagation;
pub mod ranges;
pub mod reduced;
pub mod status;
pub mod trace;
pub mod ud;
pub mod unit_preset;
pub mod unscented;
pub mod window;

use heapless::Deque;
use nalgebra::SVector;

use crate::body::posture::Posture;
use crate::dynamics::{Dynamics, Motion, PostureSample, State};
use crate::frame::Vector;
use crate::math::{Lanes, Real};
use check::Check;
pub use coefficients::{STATES, StateVector, input_coefficients, inputs_of};
use coefficients::{in_other_order, inputs_of_filter};
use full::Full;
pub use limits::MOTION_LIMITS;
use limits::limit;
use measurement::{CHANNELS, Measurement, MeasurementModel};
use preset::Preset;
use propagation::Propagation;
use reduced::Reduced;
use status::{Channel, Estimate, Faults, Health, INCONSISTENT, TEST_RATIO_GATE};
use unscented::{Innovation, SettingsError, Unscented};
use window::Window;

/// The paper's filter, with room for the paper's window of 60 samples, 0.25 s at 240 Hz.
pub type PaperFilter<T, const INTERVALS: usize = 60> = Estimator<T, Full, INTERVALS>;

/// The filter for the unit, whose 30 intervals of two samples also make 0.25 s at 240 Hz.
pub type ReducedFilter<T, const INTERVALS: usize = 30> = Estimator<T, Reduced, INTERVALS>;

/// A filter that takes one posture and one measurement at a time.
///
/// `INTERVALS` is the capacity of the prediction window, in intervals of [`Propagation::STRIDE`] samples each; the
/// preset sets its length. The estimator owns its model, which uses the limbs of the preset.
#[derive(Debug, Clone)]
pub struct Estimator<T: Real, P: Propagation<T>, const INTERVALS: usize> {
    dynamics: Dynamics<T>,
    model: MeasurementModel,
    noise: SVector<T, CHANNELS>,
    /// Duration of an interval (s).
    duration: T,
    /// Number of intervals in the prediction window.
    prediction_intervals: usize,
    /// Number of intervals in the solution window.
    solution_intervals: usize,
    filter: Unscented<T, STATES>,
    /// Reconstructed motion at the start of the window.
    skydiver: State<T>,
    /// Predicted motion at the end of the window, where new intervals are added.
    front: State<T>,
    window: Deque<P::Interval, INTERVALS>,
    posture: Posture<T>,
    /// The last interval in full, kept here because it is too large for the stack of an update.
    sample: Option<PostureSample<T>>,
    /// Samples since the last interval ended.
    waiting: usize,
    /// Samples pushed since the start.
    samples: u32,
    updates: u32,
    mean_normalised_innovation: T,
    faults: Faults,
}

impl<T: Real, P: Propagation<T>, const INTERVALS: usize> Estimator<T, P, INTERVALS> {
    /// Creates an estimator that starts with the motion and posture of sample 0.
    ///
    /// # Errors
    /// Returns an error if the preset is unsafe, a window is not a multiple of the stride, the prediction window
    /// exceeds the capacity or is shorter than the solution window, or the start is not finite.
    pub fn new(
        preset: &Preset,
        dynamics: &Dynamics<T>,
        motion: &Motion<T>,
        posture: &Posture<T>,
    ) -> Result<Self, SettingsError> {
        let filter = Unscented::new(preset.settings(P::ROOT)?)?;
        let intervals = |window: usize, room: usize| {
            let fits = window.is_multiple_of(P::STRIDE) && (P::STRIDE..=room).contains(&window);
            fits.then_some(window / P::STRIDE)
        };
        let prediction_intervals = intervals(preset.prediction_window, INTERVALS * P::STRIDE)
            .ok_or(SettingsError::PredictionWindow)?;
        let solution_intervals = intervals(preset.solution_window, preset.prediction_window)
            .ok_or(SettingsError::SolutionWindow)?;
        let mut duration = T::zero();
        for _ in 0..P::STRIDE {
            duration += preset.time_step::<T>();
        }
        if !(duration > T::zero() && duration <= T::of(0.05)) {
            return Err(SettingsError::TimeStep);
        }
        let dynamics = Dynamics {
            muscles: preset.muscles,
            ..*dynamics
        };
        let skydiver = start(&dynamics, motion, posture)?;
        Ok(Self {
            dynamics,
            model: preset.measurement,
            noise: preset.measurement.noise(),
            duration,
            prediction_intervals,
            solution_intervals,
            filter,
            skydiver,
            front: skydiver,
            window: Deque::new(),
            posture: *posture,
            sample: None,
            waiting: 0,
            samples: 0,
            updates: 0,
            mean_normalised_innovation: T::one(),
            faults: Faults::default(),
        })
    }

    /// Restarts from another motion, keeping coefficients and covariance: after a gap in the recording, or when
    /// [`Health::Inconsistent`] reports that the reconstructed motion is lost. Motion and posture must be those of the
    /// sample pushed last.
    ///
    /// # Errors
    /// Returns an error if motion or posture is not finite; the estimator is then unchanged.
    pub fn restart(
        &mut self,
        motion: &Motion<T>,
        posture: &Posture<T>,
    ) -> Result<(), SettingsError> {
        self.skydiver = start(&self.dynamics, motion, posture)?;
        self.front = self.skydiver;
        self.window.clear();
        self.posture = *posture;
        self.waiting = 0;
        self.mean_normalised_innovation = T::one();
        Ok(())
    }

    /// Time (s) from the sample that an estimate refers to until the measurement that completes it: the length of the
    /// prediction window.
    pub fn delay(&self) -> T {
        self.duration * T::of(f64::from(count(self.prediction_intervals)))
    }

    /// Number of samples in the prediction window, N_pred.
    pub const fn prediction_window(&self) -> usize {
        self.prediction_intervals * P::STRIDE
    }

    /// Returns the coefficients and their covariance, in the order of paper eq. (ukf_state).
    pub fn filter(&self) -> &Unscented<T, STATES> {
        &self.filter
    }

    /// Processes the next sample: a posture and the measurement of the same instant. Returns an estimate with the
    /// sample that fills the window, and then once per solution window.
    ///
    /// A posture or measurement that is not finite or not plausible changes neither coefficients nor covariance: the
    /// last good posture is held, the affected channels are left out, and [`Estimate::faults`] reports it.
    pub fn push(&mut self, posture: &Posture<T>, measured: &Measurement<T>) -> Option<Estimate<T>> {
        self.samples = self.samples.wrapping_add(1);
        self.waiting += 1;
        if self.waiting < P::STRIDE {
            return None;
        }
        self.waiting = 0;
        self.append(posture);
        if self.window.len() < self.prediction_intervals {
            return None;
        }
        Some(self.update(measured))
    }

    /// Creates an empty posture sample. Kept out of line, since it is built on the stack first.
    #[cold]
    #[inline(never)]
    fn make_room(&mut self) {
        self.sample = Some(PostureSample::blank());
    }

    /// Appends the interval from the last posture to this one to the window.
    ///
    /// Not inlined, so that its stack frame does not add to that of the update.
    #[inline(never)]
    fn append(&mut self, posture: &Posture<T>) {
        if self.sample.is_none() {
            self.make_room();
        }
        let Some(sample) = &mut self.sample else {
            return;
        };
        let dynamics = &self.dynamics;
        let good = posture.is_valid();
        self.faults.posture |= !good;
        let next = if good { posture } else { &self.posture };
        dynamics.between_into(&self.posture, next, self.duration, sample);
        if good {
            self.posture = *posture;
        }
        let velocity = self.front.motion(sample).velocity_inertial();
        let through_air = velocity - dynamics.air.velocity;
        let velocity = self.front.inertial_from_body.inverse() * through_air;
        let interval = P::keep(dynamics, sample, &velocity);
        let inputs = inputs_of_filter(self.filter.state());
        self.front = dynamics.step(&self.front, sample, &inputs, self.duration);
        // There is room, because every update shortens the window.
        let _ = self.window.push_back(interval);
    }

    /// Prediction, update and solution step, paper "The Modified Unscented Kalman Filter".
    #[inline(never)]
    fn update(&mut self, measured: &Measurement<T>) -> Estimate<T> {
        let dynamics = &self.dynamics;
        let window = Window {
            dynamics,
            intervals: &self.window,
            duration: self.duration,
            density: dynamics.density_at(&self.skydiver),
        };
        let points = self.filter.sigma_points();
        let (moments, front) =
            P::predict(&self.filter, &points, &self.skydiver, &window, &self.model);
        let usable = self.model.usable(measured);
        let observation = self.model.vector(measured);
        let difference = self.model.difference(&observation, &moments.prediction);
        let before = *self.filter.state();
        let innovation = self
            .filter
            .update(&moments, &difference, &self.noise, &usable);
        let check = Check {
            model: &self.model,
            observation: &observation,
            noise: &self.noise,
            usable: &usable,
            before: &before,
            innovation: &innovation,
            mean_normalised_innovation: self.mean_normalised_innovation,
        };
        let front = P::settle(&check, &mut self.filter, &self.skydiver, &window, front);

        let inputs = inputs_of_filter(self.filter.state());
        let mut skydiver = self.skydiver;
        let mut motion = None;
        for interval in self.window.iter().take(self.solution_intervals) {
            skydiver = window.step(&skydiver, interval, &inputs);
            motion = Some(interval);
        }
        let held = !skydiver.is_finite();
        if held {
            skydiver = self.skydiver;
        }
        let motion = match motion {
            Some(interval) => {
                self.faults.motion |= limit(&mut skydiver, interval) || held;
                skydiver.motion(interval)
            }
            None => Motion {
                inertial_from_body: skydiver.inertial_from_body,
                position: skydiver.cg_position,
                velocity: Vector::zero(),
                angular_velocity: Vector::zero(),
            },
        };
        self.skydiver = skydiver;
        self.front = if front.is_finite() { front } else { skydiver };
        for _ in 0..self.solution_intervals {
            let _ = self.window.pop_front();
        }
        let expected = self.model.channels.map(|channel| channel.is_some());
        self.faults.measurement |= usable != expected;
        self.faults.update |= !innovation.fused && usable.contains(&true);
        self.faults.covariance |= innovation.repaired;
        self.updates = self.updates.wrapping_add(1);
        self.publish(
            motion,
            &observation,
            &moments.prediction,
            &usable,
            &innovation,
        )
    }

    fn publish(
        &mut self,
        motion: Motion<T>,
        observation: &SVector<T, CHANNELS>,
        prediction: &SVector<T, CHANNELS>,
        usable: &[bool; CHANNELS],
        innovation: &Innovation<T, CHANNELS>,
    ) -> Estimate<T> {
        let gate = T::of(TEST_RATIO_GATE * TEST_RATIO_GATE);
        let mut used = T::zero();
        let channels = core::array::from_fn(|k| {
            let fused = innovation.fused && usable[k];
            if fused {
                used += T::one();
            }
            let (value, variance) = (innovation.innovation[k], innovation.covariance[(k, k)]);
            Channel {
                quantity: self.model.channels[k].map(|(quantity, _)| quantity),
                observation: observation[k],
                predicted: prediction[k],
                innovation: value,
                variance,
                test_ratio: value * value / (gate * variance),
                fused,
            }
        });
        let interval = self.duration * T::of(f64::from(count(self.solution_intervals)));
        if innovation.fused {
            // The mean covers about one second.
            let mean = innovation.normalised_square / used;
            let share = if interval < T::one() {
                interval
            } else {
                T::one()
            };
            self.mean_normalised_innovation += (mean - self.mean_normalised_innovation) * share;
        }
        let health = if !innovation.fused {
            Health::Failing
        } else if T::of(f64::from(self.updates)) * interval < T::one() {
            Health::Settling
        } else if self.mean_normalised_innovation > T::of(INCONSISTENT) {
            Health::Inconsistent
        } else {
            Health::Good
        };
        let window = count(self.prediction_window());
        let sample = self.samples.wrapping_sub(window);
        let state = in_other_order(self.filter.state());
        Estimate {
            sample,
            inputs: inputs_of(&state),
            state,
            deviation: in_other_order(&self.filter.covariance().diagonal()).map(Lanes::root),
            solved_sample: sample.wrapping_add(count(self.solution_intervals * P::STRIDE)),
            motion,
            reconstructed: Measurement::of(&motion),
            channels,
            innovation_covariance: innovation.covariance,
            normalised_innovation: innovation.normalised_square,
            mean_normalised_innovation: self.mean_normalised_innovation,
            health,
            faults: core::mem::take(&mut self.faults),
        }
    }
}

/// State of a skydiver with this motion.
fn start<T: Real>(
    dynamics: &Dynamics<T>,
    motion: &Motion<T>,
    posture: &Posture<T>,
) -> Result<State<T>, SettingsError> {
    let state = State::from_motion(motion, &dynamics.hold(posture));
    if posture.is_valid() && state.is_finite() {
        Ok(state)
    } else {
        Err(SettingsError::Start)
    }
}

/// Converts a number of samples to `u32`, saturating.
fn count(samples: usize) -> u32 {
    u32::try_from(samples).unwrap_or(u32::MAX)
}
