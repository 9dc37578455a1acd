//! The forward pass over a flight along a trajectory, and the backward pass over the same intervals.
//!
//! The backward pass needs all that the forward pass found in each interval, 27 kB. Of a long flight it is kept for one
//! block of intervals at a time: of the others only where the forward pass was at their beginning, from where it is flown
//! again, with the same bits.

use bodyflight_core::Posture;
use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::dynamics::interval::Interval;
use bodyflight_core::dynamics::muscle_input::MuscleModel;
use bodyflight_core::dynamics::{Dynamics, Motion, PostureSample};
use bodyflight_core::estimator::motion::measurement::{
    CHANNELS, MotionMeasurement, Noise, Prediction,
};
use bodyflight_core::estimator::motion::process::Process;
use bodyflight_core::estimator::motion::repeats::{BELIEVED, Repeats};
use bodyflight_core::estimator::motion::settings::MotionPreset;
use bodyflight_core::estimator::motion::state::{
    Difference, FlightState, INPUT_STATES, MOTION_STATES, MUSCLE, RESIDUAL_MOMENT, input_vector,
};
use bodyflight_core::estimator::motion::transition::{self, MotionSlope};
use bodyflight_core::estimator::unscented::SettingsError;
use bodyflight_core::frame::Vector;
use nalgebra::Vector3;

use crate::constants::Found;
use crate::joints::{Directions, JointDirections};
use crate::smoother::backward::{Backward, Scores, Smoothed};
use crate::smoother::{Damped, Pass};
use bodyflight_io::diagnostic::Result;
use bodyflight_io::{interrupt, progress};

/// Samples per interval: steps of 1/120 s are fine enough, at half the cost.
pub const STRIDE: usize = 2;

/// Intervals in a block: a minute of flight and some seconds, so that no flight of a minute is flown twice.
pub(crate) const BLOCK: usize = 8192;

/// An instant of the flight.
#[derive(Debug, Clone)]
pub struct Sample<'a> {
    /// Time since the start (s).
    pub time: f64,
    /// Posture as recorded.
    pub posture: &'a Posture<f64>,
    /// Motion as measured.
    pub motion: &'a Motion<f64>,
    /// Limbs that act.
    pub muscles: MuscleModel,
    /// How actively each axis is controlled, 0 to 1.
    pub activity: [f64; 3],
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

/// A flight, and the trajectory about which its problem is linearized.
pub(crate) struct Course<'a> {
    pub(crate) dynamics: Dynamics<f64>,
    /// Known loads.
    pub(crate) applied: AppliedLoads<f64>,
    pub(crate) samples: Vec<Sample<'a>>,
    pub(crate) directions: JointDirections,
    /// States at the start and at the end of each interval.
    pub(crate) trajectory: Vec<FlightState<f64>>,
    /// Joint errors for which postures are corrected (rad, along the directions).
    pub(crate) errors: Directions,
    /// What pulls the damping at the start and at the end of each interval, from the last iteration; empty before.
    pub(crate) pulls: Vec<[f64; 3]>,
    /// Number of intervals whose results are kept at a time.
    pub(crate) block: usize,
}

