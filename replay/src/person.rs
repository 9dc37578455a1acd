//! Whether the person of a flight can be the one in its recording: the lengths of the limbs are in both.

use bodyflight_core::{Body, Segment};
use bodyflight_mvnx::Header;
use bodyflight_mvnx::recording::Warning;

/// Bones of the limbs: the segment of the suit and of the model, and the joints at both ends of one side.
const BONES: [(&str, &str, &str, Segment); 4] = [
    ("UpperLeg", "Hip", "Knee", Segment::RightThigh),
    ("LowerLeg", "Knee", "Ankle", Segment::RightShank),
    ("UpperArm", "Shoulder", "Elbow", Segment::RightUpperArm),
    ("ForeArm", "Elbow", "Wrist", Segment::RightForearm),
];
/// Relative difference of the limbs' lengths that is beyond the few per cent between people of one stature.
const APART: f64 = 0.15;

/// Ratio of the lengths of the limbs in a recording to those of a body; `None` if the recording lacks one of them.
fn limbs(header: &Header, body: &Body<f64>) -> Option<f64> {
    let (mut recorded, mut modelled) = (0.0, 0.0);
    for (segment, from, to, own) in BONES {
        for side in ["Right", "Left"] {
            let at = header.segment_index(&format!("{side}{segment}"))?;
            let point = |joint: &str| header.segments[at].point(&format!("j{side}{joint}"));
            recorded += (point(to)? - point(from)?).norm();
            modelled += body.segments[own].length;
        }
    }
    (recorded > 0.0 && modelled > 0.0).then(|| recorded / modelled)
}

/// A warning if a recording is not of that body; a contradiction only if the body is `stated` rather than assumed.
pub fn compared(header: &Header, body: &Body<f64>, stated: bool) -> Option<Warning> {
    let ratio = limbs(header, body).filter(|ratio| (ratio - 1.0).abs() > APART)?;
    let whose = if stated {
        "the subject's"
    } else {
        "those of the assumed person; name a subject.toml"
    };
    Some(Warning {
        frame: 0,
        message: format!(
            "the limbs of the recorded person are {ratio:.2} times as long as {whose}"
        ),
        segment: None,
        span_s: None,
        is_fault: stated,
    })
}
