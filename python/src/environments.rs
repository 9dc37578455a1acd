//! Environments for learning: skydivers with a task, flown, observed and rewarded in one pass on all cores.

use bodyflight_core::four::Four;
use bodyflight_core::math::Lanes;
use bodyflight_io::diagnostic::Problem;
use bodyflight_replay::flight::DEFAULT_DENSITY;
use bodyflight_viewer::cockpit::CONTROLS;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::{array, finite};
use crate::observed::{OBSERVED, observation};
use crate::options::Options;
use crate::picture::Scene;
use crate::problem::raise;
use crate::side_by_side::Flights;
use crate::skydiver::{Course, NUMBERS, Skydiver};
use crate::skydivers::{of_states, state_names};
use crate::step::{Given, Rows, fly};
use crate::subject::Subject;
use crate::task::{EPISODE, Environment, GOAL, LIMIT, MOST_STEPS, STATE, SUIT, TERMS, Task, WIDTH};
use crate::threads::threads;

/// Most pixels of a picture each way.
const LARGEST: usize = 4096;

/// n environments with one body and one task. `bodyflight.gym` draws the goals and follows Gymnasium's rules.
#[pyclass(module = "bodyflight._native")]
pub(crate) struct Environments {
    course: Course<f32>,
    course_of_four: Course<Four>,
    task: Task,
    all: Flights<Environment<Four>>,
    seconds: f64,
    options: Options,
}

/// Observations (n by 17), rewards, terminated, truncated (n each), terms of the rewards (n by 5), success (n).
type Step<'py> = (
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<bool>>,
    Bound<'py, PyArray1<bool>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray1<bool>>,
);

