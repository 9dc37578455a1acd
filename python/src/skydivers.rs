//! Many skydivers that fly in parallel: movement patterns in, the quantities that a motion-capture suit measures out.

use bodyflight_core::dynamics::PostureSample;
use bodyflight_core::dynamics::applied_load::factor::FACTORS;
use bodyflight_core::dynamics::applied_load::{
    AppliedLoad, AppliedLoads, Axis, Direction, Kind, Point,
};
use bodyflight_core::four::Four;
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_io::diagnostic::Problem;
use bodyflight_replay::flight::DEFAULT_DENSITY;
use bodyflight_viewer::cockpit::{CONTROLS, STARTS};
use numpy::{PyArray2, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::arguments::{array, finite};
use crate::arrays::{MotionArrays, Motions};
use crate::observed::{OBSERVED, Row, observation};
use crate::options::Options;
use crate::problem::raise;
use crate::side_by_side::{Flights, SIDE_BY_SIDE, columns, write_rows};
use crate::skydiver::{Course, MOVING, NUMBERS, Skydiver};
use crate::subject::Subject;
use crate::threads::{on_all_cores, threads};

/// Smallest number of neighbouring fours that a thread flies in one go, so that threads have enough to do.
pub(crate) const RUN: usize = 16;

/// n skydivers with one body, each in a flight of its own. An action holds a share, -1 to 1, of the range of each movement
/// pattern in `controls`; joints follow no faster than a person moves them.
#[pyclass(module = "bodyflight")]
pub(crate) struct Skydivers {
    course: Course<f32>,
    course_of_four: Course<Four>,
    flights: Flights<Skydiver<Four>>,
    options: Options,
}

#[pymethods]
impl Skydivers {
    #[new]
    #[pyo3(
        signature = (count, *, start = "neutral", subject = None, density = DEFAULT_DENSITY, substeps = 8),
        text_signature = "(count, *, start='neutral', subject=None, density=1.0, substeps=8)"
    )]
    fn new(
        count: usize,
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
        Ok(Self {
            flights: Flights::new(count, &course.begun()),
            course_of_four: course.for_four(),
            course,
            options,
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

    /// Names of the 30 numbers of a state, with units; the last eight are the present shares of the controls.
    #[classattr]
    fn state_names() -> Vec<String> {
        state_names()
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
        which: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        match which {
            None => self.flights = Flights::new(self.flights.len(), &self.course.begun()),
            Some(which) => {
                let which = array::<bool>(which, "which", &[Some(self.flights.len())])?;
                let begun = self.course.begun();
                for (index, _) in which
                    .as_slice()?
                    .iter()
                    .enumerate()
                    .filter(|(_, again)| **again)
                {
                    self.flights.put(index, &begun);
                }
            }
        }
        self.observe(py)
    }

    /// Flies one step with an action for each skydiver, n by 8. Returns the observations, n by 16.
    ///
    /// `force` (N) and `moment` (N m) are loads that others apply during the step: at and about the centre of gravity, north,
    /// west and up, n by 3.
    #[pyo3(signature = (actions, *, force = None, moment = None))]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        actions: &Bound<'py, PyAny>,
        force: Option<&Bound<'py, PyAny>>,
        moment: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let count = self.flights.len();
        let actions = finite::<f32>(actions, "actions", &[Some(count), Some(CONTROLS.len())])?;
        let actions: &[[f32; CONTROLS.len()]] = actions.as_slice()?.as_chunks().0;
        let loads = loads(count, force, moment)?;
        let seen = PyArray2::zeros(py, [count, OBSERVED.len()], false);
        {
            let mut places = seen.readwrite();
            let (rows, last_rows) = places
                .as_slice_mut()?
                .as_chunks_mut()
                .0
                .as_chunks_mut::<SIDE_BY_SIDE>();
            let (actions, last_actions) = actions.as_chunks::<SIDE_BY_SIDE>();
            let (course, course_of_four) = (&self.course, &self.course_of_four);
            let flights = &mut self.flights;
            let (of_fours, last_loads) = loads.split_at(loads.len().min(flights.of_fours()));
            let pool = threads(py)?;
            py.detach(|| {
                on_all_cores(pool, &mut flights.fours, |fours| {
                    fours
                        .par_iter_mut()
                        .zip(actions.par_iter().zip(rows.par_iter_mut()))
                        .enumerate()
                        .with_min_len(RUN)
                        .for_each_init(
                            || (PostureSample::blank(), PostureSample::blank()),
                            |(sample, single), (index, (four, (actions, rows)))| {
                                let loads = of_fours.get(index * SIDE_BY_SIDE..);
                                let loads = loads.and_then(|loads| loads.first_chunk());
                                match loads {
                                    Some(loads) => {
                                        course.fly_four_under(loads, four, actions, single)
                                    }
                                    None => course_of_four.fly(four, &columns(actions), sample),
                                }
                                write_rows(&observation(&four.motion), rows);
                            },
                        );
                });
                let mut sample = PostureSample::blank();
                let last = flights.rest.iter_mut().zip(last_actions).zip(last_rows);
                for (index, ((flight, action), row)) in last.enumerate() {
                    match last_loads.get(index) {
                        Some(loads) => course.fly_under(loads, flight, action, &mut sample),
                        None => course.fly(flight, action, &mut sample),
                    }
                    *row = observation(&flight.motion);
                }
            });
        }
        Ok(seen)
    }

    /// Returns the observations, n by 16.
    fn observe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let flights = self.flights.iter();
        let observed: Vec<Row<f32>> = flights.map(|flight| observation(&flight.motion)).collect();
        let count = observed.len();
        let flat = numpy::PyArray1::from_vec(py, observed.into_flattened());
        flat.reshape([count, OBSERVED.len()])
    }

    /// Motion of all skydivers after the last step, n rows.
    #[getter]
    fn motion(&self, py: Python<'_>) -> PyResult<Py<MotionArrays>> {
        let mut motions = Motions::default();
        for flight in self.flights.iter() {
            motions.push(&flight.motion.cast());
        }
        motions.arrays(py)
    }

    /// Returns everything that the flights consist of, n by 30 in the order of `state_names`. `set_state` continues them to
    /// the bit.
    fn get_state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let numbers: Vec<_> = self.flights.iter().map(|flight| flight.numbers()).collect();
        let count = numbers.len();
        let flat = numpy::PyArray1::from_vec(py, numbers.into_flattened());
        flat.reshape([count, NUMBERS])
    }

    /// Continues the flights from a `state` that `get_state` returned, n by 30.
    fn set_state(&mut self, state: &Bound<'_, PyAny>) -> PyResult<()> {
        let shape = [Some(self.flights.len()), Some(NUMBERS)];
        let state = finite::<f32>(state, "state", &shape)?;
        let rows = state.as_slice()?.as_chunks().0;
        for (index, flight) in of_states(&self.course, rows.iter())?.iter().enumerate() {
            self.flights.put(index, flight);
        }
        Ok(())
    }

    /// Gives all skydivers another motion; what is None stays as it is. Joints come to rest.
    ///
    /// `position` (m) and `velocity` (m/s) of the pelvis are north, west and up, `inertial_from_body` is the attitude as a
    /// quaternion w, x, y, z, `angular_velocity` (rad/s) is about left, dorsal and cranial, `controls` are the shares of the
    /// movement patterns; n by 3, 3, 4, 3 and 8.
    #[pyo3(signature = (*, position = None, velocity = None, inertial_from_body = None, angular_velocity = None, controls = None))]
    fn set_motion(
        &mut self,
        position: Option<&Bound<'_, PyAny>>,
        velocity: Option<&Bound<'_, PyAny>>,
        inertial_from_body: Option<&Bound<'_, PyAny>>,
        angular_velocity: Option<&Bound<'_, PyAny>>,
        controls: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let count = self.flights.len();
        let position = Given::of(position, "position", count, 3)?;
        let velocity = Given::of(velocity, "velocity", count, 3)?;
        let attitude = Given::of(inertial_from_body, "inertial_from_body", count, 4)?;
        let spin = Given::of(angular_velocity, "angular_velocity", count, 3)?;
        let controls = Given::of(controls, "controls", count, CONTROLS.len())?;
        let mut moved = self.flights.clone();
        for (index, flight) in self.flights.iter().enumerate() {
            let mut motion = flight.motion;
            let along = motion.velocity_inertial();
            if let Some(wxyz) = attitude.row(index)? {
                let rotation = Rotation::from_wxyz(wxyz);
                motion.inertial_from_body =
                    rotation.ok_or_else(|| no_attitude("inertial_from_body", index))?;
            }
            let along = velocity.row(index)?.map_or(along, vector);
            motion.velocity = motion.inertial_from_body.inverse() * along;
            if let Some(position) = position.row(index)? {
                motion.position = vector(position);
            }
            if let Some(spin) = spin.row(index)? {
                motion.angular_velocity = vector(spin);
            }
            let amounts = controls.row(index)?.unwrap_or(flight.amounts);
            let amounts = amounts.map(|amount| amount.clamp(-1.0, 1.0));
            moved.put(index, &self.course.moving(&motion, amounts));
        }
        self.flights = moved;
        Ok(())
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<((usize,), Bound<'py, PyDict>)> {
        Ok(((self.flights.len(),), self.options.keywords(py)?))
    }

    fn __getstate__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        self.get_state(py)
    }

    fn __setstate__(&mut self, state: &Bound<'_, PyAny>) -> PyResult<()> {
        self.set_state(state)
    }
}

