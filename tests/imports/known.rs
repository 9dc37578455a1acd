//! The known flight, and the difference of an imported flight from it.

use std::path::{Path, PathBuf};

use bodyflight_core::SegmentArray;
use bodyflight_mvnx::recording::{FlightFrame, Options, Recording};
use bodyflight_tests::program::{Program, plain};
use nalgebra::UnitQuaternion;

pub(crate) const PROGRAM: Program = Program(env!("CARGO_BIN_EXE_bodyflight"));

/// Largest allowed error of a recovered attitude (degrees).
pub(crate) const RETURNS: f64 = 0.5;

pub(crate) fn acrobatics(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "../verbs/data/acrobatics", name]
        .iter()
        .collect()
}

pub(crate) fn frames(path: &Path) -> Vec<FlightFrame> {
    let recording = Recording::open(path, Options::default()).expect("a recording");
    recording.collect::<Result<_, _>>().expect("good frames")
}

/// The known flight: a somersault with two twists.
pub(crate) fn known() -> Vec<FlightFrame> {
    frames(&acrobatics("flight-1.mvnx.gz"))
}

/// Rotations from segment axes to inertial axes.
pub(crate) fn turned(frame: &FlightFrame) -> SegmentArray<UnitQuaternion<f64>> {
    let attitude = *frame.pelvis.inertial_from_body.quaternion();
    (frame.posture.body_from_segments()).map(|_, segment| attitude * segment)
}

/// Imports a file and compares it with the known flight; returns the largest angular error of each segment (degrees)
/// and the largest position error (m).
pub(crate) fn imported(folder: &Path, arguments: &[&str]) -> (SegmentArray<f64>, f64) {
    let out = folder.join("out");
    // Some tables leave their positions in other axes, so that the body does not fall.
    let (report, code) =
        PROGRAM.answer(&[&["import"], arguments, &["--out", plain(&out), "--force"]].concat());
    assert!(matches!(code, Some(0 | 5)), "{report}");
    let (came, went) = (frames(&out.join("flight.mvnx")), known());
    assert_eq!(came.len(), went.len(), "{report}");
    assert_eq!(report["frame_rate_hz"], 200.0, "{report}");
    let mut angles = SegmentArray::from_fn(|_| 0.0_f64);
    let mut places = 0.0_f64;
    for (came, went) in came.iter().zip(&went) {
        let (a, b) = (turned(came), turned(went));
        for (segment, angle) in angles.iter_mut() {
            *angle = angle.max(a[segment].angle_to(&b[segment]).to_degrees());
        }
        let apart = came.pelvis.position.components - went.pelvis.position.components;
        places = places.max(apart.norm());
    }
    (angles, places)
}

pub(crate) fn largest(angles: &SegmentArray<f64>) -> f64 {
    angles.values().copied().fold(0.0, f64::max)
}
