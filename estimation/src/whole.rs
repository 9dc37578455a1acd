//! The whole flight as one problem: finds the trajectory, inputs and joint errors that make the measurements most
//! likely.
//!
//! Gauss-Newton iteration: the problem is linearized about a trajectory, initially the filter's, and solved by the
//! [smoother](super::smoother). Postures are corrected by the joint errors found, the trajectory moves to the solution,
//! and the next iteration starts. Between iterations the assumed noise adapts to the flight, within bounds, and axes
//! become active where quiet input does not suffice.

use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::dynamics::interval::Interval;
use bodyflight_core::dynamics::muscle_input::MuscleModel;
use bodyflight_core::dynamics::{Dynamics, Motion, PostureSample};
use bodyflight_core::estimator::motion::measurement::{
    CHANNELS, MotionMeasurement, Noise, Prediction,
};
use bodyflight_core::estimator::motion::posture_error::load;
use bodyflight_core::estimator::motion::process::Process;
use bodyflight_core::estimator::motion::repeats::{BELIEVED, Repeats};
use bodyflight_core::estimator::motion::settings::MotionPreset;
use bodyflight_core::estimator::motion::state::{
    Difference, FlightState, INPUT_STATES, MUSCLE, input_vector,
};
use bodyflight_core::estimator::motion::transition::{self, MotionSlope};
use bodyflight_core::estimator::unscented::SettingsError;
use bodyflight_core::{Posture, SegmentArray};
use nalgebra::Vector3;

use crate::assumed::Assumed;
use crate::constants::{Constants, Found};
use crate::joints::{DIRECTIONS, Directions, JointDirections};
use crate::size::{Size, Sizes};
use crate::smoother::{Pass, Score, Smoothed};
use bodyflight_io::diagnostic::Result;
use bodyflight_io::progress;

/// Samples per interval: steps of 1/120 s are fine enough, at half the cost.
pub const STRIDE: usize = 2;

/// Least and largest number of iterations. The second reaches the sensor noise; two more settle the assumed noise and the
/// active axes, and the size of the joint errors. The errors themselves take longer, the more so the larger they are.
const ITERATIONS: [usize; 2] = [4, 12];

/// Largest step of a joint error, in its standard deviations, at which the iteration has reached it.
const SETTLED: f64 = 0.5;

/// Wander of the joints (deg) above which their errors are not constant, so that a filter that forgets them is better.
/// Its estimate is below 0.13 on synthetic flights with constant errors, and above 0.7 if they wander by 1 degree.
const STAYS: f32 = 0.25;

/// Factor on the deviations, for the errors of linearization and of the choice of noise.
const CAUTION: f64 = 1.25;

/// An instant of the flight.
#[derive(Debug, Clone)]
pub struct Sample {
    /// Time since the start (s).
    pub time: f64,
    /// Posture as recorded.
    pub posture: Posture<f64>,
    /// Motion as measured.
    pub motion: Motion<f64>,
    /// Limbs that act.
    pub muscles: MuscleModel,
    /// How actively each axis is controlled, 0 to 1.
    pub activity: [f64; 3],
}

/// A flight as one problem.
pub struct Whole {
    dynamics: Dynamics<f64>,
    /// Known loads.
    applied: AppliedLoads<f64>,
    samples: Vec<Sample>,
    directions: JointDirections,
    /// States at the start and at the end of each interval.
    trajectory: Vec<FlightState<f64>>,
    /// Joint errors for which postures are corrected (rad, along the directions).
    errors: Directions,
    assumed: Assumed,
}

/// The solution at an instant.
#[derive(Debug, Clone, Copy)]
pub struct Known {
    /// Motion and inputs.
    pub state: FlightState<f64>,
    /// Motion of the pelvis.
    pub motion: Motion<f64>,
    /// Standard deviations.
    pub deviation: Difference<f64>,
}

/// The solution for a whole flight.
#[derive(Debug, Clone)]
pub struct Solution {
    /// At the start and at the end of each interval.
    pub known: Vec<Known>,
    /// Size of the joint errors.
    pub size: Size,
}

/// A forward pass over a flight.
struct Flown {
    pass: Pass,
    process: Process<f64>,
    intervals: Vec<PostureSample<f64>>,
}

