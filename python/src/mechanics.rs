//! Postures as arrays, and what follows from them: mass, momentum, the loads of the air, and the linear response to joints.

use std::path::Path;

use bodyflight_core::body::joint_angle::JointAngle;
use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::{Dynamics, Motion, State};
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::{Posture, Segment};
use bodyflight_io::diagnostic::Problem;
use bodyflight_io::interrupt;
use bodyflight_replay::flight::{DEFAULT_DENSITY, DensityChoice, Flight};
use bodyflight_replay::joint_change::angle_named;
use bodyflight_replay::subject;
use bodyflight_verbs::technique::linear::{Linear, OUTPUT_NAMES};
use bodyflight_viewer::cockpit::STARTS;
use nalgebra::{DVector, Quaternion, UnitQuaternion};
use numpy::{Ix3, PyArray, PyArray2, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use std::collections::BTreeMap;

use crate::arguments::finite;
use crate::arrays::{rows, tables};
use crate::long::long;
use crate::problem::{dictionary, raise, unknown};
use crate::subject::Subject;

/// Number of segments.
const SEGMENTS: usize = Segment::ALL.len();

/// Mass, momentum and loads of a body in n postures, in body axes: left, dorsal, cranial, from the pelvic joint.
#[pyclass(frozen, module = "bodyflight")]
pub(crate) struct Mechanics {
    /// Mass with equipment (kg).
    #[pyo3(get)]
    mass: f64,
    /// Centre of mass (m); n by 3.
    #[pyo3(get)]
    centre_of_mass: Py<PyArray2<f64>>,
    /// Inertia about the centre of mass (kg m2); n by 3 by 3.
    #[pyo3(get)]
    inertia: Py<PyArray<f64, Ix3>>,
    /// Linear momentum: north, west, up (kg m/s); n by 3.
    #[pyo3(get)]
    linear_momentum: Py<PyArray2<f64>>,
    /// Angular momentum about the centre of mass: north, west, up (kg m2/s); n by 3.
    #[pyo3(get)]
    angular_momentum: Py<PyArray2<f64>>,
    /// Force of the air on each segment, without damping and muscle input (N); n by 16 by 3.
    #[pyo3(get)]
    segment_force: Py<PyArray<f64, Ix3>>,
    /// Moment of the air on each segment about the pelvic joint (N m); n by 16 by 3.
    #[pyo3(get)]
    segment_moment: Py<PyArray<f64, Ix3>>,
}

#[derive(Default)]
struct Columns {
    centre: Vec<[f64; 3]>,
    inertia: Vec<[[f64; 3]; 3]>,
    linear: Vec<[f64; 3]>,
    angular: Vec<[f64; 3]>,
    force: Vec<[[f64; 3]; SEGMENTS]>,
    moment: Vec<[[f64; 3]; SEGMENTS]>,
}

impl Columns {
    fn push(
        &mut self,
        dynamics: &Dynamics<f64>,
        posture: &Posture<f64>,
        rate: &PostureRate<f64>,
        motion: &Motion<f64>,
    ) {
        let sample = dynamics.sample(posture, rate);
        let state = State::from_motion(motion, &sample);
        let loads = dynamics.segment_loads(posture, motion);
        self.centre.push(sample.mass.cg.into());
        // Symmetric, so that rows are columns.
        self.inertia.push(sample.inertia.into());
        self.linear.push(state.linear_momentum.to_array());
        self.angular.push(state.angular_momentum.to_array());
        self.force
            .push(Segment::ALL.map(|segment| loads[segment].force.into()));
        self.moment
            .push(Segment::ALL.map(|segment| loads[segment].moment.into()));
    }
}

/// Mass, momentum and loads of a person in postures: `parent_from_segment`, n by 16 by 4, as `Recording` has them.
///
/// `velocity` (m/s; north, west, up) and `angular_velocity` (rad/s, body axes) are those of the pelvis, n by 3, by default 0;
/// `inertial_from_body` is the attitude as a quaternion w, x, y, z, n by 4, by default 1, 0, 0, 0: upright, with the left side to
/// the north. If `time` (s; n) is given, joints move from each posture to the next, otherwise they are at rest. The air is still, with `density` (kg/m3).
#[pyfunction]
#[pyo3(
    signature = (subject, parent_from_segment, *, velocity = None, inertial_from_body = None, angular_velocity = None, time = None, density = DEFAULT_DENSITY),
    text_signature = "(subject, parent_from_segment, *, velocity=None, inertial_from_body=None, angular_velocity=None, time=None, density=1.0)"
)]
#[expect(clippy::too_many_arguments, reason = "one for each option")]
pub(crate) fn mechanics(
    py: Python<'_>,
    subject: Subject,
    parent_from_segment: &Bound<'_, PyAny>,
    velocity: Option<&Bound<'_, PyAny>>,
    inertial_from_body: Option<&Bound<'_, PyAny>>,
    angular_velocity: Option<&Bound<'_, PyAny>>,
    time: Option<&Bound<'_, PyAny>>,
    density: f64,
) -> PyResult<Py<Mechanics>> {
    let postures = postures(parent_from_segment, None)?;
    let count = Some(postures.len());
    let columns = |given: Option<&Bound<'_, PyAny>>, name: &str, columns: usize| {
        let shape = [count, Some(columns)];
        given.map(|given| numbers(given, name, &shape)).transpose()
    };
    let velocity = columns(velocity, "velocity", 3)?;
    let spin = columns(angular_velocity, "angular_velocity", 3)?;
    let attitude = columns(inertial_from_body, "inertial_from_body", 4)?;
    let time = time
        .map(|time| numbers(time, "time", &[count]))
        .transpose()?;
    let times = time.as_deref();
    if let Some(place) =
        times.and_then(|times| times.windows(2).position(|pair| pair[1] <= pair[0]))
    {
        let problem = Problem::bad_input("expected times that increase");
        return Err(raise(problem.at(format!("time, row {}", place + 1))));
    }
    let attitudes = attitude
        .as_deref()
        .map(|attitude| attitudes(attitude, "inertial_from_body"))
        .transpose()?;
    let dynamics = in_air(&subject.inner, density)?.dynamics(0.0);
    let found = long(py, None, |_| {
        let mut found = Columns::default();
        for (index, posture) in postures.iter().enumerate() {
            if index.is_multiple_of(256) {
                interrupt::check()?;
            }
            let inertial_from_body = attitudes
                .as_ref()
                .and_then(|all| all.get(index).copied())
                .map_or_else(Rotation::identity, Rotation::from_quaternion);
            let motion = Motion {
                inertial_from_body,
                position: Vector::zero(),
                velocity: inertial_from_body.inverse() * vector(velocity.as_deref(), index),
                angular_velocity: vector(spin.as_deref(), index),
            };
            let rate = rate(&postures, times, index);
            found.push(&dynamics, posture, &rate, &motion);
        }
        Ok(found)
    })?;
    let mechanics = Mechanics {
        mass: dynamics.body.mass(),
        centre_of_mass: rows(py, found.centre)?,
        inertia: tables(py, found.inertia)?,
        linear_momentum: rows(py, found.linear)?,
        angular_momentum: rows(py, found.angular)?,
        segment_force: tables(py, found.force)?,
        segment_moment: tables(py, found.moment)?,
    };
    Py::new(py, mechanics)
}

