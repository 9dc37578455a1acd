//! Flights, the recordings in them, and synthetic ones.

use std::path::{Path, PathBuf};

use bodyflight_core::Segment;
use bodyflight_core::dynamics::free_run::Equations;
use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::maneuver::scripts::MANEUVERS;
use bodyflight_core::sensor_noise::SensorNoise;
use bodyflight_io::destination;
use bodyflight_laboratory::synthesize::{JointError, Request, synthesize};
use bodyflight_mvnx::ArmFrame;
use bodyflight_mvnx::recording::{BadFrames, Options};
use bodyflight_replay::flight::{self, Start};
use bodyflight_replay::model_file::Effects;
use numpy::{PyArray, PyArray1};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays::{MotionArrays, Motions, parts, tables};
use crate::long::long;
use crate::mechanics::{attitudes, numbers, postures, wxyz};
use crate::problem::{dictionary, raise, unknown};
use crate::record;
use crate::subject::Subject;

/// A recording with the subject, the air and the inputs that go with it: a `flight.toml`, its folder, or an MVNX file.
#[pyclass(frozen, from_py_object, module = "bodyflight")]
#[derive(Clone)]
pub(crate) struct Flight {
    pub(crate) inner: flight::Flight,
    pub(crate) options: Options,
    asked: Asked,
}

/// What a flight was made of. Its files are read again by whoever unpickles it.
#[derive(Clone)]
struct Asked {
    path: PathBuf,
    model: Option<PathBuf>,
    equations: Option<String>,
    subject: Option<Subject>,
    strict: bool,
    allow_truncated: bool,
    arm_frame: Option<String>,
}

impl Flight {
    /// Its name in reports.
    pub(crate) fn name(&self) -> String {
        flight::name_of(&self.asked.path)
    }
}

#[pymethods]
impl Flight {
    #[new]
    #[pyo3(signature = (path, *, model = None, equations = None, subject = None, strict = false, allow_truncated = false, arm_frame = None))]
    fn new(
        path: PathBuf,
        model: Option<PathBuf>,
        equations: Option<&str>,
        subject: Option<Subject>,
        strict: bool,
        allow_truncated: bool,
        arm_frame: Option<&str>,
    ) -> PyResult<Self> {
        // Absolute, so that other processes find them from wherever they work.
        let absolute = |path: &PathBuf| std::path::absolute(path).unwrap_or_else(|_| path.clone());
        let asked = Asked {
            path: absolute(&path),
            model: model.as_ref().map(absolute),
            equations: equations.map(str::to_owned),
            subject: subject.clone(),
            strict,
            allow_truncated,
            arm_frame: arm_frame.map(str::to_owned),
        };
        let mut inner = flight::Flight::read(&path).map_err(raise)?;
        if let Some(model) = model {
            inner.effects = Effects::read(&model).map_err(raise)?;
        }
        if let Some(name) = equations {
            inner.equations = match name {
                "exact" => Equations::Exact,
                "as-published" => Equations::AsPublished,
                _ => return Err(unknown("equations", name, &["exact", "as-published"])),
            };
        }
        if let Some(subject) = subject {
            inner.subject = subject.inner;
            inner.has_subject = true;
        }
        let arm_frame = match arm_frame {
            None => None,
            Some("t-pose") => Some(ArmFrame::TPose),
            Some("isb") => Some(ArmFrame::Isb),
            Some(name) => return Err(unknown("arm frame", name, &["t-pose", "isb"])),
        };
        let bad_frames = if strict {
            BadFrames::Refuse
        } else {
            BadFrames::Bridge
        };
        let options = Options {
            bad_frames,
            allow_truncated,
            arm_frame,
        };
        // A file that is missing or no recording fails here, not in the middle of later work.
        bodyflight_mvnx::recording::Recording::open(&inner.recording, options).map_err(raise)?;
        Ok(Self {
            inner,
            options,
            asked,
        })
    }