impl Whole {
    /// Takes the possible sizes of the joint errors, the errors of segments as multiples of that size, if there are any, the
    /// samples of a flight, beginning with the start, and the filter's states at the end of each interval.
    pub fn new(
        preset: &MotionPreset,
        sizes: Sizes,
        (dynamics, applied): (&Dynamics<f64>, &AppliedLoads<f64>),
        segments: Option<SegmentArray<f64>>,
        samples: Vec<Sample>,
        states: &[FlightState<f64>],
    ) -> Self {
        let flight = samples
            .iter()
            .map(|sample| (&sample.posture, &sample.motion));
        let directions = JointDirections::new(dynamics, segments, flight);
        let mut trajectory = Vec::with_capacity(states.len() + 1);
        if let (Some(first), Some(sample)) = (states.first(), samples.first()) {
            let motion = bodyflight_core::dynamics::State::from_motion(
                &sample.motion,
                &dynamics.hold(&sample.posture),
            );
            trajectory.push(FlightState { motion, ..*first });
        }
        trajectory.extend(states.iter().take(samples.len().saturating_sub(1) / STRIDE));
        Self {
            dynamics: *dynamics,
            applied: *applied,
            samples,
            directions,
            trajectory,
            errors: Directions::zeros(),
            assumed: Assumed::of(preset, sizes),
        }
    }

    /// Solves for the start and the end of each interval; `None` if there is no solution, if joint errors wander, or if they
    /// do not settle, because they are too large for the loads to be linear in them.
    ///
    /// # Errors
    /// Returns an error if the program is interrupted.
    pub fn solve(mut self) -> Result<Option<Solution>> {
        let [least, most] = ITERATIONS;
        for iteration in 1..=most {
            progress::stage(format!("smoothing, pass {iteration}"));
            let Some((mut solution, step)) = self.iterate()? else {
                return Ok(None);
            };
            if iteration >= least && step < SETTLED {
                self.load_by_joints(&mut solution.known);
                return Ok(Some(solution));
            }
        }
        Ok(None)
    }

    /// The size of the joint errors, which settles before they do; `None` if there is no solution or if they wander.
    ///
    /// # Errors
    /// Returns an error if the program is interrupted.
    pub fn size(mut self) -> Result<Option<Size>> {
        let mut size = None;
        let [passes, _] = ITERATIONS;
        for iteration in 1..=passes {
            progress::stage(format!("smoothing, pass {iteration} of {passes}"));
            let Some((solution, _)) = self.iterate()? else {
                return Ok(None);
            };
            size = Some(solution.size);
        }
        Ok(size)
    }

    /// The constants after a forward pass, as differences from their present values; `None` without a solution.
    fn constants(&self, flown: &Flown) -> Option<Found> {
        let mut expected = Constants::zeros();
        expected
            .fixed_rows_mut::<DIRECTIONS>(0)
            .copy_from(&-self.errors);
        let Assumed { sizes, offsets, .. } = &self.assumed;
        let information = flown.pass.information();
        information.constants(&expected, sizes, offsets)
    }

    /// Moves trajectory, joint errors and assumptions to the solution of the linearized problem, and returns it with the
    /// largest step of a joint error, in its standard deviations; `None` if there is none or if joint errors wander.
    fn iterate(&mut self) -> Result<Option<(Solution, f64)>> {
        let Ok(flown) = self.fly()? else {
            return Ok(None);
        };
        let Some(found) = self.constants(&flown) else {
            return Ok(None);
        };
        let (smoothed, scores) = flown.pass.smoothed(&found);
        let Some(known) = self.moved(&flown.process, &smoothed, &flown.intervals) else {
            return Ok(None);
        };
        self.trajectory = known.iter().map(|known| known.state).collect();
        self.errors += found.errors.fixed_rows::<DIRECTIONS>(0);
        self.wake(&scores.each);
        self.assumed.follow(&scores);
        let variances = found.covariance.diagonal();
        let steps = found.errors.iter().zip(&variances).take(DIRECTIONS);
        let steps = steps.map(|(step, variance)| step.abs() / variance.sqrt());
        let step = steps.fold(0.0, f64::max);
        let size = found.size;
        let stays = self.assumed.preset.joint_error <= STAYS.to_radians();
        Ok(stays.then_some((Solution { known, size }, step)))
    }

