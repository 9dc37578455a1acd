//! MVNX from end to end.

use std::sync::OnceLock;

use bodyflight_core::Body;
use bodyflight_mvnx::recording::{BadFrames, FlightFrame, Options};
use bodyflight_mvnx::writer::{Description, Origin, Writer};
use bodyflight_replay::subject::Subject;

use super::choices::Choices;
use crate::small_recording::{NAME, is_usable, read_as, survey, written};

/// Longest input that is read (bytes): longer ones are slow and find nothing new.
const LONGEST: usize = 24 << 10;

/// Largest number of edits of the small recording.
const MOST_EDITS: usize = 8;

/// An input that begins with `<` is a file; otherwise it is a list of edits of a small recording: position, number of
/// bytes removed, bytes inserted. The file is inspected and read, and the result is written and read again.
pub(super) fn mvnx(input: &[u8]) {
    let input = &input[..input.len().min(LONGEST)];
    if input.starts_with(b"<") {
        check(input);
    } else {
        check(&edited(input));
    }
}

fn edited(input: &[u8]) -> Vec<u8> {
    static SMALL: OnceLock<String> = OnceLock::new();
    let mut text = SMALL.get_or_init(|| written(2)).as_bytes().to_vec();
    let mut choices = Choices(input);
    for _ in 0..MOST_EDITS {
        if choices.is_empty() {
            break;
        }
        let start = usize::from(choices.word()) % text.len();
        let gone = usize::from(choices.byte());
        let come = usize::from(choices.byte());
        let end = (start + gone).min(text.len());
        text.splice(start..end, choices.bytes(come).iter().copied());
        if text.is_empty() {
            break;
        }
    }
    text
}

fn check(text: &[u8]) {
    if let Ok(report) = survey(text) {
        // The report can be displayed.
        assert!(!report.to_string().is_empty());
        assert!(report.duration_s.is_finite() && report.frame_rate_hz >= 1.0);
    }
    let strict = Options {
        bad_frames: BadFrames::Refuse,
        ..Options::default()
    };
    let lenient = Options {
        allow_truncated: true,
        ..Options::default()
    };
    let Ok((frames, _)) = read_as(text, NAME, lenient) else {
        assert!(read_as(text, NAME, strict).is_err());
        return;
    };
    assert!(frames.iter().all(is_usable));
    assert!(frames.is_sorted_by(|a, b| a.time < b.time));
    if let Some(again) = rewritten(&frames) {
        let (again, _) = read_as(&again, NAME, strict).expect("what was written is read");
        assert_eq!(again.len(), frames.len());
    }
}

/// Writes the frames as a file; `None` if they cannot be written.
fn rewritten(frames: &[FlightFrame]) -> Option<Vec<u8>> {
    let description = Description {
        subject_label: "fuzz".to_owned(),
        frame_rate: 240.0,
        start_unix_ms: 0,
        comment: String::new(),
        origin: Origin::Simulated,
    };
    static BODY: OnceLock<Body<f64>> = OnceLock::new();
    let body = BODY.get_or_init(|| Subject::default().body());
    let mut writer = Writer::new(Vec::new(), NAME.as_ref(), description, body).ok()?;
    let first = frames.first()?;
    for (index, frame) in (first.index..).zip(frames) {
        // Gaps would be bridged, which would add frames that were not written.
        let frame = FlightFrame { index, ..*frame };
        writer.write(&frame).ok()?;
    }
    writer.complete().ok()
}
