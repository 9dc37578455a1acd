//! Faults planted in real captures: which of them `airborne` names.

use core::f64::consts::PI;
use std::path::{Path, PathBuf};

use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::{Posture, Segment, SegmentArray};
use bodyflight_mvnx::recording::{FlightFrame, Options, Recording};
use bodyflight_mvnx::writer::{Description, Origin, Writer};
use bodyflight_replay::subject::Subject;
use bodyflight_tests::program::plain;
use bodyflight_verbs::airborne::verdict::Verdict;
use nalgebra::{UnitQuaternion, Vector3};

use crate::{PROGRAM, acrobatics};

/// Frames of a capture, its rate (Hz), and its person.
pub(super) struct Capture {
    pub(super) name: &'static str,
    pub(super) frames: Vec<FlightFrame>,
    pub(super) rate: f64,
    pub(super) subject: Option<PathBuf>,
}

pub(super) fn frames(path: &Path) -> (Vec<FlightFrame>, f64) {
    let recording = Recording::open(path, Options::default()).expect("a recording");
    let rate = recording.header().frame_rate;
    (
        recording.map(|frame| frame.expect("a frame")).collect(),
        rate,
    )
}

/// The bundled somersaults.
pub(super) fn somersaults() -> Vec<Capture> {
    [
        ("flight-1", "subject-1.toml"),
        ("flight-3", "subject-3.toml"),
    ]
    .into_iter()
    .map(|(name, subject)| {
        let (frames, rate) = frames(&acrobatics().join(format!("{name}.mvnx.gz")));
        let subject = Some(acrobatics().join(subject));
        Capture {
            name,
            frames,
            rate,
            subject,
        }
    })
    .collect()
}

/// The bundled somersaults, and two jumps of the CMU library.
fn captures(folder: &Path) -> Vec<Capture> {
    let mut all = somersaults();
    let out = folder.join("cmu");
    let file = acrobatics().join("../cmu/01_01.amc.gz");
    // A jump with its run-up is no fall, which import says.
    let (_, code) = PROGRAM.answer(&["import", plain(&file), "--out", plain(&out)]);
    assert_eq!(code, Some(5));
    let (frames, rate) = frames(&out.join("flight.mvnx"));
    all.push(Capture {
        name: "cmu",
        frames,
        rate,
        subject: None,
    });
    all
}

/// Attitudes of all segments, changed by a function.
pub(super) fn turned(
    frame: &FlightFrame,
    change: impl Fn(&mut SegmentArray<UnitQuaternion<f64>>),
) -> FlightFrame {
    let body = *frame.pelvis.inertial_from_body.quaternion();
    let mut segments = frame
        .posture
        .body_from_segments()
        .map(|_, segment| body * segment);
    change(&mut segments);
    let mut changed = *frame;
    changed.posture = Posture::from_body_rotations(&segments);
    changed.pelvis.inertial_from_body = Rotation::from_quaternion(segments[Segment::Pelvis]);
    changed
}

/// A fault: its name, the kind of verdict that names it, the factor of the rate, and how it changes a frame. The flag
/// tells whether the frame is among those that the fault concerns.
type Fault = (
    &'static str,
    &'static str,
    f64,
    fn(&FlightFrame, bool) -> FlightFrame,
);

/// A fault of an attitude after which the places of the joints are as measured.
const PLACES_KEPT: &str = "thigh mounted 5 degrees off, joints where they are";

