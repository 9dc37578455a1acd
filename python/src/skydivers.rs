//! Many skydivers that fly in parallel: movement patterns in, the quantities that a motion-capture suit measures out.

use bodyflight_core::dynamics::{Motion, PostureSample};
use bodyflight_core::frame::{Inertial, Vector};
use bodyflight_core::math::Real;
use bodyflight_core::observation::Observation;
use bodyflight_io::diagnostic::Problem;
use bodyflight_replay::flight::DEFAULT_DENSITY;
use bodyflight_verbs::view::page::setup;
use bodyflight_viewer::cockpit::{CONTROLS, STARTS};
use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::problem::{raise, unknown};
use crate::skydiver::{Course, Skydiver};
use crate::subject::Subject;

/// Names of the observed quantities, with units.
pub(crate) const OBSERVED: [&str; 16] = [
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

/// One row of observations, in the order of [`OBSERVED`].
pub(crate) type Row = [f32; OBSERVED.len()];

/// Smallest number of neighbouring skydivers that a thread flies in one go, so that threads have enough to do.
pub(crate) const RUN: usize = 64;

/// n skydivers with one body, each in a flight of its own. An action holds a share, -1 to 1, of the range of each movement
/// pattern in `controls`; joints follow no faster than a person moves them.
#[pyclass(module = "bodyflight")]
pub(crate) struct Skydivers {
    course: Course,
    flights: Vec<Skydiver>,
}

/// Checks the options of flights that are named as in Python.
pub(crate) fn course(
    start: &str,
    subject: Option<Subject>,
    density: f64,
    substeps: u32,
) -> PyResult<Course> {
    let names = STARTS.map(|start| start.name);
    let found = STARTS.iter().find(|known| known.name == start);
    let start = found.ok_or_else(|| unknown("start", start, &names))?;
    if !(density > 0.0 && density <= 2.0) || substeps == 0 {
        return Err(raise(Problem::bad_input(format!(
            "expected a density above 0 and up to 2 kg/m3 and at least one substep, found {density} and {substeps}"
        ))));
    }
    let subject = Subject::or_default(subject);
    Ok(Course::new(&setup(&subject, density), start, substeps))
}

/// Returns an error unless the array called `what` has the expected shape.
pub(crate) fn expect_shape(what: &str, found: &[usize], expected: &[usize]) -> PyResult<()> {
    if found == expected {
        return Ok(());
    }
    let shape = |sizes: &[usize]| {
        sizes
            .iter()
            .map(usize::to_string)
            .collect::<Vec<_>>()
            .join(" by ")
    };
    let problem = format!(
        "expected the shape {}, found {}",
        shape(expected),
        shape(found)
    );
    Err(raise(Problem::bad_input(problem).at(what)))
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
        let course = course(start, subject, density, substeps)?;
        Ok(Self {
            flights: vec![course.begun(); count],
            course,
        })
    }

    /// Names of the eight movement patterns that an action sets.
    #[classattr]
    fn controls() -> Vec<&'static str> {
        CONTROLS.iter().map(|control| control.name).collect()
    }

    /// Names of the 16 observed quantities, with units; body axes are left, dorsal and cranial.
    #[classattr]
    fn observed() -> Vec<&'static str> {
        OBSERVED.to_vec()
    }

    /// Names of the postures and speeds in which flights can begin.
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

    /// Restarts all flights, or those whose entry of `which` (n) is true. Returns the observations, n by 16.
    #[pyo3(signature = (which = None))]
    fn reset<'py>(
        &mut self,
        py: Python<'py>,
        which: Option<PyReadonlyArray1<'_, bool>>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        match which {
            None => self.flights.fill(self.course.begun()),
            Some(which) => {
                expect_shape("which", which.shape(), &[self.flights.len()])?;
                let pairs = self.flights.iter_mut().zip(which.as_slice()?);
                for (flight, _) in pairs.filter(|(_, again)| **again) {
                    *flight = self.course.begun();
                }
            }
        }
        self.observe(py)
    }

    /// Flies one step with an action for each skydiver, n by 8. Returns the observations, n by 16.
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        actions: PyReadonlyArray2<'_, f32>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let count = self.flights.len();
        expect_shape("actions", actions.shape(), &[count, CONTROLS.len()])?;
        let actions = actions.as_slice()?.as_chunks().0;
        let seen = PyArray2::zeros(py, [count, OBSERVED.len()], false);
        {
            let mut places = seen.readwrite();
            let rows = places.as_slice_mut()?.as_chunks_mut().0;
            let (course, flights) = (&self.course, &mut self.flights);
            py.detach(|| {
                flights
                    .par_iter_mut()
                    .zip(actions.par_iter().zip(rows.par_iter_mut()))
                    .with_min_len(RUN)
                    .for_each_init(PostureSample::blank, |sample, (flight, (action, row))| {
                        course.fly(flight, action, sample);
                        *row = observation(&flight.motion);
                    });
            });
        }
        Ok(seen)
    }

    /// Returns the observations, n by 16.
    fn observe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let flights = self.flights.iter();
        let observed: Vec<Row> = flights.map(|flight| observation(&flight.motion)).collect();
        let count = observed.len();
        let flat = numpy::PyArray1::from_vec(py, observed.into_flattened());
        flat.reshape([count, OBSERVED.len()])
    }
}

/// Observes a motion, in the order of [`OBSERVED`].
pub(crate) fn observation(motion: &Motion<f32>) -> Row {
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