    /// Writes a motion of n frames as a recording with its files into the folder `out`, and returns it as a flight.
    ///
    /// `time` (s, evenly spaced; n), `position` of the pelvis (m; north, west, up; n by 3), `inertial_from_body` (quaternions w,
    /// x, y, z; n by 4) and `parent_from_segment` (n by 16 by 4) are as in `Recording`, and so are `velocity` (m/s) and
    /// `angular_velocity` (rad/s, body axes), n by 3, which otherwise follow from them. Numbers are written with six decimals.
    #[staticmethod]
    #[pyo3(
        signature = (out, *, time, position, inertial_from_body, parent_from_segment, velocity = None, angular_velocity = None, subject = None, density = flight::DEFAULT_DENSITY, force = false, progress = None),
        text_signature = "(out, *, time, position, inertial_from_body, parent_from_segment, velocity=None, angular_velocity=None, subject=None, density=1.0, force=False, progress=None)"
    )]
    #[expect(clippy::too_many_arguments, reason = "one for each option")]
    fn from_arrays(
        py: Python<'_>,
        out: PathBuf,
        time: &Bound<'_, PyAny>,
        position: &Bound<'_, PyAny>,
        inertial_from_body: &Bound<'_, PyAny>,
        parent_from_segment: &Bound<'_, PyAny>,
        velocity: Option<&Bound<'_, PyAny>>,
        angular_velocity: Option<&Bound<'_, PyAny>>,
        subject: Option<Subject>,
        density: f64,
        force: bool,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let time = numbers(time, "time", &[None])?;
        let count = Some(time.len());
        let optional = |given: Option<&Bound<'_, PyAny>>, name: &str| {
            let numbers = given.map(|given| numbers(given, name, &[count, Some(3)]));
            numbers.transpose()
        };
        let name = "inertial_from_body";
        let attitudes = attitudes(&numbers(inertial_from_body, name, &[count, Some(4)])?, name)?;
        let given = record::Given {
            postures: postures(parent_from_segment, count)?,
            attitudes,
            position: numbers(position, "position", &[count, Some(3)])?,
            velocity: optional(velocity, "velocity")?,
            angular_velocity: optional(angular_velocity, "angular_velocity")?,
            time,
        };
        destination::check_in(&out, record::FILES, force).map_err(raise)?;
        let subject = Subject::or_default(subject);
        let path = long(py, progress, |progress| {
            given.write(&out, &subject, density, progress)
        })?;
        Self::new(path, None, None, None, false, false, None)
    }

    /// Path of the recording.
    #[getter]
    fn path(&self) -> PathBuf {
        self.inner.recording.clone()
    }

    /// The person.
    #[getter]
    fn subject(&self) -> Subject {
        Subject {
            inner: self.inner.subject.clone(),
        }
    }

    /// Returns the same flight with another person.
    fn with_subject(&self, subject: Subject) -> Self {
        let mut flight = self.clone();
        flight.inner.subject = subject.inner.clone();
        flight.inner.has_subject = true;
        flight.asked.subject = Some(subject);
        flight
    }

    /// Reads every frame.
    #[pyo3(signature = (*, progress = None))]
    fn read(&self, py: Python<'_>, progress: Option<Py<PyAny>>) -> PyResult<Recording> {
        Recording::read(py, self, progress)
    }

    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<((PathBuf,), Bound<'py, PyDict>)> {
        let asked = &self.asked;
        let options = PyDict::new(py);
        options.set_item("model", asked.model.as_deref())?;
        options.set_item("equations", asked.equations.as_deref())?;
        options.set_item("subject", asked.subject.clone())?;
        options.set_item("strict", asked.strict)?;
        options.set_item("allow_truncated", asked.allow_truncated)?;
        options.set_item("arm_frame", asked.arm_frame.as_deref())?;
        Ok(((asked.path.clone(),), options))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    fn __repr__(&self) -> String {
        format!("Flight({:?})", self.inner.recording.display().to_string())
    }
}

impl Flight {
    /// The file or folder that it was made of.
    pub(crate) fn asked_path(&self) -> &Path {
        &self.asked.path
    }

    /// Returns the flight with the start of this name.
    pub(crate) fn starting(&self, start: &str) -> PyResult<flight::Flight> {
        let mut inner = self.inner.clone();
        inner.start = match start {
            "smoothed" => Start::Smoothed,
            "first" => Start::First,
            _ => return Err(unknown("start", start, &["smoothed", "first"])),
        };
        Ok(inner)
    }
}

