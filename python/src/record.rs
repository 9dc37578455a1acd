//! A flight by actions as a recording, for the verbs that read recordings.

use std::path::PathBuf;

use bodyflight_core::Posture;
use bodyflight_core::dynamics::Motion;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_io::destination;
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_mvnx::writer::{Description, Origin, Writer};
use bodyflight_replay::flight::DEFAULT_DENSITY;
use bodyflight_viewer::cockpit::CONTROLS;
use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::problem::raise;
use crate::skydivers::{course, expect_shape};
use crate::subject::Subject;

/// Flies `actions` (t by 8, as for `Skydivers.step`) and writes the flight to `out` as an MVNX file with 240 frames a second.
///
/// The motion after each action is the same as that of `Skydivers` and of the environments. Returns the number of frames.
#[pyfunction]
#[pyo3(signature = (actions, out, *, start = "neutral", subject = None, density = DEFAULT_DENSITY, substeps = 8, force = false))]
pub(crate) fn record(
    actions: PyReadonlyArray2<'_, f32>,
    out: PathBuf,
    start: &str,
    subject: Option<Subject>,
    density: f64,
    substeps: u32,
    force: bool,
) -> PyResult<u64> {
    let steps = actions.shape().first().copied().unwrap_or(0);
    expect_shape("actions", actions.shape(), &[steps, CONTROLS.len()])?;
    let body = Subject::or_default(subject.clone()).body();
    let course = course(start, subject, density, substeps)?;
    destination::check([&out], force).map_err(raise)?;
    let description = Description {
        subject_label: "Simulated".to_owned(),
        frame_rate: 1.0 / TIME_STEP,
        start_unix_ms: 0,
        comment: "bodyflight.record".to_owned(),
        origin: Origin::Simulated,
    };
    let mut writer = Writer::create(&out, description, &body).map_err(raise)?;
    let mut index = 0;
    let mut skydiver = course.begun();
    let (posture, motion) = course.at_start();
    writer
        .write(&frame(index, &posture, &motion))
        .map_err(raise)?;
    for action in actions.as_slice()?.as_chunks().0 {
        for (posture, motion) in course.watch(&mut skydiver, action) {
            index += 1;
            writer
                .write(&frame(index, &posture, &motion))
                .map_err(raise)?;
        }
    }
    writer.finish().map_err(raise)?;
    Ok(index + 1)
}

/// A frame of the recording.
fn frame(index: u64, posture: &Posture<f32>, motion: &Motion<f32>) -> FlightFrame {
    let motion: Motion<f64> = motion.cast();
    #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
    let time = index as f64 * TIME_STEP;
    FlightFrame::from_motion(index, time, posture.cast(), &motion)
}
