//! Environments for learning: skydivers with a task, flown, observed and rewarded in one pass on all cores.

use bodyflight_core::dynamics::PostureSample;
use bodyflight_core::math::{Real, clamp};
use bodyflight_replay::flight::DEFAULT_DENSITY;
use bodyflight_viewer::cockpit::CONTROLS;
use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::skydiver::{Course, Skydiver};
use crate::skydivers::{OBSERVED, RUN, Row, course, expect_shape, observation};
use crate::subject::Subject;

/// Largest magnitude of a scaled observation, far beyond what a person flies.
const LIMIT: f32 = 100.0;
/// Angular velocity about one body axis at which a flight counts as tumbling (rad/s).
const TUMBLING: f32 = 15.0;
/// Reward of the step in which an episode is terminated.
const FALLEN: f32 = -10.0;

/// What every task observes of the body: indices into [`OBSERVED`], and the divisors that scale the values to about
/// one.
const SUIT: [(usize, f32); 13] = [
    (0, 1.0),
    (1, 1.0),
    (2, 1.0),
    (3, 1.0),
    (4, 1.0),
    (5, 5.0),
    (6, 5.0),
    (7, 5.0),
    (8, 60.0),
    (9, 60.0),
    (10, 60.0),
    (14, 20.0),
    (15, 60.0),
];
/// What every task observes of its goal.
const GOAL: [&str; 4] = [
    "turn_left_sin",
    "turn_left_cos",
    "target_ahead_m",
    "target_left_m",
];
/// Distance of the target that is scaled to one (m).
const GOAL_SCALE: f32 = 10.0;
/// Number of controls, over which the effort is averaged.
#[expect(clippy::cast_precision_loss, reason = "there are eight controls")]
const EFFORT: f32 = CONTROLS.len() as f32;
/// Number of components in an observation.
const WIDTH: usize = SUIT.len() + GOAL.len();

/// What is rewarded.
#[derive(Clone, Copy)]
struct Task {
    /// Wanted components of the upward direction: left, dorsal, cranial.
    up: [f32; 3],
    /// Whether facing the goal's heading is rewarded.
    faces: bool,
    /// Whether nearness to the goal's place is rewarded.
    docks: bool,
    /// Steps after which an episode is truncated.
    limit: u32,
}

/// One skydiver with the goal of its episode.
#[derive(Clone, Copy)]
struct Environment {
    skydiver: Skydiver,
    /// Sine and cosine of the wanted heading.
    heading: (f32, f32),
    /// Wanted place: north, west (m).
    target: [f32; 2],
    /// Steps since the episode began.
    steps: u32,
}

/// n environments with one body and one task. `bodyflight.gym` draws the goals and follows Gymnasium's rules.
#[pyclass(module = "bodyflight")]
pub(crate) struct Environments {
    course: Course,
    task: Task,
    all: Vec<Environment>,
}

/// Observations (n by 17), rewards, terminated, truncated (n each).
type Step<'py> = (
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<bool>>,
    Bound<'py, PyArray1<bool>>,
);

