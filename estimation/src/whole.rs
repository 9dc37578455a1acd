//! The whole flight as one problem: finds the trajectory, inputs and joint errors that make the measurements most
//! likely.
//!
//! Gauss-Newton iteration: the problem is linearized about a trajectory, initially the filter's, and solved by the
//! [smoother](super::smoother). Postures are corrected by the joint errors found, the trajectory moves to the solution,
//! and the next iteration starts. Between iterations the assumed noise adapts to the flight, within bounds, and axes
//! become active where quiet input does not suffice.

use bodyflight_core::SegmentArray;
use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::dynamics::{Dynamics, PostureSample};
use bodyflight_core::estimator::motion::posture_error::load;
use bodyflight_core::estimator::motion::settings::MotionPreset;
use bodyflight_core::estimator::motion::state::{FlightState, MUSCLE};

use crate::assumed::Assumed;
use crate::constants::{Constants, Found};
use crate::forward::{BLOCK, Course, Flown, Known, STRIDE, Sample};
use crate::joints::{DIRECTIONS, Directions, JointDirections};
use crate::size::{Size, Sizes};
use crate::smoother::Pass;
use crate::smoother::backward::Score;
use bodyflight_io::diagnostic::Result;
use bodyflight_io::progress;

/// Least and largest number of iterations. The second reaches the sensor noise; two more settle the assumed noise and the
/// active axes, and the size of the joint errors. The errors themselves take longer, the more so the larger they are.
const ITERATIONS: [usize; 2] = [4, 12];

/// Largest step of a joint error, in its standard deviations, at which the iteration has reached it.
const SETTLED: f64 = 0.5;

/// The same, at which the size of the joint errors has settled: it is the mean of two dozen of them.
const NEARLY_SETTLED: f64 = 2.0;

/// Wander of the joints (deg) above which their errors are not constant, so that a filter that forgets them is better.
/// Its estimate is below 0.13 on synthetic flights with constant errors, and above 0.7 if they wander by 1 degree.
const STAYS: f32 = 0.25;

/// Distance of the damping from its mean, in its prior deviations, from which on the solution is none: damping that explains
/// what joint errors do ends at its limits.
const IMPLAUSIBLE_DAMPING: f64 = 3.0;

/// Mean turn of the joint axes (rad) after which the loads of the joint errors are computed anew: a hundredth of a turn
/// changes them by some per cent.
const RENEWED: f64 = 0.01;

/// Growth of the variance of muscle input for each degree of the joint errors: what their loads leave that are taken as
/// linear. Chosen on 26 flights of the bench of error bars, seeds 601 and 602.
const NOT_LINEAR: f64 = 0.3;

/// A flight as one problem.
pub struct Whole<'a> {
    course: Course<'a>,
    assumed: Assumed,
    /// Joint errors about which the loads of the directions were computed.
    about: Directions,
    /// Deviations of the damping as found: its offset, the doubt about that, and how much it varies.
    damping: [f64; 3],
}

/// The solution for a whole flight.
#[derive(Debug, Clone)]
pub struct Solution {
    /// At the start and at the end of each interval.
    pub known: Vec<Known>,
    /// Size of the joint errors.
    pub size: Size,
}

impl Solution {
    /// Adds to the deviations what joint errors do that is not linear in them.
    fn doubt_linear_loads(&mut self) {
        let degrees = self.size.root_mean_square().to_degrees();
        for known in &mut self.known {
            let mut deviations = known.deviation.fixed_rows_mut::<3>(MUSCLE);
            deviations *= (1.0 + NOT_LINEAR * degrees).sqrt();
        }
    }
}

/// What a filter has to expect of a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// Size of the joint errors.
    pub size: Size,
    /// Standard deviations of the damping from the filter's mean.
    pub damping: [f64; 3],
}