impl Course<'_> {
    /// A posture corrected by the joint errors.
    pub(crate) fn corrected(&self, posture: &Posture<f64>) -> Posture<f64> {
        self.directions.corrected(posture, &self.errors)
    }

    /// The trajectory at some intervals moved to a solution; `None` if that is not finite. All begin with the interval
    /// `first`, but `smoothed` is in the opposite order.
    fn moved(
        &self,
        process: &Process<f64>,
        first: usize,
        smoothed: &[Smoothed],
        intervals: &[PostureSample<f64>],
    ) -> Option<Vec<Known>> {
        let states = self.trajectory.iter().skip(first);
        let samples = self.samples.iter().step_by(STRIDE).skip(first);
        let found = smoothed.iter().rev().zip(intervals);
        states
            .zip(found)
            .zip(samples)
            .map(|((state, (smoothed, interval)), sample)| {
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
}

/// A forward pass at the end of an interval, with the intervals of its block.
#[derive(Clone)]
struct Forward<'a> {
    course: &'a Course<'a>,
    noise: Noise<f64>,
    gate: f64,
    duration: f64,
    process: Process<f64>,
    dynamics: Dynamics<f64>,
    repeats: Repeats<f64>,
    /// The posture at the end of the interval, corrected.
    posture: Posture<f64>,
    sample: PostureSample<f64>,
    pass: Pass,
    /// Index of the first of `intervals`; the start is number 0.
    first: usize,
    intervals: Vec<PostureSample<f64>>,
}

impl<'a> Forward<'a> {
    /// At the start of a flight.
    fn new(
        course: &'a Course<'a>,
        preset: &MotionPreset,
    ) -> core::result::Result<Self, SettingsError> {
        let duration = preset.duration::<f64>(STRIDE);
        let mut process = Process::<f64>::new(preset, duration)?;
        let noise = preset.noise.of::<f64>();
        let (Some(start), Some(first)) = (course.trajectory.first(), course.samples.first()) else {
            return Err(SettingsError::Start);
        };
        process.set_sensitivity(&course.directions.covariance(0));
        // The start itself is measured: before that, almost nothing is known about its motion.
        let pass = Pass::new(&process.start(&noise.scaled(10.0)), &ahead(&process, start));
        let posture = course.corrected(first.posture);
        let mut sample = PostureSample::blank();
        course
            .dynamics
            .sample_into(&posture, &PostureRate::zero(), &mut sample);
        let mut forward = Self {
            course,
            noise,
            gate: f64::from(preset.gate),
            duration,
            process,
            dynamics: course.dynamics,
            repeats: Repeats::new(),
            posture,
            sample,
            pass,
            first: 0,
            intervals: vec![sample],
        };
        forward.measure(0, start, first);
        Ok(forward)
    }

    /// Index of the next interval.
    fn next(&self) -> usize {
        self.first + self.intervals.len()
    }

    /// Crosses the next interval; false at the end of the flight.
    fn cross(&mut self) -> bool {
        let course = self.course;
        let next = self.next();
        let index = next * STRIDE;
        let (Some([from, to]), Some(end)) = (
            course.trajectory.get(next - 1..=next),
            course.samples.get(index),
        ) else {
            return false;
        };
        let duration = self.duration;
        let mut pushed = *from;
        let middle = end.time - 0.5 * duration;
        let body = (&self.posture, &self.sample);
        course
            .applied
            .push(&self.dynamics, &mut pushed.motion, body, middle, duration);
        self.dynamics.muscles = end.muscles;
        let posture = course.corrected(end.posture);
        let (dynamics, process) = (&self.dynamics, &mut self.process);
        dynamics.between_into(&self.posture, &posture, duration, &mut self.sample);
        self.posture = posture;
        let sample = &self.sample;
        process.set_sensitivity(&course.directions.covariance(index));
        process.set_turn(turn_rate(dynamics, &from.motion.motion(sample)) * duration);
        process.set_activity(end.activity);
        let mut slope = MotionSlope::zeros();
        let flown = transition::fly(
            dynamics, sample, process, &pushed, None, duration, &mut slope,
        );
        let gap = to.difference(&flown, sample);
        let loads = course.directions.at(index);
        let damped = damped(dynamics, sample, &from.motion.motion(sample), &slope);
        self.pass.cross(&slope, process, &gap, &loads, &damped);
        self.repeats
            .take(&MotionMeasurement::of(end.motion), duration);
        self.measure(next, to, end);
        self.intervals.push(self.sample);
        true
    }

    /// Updates with the measurements at the end of the interval `index`, where the trajectory has this state.
    fn measure(&mut self, index: usize, state: &FlightState<f64>, end: &Sample<'_>) {
        let prediction = Prediction::of(state, &self.sample);
        let measured = MotionMeasurement::of(end.motion).into();
        for channel in 0..CHANNELS {
            if self.repeats.time(channel) > f64::from(BELIEVED) {
                continue;
            }
            if let Some(row) = prediction.row(channel, &measured) {
                let spin = &prediction.motion.angular_velocity.components;
                let variance = self.noise.variance(channel, spin);
                self.pass.take(&row, variance, self.gate);
            }
        }
        if let Some(pull) = self.course.pulls.get(index) {
            self.pass.pull(*pull);
        }
        self.pass.settle();
    }

    /// Begins a new block at the next interval.
    fn forget(&mut self) {
        self.first = self.next();
        self.intervals.clear();
        self.pass.forget();
    }
}

/// A forward pass over a whole flight.
pub(crate) struct Flown<'a> {
    /// At the beginning of each block but the last.
    blocks: Vec<Forward<'a>>,
    /// At the end, with the intervals of the last block.
    end: Forward<'a>,
}