/// The n frames of a flight, as arrays.
#[pyclass(frozen, module = "bodyflight")]
pub(crate) struct Recording {
    /// Time since frame 0 (s); n.
    #[pyo3(get)]
    time: Py<PyArray1<f64>>,
    /// Motion of the pelvis.
    #[pyo3(get)]
    motion: Py<MotionArrays>,
    /// Rotation of each segment relative to its parent as a quaternion w, x, y, z, in the order of `Subject.segments`; n by 16
    /// by 4.
    #[pyo3(get)]
    parent_from_segment: Py<PyArray<f64, numpy::Ix3>>,
    /// Whether a frame was interpolated to replace a bad one; n.
    #[pyo3(get)]
    bridged: Py<PyArray1<bool>>,
    /// Sentences about implausible parts of the recording.
    #[pyo3(get)]
    warnings: Vec<String>,
}

#[pymethods]
impl Recording {
    /// Creates a recording from its parts, as pickle does.
    #[new]
    const fn new(
        time: Py<PyArray1<f64>>,
        motion: Py<MotionArrays>,
        parent_from_segment: Py<PyArray<f64, numpy::Ix3>>,
        bridged: Py<PyArray1<bool>>,
        warnings: Vec<String>,
    ) -> Self {
        Self {
            time,
            motion,
            parent_from_segment,
            bridged,
            warnings,
        }
    }

    fn __getnewargs__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let names = [
            "time",
            "motion",
            "parent_from_segment",
            "bridged",
            "warnings",
        ];
        parts(slf, &names)
    }
}

impl Recording {
    fn read(py: Python<'_>, flight: &Flight, progress: Option<Py<PyAny>>) -> PyResult<Self> {
        let (mut time, mut bridged) = (Vec::new(), Vec::new());
        let (mut postures, mut motions) = (Vec::new(), Motions::default());
        let warnings = long(py, progress, |progress| {
            let mut recording = flight.inner.open(flight.options)?;
            for frame in recording.by_ref() {
                let frame = frame?;
                time.push(frame.time);
                bridged.push(frame.bridged);
                postures.push(Segment::ALL.map(|segment| wxyz(&frame.posture, segment)));
                motions.push(&frame.motion()?);
                if time.len().is_multiple_of(1024) {
                    progress(frame.time);
                    bodyflight_io::interrupt::check()?;
                }
            }
            let warnings = recording.warnings();
            Ok(warnings.iter().map(ToString::to_string).collect())
        })?;
        Ok(Self {
            time: PyArray1::from_vec(py, time).unbind(),
            motion: motions.arrays(py)?,
            parent_from_segment: tables(py, postures)?,
            bridged: PyArray1::from_vec(py, bridged).unbind(),
            warnings,
        })
    }
}

/// Simulates a maneuver and writes it to the folder `out` as a flight. Returns the dictionary of `bodyflight synth --json`.
#[pyfunction]
#[pyo3(
    signature = (maneuver, out, *, subject = None, density = flight::DEFAULT_DENSITY, seed = 0, noise = 1.0, joint_error_deg = 0.0, joint_wander_deg = 0.0, tunnel = false, progress = None),
    text_signature = "(maneuver, out, *, subject=None, density=1.0, seed=0, noise=1.0, joint_error_deg=0.0, joint_wander_deg=0.0, tunnel=False, progress=None)"
)]
#[expect(clippy::too_many_arguments, reason = "one for each option")]
pub(crate) fn synth(
    py: Python<'_>,
    maneuver: &str,
    out: PathBuf,
    subject: Option<Subject>,
    density: f64,
    seed: u64,
    noise: f64,
    joint_error_deg: f64,
    joint_wander_deg: f64,
    tunnel: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyAny>> {
    let names: Vec<&str> = MANEUVERS.iter().map(|maneuver| maneuver.name).collect();
    let found = Maneuver::from_name(maneuver);
    let maneuver = found.ok_or_else(|| unknown("maneuver", maneuver, &names))?;
    let subject = Subject::or_default(subject);
    let request = Request {
        density,
        noise: SensorNoise::PAPER.scaled(noise),
        joint_error: JointError {
            calibration: joint_error_deg.to_radians(),
            wander: joint_wander_deg.to_radians(),
        },
        tunnel,
        ..Request::new(maneuver, &subject, seed)
    };
    let report = long(py, progress, |progress| {
        synthesize(&request, &out, &mut |time| progress(time))
    })?;
    dictionary(py, &report)
}