impl<'a> Whole<'a> {
    /// Takes the possible sizes of the joint errors, the errors of segments as multiples of that size, if there are any, the
    /// samples of a flight, beginning with the start, and the filter's states at the end of each interval.
    pub fn new(
        preset: &MotionPreset,
        sizes: Sizes,
        (dynamics, applied): (&Dynamics<f64>, &AppliedLoads<f64>),
        segments: Option<SegmentArray<f64>>,
        samples: Vec<Sample<'a>>,
        states: &[FlightState<f64>],
    ) -> Self {
        let flight = samples.iter().map(|sample| (sample.posture, sample.motion));
        let directions = JointDirections::new(dynamics, segments, flight);
        let mut trajectory = Vec::with_capacity(states.len() + 1);
        if let (Some(first), Some(sample)) = (states.first(), samples.first()) {
            let motion = bodyflight_core::dynamics::State::from_motion(
                sample.motion,
                &dynamics.hold(sample.posture),
            );
            trajectory.push(FlightState { motion, ..*first });
        }
        trajectory.extend(states.iter().take(samples.len().saturating_sub(1) / STRIDE));
        Self {
            course: Course {
                dynamics: *dynamics,
                applied: *applied,
                samples,
                directions,
                trajectory,
                errors: Directions::zeros(),
                pulls: Vec::new(),
                block: BLOCK,
            },
            assumed: Assumed::of(preset, sizes),
            about: Directions::zeros(),
            damping: preset.damping_deviation.map(f64::from),
        }
    }

    /// Solves for the start and the end of each interval; `None` if there is no solution, if joint errors wander, if they do
    /// not settle, because they are too large for the loads to be linear in them, or if the damping is nobody's.
    ///
    /// # Errors
    /// Returns an error if the program is interrupted.
    pub fn solve(mut self) -> Result<Option<Solution>> {
        let Some((mut solution, true)) = self.until(SETTLED)? else {
            return Ok(None);
        };
        if self.damping_is_implausible() {
            return Ok(None);
        }
        self.load_by_joints(&mut solution.known);
        solution.doubt_linear_loads();
        Ok(Some(solution))
    }

    /// How much a filter has to expect; `None` if there is no solution, if joint errors wander, or if they do not settle.
    ///
    /// # Errors
    /// Returns an error if the program is interrupted.
    pub fn expected(mut self) -> Result<Option<Expected>> {
        let found = self.until(NEARLY_SETTLED)?;
        let found = found.filter(|(_, is_settled)| *is_settled);
        Ok(found.map(|(solution, _)| Expected {
            size: solution.size,
            damping: self.damping,
        }))
    }

    /// Iterates until the largest step of a joint error, in its standard deviations, is below `settled`; returns the last
    /// solution, and whether that happened. `None` if there is none or if joint errors wander.
    fn until(&mut self, settled: f64) -> Result<Option<(Solution, bool)>> {
        let [least, most] = ITERATIONS;
        let mut last = None;
        for iteration in 1..=most {
            progress::stage(format!("smoothing, pass {iteration} of {least} to {most}"));
            let before = self.assumed.preset.joint_error;
            let Some((solution, step)) = self.iterate()? else {
                return Ok(None);
            };
            let is_settled = step < settled;
            last = Some((solution, is_settled));
            if iteration < least {
                continue;
            }
            // Errors that are not linear yet look like wander too, but less so with every pass.
            let wanders_on = self.assumed.preset.joint_error >= before;
            let is_over = if self.stays() { is_settled } else { wanders_on };
            if is_over {
                break;
            }
        }
        Ok(last.filter(|_| self.stays()))
    }

    /// Whether the mean damping of the flight is too far from that expected.
    fn damping_is_implausible(&self) -> bool {
        let preset = &self.assumed.preset;
        (0..3).any(|axis| {
            let found = self.course.trajectory.iter();
            let sum: f64 = found
                .map(|state| state.inputs.damping.to_array()[axis])
                .sum();
            let mean = sum / self.course.trajectory.len() as f64;
            let deviation = self.assumed.offsets[3 + axis];
            (mean - f64::from(preset.damping[axis])).abs() > IMPLAUSIBLE_DAMPING * deviation
        })
    }

    /// Whether joint errors are constant, as far as the flight tells.
    fn stays(&self) -> bool {
        self.assumed.preset.joint_error <= STAYS.to_radians()
    }