impl<'a> Flown<'a> {
    /// Runs the forward pass along a trajectory.
    pub(crate) fn along(
        course: &'a Course<'a>,
        preset: &MotionPreset,
    ) -> Result<core::result::Result<Self, SettingsError>> {
        let mut end = match Forward::new(course, preset) {
            Ok(start) => start,
            Err(error) => return Ok(Err(error)),
        };
        let mut blocks = Vec::new();
        let mut begin = end.clone();
        loop {
            if end.intervals.len() == course.block {
                blocks.push(begin);
                end.forget();
                begin = end.clone();
            }
            if !end.cross() {
                break;
            }
            if end.next().is_multiple_of(256) {
                progress::reached(end.next(), course.trajectory.len())?;
            }
        }
        Ok(Ok(Self { blocks, end }))
    }

    /// The pass, whose intervals are those of the last block.
    pub(crate) fn pass(&self) -> &Pass {
        &self.end.pass
    }

    /// Runs backward over the flight: the trajectory moved to the solution, at the start and at the end of each interval,
    /// and scores of the noises; `None` if the solution is not finite.
    pub(crate) fn smoothed(self, constants: &Found) -> Result<Option<(Vec<Known>, Scores)>> {
        let process = self.end.process;
        let mut backward = Backward::new(constants);
        let mut parts = Vec::with_capacity(self.blocks.len() + 1);
        let mut over = |block: &Forward<'_>| {
            let smoothed = backward.over(&block.pass);
            let (first, intervals) = (block.first, &block.intervals);
            let known = block.course.moved(&process, first, &smoothed, intervals);
            known.map(|known| parts.push(known)).is_some()
        };
        let mut is_finite = over(&self.end);
        drop(self.end);
        for mut block in self.blocks.into_iter().rev() {
            while is_finite && block.intervals.len() < block.course.block && block.cross() {
                if block.next().is_multiple_of(256) {
                    interrupt::check()?;
                }
            }
            is_finite = is_finite && over(&block);
        }
        let scores = backward.scores();
        let known = parts.into_iter().rev().flatten().collect();
        Ok(is_finite.then_some((known, scores)))
    }
}

/// Deviations to report: those of the linear problem, and of muscle input also what may go unnoticed.
fn stated(
    process: &Process<f64>,
    deviation: &Difference<f64>,
    activity: &[f64; 3],
) -> Difference<f64> {
    let mut stated = *deviation;
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

/// Change of the motion over an interval by each damping coefficient, per angular velocity about its axis; `slope` has the
/// change by a moment.
fn damped(
    dynamics: &Dynamics<f64>,
    interval: &PostureSample<f64>,
    motion: &Motion<f64>,
    slope: &MotionSlope<f64>,
) -> Damped {
    let velocity = Vector::from_components(through_air(dynamics, motion));
    let density = dynamics.air.density.at(motion.position.up());
    let loads = interval.unit_loads(dynamics, &velocity, &motion.angular_velocity, density);
    let pressure = 0.5 * density * velocity.norm_squared();
    let by_moments = slope.fixed_view::<MOTION_STATES, 3>(0, RESIDUAL_MOMENT);
    by_moments * (-loads.damping / pressure)
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
