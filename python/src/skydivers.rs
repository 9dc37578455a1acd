//! Many skydivers in step, for learning: movement patterns in, what a suit sees out.

use bodyflight::diagnostic::Problem;
use bodyflight::formats::flight::DEFAULT_DENSITY;
use bodyflight::formats::subject;
use bodyflight::verbs::view::page::setup;
use bodyflight_core::dynamics::{Motion, PostureSample};
use bodyflight_core::frame::{Inertial, Vector};
use bodyflight_core::math::Real;
use bodyflight_core::observation::Observation;
use bodyflight_viewer::cockpit::{CONTROLS, STARTS};
use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::problem::{raise, unknown};
use crate::skydiver::{Course, Skydiver};
use crate::subject::Subject;

/// Names of what is observed, with units.
const OBSERVED: [&str; 16] = [
    "up_left",
    "up_dorsal",
    "up_cranial",
    "heading_sin",
    "heading_cos",
    "angular_velocity_left_radps",
    "angular_velocity_dorsal_radps",
    "angular_velocity_cranial_radps",
    "velocity_left_mps",
    "velocity_dorsal_mps",
    "velocity_cranial_mps",
    "position_north_m",
    "position_west_m",
    "position_up_m",
    "horizontal_speed_mps",
    "vertical_velocity_mps",
];

/// n skydivers of one body, each with a flight of its own. Actions are shares of the movement patterns `controls`, -1 to 1;
/// joints follow as fast as a person's.
#[pyclass(module = "bodyflight")]
pub(crate) struct Skydivers {
    course: Course,
    flights: Vec<Skydiver>,
}

#[pymethods]
impl Skydivers {
    #[new]
    #[pyo3(signature = (count, *, start = "neutral", subject = None, density = DEFAULT_DENSITY, substeps = 8))]
    fn new(
        count: usize,
        start: &str,
        subject: Option<Subject>,
        density: f64,
        substeps: u32,
    ) -> PyResult<Self> {
        let names = STARTS.map(|start| start.name);
        let found = STARTS.iter().find(|known| known.name == start);
        let start = found.ok_or_else(|| unknown("start", start, &names))?;
        if !(density > 0.0 && density <= 2.0) || substeps == 0 {
            return Err(raise(Problem::bad_input(format!(
                "expected a density above 0 and up to 2 kg/m3 and at least one substep, found {density} and {substeps}"
            ))));
        }
        let subject = subject.map_or_else(subject::Subject::default, |subject| subject.inner);
        let course = Course::new(&setup(&subject, density), start, substeps);
        Ok(Self {
            flights: vec![course.begun(); count],
            course,
        })
    }

    /// Names of the movement patterns that an action sets.
    #[classattr]
    fn controls() -> Vec<&'static str> {
        CONTROLS.iter().map(|control| control.name).collect()
    }

    /// Names of what is observed, with units; axes are the body's: left, dorsal, cranial.
    #[classattr]
    fn observed() -> Vec<&'static str> {
        OBSERVED.to_vec()
    }

    /// Names of the ways to begin.
    #[classattr]
    fn starts() -> Vec<&'static str> {
        STARTS.iter().map(|start| start.name).collect()
    }

    /// Time from one action to the next (s).
    #[getter]
    fn time_step(&self) -> f64 {
        self.course.duration()
    }

    fn __len__(&self) -> usize {
        self.flights.len()
    }

    /// Begins anew: all flights, or those whose entry of `which` is true. Returns the observations; n by 16.
    #[pyo3(signature = (which = None))]
    fn reset<'py>(
        &mut self,
        py: Python<'py>,
        which: Option<PyReadonlyArray1<'_, bool>>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        match which {
            None => self.flights.fill(self.course.begun()),
            Some(which) => {
                let which = which.as_slice()?;
                self.expect_rows("which", which.len())?;
                let pairs = self.flights.iter_mut().zip(which);
                for (flight, _) in pairs.filter(|(_, again)| **again) {
                    *flight = self.course.begun();
                }
            }
        }
        self.observe(py)
    }

    /// Flies one step with an action for each: n by 8. Returns the observations, n by 16.
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        actions: PyReadonlyArray2<'_, f32>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let actions = actions.as_slice()?;
        let width = CONTROLS.len();
        self.expect_rows("actions", actions.len() / width)?;
        if !actions.len().is_multiple_of(width) {
            return Err(raise(Problem::bad_input(format!(
                "expected actions of {width} columns"
            ))));
        }
        let (course, flights) = (&self.course, &mut self.flights);
        py.detach(|| {
            flights
                .par_iter_mut()
                .with_min_len(64)
                .zip(actions.par_chunks_exact(width))
                .for_each_init(PostureSample::blank, |sample, (flight, action)| {
                    course.fly(flight, action, sample);
                });
        });
        self.observe(py)
    }

    /// What there is to observe; n by 16.
    fn observe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let observed: Vec<[f32; OBSERVED.len()]> = self
            .flights
            .iter()
            .map(|flight| observation(&flight.motion))
            .collect();
        let count = observed.len();
        let flat = numpy::PyArray1::from_vec(py, observed.into_flattened());
        flat.reshape([count, OBSERVED.len()])
    }
}

impl Skydivers {
    fn expect_rows(&self, what: &str, found: usize) -> PyResult<()> {
        let expected = self.flights.len();
        if found == expected {
            return Ok(());
        }
        Err(raise(
            Problem::bad_input(format!("expected {expected} rows, found {found}")).at(what),
        ))
    }
}

/// In the order of [`OBSERVED`].
fn observation(motion: &Motion<f32>) -> [f32; OBSERVED.len()] {
    let seen = Observation::of(motion);
    let up = motion.inertial_from_body.inverse() * Vector::<f32, Inertial>::new(0.0, 0.0, 1.0);
    let (sin, cos) = seen.angles.heading.sine_cosine();
    let [ul, ud, uc] = up.to_array();
    let [wl, wd, wc] = motion.angular_velocity.to_array();
    let [vl, vd, vc] = motion.velocity.to_array();
    let [north, west, height] = motion.position.to_array();
    [
        ul,
        ud,
        uc,
        sin,
        cos,
        wl,
        wd,
        wc,
        vl,
        vd,
        vc,
        north,
        west,
        height,
        seen.horizontal_speed,
        seen.vertical_velocity,
    ]
}