#[pymethods]
impl Environments {
    #[new]
    #[expect(
        clippy::too_many_arguments,
        reason = "keyword arguments of a Python class"
    )]
    #[pyo3(
        signature = (count, *, up, faces, docks, seconds, start = "neutral", subject = None, density = DEFAULT_DENSITY, substeps = 8),
        text_signature = "(count, *, up, faces, docks, seconds, start='neutral', subject=None, density=1.0, substeps=8)"
    )]
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
        let options = Options {
            start: start.to_owned(),
            subject,
            density,
            substeps,
        };
        let course = options.course()?;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "the conversion saturates, and an episode has at least one step"
        )]
        let limit = (seconds / course.duration()).round().clamp(1.0, MOST_STEPS) as u32;
        let begun = Environment {
            skydiver: course.begun(),
            heading: (0.0, 1.0),
            target: [0.0; 2],
            steps: 0.0,
        };
        Ok(Self {
            course_of_four: course.for_four(),
            course,
            task: Task {
                up,
                faces,
                docks,
                limit,
            },
            all: Flights::new(count, &begun),
            seconds,
            options,
        })
    }

    /// Names of the 17 components of an observation before scaling, with units; axes are the body's.
    #[classattr]
    fn observed() -> Vec<&'static str> {
        let suit = SUIT.iter().filter_map(|(index, _)| OBSERVED.get(*index));
        suit.copied().chain(GOAL).collect()
    }

    /// Names of the five terms of a reward.
    #[classattr]
    fn reward_terms() -> Vec<&'static str> {
        TERMS.to_vec()
    }

    /// Names of the 35 numbers of a state, with units: those of `Skydivers`, and the episode's goal and steps.
    #[classattr]
    fn state_names() -> Vec<String> {
        let episode = EPISODE.map(str::to_owned);
        state_names().into_iter().chain(episode).collect()
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
        which: &Bound<'_, PyAny>,
        headings: &Bound<'_, PyAny>,
        targets: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let count = Some(self.all.len());
        let which = array::<bool>(which, "which", &[count])?;
        let headings = finite::<f32>(headings, "headings", &[count])?;
        let targets = finite::<f32>(targets, "targets", &[count, Some(2)])?;
        let goals = headings.as_slice()?.iter();
        let goals = goals.zip(targets.as_slice()?.as_chunks::<2>().0);
        let begun = self.course.begun();
        let [north, west, _] = begun.motion.position.to_array();
        for (index, (again, (heading, [to_north, to_west]))) in
            which.as_slice()?.iter().zip(goals).enumerate()
        {
            if *again {
                let environment = Environment {
                    skydiver: begun,
                    heading: heading.sine_cosine(),
                    target: [north + to_north, west + to_west],
                    steps: 0.0,
                };
                self.all.put(index, &environment);
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
    /// begun, with a reward of zero. `actions` is n by 8. Returns observations (n by 17), rewards, terminated and truncated (n
    /// each), the terms of the rewards in the order of `reward_terms` (n by 5), and whether the flight is where the task wants
    /// it to be (n).
    ///
    /// Returns new arrays, since learning compares observations before and after a step.
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        actions: &Bound<'py, PyAny>,
        resting: &Bound<'py, PyAny>,
    ) -> PyResult<Step<'py>> {
        let count = self.all.len();
        let actions = finite::<f32>(actions, "actions", &[Some(count), Some(CONTROLS.len())])?;
        let resting = array::<bool>(resting, "resting", &[Some(count)])?;
        let seen = PyArray2::zeros(py, [count, WIDTH], false);
        let rewards = PyArray1::zeros(py, count, false);
        let terms = PyArray2::zeros(py, [count, TERMS.len()], false);
        let flags = [(); 3].map(|()| PyArray1::zeros(py, count, false));
        {
            let (mut seen, mut rewards) = (seen.readwrite(), rewards.readwrite());
            let mut terms = terms.readwrite();
            let [mut terminated, mut truncated, mut success] =
                flags.each_ref().map(|array| array.readwrite());
            let given = Given {
                actions: actions.as_slice()?.as_chunks().0,
                resting: resting.as_slice()?,
            };
            let rows = Rows {
                seen: seen.as_slice_mut()?.as_chunks_mut().0,
                rewards: rewards.as_slice_mut()?,
                terms: terms.as_slice_mut()?.as_chunks_mut().0,
                success: success.as_slice_mut()?,
                terminated: terminated.as_slice_mut()?,
                truncated: truncated.as_slice_mut()?,
            };
            let pool = threads(py)?;
            let courses = (&self.course, &self.course_of_four);
            let (all, task) = (&mut self.all, &self.task);
            py.detach(|| fly(all, courses, task, given, rows, pool));
        }
        let [terminated, truncated, success] = flags;
        Ok((seen, rewards, terminated, truncated, terms, success))
    }

    /// Draws one environment (`index`) as an image, `height` by `width` by 3 of red, green and blue. A green mark points to the
    /// goal.
    fn render<'py>(
        &self,
        py: Python<'py>,
        index: usize,
        width: usize,
        height: usize,
    ) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let count = self.all.len();
        let Some(environment) = self.all.get(index) else {
            let problem = Problem::bad_input(format!("expected 0 to below {count}, found {index}"));
            return Err(raise(problem.at("index")));
        };
        if !(1..=LARGEST).contains(&width) || !(1..=LARGEST).contains(&height) {
            let problem = Problem::bad_input(format!(
                "expected 1 to {LARGEST} pixels each way, found {width} and {height}"
            ));
            return Err(raise(problem.at("width, height")));
        }
        let Skydiver { motion, .. } = &environment.skydiver;
        let toward = environment.toward(&self.task, &observation(motion));
        let scene = Scene::new(
            &Subject::or_default(self.options.subject.clone()).body(),
            &environment.skydiver.posture().cast(),
            &motion.cast(),
            toward.map(|way| way.map(f64::from)),
        );
        let pixels = py.detach(|| scene.draw(width, height));
        PyArray1::from_vec(py, pixels).reshape([height, width, 3])
    }

    /// Returns everything that the environments consist of, n by 35 in the order of `state_names`. `set_state` continues them
    /// to the bit.
    fn get_state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let numbers: Vec<_> = self
            .all
            .iter()
            .map(|environment| environment.numbers())
            .collect();
        let count = numbers.len();
        let flat = PyArray1::from_vec(py, numbers.into_flattened());
        flat.reshape([count, STATE])
    }

    /// Continues the environments from a `state` that `get_state` returned, n by 35.
    fn set_state(&mut self, state: &Bound<'_, PyAny>) -> PyResult<()> {
        let state = finite::<f32>(state, "state", &[Some(self.all.len()), Some(STATE)])?;
        let rows = state.as_slice()?.as_chunks::<STATE>().0;
        let flights = of_states(
            &self.course,
            rows.iter().filter_map(|row| row.first_chunk::<NUMBERS>()),
        )?;
        for (index, (skydiver, row)) in flights.into_iter().zip(rows).enumerate() {
            let [.., sine, cosine, north, west, steps] = *row;
            let environment = Environment {
                skydiver,
                heading: (sine, cosine),
                target: [north, west],
                steps: steps.max(0.0).trunc(),
            };
            self.all.put(index, &environment);
        }
        Ok(())
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<((usize,), Bound<'py, PyDict>)> {
        let keywords = self.options.keywords(py)?;
        keywords.set_item("up", self.task.up)?;
        keywords.set_item("faces", self.task.faces)?;
        keywords.set_item("docks", self.task.docks)?;
        keywords.set_item("seconds", self.seconds)?;
        Ok(((self.all.len(),), keywords))
    }

    fn __getstate__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        self.get_state(py)
    }

    fn __setstate__(&mut self, state: &Bound<'_, PyAny>) -> PyResult<()> {
        self.set_state(state)
    }
}
