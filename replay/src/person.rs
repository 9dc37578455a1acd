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

/// Body mass index with equipment (kg/m2) outside of which nobody jumps: a mass is in another unit, or another person's.
const INDICES: core::ops::Range<f64> = 14.0..48.0;
/// Ratio of stature and thigh.
const STATURE: f64 = 4.21;

/// Why nobody has the mass of a body with its equipment, judged by its limbs.
pub fn unlikely(body: &Body<f64>) -> Option<String> {
    let stature = STATURE * body.segments[Segment::LeftThigh].length;
    let index = body.mass() / (stature * stature);
    (!INDICES.contains(&index)).then(|| {
        format!(
            "the subject has {:.0} kg with equipment at about {stature:.2} m, a body mass index of {index:.0}; expected {} to {}: is the mass in kg?",
            body.mass(),
            INDICES.start,
            INDICES.end
        )
    })
}

/// What is implausible about a person: limbs of other lengths than in the recording, which contradicts only if the body is
/// `stated` rather than assumed, and a mass that nobody of that size has.
pub fn compared(header: &Header, body: &Body<f64>, stated: bool) -> Vec<Warning> {
    let remark = |message: String, is_fault: bool| Warning {
        frame: 0,
        message,
        segment: None,
        span_s: None,
        is_fault,
    };
    let ratio = limbs(header, body).filter(|ratio| (ratio - 1.0).abs() > APART);
    let other = ratio.map(|ratio| {
        let whose = if stated {
            "the subject's"
        } else {
            "those of the assumed person; name a subject.toml"
        };
        let message =
            format!("the limbs of the recorded person are {ratio:.2} times as long as {whose}");
        remark(message, stated)
    });
    let unlikely = unlikely(body).filter(|_| stated);
    let unlikely = unlikely.map(|message| remark(message, true));
    other.into_iter().chain(unlikely).collect()
}