    /// Computes the loads of the joint errors anew if these have moved far.
    fn renew_loads(&mut self) {
        let course = &mut self.course;
        if JointDirections::turn(&(course.errors - self.about)) > RENEWED {
            let flight = course.samples.iter();
            let flight = flight.map(|sample| (sample.posture, sample.motion));
            let (dynamics, errors) = (&course.dynamics, &course.errors);
            course.directions.renew(dynamics, errors, flight);
            self.about = course.errors;
        }
    }

    /// The constants after a forward pass, as differences from their present values; `None` without a solution.
    fn constants(&self, pass: &Pass) -> Option<Found> {
        let mut expected = Constants::zeros();
        expected
            .fixed_rows_mut::<DIRECTIONS>(0)
            .copy_from(&-self.course.errors);
        let Assumed { sizes, offsets, .. } = &self.assumed;
        pass.information().constants(&expected, sizes, offsets)
    }

    /// Moves trajectory, joint errors and assumptions to the solution of the linearized problem, and returns it with the
    /// largest step of a joint error, in its standard deviations; `None` if there is none.
    fn iterate(&mut self) -> Result<Option<(Solution, f64)>> {
        let Ok(flown) = Flown::along(&self.course, &self.assumed.preset)? else {
            return Ok(None);
        };
        let Some(found) = self.constants(flown.pass()) else {
            return Ok(None);
        };
        let Some((known, scores)) = flown.smoothed(&found)? else {
            return Ok(None);
        };
        self.course.trajectory = known.iter().map(|known| known.state).collect();
        self.course.errors += found.errors.fixed_rows::<DIRECTIONS>(0);
        self.wake(&scores.each);
        self.course.pulls = scores.pulls_as_found();
        self.assumed.follow(&scores);
        let variances = found.covariance.diagonal();
        let steps = found.errors.iter().zip(&variances).take(DIRECTIONS);
        let steps = steps.map(|(step, variance)| step.abs() / variance.sqrt());
        let step = steps.fold(0.0, f64::max);
        self.damping = std::array::from_fn(|axis| {
            let place = DIRECTIONS + 3 + axis;
            let varies = f64::from(self.assumed.preset.damping_deviation[axis]);
            let doubt = variances[place].sqrt();
            varies.hypot(found.errors[place]).hypot(doubt)
        });
        let size = found.size;
        self.renew_loads();
        Ok(Some((Solution { known, size }, step)))
    }

