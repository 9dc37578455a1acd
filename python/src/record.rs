//! A flight by actions as a recording, for the verbs that read recordings.

use std::path::{Path, PathBuf};

use bodyflight_core::Posture;
use bodyflight_core::dynamics::Motion;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::frame::Rotation;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::write_file;
use bodyflight_io::{destination, interrupt};
use bodyflight_mvnx::recording::{FlightFrame, PelvisMotion};
use bodyflight_mvnx::writer::{Description, Origin, Writer};
use bodyflight_replay::flight::DEFAULT_DENSITY;
use bodyflight_replay::subject::{self, SEGMENTS_FILE, SUBJECT_FILE};
use bodyflight_viewer::cockpit::CONTROLS;
use nalgebra::UnitQuaternion;
use pyo3::prelude::*;

use crate::arguments::finite;
use crate::long::long;
use crate::mechanics::vector;
use crate::options::Options;
use crate::problem::raise;
use crate::subject::Subject;

/// Flies `actions` (t by 8, as for `Skydivers.step`) and writes the flight to `out` as an MVNX file with 240 frames a second.
///
/// The motion after each action is the same as that of `Skydivers` and of the environments. Returns the number of frames.
/// `progress` is called with the flight time reached (s).
#[pyfunction]
#[pyo3(
    signature = (actions, out, *, start = "neutral", subject = None, density = DEFAULT_DENSITY, substeps = 8, force = false, progress = None),
    text_signature = "(actions, out, *, start='neutral', subject=None, density=1.0, substeps=8, force=False, progress=None)"
)]
#[expect(clippy::too_many_arguments, reason = "one for each option")]
pub(crate) fn record(
    py: Python<'_>,
    actions: &Bound<'_, PyAny>,
    out: PathBuf,
    start: &str,
    subject: Option<Subject>,
    density: f64,
    substeps: u32,
    force: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<u64> {
    let actions = finite::<f32>(actions, "actions", &[None, Some(CONTROLS.len())])?;
    let actions = actions.as_slice()?.as_chunks().0;
    let body = Subject::or_default(subject.clone()).body();
    let options = Options {
        start: start.to_owned(),
        subject,
        density,
        substeps,
    };
    let course = options.course()?;
    destination::check([&out], force).map_err(raise)?;
    let description = Description {
        subject_label: "Simulated".to_owned(),
        frame_rate: 1.0 / TIME_STEP,
        start_unix_ms: 0,
        comment: "bodyflight.record".to_owned(),
        origin: Origin::Simulated,
    };
    long(py, progress, |progress| {
        let mut writer = Writer::create(&out, description, &body)?;
        let mut index = 0;
        let mut skydiver = course.begun();
        let (posture, motion) = course.at_start();
        writer.write(&frame(index, &posture, &motion))?;
        for action in actions {
            interrupt::check()?;
            for (posture, motion) in course.watch(&mut skydiver, action) {
                index += 1;
                let frame = frame(index, &posture, &motion);
                writer.write(&frame)?;
                progress(frame.time);
            }
        }
        writer.finish()?;
        Ok(index + 1)
    })
}

/// A motion given as arrays of n frames.
pub(crate) struct Given {
    pub(crate) time: Vec<f64>,
    pub(crate) postures: Vec<Posture<f64>>,
    pub(crate) attitudes: Vec<UnitQuaternion<f64>>,
    pub(crate) position: Vec<f64>,
    pub(crate) velocity: Option<Vec<f64>>,
    pub(crate) angular_velocity: Option<Vec<f64>>,
}

/// Names of the files that [`Given::write`] makes.
pub(crate) const FILES: &[&str] = &["flight.toml", SUBJECT_FILE, SEGMENTS_FILE, RECORDING];
const RECORDING: &str = "flight.mvnx";
/// Largest deviation of a time from an even spacing, for that spacing.
const UNEVEN: f64 = 0.01;

impl Given {
    /// Number of frames in a second, which have to be evenly spaced.
    fn frame_rate(&self) -> Result<f64> {
        let [first, .., last] = self.time.as_slice() else {
            return Err(Problem::bad_input("expected at least two frames").at("time"));
        };
        #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
        let spacing = (last - first) / (self.time.len() - 1) as f64;
        #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
        let even = |index: usize| first + spacing * index as f64;
        let is_off = |(index, time): (usize, &f64)| (time - even(index)).abs() > UNEVEN * spacing;
        match self.time.iter().enumerate().position(is_off) {
            None if spacing > 0.0 => Ok(1.0 / spacing),
            found => Err(Problem::bad_input(format!(
                "expected times that increase evenly, each within {:.0} % of the spacing",
                100.0 * UNEVEN
            ))
            .at(format!("time, row {}", found.unwrap_or_default()))
            .help("interpolate the motion to even times first")),
        }
    }

    /// Writes a recording of `subject` with its `flight.toml` into a folder. Velocities that are not given follow from the
    /// positions and attitudes.
    pub(crate) fn write(
        &self,
        folder: &Path,
        subject: &subject::Subject,
        density: f64,
        progress: &dyn Fn(f64),
    ) -> Result<PathBuf> {
        let description = Description {
            subject_label: "From arrays".to_owned(),
            frame_rate: self.frame_rate()?,
            start_unix_ms: 0,
            comment: "bodyflight.Flight.from_arrays".to_owned(),
            origin: Origin::Simulated,
        };
        std::fs::create_dir_all(folder)
            .map_err(|error| Problem::system("create", folder, error))?;
        let mut writer = Writer::create(&folder.join(RECORDING), description, &subject.body())?;
        let pairs = self.postures.iter().zip(&self.attitudes).zip(&self.time);
        for (index, ((posture, attitude), time)) in pairs.enumerate() {
            if index.is_multiple_of(256) {
                interrupt::check()?;
                progress(*time);
            }
            let inertial_from_body = Rotation::from_quaternion(*attitude);
            let spin = self.angular_velocity.as_deref();
            writer.write(&FlightFrame {
                index: index as u64,
                time: *time,
                posture: *posture,
                pelvis: PelvisMotion {
                    inertial_from_body,
                    position: vector(Some(&self.position), index),
                    velocity: (self.velocity.as_deref()).map(|rows| vector(Some(rows), index)),
                    angular_velocity: spin
                        .map(|rows| inertial_from_body * vector(Some(rows), index)),
                },
                centre_of_mass: None,
                bridged: false,
            })?;
        }
        writer.finish()?;
        subject.write_in(folder)?;
        let path = folder.join("flight.toml");
        let text = format!(
            "recording = \"{RECORDING}\"\nsubject = \"{SUBJECT_FILE}\"\n\n[air]\ndensity = {density:?}\n"
        );
        write_file(&path, text.as_bytes())?;
        Ok(path)
    }
}

/// A frame of the recording.
fn frame(index: u64, posture: &Posture<f32>, motion: &Motion<f32>) -> FlightFrame {
    let motion: Motion<f64> = motion.cast();
    #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
    let time = index as f64 * TIME_STEP;
    FlightFrame::from_motion(index, time, posture.cast(), &motion)
}