/// A vector of three components.
fn vector<F>(components: [f32; 3]) -> Vector<f32, F> {
    Vector::from_components(components.into())
}

/// A number of columns for each skydiver, if given.
struct Given<'py>(Option<PyReadonlyArrayDyn<'py, f32>>);

impl<'py> Given<'py> {
    fn of(
        given: Option<&Bound<'py, PyAny>>,
        name: &str,
        count: usize,
        columns: usize,
    ) -> PyResult<Self> {
        let shape = [Some(count), Some(columns)];
        let array = given.map(|given| finite::<f32>(given, name, &shape));
        Ok(Self(array.transpose()?))
    }

    fn row<const N: usize>(&self, index: usize) -> PyResult<Option<[f32; N]>> {
        let Some(array) = &self.0 else {
            return Ok(None);
        };
        Ok(array.as_slice()?.as_chunks::<N>().0.get(index).copied())
    }
}

/// Names of the numbers of a state.
pub(crate) fn state_names() -> Vec<String> {
    let amounts = CONTROLS.iter().map(|control| control.name.to_owned());
    MOVING
        .iter()
        .copied()
        .map(str::to_owned)
        .chain(amounts)
        .collect()
}

/// Returns the flights with these states.
///
/// # Errors
/// Returns an error if the quaternion of an attitude has not the length one.
pub(crate) fn of_states<'a>(
    course: &Course<f32>,
    rows: impl Iterator<Item = &'a [f32; NUMBERS]>,
) -> PyResult<Vec<Skydiver<f32>>> {
    let flight = |(index, row): (usize, &[f32; NUMBERS])| {
        let [w, x, y, z, ..] = *row;
        let size = w * w + x * x + y * y + z * z;
        if (size - 1.0).abs() > 1e-3 {
            return Err(no_attitude("state", index));
        }
        Ok(course.of_numbers(row))
    };
    rows.enumerate().map(flight).collect()
}