const FAULTS: [Fault; 7] = [
    ("tilt of 1 degree", "tilt", 1.0, |frame, _| {
        let tilt = UnitQuaternion::from_scaled_axis(Vector3::x() * (PI / 180.0));
        let mut tilted = turned(frame, |segments| {
            for (_, segment) in segments.iter_mut() {
                *segment = tilt * *segment;
            }
        });
        tilted.pelvis.position = Vector::from_components(tilt * frame.pelvis.position.components);
        tilted
    }),
    ("rate 2 % high", "rate", 1.02, |frame, _| *frame),
    ("rate 2 % low", "rate", 0.98, |frame, _| *frame),
    ("exchanged forearms", "step", 1.0, |frame, is_concerned| {
        turned(frame, |segments| {
            if is_concerned {
                let left = segments[Segment::LeftForearm];
                segments[Segment::LeftForearm] = segments[Segment::RightForearm];
                segments[Segment::RightForearm] = left;
            }
        })
    }),
    ("slipped marker", "step", 1.0, |frame, is_concerned| {
        turned(frame, |segments| {
            if is_concerned {
                segments[Segment::LeftShank] *=
                    UnitQuaternion::from_scaled_axis(Vector3::x() * 0.25);
            }
        })
    }),
    (PLACES_KEPT, "mounting", 1.0, |frame, _| mounted(frame)),
    (
        "thigh mounted 5 degrees off, joints where that puts them",
        "mounting",
        1.0,
        |frame, _| mounted(frame),
    ),
];

fn mounted(frame: &FlightFrame) -> FlightFrame {
    turned(frame, |segments| {
        segments[Segment::LeftThigh] *=
            UnitQuaternion::from_scaled_axis(Vector3::x() * (5.0 * PI / 180.0));
    })
}

/// The text of a recording with the places of another one of the same frames.
fn with_places(text: &str, of: &str) -> String {
    let (begin, end) = ("<position>", "</position>");
    let mut places = of
        .split(begin)
        .skip(1)
        .filter_map(|part| part.split_once(end));
    let mut parts = text.split(begin);
    let mut merged = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (_, rest) = part.split_once(end).expect("its end");
        let (place, _) = places.next().expect("as many frames");
        merged.push_str(&format!("{begin}{place}{end}{rest}"));
    }
    merged
}

/// Kinds of faults that `airborne` names in a capture after a change.
fn named(
    folder: &Path,
    capture: &Capture,
    rate: f64,
    keeps_places: bool,
    change: impl Fn(&FlightFrame, bool) -> FlightFrame,
) -> Vec<&'static str> {
    let verdict = verdict(folder, capture, rate, keeps_places, change);
    verdict.faults.iter().map(|fault| fault.kind).collect()
}

/// The verdict on a capture after a change.
fn verdict(
    folder: &Path,
    capture: &Capture,
    rate: f64,
    keeps_places: bool,
    change: impl Fn(&FlightFrame, bool) -> FlightFrame,
) -> Verdict {
    // A file that was read is never written again by the same process.
    let folder = tempfile::tempdir_in(folder).expect("a folder");
    let flight = planted(
        folder.path(),
        capture,
        rate,
        keeps_places,
        |frame, is_concerned| {
            let mut changed = change(frame, is_concerned);
            changed.pelvis.velocity = None;
            changed.pelvis.angular_velocity = None;
            changed
        },
    );
    let capture = bodyflight_verbs::airborne::Capture::read(Path::new(&flight)).expect("a capture");
    bodyflight_verbs::airborne::judged(&capture)
}