#[pymethods]
impl Environments {
    #[new]
    #[expect(
        clippy::too_many_arguments,
        reason = "keyword arguments of a Python class"
    )]
    #[pyo3(signature = (count, *, up, faces, docks, seconds, start = "neutral", subject = None, density = DEFAULT_DENSITY, substeps = 8))]
    fn new(
        count: usize,
        up: [f32; 3],
        faces: bool,
        docks: bool,
        seconds: f64,
        start: &str,
        subject: Option<Subject>,
        density: f64,
        substeps: u32,
    ) -> PyResult<Self> {
        let course = course(start, subject, density, substeps)?;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "the conversion saturates, and an episode has at least one step"
        )]
        let limit = (seconds / course.duration()).round().max(1.0) as u32;
        let begun = Environment {
            skydiver: course.begun(),
            heading: (0.0, 1.0),
            target: [0.0; 2],
            steps: 0,
        };
        Ok(Self {
            course,
            task: Task {
                up,
                faces,
                docks,
                limit,
            },
            all: vec![begun; count],
        })
    }

    /// Names of the 17 components of an observation before scaling, with units; axes are the body's.
    #[classattr]
    fn observed() -> Vec<&'static str> {
        let suit = SUIT.iter().filter_map(|(index, _)| OBSERVED.get(*index));
        suit.copied().chain(GOAL).collect()
    }

    /// Largest magnitude of a component of an observation.
    #[classattr]
    fn limit() -> f32 {
        LIMIT
    }

    /// Steps after which an episode is truncated.
    #[getter]
    fn episode_steps(&self) -> u32 {
        self.task.limit
    }

    fn __len__(&self) -> usize {
        self.all.len()
    }

    /// Begins an episode in every environment whose entry of `which` (n) is true.
    ///
    /// `headings` (n, rad) and `targets` (n by 2: north and west of the start, m) hold the goals; entries of other
    /// environments are ignored.
    fn begin(
        &mut self,
        which: PyReadonlyArray1<'_, bool>,
        headings: PyReadonlyArray1<'_, f32>,
        targets: PyReadonlyArray2<'_, f32>,
    ) -> PyResult<()> {
        let count = self.all.len();
        expect_shape("which", which.shape(), &[count])?;
        expect_shape("headings", headings.shape(), &[count])?;
        expect_shape("targets", targets.shape(), &[count, 2])?;
        let goals = headings.as_slice()?.iter();
        let goals = goals.zip(targets.as_slice()?.as_chunks::<2>().0);
        let begun = self.course.begun();
        let [north, west, _] = begun.motion.position.to_array();
        for ((environment, again), (heading, [to_north, to_west])) in
            self.all.iter_mut().zip(which.as_slice()?).zip(goals)
        {
            if *again {
                *environment = Environment {
                    skydiver: begun,
                    heading: heading.sine_cosine(),
                    target: [north + to_north, west + to_west],
                    steps: 0,
                };
            }
        }
        Ok(())
    }

    /// Returns the observations, n by 17, in the order of `observed` and scaled to about one.
    fn observe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let seen = PyArray2::zeros(py, [self.all.len(), WIDTH], false);
        let mut places = seen.readwrite();
        let rows = places.as_slice_mut()?.as_chunks_mut::<WIDTH>().0;
        for (environment, row) in self.all.iter().zip(rows) {
            *row = environment.observe(&observation(&environment.skydiver.motion));
        }
        drop(places);
        Ok(seen)
    }

    /// Flies one step in every environment, except that those whose entry of `resting` (n) is true stay as they have
    /// begun, with a reward of zero. `actions` is n by 8.
    ///
    /// Returns new arrays, since learning compares observations before and after a step.
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        actions: PyReadonlyArray2<'_, f32>,
        resting: PyReadonlyArray1<'_, bool>,
    ) -> PyResult<Step<'py>> {
        let count = self.all.len();
        expect_shape("actions", actions.shape(), &[count, CONTROLS.len()])?;
        expect_shape("resting", resting.shape(), &[count])?;
        let seen = PyArray2::zeros(py, [count, WIDTH], false);
        let rewards = PyArray1::zeros(py, count, false);
        let ends = [(); 2].map(|()| PyArray1::zeros(py, count, false));
        {
            let (mut seen, mut rewards) = (seen.readwrite(), rewards.readwrite());
            let [mut terminated, mut truncated] = ends.each_ref().map(|array| array.readwrite());
            let (seen, rewards) = (seen.as_slice_mut()?, rewards.as_slice_mut()?);
            let (terminated, truncated) = (terminated.as_slice_mut()?, truncated.as_slice_mut()?);
            let given = (actions.as_slice()?.as_chunks().0, resting.as_slice()?);
            let (course, task, all) = (&self.course, &self.task, &mut self.all);
            py.detach(|| {
                let given = given.0.par_iter().zip(given.1.par_iter());
                let ends = terminated.par_iter_mut().zip(truncated.par_iter_mut());
                let seen = seen.as_chunks_mut().0.par_iter_mut();
                all.par_iter_mut()
                    .zip(given)
                    .zip(seen.zip(rewards.par_iter_mut()).zip(ends))
                    .with_min_len(RUN)
                    .for_each_init(PostureSample::blank, |sample, (moved, found)| {
                        let ((environment, (action, resting)), ((seen, reward), ends)) =
                            (moved, found);
                        if *resting {
                            let row = observation(&environment.skydiver.motion);
                            *seen = environment.observe(&row);
                            return;
                        }
                        course.fly(&mut environment.skydiver, action, sample);
                        environment.steps += 1;
                        let row = observation(&environment.skydiver.motion);
                        *seen = environment.observe(&row);
                        let fallen = is_tumbling(&row);
                        *reward = environment.reward(task, &row, action, fallen);
                        (*ends.0, *ends.1) = (fallen, environment.steps >= task.limit);
                    });
            });
        }
        let [terminated, truncated] = ends;
        Ok((seen, rewards, terminated, truncated))
    }
}