/// Rates of the joints at a posture: from the one before to the one after it, if there are times.
fn rate(postures: &[Posture<f64>], times: Option<&[f64]>, index: usize) -> PostureRate<f64> {
    let (before, after) = (index.saturating_sub(1), index + 1);
    let after = after.min(postures.len().saturating_sub(1));
    let pair = postures.get(before).zip(postures.get(after));
    let duration = times.and_then(|times| Some(times.get(after)? - times.get(before)?));
    match (pair, duration) {
        (Some((from, to)), Some(duration)) if duration > 0.0 => {
            PostureRate::between(from, to, duration)
        }
        _ => PostureRate::zero(),
    }
}

/// A person in still air of this density (kg/m3).
fn in_air(subject: &subject::Subject, density: f64) -> PyResult<Flight> {
    if !(density > 0.0 && density <= 2.0) {
        return Err(raise(Problem::bad_input(format!(
            "expected a density above 0 and up to 2 kg/m3, found {density}"
        ))));
    }
    let mut flight = Flight::bare(Path::new(""));
    flight.subject = subject.clone();
    flight.density = DensityChoice::Constant(density);
    Ok(flight)
}

/// Copies finite numbers of an argument.
pub(crate) fn numbers(
    given: &Bound<'_, PyAny>,
    name: &str,
    shape: &[Option<usize>],
) -> PyResult<Vec<f64>> {
    let array: PyReadonlyArrayDyn<'_, f64> = finite(given, name, shape)?;
    Ok(array.as_slice()?.to_vec())
}

