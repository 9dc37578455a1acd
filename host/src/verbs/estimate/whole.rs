//! The whole flight as one problem: the trajectory, the inputs and the joint errors under which all that was measured is
//! likeliest.
//!
//! Gauss-Newton: the problem is linearized about a trajectory, at first the filter's, and solved by the
//! [smoother](super::smoother); postures are corrected by the joint errors that it finds, the trajectory moves to its
//! solution, and once more. Between iterations the assumed noise follows what the flight says of it, within bounds, and
//! axes wake up where quiet input does not do.

use bodyflight_core::Posture;
use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::dynamics::interval::Interval;
use bodyflight_core::dynamics::muscle_input::MuscleModel;
use bodyflight_core::dynamics::{Dynamics, Motion, PostureSample};
use bodyflight_core::estimator::motion::measurement::{
    CHANNELS, MotionMeasurement, Noise, Prediction,
};
use bodyflight_core::estimator::motion::posture_error::load;
use bodyflight_core::estimator::motion::repeats::{BELIEVED, Repeats};
use bodyflight_core::estimator::motion::settings::{MotionPreset, Process};
use bodyflight_core::estimator::motion::state::{
    Difference, FlightState, INPUT_STATES, MUSCLE, input_vector,
};
use bodyflight_core::estimator::motion::transition::{self, MotionSlope};
use bodyflight_core::estimator::unscented::SettingsError;
use nalgebra::Vector3;

use super::assumed::Assumed;
use super::joints::{DIRECTIONS, Directions, JointDirections};
use super::smoother::{Constants, Pass, Score, Smoothed};
use crate::diagnostic::Result;
use crate::progress;

/// Samples of an interval: steps of 1/120 s are fine enough, and half the work.
pub const STRIDE: usize = 2;

/// Iterations. The second meets the sensors' noise; the others settle noise and awake axes.
const ITERATIONS: usize = 4;

/// Wander of the joints (deg) above which their errors do not stay, and a filter that forgets them does better: it comes out
/// below 0.13 on synthetic flights with constant errors, above 0.7 where they wander by 1 degree.
const STAYS: f32 = 0.25;

/// Share of the deviations that linearization and the choice of noise leave out.
const CAUTION: f64 = 1.25;

/// An instant as the problem takes it.
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
    /// How much each axis is moved on purpose, 0 to 1.
    pub activity: [f64; 3],
}

/// A flight as one problem.
pub struct Whole {
    dynamics: Dynamics<f64>,
    /// Loads that are known.
    applied: AppliedLoads<f64>,
    samples: Vec<Sample>,
    directions: JointDirections,
    /// The start, and the end of each interval.
    trajectory: Vec<FlightState<f64>>,
    /// Errors of the joints that postures are corrected by (rad, along the directions).
    errors: Directions,
    assumed: Assumed,
}

/// What is known of an instant.
#[derive(Debug, Clone, Copy)]
pub struct Known {
    /// Motion and inputs.
    pub state: FlightState<f64>,
    /// Motion of the pelvis.
    pub motion: Motion<f64>,
    /// Standard deviations.
    pub deviation: Difference<f64>,
}

/// The way forward over a flight.
struct Flown {
    pass: Pass,
    process: Process<f64>,
    intervals: Vec<PostureSample<f64>>,
}

impl Whole {
    /// Of the samples of a flight, the first being the start, and of the filter's states at the end of each interval.
    pub fn new(
        preset: &MotionPreset,
        (dynamics, applied): (&Dynamics<f64>, &AppliedLoads<f64>),
        samples: Vec<Sample>,
        states: &[FlightState<f64>],
    ) -> Self {
        let flight = samples
            .iter()
            .map(|sample| (&sample.posture, &sample.motion));
        let directions = JointDirections::new(dynamics, flight);
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
            assumed: Assumed::of(preset),
        }
    }

    /// What the whole flight says of the start and of the end of each interval; nothing where it cannot be solved, or where
    /// joint errors wander.
    ///
    /// # Errors
    /// Returns an error where the program was interrupted.
    pub fn solve(mut self) -> Result<Vec<Known>> {
        let mut known = Vec::new();
        for iteration in 1..=ITERATIONS {
            progress::stage(format!("smoothing, pass {iteration} of {ITERATIONS}"));
            let Ok(flown) = self.fly()? else {
                break;
            };
            let mut expected = Constants::zeros();
            expected
                .fixed_rows_mut::<DIRECTIONS>(0)
                .copy_from(&-self.errors);
            let found = flown.pass.constants(&expected, &self.assumed.deviations());
            let (smoothed, scores) = flown.pass.smoothed(&found);
            let Some(next) = self.moved(&flown.process, &smoothed, &flown.intervals) else {
                break;
            };
            self.trajectory = next.iter().map(|known| known.state).collect();
            self.errors += found.errors.fixed_rows::<DIRECTIONS>(0);
            self.wake(&scores.each);
            self.assumed.follow(&found, &scores, &self.errors);
            known = next;
            if self.assumed.preset.joint_error > STAYS.to_radians() {
                return Ok(Vec::new());
            }
        }
        self.load_by_joints(&mut known);
        Ok(known)
    }

    /// Adds to the residual load what the joints' errors do: postures as recorded then fly as the corrected ones.
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

    /// The trajectory moved to a solution; none where that is not finite.
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

    /// Goes forward along the trajectory.
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
        // The start itself is measured: before that, next to nothing is known of its motion.
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
            let flown =
                transition::fly(&dynamics, &sample, &process, &pushed, duration, &mut slope);
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

    /// Wakes axes up where for a tenth of a second what was measured asks for more than quiet input.
    fn wake(&mut self, each: &[[Score; 6]]) {
        /// Time on both sides that is looked at together, and that wakes up together (s).
        const BESIDE: [f64; 2] = [0.05, 0.1];
        /// Mean square, over what is expected, of which chance makes less than one in a flight.
        const LIMIT: f64 = 6.0;
        let around = |index: usize, beside: usize, length: usize| {
            index.saturating_sub(beside)..(index + beside + 1).min(length)
        };
        let duration = self.assumed.preset.duration::<f64>(STRIDE);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few intervals"
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

/// Deviations to state of those of the linear problem.
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

/// How far the process' mean of the inputs is from those of the trajectory at its start.
fn ahead(process: &Process<f64>, start: &FlightState<f64>) -> Difference<f64> {
    let mut ahead = Difference::zeros();
    ahead
        .fixed_rows_mut::<INPUT_STATES>(MUSCLE)
        .copy_from(&(process.centre() - input_vector(&start.inputs)));
    ahead
}

/// Takes in what was measured at an instant of the trajectory.
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
    let measured = MotionMeasurement::of(&sample.motion);
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

/// How fast the stream turns about the body (rad/s).
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