/// Whether the body spins faster than [`TUMBLING`], or its motion is no longer finite.
fn is_tumbling(row: &Row) -> bool {
    let [_, _, _, _, _, left, dorsal, cranial, ..] = *row;
    let spins = [left, dorsal, cranial].map(f32::abs);
    !row.iter().all(|value| value.is_finite()) || spins.iter().any(|spin| *spin > TUMBLING)
}

impl Environment {
    /// Sine and cosine of the wanted heading minus that of the body.
    fn turn_left(&self, row: &Row) -> (f32, f32) {
        let [_, _, _, sine, cosine, ..] = *row;
        let (wanted_sine, wanted_cosine) = self.heading;
        (
            wanted_sine * cosine - wanted_cosine * sine,
            wanted_cosine * cosine + wanted_sine * sine,
        )
    }

    /// Returns the way from the body to the target: north, west (m).
    fn way(&self, row: &Row) -> [f32; 2] {
        let [.., north, west, _, _, _] = *row;
        let [to_north, to_west] = self.target;
        [to_north - north, to_west - west]
    }

    fn observe(&self, row: &Row) -> [f32; WIDTH] {
        let [_, _, _, sine, cosine, ..] = *row;
        let (turn_sine, turn_cosine) = self.turn_left(row);
        let [north, west] = self.way(row);
        let goal = [
            turn_sine,
            turn_cosine,
            (north * cosine + west * sine) / GOAL_SCALE,
            (west * cosine - north * sine) / GOAL_SCALE,
        ];
        let suit = SUIT
            .iter()
            .map(|(index, scale)| row.get(*index).map_or(0.0, |value| value / scale));
        let mut seen = [0.0; WIDTH];
        for (place, value) in seen.iter_mut().zip(suit.chain(goal)) {
            // A flight may tumble until its numbers overflow.
            *place = if value.is_nan() {
                0.0
            } else {
                clamp(value, -LIMIT, LIMIT)
            };
        }
        seen
    }

    fn reward(&self, task: &Task, row: &Row, action: &[f32; CONTROLS.len()], fallen: bool) -> f32 {
        if fallen {
            return FALLEN;
        }
        let [left, dorsal, cranial, ..] = *row;
        let upright = left * task.up[0] + dorsal * task.up[1] + cranial * task.up[2];
        let effort = action.iter().map(|share| share * share).sum::<f32>() / EFFORT;
        let mut reward = 0.5 * (1.0 + upright) - 0.01 * effort;
        if task.docks {
            let [north, west] = self.way(row);
            let distance = (north * north + west * west).root();
            reward += std::f32::consts::E.power(-0.5 * distance);
        }
        if task.faces {
            reward += 0.5 * (1.0 + self.turn_left(row).1);
        }
        if reward.is_nan() { 0.0 } else { reward }
    }
}