/// A row of three components; zero if there are none.
pub(crate) fn vector<F>(rows: Option<&[f64]>, index: usize) -> Vector<f64, F> {
    let row = rows.and_then(|rows| rows.as_chunks::<3>().0.get(index));
    row.map_or_else(Vector::zero, |row| Vector::from_components((*row).into()))
}

/// Reads rows of quaternions w, x, y, z.
///
/// # Errors
/// Returns an error if one has not the length one.
pub(crate) fn attitudes(rows: &[f64], name: &str) -> PyResult<Vec<UnitQuaternion<f64>>> {
    let quaternion = |(row, wxyz): (usize, &[f64; 4])| {
        let [w, x, y, z] = *wxyz;
        let quaternion = Quaternion::new(w, x, y, z);
        if (quaternion.norm() - 1.0).abs() > 1e-3 {
            let problem = Problem::bad_input(format!(
                "expected quaternions w, x, y, z of length 1, found {wxyz:?}"
            ));
            return Err(raise(problem.at(format!("{name}, row {row}"))));
        }
        Ok(*Rotation::<f64, (), ()>::from_wxyz(*wxyz)
            .unwrap_or_else(Rotation::identity)
            .quaternion())
    };
    let rows = rows.as_chunks().0.iter().enumerate();
    rows.map(quaternion).collect()
}

/// Reads postures, n by 16 by 4; any number of them if `count` is None.
///
/// # Errors
/// Returns an error if the argument has another shape, or a quaternion has not the length one.
pub(crate) fn postures(
    given: &Bound<'_, PyAny>,
    count: Option<usize>,
) -> PyResult<Vec<Posture<f64>>> {
    let name = "parent_from_segment";
    let rotations = attitudes(
        &numbers(given, name, &[count, Some(SEGMENTS), Some(4)])?,
        name,
    )?;
    let posture = |rotations: &[UnitQuaternion<f64>; SEGMENTS]| {
        let pairs = Segment::ALL.into_iter().zip(rotations);
        pairs.fold(Posture::h_pose(), |posture, (segment, rotation)| {
            posture.with(segment, *rotation)
        })
    };
    Ok(rotations.as_chunks().0.iter().map(posture).collect())
}

/// Returns the posture of a start in `Skydivers.starts`, with joints turned further by `angles`: by name of the angle, such as
/// {"l_shank.bend": 0.3} (rad). 16 by 4, as a row of `Recording.parent_from_segment`.
#[pyfunction]
#[pyo3(signature = (start = "neutral", angles = None))]
pub(crate) fn posture(
    py: Python<'_>,
    start: &str,
    angles: Option<BTreeMap<String, f64>>,
) -> PyResult<Py<PyArray2<f64>>> {
    let names = STARTS.map(|start| start.name);
    let found = STARTS.iter().find(|known| known.name == start);
    let start = found.ok_or_else(|| unknown("start", start, &names))?;
    let mut posture = pattern::posture(start.posture);
    for (name, by) in angles.unwrap_or_default() {
        if !by.is_finite() {
            let problem = Problem::bad_input(format!("expected a finite angle, found {by}"));
            return Err(raise(problem.at(format!("angles, {name}"))));
        }
        posture = angle_named(&name).map_err(raise)?.turned(&posture, by);
    }
    rows(
        py,
        Segment::ALL.map(|segment| wxyz(&posture, segment)).to_vec(),
    )
}

/// Rotation of a segment as w, x, y, z.
pub(crate) fn wxyz(posture: &Posture<f64>, segment: Segment) -> [f64; 4] {
    let [x, y, z, w] = posture.parent_from_segment(segment).coords.into();
    [w, x, y, z]
}