/// Writes a capture after a change into a folder, and returns its flight.
pub(super) fn planted(
    folder: &Path,
    capture: &Capture,
    rate: f64,
    keeps_places: bool,
    change: impl Fn(&FlightFrame, bool) -> FlightFrame,
) -> String {
    let subject = capture
        .subject
        .as_deref()
        .map(|path| Subject::read(path).expect("a subject"));
    let body = subject.unwrap_or_default().body();
    let write = |name: &str, change: &dyn Fn(&FlightFrame, bool) -> FlightFrame| {
        let file = folder.join(name);
        let description = Description {
            subject_label: "Planted".to_owned(),
            frame_rate: capture.rate * rate,
            start_unix_ms: 0,
            comment: "a planted fault".to_owned(),
            origin: Origin::Imported { has_places: true },
        };
        let mut writer = Writer::create(&file, description, &body).expect("a file");
        let count = capture.frames.len();
        for (k, frame) in capture.frames.iter().enumerate() {
            let mut changed = change(frame, (count / 2..count / 2 + 20).contains(&k));
            changed.time = frame.time / rate;
            writer.write(&changed).expect("a frame");
        }
        writer.finish().expect("a file");
        std::fs::read_to_string(&file).expect("text")
    };
    if keeps_places {
        let clean = write("clean.mvnx", &|frame, _| *frame);
        let turned = write("turned.mvnx", &change);
        let merged = with_places(&turned, &clean);
        bodyflight_tests::program::written(folder, "flight.mvnx", &merged);
    } else {
        write("flight.mvnx", &change);
    }
    let mut flight = "recording = \"flight.mvnx\"\n".to_owned();
    if let Some(subject) = &capture.subject {
        flight.push_str(&format!("subject = \"{}\"\n", plain(subject)));
    }
    bodyflight_tests::program::written(folder, "flight.toml", &flight)
}

/// Jumps of segments are named in every capture, a tilt and a wrong rate in those that are a second in the air. A segment
/// that is mounted a few degrees off is named where the places of its joints were measured, and only there.
#[test]
fn planted_faults_are_named_and_clean_captures_are_not_blamed() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut hits = Vec::new();
    for capture in captures(folder.path()) {
        let clean = named(folder.path(), &capture, 1.0, false, |frame, _| *frame);
        assert!(clean.is_empty(), "{}: {clean:?}", capture.name);
        for (name, kind, rate, change) in FAULTS {
            let keeps_places = name == PLACES_KEPT;
            let found = named(folder.path(), &capture, rate, keeps_places, change);
            println!("{} {name}: {found:?}", capture.name);
            if found.contains(&kind) {
                hits.push(kind);
            }
            // Whatever else is named would be wrong, but the checks of every recording see jumps too.
            let is_right = |named: &&str| *named == kind || kind == "step" && *named == "recording";
            assert!(found.iter().all(is_right), "{name}: {found:?}");
        }
    }
    let count = |kind: &str| hits.iter().filter(|hit| **hit == kind).count();
    // Of three captures with two jumps each, of two long ones with a tilt, of two long ones with two wrong rates.
    assert_eq!(count("step"), 6);
    assert_eq!(count("mounting"), 3);
    assert!(count("tilt") >= 2 && count("rate") >= 3, "{hits:?}");
}

/// A file that is written at a rate other than that of its recording: gravity is what the wrong rate makes of it, so the
/// true rate is named, even where the wrong gravity is beyond what counts as falling at first sight.
#[test]
fn a_rate_far_off_is_named_with_the_true_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut told = 0;
    for capture in captures(folder.path()) {
        let gravity = |rate: f64| {
            let verdict = verdict(folder.path(), &capture, rate, false, |frame, _| *frame);
            let has_bar = verdict.sentence.contains(" Hz instead of ")
                && verdict.sentence.matches("+-").count() > 1;
            assert_eq!(
                has_bar,
                (rate - 1.0).abs() > 0.01 && verdict.g_mps2.is_some(),
                "{}",
                verdict.sentence
            );
            verdict.g_mps2.zip(verdict.g_standard_error_mps2)
        };
        let (clean, _) = gravity(1.0).expect("a phase");
        for rate in [0.85, 0.9, 1.1, 1.15, 1.2] {
            // Where nothing is found, nothing is claimed.
            let Some((found, error)) = gravity(rate) else {
                continue;
            };
            let off = (found / clean).sqrt() / rate - 1.0;
            println!(
                "{} {rate}: g {found:.2} +- {error:.2}, rate {:+.2} %",
                capture.name,
                100.0 * off
            );
            assert!(off.abs() < 0.01, "{} {rate}: {off}", capture.name);
            told += 1;
        }
    }
    assert!(told >= 12, "{told} of 15");
}