    /// Adds the effect of the joint errors to the residual load, so that recorded postures act like corrected ones.
    fn load_by_joints(&self, known: &mut [Known]) {
        let mut place = PostureSample::blank();
        let samples = self.samples.iter().step_by(STRIDE);
        for (known, sample) in known.iter_mut().zip(samples) {
            let motion = known.motion;
            let mut load = |posture| load(&self.dynamics, posture, &motion, &mut place);
            let corrected = self.directions.corrected(&sample.posture, &self.errors);
            let difference = load(&corrected) - load(&sample.posture);
            let residual = &mut known.state.inputs.residual;
            residual.force.components += difference.fixed_rows::<3>(0);
            residual.moment.components += difference.fixed_rows::<3>(3);
        }
    }

    /// The trajectory moved to a solution; `None` if that is not finite.
    fn moved(
        &self,
        process: &Process<f64>,
        smoothed: &[Smoothed],
        intervals: &[PostureSample<f64>],
    ) -> Option<Vec<Known>> {
        let states = self.trajectory.iter().zip(smoothed).zip(intervals);
        let samples = self.samples.iter().step_by(STRIDE);
        states
            .zip(samples)
            .map(|(((state, smoothed), interval), sample)| {
                let mut state = state.moved(&smoothed.correction, interval);
                state.limit_inputs();
                let finite = state.is_finite() && smoothed.deviation.iter().all(|d| d.is_finite());
                finite.then(|| Known {
                    motion: state.motion.motion(interval),
                    state,
                    deviation: stated(process, &smoothed.deviation, &sample.activity),
                })
            })
            .collect()
    }

    /// Runs the forward pass along the trajectory.
    fn fly(&self) -> Result<core::result::Result<Flown, SettingsError>> {
        let preset = &self.assumed.preset;
        let duration = preset.duration::<f64>(STRIDE);
        let mut process = match Process::<f64>::new(preset, duration) {
            Ok(process) => process,
            Err(error) => return Ok(Err(error)),
        };
        let noise = preset.noise.of::<f64>();
        let gate = f64::from(preset.gate);
        let (Some(start), Some(first)) = (self.trajectory.first(), self.samples.first()) else {
            return Ok(Err(SettingsError::Start));
        };
        process.set_sensitivity(&self.directions.covariance(0));
        // The start itself is measured: before that, almost nothing is known about its motion.
        let mut pass = Pass::new(
            &process.start(&times(&noise, 10.0)),
            &ahead(&process, start),
        );
        let mut dynamics = self.dynamics;
        let mut sample = PostureSample::blank();
        let mut slope = MotionSlope::zeros();
        let mut repeats = Repeats::new();
        let mut posture = self.directions.corrected(&first.posture, &self.errors);
        dynamics.sample_into(&posture, &PostureRate::zero(), &mut sample);
        measure(&mut pass, start, &sample, first, &repeats, &noise, gate);
        let mut intervals = vec![sample];
        for (k, pair) in self.trajectory.windows(2).enumerate() {
            let index = (k + 1) * STRIDE;
            let ([from, to], Some(end)) = (pair, self.samples.get(index)) else {
                break;
            };
            let mut pushed = *from;
            let middle = end.time - 0.5 * duration;
            let body = (&posture, &sample);
            self.applied
                .push(&dynamics, &mut pushed.motion, body, middle, duration);
            dynamics.muscles = end.muscles;
            let next = self.directions.corrected(&end.posture, &self.errors);
            dynamics.between_into(&posture, &next, duration, &mut sample);
            posture = next;
            process.set_sensitivity(&self.directions.covariance(index));
            process.set_turn(turn_rate(&dynamics, &from.motion.motion(&sample)) * duration);
            process.set_activity(end.activity);
            let flown = transition::fly(
                &dynamics, &sample, &process, &pushed, None, duration, &mut slope,
            );
            let gap = to.difference(&flown, &sample);
            pass.cross(&slope, &process, &gap, &self.directions.at(index));
            repeats.take(&MotionMeasurement::of(&end.motion), duration);
            measure(&mut pass, to, &sample, end, &repeats, &noise, gate);
            intervals.push(sample);
            if k.is_multiple_of(256) {
                progress::reached(k, self.trajectory.len())?;
            }
        }
        Ok(Ok(Flown {
            pass,
            process,
            intervals,
        }))
    }