fn no_attitude(name: &str, row: usize) -> PyErr {
    let problem =
        Problem::bad_input("expected the attitude as a quaternion w, x, y, z of length 1");
    raise(problem.at(format!("{name}, row {row}")))
}

/// Returns the loads on each skydiver; none at all if no loads are given.
fn loads(
    count: usize,
    force: Option<&Bound<'_, PyAny>>,
    moment: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<AppliedLoads<f32>>> {
    if force.is_none() && moment.is_none() {
        return Ok(Vec::new());
    }
    let force = Given::of(force, "force", count, 3)?;
    let moment = Given::of(moment, "moment", count, 3)?;
    let mut all = Vec::with_capacity(count);
    for index in 0..count {
        let mut loads = AppliedLoads::none();
        let kinds = [
            (Kind::Force(Point::Body), force.row::<3>(index)?),
            (Kind::Moment, moment.row::<3>(index)?),
        ];
        for (kind, row) in kinds {
            for (axis, size) in Axis::ALL.into_iter().zip(row.into_iter().flatten()) {
                let load = AppliedLoad {
                    kind,
                    direction: Direction::World(axis),
                    size,
                    factors: [None; FACTORS],
                };
                loads = loads
                    .with(load)
                    .map_err(|error| raise(Problem::internal(error.to_string())))?;
            }
        }
        all.push(loads);
    }
    Ok(all)
}