/// A linear model of small motions about a steady fall: dx/dt = A x + B u + B_rate du/dt, y = C x + D u + D_rate du/dt.
#[pyclass(frozen, module = "bodyflight")]
pub(crate) struct Linearization {
    /// A; 9 by 9.
    #[pyo3(get, name = "A")]
    states: Py<PyArray2<f64>>,
    /// B; 9 by 45.
    #[pyo3(get, name = "B")]
    input: Py<PyArray2<f64>>,
    /// B_rate; 9 by 45.
    #[pyo3(get, name = "B_rate")]
    input_rate: Py<PyArray2<f64>>,
    /// C; 5 by 9.
    #[pyo3(get, name = "C")]
    seen: Py<PyArray2<f64>>,
    /// D; 5 by 45.
    #[pyo3(get, name = "D")]
    direct: Py<PyArray2<f64>>,
    /// D_rate; 5 by 45.
    #[pyo3(get, name = "D_rate")]
    direct_rate: Py<PyArray2<f64>>,
    /// Posture of the steady fall; 16 by 4.
    #[pyo3(get)]
    posture: Py<PyArray2<f64>>,
    /// The steady fall: fall rate (m/s), body pitch (rad; pi/2 is belly to earth), bend of the knees (rad) and glide ratio.
    #[pyo3(get)]
    fall: Py<PyAny>,
}

#[pymethods]
impl Linearization {
    /// Names of the nine states, with units; axes are inertial for velocity, and the body's otherwise.
    #[classattr]
    const fn states() -> [&'static str; 9] {
        [
            "rotation_left_rad",
            "rotation_dorsal_rad",
            "rotation_cranial_rad",
            "velocity_north_mps",
            "velocity_west_mps",
            "velocity_up_mps",
            "angular_velocity_left_radps",
            "angular_velocity_dorsal_radps",
            "angular_velocity_cranial_radps",
        ]
    }

    /// Names of the 45 inputs: angles of joints (rad).
    #[classattr]
    fn inputs() -> Vec<String> {
        JointAngle::all().map(|angle| angle.to_string()).collect()
    }

    /// Names of the five outputs, with units.
    #[classattr]
    fn outputs() -> [&'static str; OUTPUT_NAMES.len()] {
        OUTPUT_NAMES
    }
}

/// Linearises the model about the steady fall of a person in the neutral pose, as `bodyflight technique` does, in still air of
/// `density` (kg/m3).
#[pyfunction]
#[pyo3(signature = (subject = None, *, density = DEFAULT_DENSITY), text_signature = "(subject=None, *, density=1.0)")]
pub(crate) fn linearize(
    py: Python<'_>,
    subject: Option<Subject>,
    density: f64,
) -> PyResult<Linearization> {
    let flight = in_air(&Subject::or_default(subject), density)?;
    let axes: Vec<JointAngle> = JointAngle::all().collect();
    let linear = long(py, None, |_| {
        let found = Linear::of(&flight.dynamics(0.0), &flight.constant_inputs(), &axes);
        found.map_err(|error| Problem::disagreement(error.to_string()))
    })?;
    let unit = |place: usize| {
        let mut weights = DVector::zeros(axes.len());
        weights[place] = 1.0;
        linear.of_pattern(&weights)
    };
    let each: Vec<_> = (0..axes.len()).map(unit).collect();
    let matrix = |height: usize, width: usize, at: &dyn Fn(usize, usize) -> f64| {
        let row = |row: usize| (0..width).map(|column| at(row, column)).collect();
        let all: Vec<Vec<f64>> = (0..height).map(row).collect();
        Ok::<_, PyErr>(PyArray2::from_vec2(py, &all)?.unbind())
    };
    let (states, inputs, outputs) = (linear.states.nrows(), axes.len(), OUTPUT_NAMES.len());
    let fall = linear.fall;
    let described = serde_json::json!({
        "fall_rate_mps": fall.fall_rate,
        "body_pitch_rad": fall.body_pitch,
        "knee_rad": fall.knee,
        "glide": fall.glide,
    });
    let posture = Segment::ALL.map(|segment| wxyz(&linear.posture, segment));
    let seen = each.first().map(|single| single.seen).unwrap_or_default();
    Ok(Linearization {
        states: matrix(states, states, &|row, column| linear.states[(row, column)])?,
        input: matrix(states, inputs, &|row, column| each[column].input[0][row])?,
        input_rate: matrix(states, inputs, &|row, column| each[column].input[1][row])?,
        seen: matrix(outputs, states, &|row, column| seen[(row, column)])?,
        direct: matrix(outputs, inputs, &|row, column| each[column].direct[0][row])?,
        direct_rate: matrix(outputs, inputs, &|row, column| each[column].direct[1][row])?,
        posture: rows(py, posture.to_vec())?,
        fall: dictionary(py, &described)?,
    })
}