    /// Marks axes as active where, for a tenth of a second, measurements require more than quiet input.
    fn wake(&mut self, each: &[[Score; 6]]) {
        /// Time on either side of an interval over which its scores are pooled, and time on either side of a pooled
        /// score above `LIMIT` that becomes active (s).
        const BESIDE: [f64; 2] = [0.05, 0.1];
        /// Ratio of the mean square to its expectation above which an axis becomes active; chance exceeds it less than
        /// once in a flight.
        const LIMIT: f64 = 6.0;
        let around = |index: usize, beside: usize, length: usize| {
            index.saturating_sub(beside)..(index + beside + 1).min(length)
        };
        let duration = self.assumed.preset.duration::<f64>(STRIDE);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "only a few intervals"
        )]
        let beside = BESIDE.map(|time| (time / duration).round().max(1.0) as usize);
        for axis in 0..3 {
            let asks = |index: usize| {
                let near = &each[around(index, beside[0], each.len())];
                [axis, axis + 3].into_iter().any(|k| {
                    let all = near
                        .iter()
                        .fold(Score::default(), |all, score| all.joined(&score[k]));
                    all.factor() > LIMIT
                })
            };
            let asking: Vec<bool> = (0..each.len()).map(asks).collect();
            for index in 0..each.len() {
                let wakes = asking[around(index, beside[1], each.len())].contains(&true);
                if let (true, Some(sample)) = (wakes, self.samples.get_mut(index * STRIDE)) {
                    sample.activity[axis] = 1.0;
                }
            }
        }
    }
}

/// Deviations to report, from those of the linear problem.
fn stated(
    process: &Process<f64>,
    deviation: &Difference<f64>,
    activity: &[f64; 3],
) -> Difference<f64> {
    let mut stated = deviation * CAUTION;
    for (axis, activity) in activity.iter().enumerate() {
        let known = deviation[MUSCLE + axis] * deviation[MUSCLE + axis];
        stated[MUSCLE + axis] =
            stated[MUSCLE + axis].hypot(process.unnoticed(axis, known, *activity).sqrt());
    }
    stated
}

/// Difference of the process's mean inputs from those of the trajectory at its start.
fn ahead(process: &Process<f64>, start: &FlightState<f64>) -> Difference<f64> {
    let mut ahead = Difference::zeros();
    ahead
        .fixed_rows_mut::<INPUT_STATES>(MUSCLE)
        .copy_from(&(process.centre() - input_vector(&start.inputs)));
    ahead
}

/// Updates with the measurements at an instant of the trajectory.
fn measure(
    pass: &mut Pass,
    state: &FlightState<f64>,
    interval: &impl Interval<f64>,
    sample: &Sample,
    repeats: &Repeats<f64>,
    noise: &Noise<f64>,
    gate: f64,
) {
    let prediction = Prediction::of(state, interval);
    let measured = MotionMeasurement::of(&sample.motion).into();
    for channel in 0..CHANNELS {
        if repeats.time(channel) > f64::from(BELIEVED) {
            continue;
        }
        if let Some(row) = prediction.row(channel, &measured) {
            let spin = &prediction.motion.angular_velocity.components;
            pass.take(&row, noise.variance(channel, spin), gate);
        }
    }
    pass.settle();
}

/// How fast the airflow rotates about the body (rad/s).
fn turn_rate(dynamics: &Dynamics<f64>, motion: &Motion<f64>) -> f64 {
    let velocity = through_air(dynamics, motion);
    let across = motion.angular_velocity.components.cross(&velocity).norm();
    let rate = across / velocity.norm();
    if rate.is_finite() { rate } else { 0.0 }
}

/// Velocity through the air (m/s, body axes).
fn through_air(dynamics: &Dynamics<f64>, motion: &Motion<f64>) -> Vector3<f64> {
    let air = dynamics.air.velocity_at(&motion.position);
    (motion.velocity - motion.inertial_from_body.inverse() * air).components
}

fn times(noise: &Noise<f64>, factor: f64) -> Noise<f64> {
    Noise {
        attitude: noise.attitude * factor,
        angular_velocity: noise.angular_velocity * factor,
        horizontal_velocity: noise.horizontal_velocity * factor,
        vertical_velocity: noise.vertical_velocity * factor,
        horizontal_speed: noise.horizontal_speed * factor,
    }
}
