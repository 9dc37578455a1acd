//! A small recording in memory, functions that damage its text, and functions that read it.

use std::path::Path;

use bodyflight_core::body::posture::joint_rotation;
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::{Posture, Segment};
use bodyflight_io::diagnostic::Problem;
use bodyflight_mvnx::recording::{FlightFrame, Options, PelvisMotion, Quality, Recording};
use bodyflight_mvnx::writer::{Description, Origin, Writer};
use bodyflight_replay::subject::Subject;
use bodyflight_verbs::inspect::{Report, inspect_input};

/// Name of the recording in messages.
pub const NAME: &str = "flight.mvnx";

/// A fall with a turning body and moving limbs, at 240 Hz.
pub fn flight(count: u64) -> impl Iterator<Item = FlightFrame> {
    (0..count).map(|index| {
        #[expect(clippy::cast_precision_loss, reason = "only a few frames")]
        let time = index as f64 / 240.0;
        FlightFrame {
            index,
            time,
            posture: Posture::h_pose()
                .with_angles(Segment::LeftUpperArm, 0.2, -1.2 - time, 0.1)
                .with_angles(Segment::RightShank, 0.0, 0.1, 0.7 + time),
            pelvis: PelvisMotion {
                inertial_from_body: Rotation::from_quaternion(joint_rotation(time, 0.1, -1.5)),
                position: Vector::new(time, 0.0, 4000.0 - 50.0 * time),
                velocity: Some(Vector::new(1.0, 0.0, -50.0)),
                angular_velocity: Some(Vector::new(0.0, 0.0, -1.0)),
            },
            centre_of_mass: Some(Vector::new(time, 0.1, 4000.1 - 50.0 * time)),
            bridged: false,
        }
    })
}

/// The text of a file with the first `count` frames of [`flight`].
pub fn written(count: u64) -> String {
    let description = Description {
        subject_label: "A <B> & \"C\"".into(),
        frame_rate: 240.0,
        start_unix_ms: 1_478_188_786_272,
        comment: "free fall & tracking".into(),
        origin: Origin::Simulated,
    };
    let body = Subject::default().body();
    let mut writer = Writer::new(Vec::new(), Path::new(NAME), description, &body).expect("begun");
    for frame in flight(count) {
        writer.write(&frame).expect("written");
    }
    String::from_utf8(writer.complete().expect("complete")).expect("text")
}

/// Frames of a recording, and the problems found while reading.
pub type Flown = (Vec<FlightFrame>, Quality);

/// Reads a recording as a whole.
///
/// # Errors
/// Returns an error if the recording is refused.
pub fn read_as(bytes: &[u8], name: &str, options: Options) -> Result<Flown, Problem> {
    let mut recording = Recording::new(bytes, Path::new(name), options)?;
    let frames = recording.by_ref().collect::<Result<_, _>>()?;
    Ok((frames, recording.quality().clone()))
}

/// Same as [`read_as`] with the default name and options.
///
/// # Errors
/// Returns an error if the recording is refused.
pub fn read(bytes: &[u8]) -> Result<Flown, Problem> {
    read_as(bytes, NAME, Options::default())
}

/// Returns the result of inspecting a recording.
///
/// # Errors
/// Returns an error if the recording is refused.
pub fn survey(bytes: &[u8]) -> Result<Report, Problem> {
    inspect_input(bytes, Path::new(NAME))
}

/// Replaces the first `from` after `anchor` in the text; panics if it is not found.
pub fn replaced(text: &str, anchor: &str, from: &str, to: &str) -> String {
    let start = text.find(anchor).expect("the anchor");
    let at = start + text[start..].find(from).expect("what is replaced");
    format!("{}{to}{}", &text[..at], &text[at + from.len()..])
}

/// Text of an element in the frame with this index.
pub fn element<'a>(text: &'a str, index: usize, name: &str) -> &'a str {
    let start = text.find(&format!("index=\"{index}\"")).expect("the frame");
    let start = start
        + text[start..]
            .find(&format!("<{name}>"))
            .expect("the element");
    let end = text[start..].find(&format!("</{name}>")).expect("its end");
    &text[start + name.len() + 2..start + end]
}

/// Modifies the numbers of one element in one frame of the text.
pub fn with_numbers(
    text: &str,
    index: usize,
    name: &str,
    change: impl Fn(&str) -> String,
) -> String {
    let numbers = element(text, index, name);
    replaced(
        text,
        &format!("index=\"{index}\""),
        numbers,
        &change(numbers),
    )
}

/// Whether a frame is usable: finite, with unit quaternions.
pub fn is_usable(frame: &FlightFrame) -> bool {
    let pelvis = &frame.pelvis;
    let rates = [
        pelvis.velocity,
        pelvis.angular_velocity,
        frame.centre_of_mass,
    ];
    frame.posture.is_valid()
        && frame.time.is_finite()
        && (pelvis.inertial_from_body.quaternion().norm() - 1.0).abs() < 1e-6
        && pelvis.position.is_finite()
        && rates.iter().flatten().all(|v| v.is_finite())
}