    /// Adds the effect of the joint errors to the residual load, so that recorded postures act like corrected ones.
    fn load_by_joints(&self, known: &mut [Known]) {
        let mut place = PostureSample::blank();
        let course = &self.course;
        let samples = course.samples.iter().step_by(STRIDE);
        for (known, sample) in known.iter_mut().zip(samples) {
            let motion = known.motion;
            let mut load = |posture| load(&course.dynamics, posture, &motion, &mut place);
            let corrected = course.corrected(sample.posture);
            let difference = load(&corrected) - load(sample.posture);
            let residual = &mut known.state.inputs.residual;
            residual.force.components += difference.fixed_rows::<3>(0);
            residual.moment.components += difference.fixed_rows::<3>(3);
        }
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
                if let (true, Some(sample)) = (wakes, self.course.samples.get_mut(index * STRIDE)) {
                    sample.activity[axis] = 1.0;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use bodyflight_core::body::anthropometry::{Person, Sex};
    use bodyflight_core::dynamics::muscle_input::BACK_TRACKING;
    use bodyflight_core::dynamics::step::TIME_STEP;
    use bodyflight_core::dynamics::{Inputs, Motion, State};
    use bodyflight_core::estimator::motion::settings::MOTION;
    use bodyflight_core::flight_sample::FlightSample;
    use bodyflight_core::frame::Vector;
    use bodyflight_core::maneuver::Maneuver;

    use super::*;

    /// The samples of a second of turns, and the state at every second one.
    fn turns(dynamics: &Dynamics<f64>) -> (Vec<FlightSample>, Vec<FlightState<f64>>) {
        let maneuver = Maneuver::from_name("rotations").unwrap();
        let inputs = Inputs::belly_turn();
        let inertial_from_body = maneuver.start_attitude();
        let start = Motion {
            inertial_from_body,
            position: Vector::zero(),
            velocity: inertial_from_body.inverse() * Vector::new(0.0, 0.0, -50.0),
            angular_velocity: Vector::zero(),
        };
        let posture = |k: u32| maneuver.posture(f64::from(k) * TIME_STEP);
        let mut motion = State::from_motion(&start, &dynamics.hold(&posture(0)));
        let mut states = Vec::new();
        let samples = (0..=240).map(|k| {
            let sample = dynamics.between(&posture(k.max(1) - 1), &posture(k), TIME_STEP);
            if k > 0 {
                motion = dynamics.step(&motion, &sample, &inputs, TIME_STEP);
                if k.is_multiple_of(2) {
                    states.push(FlightState { motion, inputs });
                }
            }
            FlightSample {
                time: f64::from(k) * TIME_STEP,
                posture: posture(k),
                motion: if k > 0 { motion.motion(&sample) } else { start },
            }
        });
        (samples.collect(), states)
    }

    fn samples(flown: &[FlightSample]) -> Vec<Sample<'_>> {
        let samples = flown.iter().map(|sample| Sample {
            time: sample.time,
            posture: &sample.posture,
            motion: &sample.motion,
            muscles: BACK_TRACKING,
            activity: [0.0; 3],
        });
        samples.collect()
    }

    #[test]
    fn damping_is_pulled_as_its_likelihood_over_all_trajectories_asks() {
        const STEP: f64 = 0.1;
        let person = Person::new(1.75, 75.0, Sex::Male);
        let dynamics = Dynamics::<f64>::paper(person.body().unwrap(), 1.0);
        let (flown, states) = turns(&dynamics);
        let model = (&dynamics, &AppliedLoads::none());
        let damped_by = |axis: usize, more: f64| {
            let samples = samples(&flown);
            let mut whole = Whole::new(&MOTION, Sizes::any(), model, None, samples, &states);
            for state in &mut whole.course.trajectory {
                let mut damping = state.inputs.damping.to_array();
                damping[axis] += more;
                state.inputs.damping = damping.into();
            }
            whole
        };
        for axis in 0..3 {
            let [less, more] = [-STEP, STEP].map(|more| {
                let whole = damped_by(axis, more);
                let flown = Flown::along(&whole.course, &whole.assumed.preset);
                flown.unwrap().unwrap().pass().log_determinant()
            });
            let asked = -0.5 * (more - less) / (2.0 * STEP);
            let whole = damped_by(axis, 0.0);
            let flown = Flown::along(&whole.course, &whole.assumed.preset);
            let flown = flown.unwrap().unwrap();
            let found = whole.constants(flown.pass()).unwrap();
            let (_, scores) = flown.smoothed(&found).unwrap().unwrap();
            let pulled: f64 = scores.pulls.iter().map(|pull| pull[axis].0).sum();
            assert!(asked > 0.01, "{axis}: {asked}");
            assert!(
                (pulled / asked - 1.0).abs() < 0.1,
                "{axis}: {pulled} of {asked}"
            );
        }
    }

    #[test]
    fn blocks_change_no_bit() {
        let person = Person::new(1.75, 75.0, Sex::Male);
        let dynamics = Dynamics::<f64>::paper(person.body().unwrap(), 1.0);
        let (flown, states) = turns(&dynamics);
        let model = (&dynamics, &AppliedLoads::none());
        let solved = |block: usize| {
            let samples = samples(&flown);
            let mut whole = Whole::new(&MOTION, Sizes::any(), model, None, samples, &states);
            whole.course.block = block;
            let solution = whole.solve().unwrap().unwrap();
            let each = solution.known.iter();
            let each: Vec<_> = each.map(|known| (known.state, known.deviation)).collect();
            (each, solution.size)
        };
        let whole = solved(BLOCK);
        assert_eq!(whole.0.len(), 121);
        for block in [1, 7, 60, 120, 121] {
            assert!(solved(block) == whole, "blocks of {block}");
        }
    }
}
