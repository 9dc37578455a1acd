//! Whether the person of a flight can be the one in its recording: the lengths of the limbs are in both.

use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::{Body, Segment};
use bodyflight_mvnx::Header;
use bodyflight_mvnx::recording::Warning;

/// Bones of the limbs: the segment of the suit and of the model on either side, and the joints at both ends.
const BONES: [(&str, &str, &str, [Segment; 2]); 4] = [
    (
        "UpperLeg",
        "Hip",
        "Knee",
        [Segment::LeftThigh, Segment::RightThigh],
    ),
    (
        "LowerLeg",
        "Knee",
        "Ankle",
        [Segment::LeftShank, Segment::RightShank],
    ),
    (
        "UpperArm",
        "Shoulder",
        "Elbow",
        [Segment::LeftUpperArm, Segment::RightUpperArm],
    ),
    (
        "ForeArm",
        "Elbow",
        "Wrist",
        [Segment::LeftForearm, Segment::RightForearm],
    ),
];
const SIDES: [&str; 2] = ["Left", "Right"];
/// Relative difference between left and right, in the recording against the subject, that is beyond that between the legs
/// of people and of their skeletons.
const UNEVEN: f64 = 0.08;
/// Relative difference of the limbs' lengths that is beyond the few per cent between people of one stature.
const APART: f64 = 0.15;

/// Lengths of a bone in a recording and in a body, left and right (m).
type Lengths = [[f64; 2]; 2];

/// What a body has as the length of a bone: the distance of its joints, which moves the segments, and the length of the
/// segment, which the air sees. A table of segments may state either.
const MODELLED: [fn(&Body<f64>, Segment) -> f64; 2] = [
    |body, own| {
        // A bone of a limb ends at the joint of one segment.
        let mut all = Segment::ALL.into_iter();
        let next = all.find(|segment| segment.parent() == Some(own));
        next.map_or(0.0, |next| body.segments[next].joint_offset.norm())
    },
    |body, own| body.segments[own].length,
];

/// The length of a bone between its joints, from the points of a header (m).
fn recorded(header: &Header, own: Segment) -> Option<f64> {
    let mut bones = BONES.into_iter();
    let (segment, from, to, pair) = bones.find(|(.., pair)| pair.contains(&own))?;
    let side = SIDES[usize::from(pair[1] == own)];
    let at = header.segment_index(&format!("{side}{segment}"))?;
    let point = |joint: &str| header.segments[at].point(&format!("j{side}{joint}"));
    Some((point(to)? - point(from)?).norm())
}

/// The lengths of the bones that are known on both sides.
fn limbs(
    recorded: &impl Fn(Segment) -> Option<f64>,
    modelled: impl Fn(Segment) -> f64,
) -> Vec<([Segment; 2], Lengths)> {
    let bones = BONES.into_iter().filter_map(|(.., own)| {
        let [left, right] = own.map(|own| Some([recorded(own)?, modelled(own)]));
        let lengths = [left?, right?];
        let is_known = lengths.iter().flatten().all(|length| *length > 0.0);
        is_known.then_some((own, lengths))
    });
    bones.collect()
}

/// Ratio of the lengths of all limbs in a recording to those of a body; `None` if one of them is not known.
fn stature(bones: &[([Segment; 2], Lengths)]) -> Option<f64> {
    let sum = |of: usize| -> f64 {
        let each = bones.iter().flat_map(|(_, sides)| sides.iter());
        each.map(|lengths| lengths[of]).sum()
    };
    (bones.len() == BONES.len()).then(|| sum(0) / sum(1))
}

/// Bones whose two sides differ in a body, but not so in a recording, in sentences; `recorded` has the lengths that are known
/// of the recording (m).
pub fn uneven(
    body: &Body<f64>,
    recorded: impl Fn(Segment) -> Option<f64>,
) -> Vec<(Segment, String)> {
    let mut all: Vec<(Segment, String)> = Vec::new();
    for modelled in MODELLED {
        let bones = limbs(&recorded, |own| modelled(body, own));
        for (segment, message) in bones.iter().filter_map(|bone| odd_side(bone, &bones)) {
            if all.iter().all(|(known, _)| *known != segment) {
                all.push((segment, message));
            }
        }
    }
    all
}

/// The side of a bone that is wrong, if its two sides differ in the body, but not so in the recording.
fn odd_side(
    (own, sides): &([Segment; 2], Lengths),
    bones: &[([Segment; 2], Lengths)],
) -> Option<(Segment, String)> {
    let ratios = sides.map(|[recorded, modelled]| recorded / modelled);
    if (ratios[0] / ratios[1]).ln().abs() < UNEVEN {
        return None;
    }
    // The side that fits the other bones less is the one that is wrong: by their median, which one wrong bone does not move.
    let mut others: Vec<f64> = (bones.iter())
        .filter(|(other, _)| other != own)
        .flat_map(|(_, sides)| sides.map(|[recorded, modelled]| recorded / modelled))
        .collect();
    others.sort_by(f64::total_cmp);
    let whole = others.get(others.len() / 2).copied().unwrap_or(1.0);
    let off = ratios.map(|ratio| (ratio / whole).ln().abs());
    let (wrong, right) = if off[0] > off[1] { (0, 1) } else { (1, 0) };
    let [recorded, modelled] = sides[wrong];
    let message = format!(
        "{} is {modelled:.3} m long in the subject and {recorded:.3} m in the recording ({:.2} times), {} {:.2} times: the length of one is wrong",
        own[wrong].name(),
        ratios[wrong],
        own[right].name(),
        ratios[right]
    );
    Some((own[wrong], message))
}

/// Body mass index with equipment (kg/m2) outside of which nobody jumps: a mass is in another unit, or another person's.
const INDICES: core::ops::Range<f64> = 14.0..48.0;
/// Ratio of stature and thigh.
const STATURE: f64 = 4.21;

/// Ratio to that of the mean person of the same stature and mass which the mass of a limb, and the radius of gyration of any
/// segment, have in nobody, equipment included.
const RATIOS: core::ops::Range<f64> = 0.4..2.5;
/// Ratio of the masses of a limb's segment on either side that is no asymmetry of a person.
const SIDES_APART: f64 = 1.5;
/// Distance of a centre of gravity from that of the mean person, in lengths of the segment.
const CG_APART: f64 = 0.5;
/// Segments of the trunk, between which tables divide its mass in different ways.
const TRUNK: [Segment; 3] = [Segment::Pelvis, Segment::Abdomen, Segment::Thorax];
/// Joints that are on the left side of their counterparts.
const LEFT: [(Segment, &str); 2] = [
    (Segment::LeftThigh, "hip"),
    (Segment::LeftUpperArm, "shoulder"),
];

/// Segments of the left side whose lengths, summed, have a ratio to those of others that is within these bounds in everybody.
type Proportion = (
    &'static str,
    &'static [Segment],
    &'static str,
    &'static [Segment],
    core::ops::Range<f64>,
);

/// People have 0.9 to 1.1, 1.0 to 1.3, 0.6 to 0.75, and 0.3 to 0.8 from ankle or heel to the toes; joints of other systems are
/// up to some centimetres elsewhere.
const PROPORTIONS: [Proportion; 4] = [
    (
        "thigh",
        &[Segment::LeftThigh],
        "shank",
        &[Segment::LeftShank],
        0.65..1.5,
    ),
    (
        "upper arm",
        &[Segment::LeftUpperArm],
        "forearm",
        &[Segment::LeftForearm],
        0.65..1.8,
    ),
    (
        "arm",
        &[Segment::LeftUpperArm, Segment::LeftForearm],
        "leg",
        &[Segment::LeftThigh, Segment::LeftShank],
        0.45..0.95,
    ),
    (
        "foot",
        &[Segment::LeftFoot],
        "shank",
        &[Segment::LeftShank],
        0.1..1.0,
    ),
];

/// Bones that are as long on either side, and the ratio of both, either way, that is beyond people, who reach 1.05, and joints
/// placed 5 cm off on bones of 25 cm.
const PAIRS: [(&str, Segment); 4] = [
    ("upper arm", Segment::LeftUpperArm),
    ("forearm", Segment::LeftForearm),
    ("thigh", Segment::LeftThigh),
    ("shank", Segment::LeftShank),
];
const LOPSIDED: f64 = 1.25;

/// Lengths of limbs (m) that nobody has beside each other, with the first segment concerned; none are judged that are not
/// known.
pub fn disproportionate(length: impl Fn(Segment) -> Option<f64>) -> Option<(Segment, String)> {
    let sum = |segments: &[Segment], is_right: bool| -> Option<f64> {
        let own = |segment: &Segment| {
            length(if is_right {
                segment.mirrored()
            } else {
                *segment
            })
        };
        segments.iter().map(own).sum()
    };
    let judged = |(one, ones, other, others, within): &Proportion, is_right: bool| {
        let [long, short] = [sum(ones, is_right)?, sum(others, is_right)?];
        let ratio = long / short;
        let side = if is_right { "right" } else { "left" };
        let message = format!(
            "the {side} {one} is {long:.2} m long and the {other} {short:.2} m, a ratio of {ratio:.2}; expected {} to {}: limbs, joints or markers may be exchanged",
            within.start, within.end
        );
        (ratio.is_finite() && !within.contains(&ratio)).then(|| (ones[0], message))
    };
    let each = PROPORTIONS
        .iter()
        .flat_map(|own| [(own, false), (own, true)]);
    each.into_iter()
        .find_map(|(own, is_right)| judged(own, is_right))
        .or_else(|| lopsided(length))
}

/// A bone that is much longer on one side than on the other.
fn lopsided(length: impl Fn(Segment) -> Option<f64>) -> Option<(Segment, String)> {
    PAIRS.into_iter().find_map(|(name, own)| {
        let [left, right] = [length(own)?, length(own.mirrored())?];
        let ratio = (left / right).max(right / left);
        (ratio.is_finite() && ratio > LOPSIDED).then(|| {
            (own, format!(
                "the left {name} is {left:.2} m long and the right one {right:.2} m, a ratio of {ratio:.2}; expected at most {LOPSIDED}: joints or markers of one side may be exchanged"
            ))
        })
    })
}

/// Why nobody is built like a body with its equipment: masses, lengths, inertias, centres of gravity or sides of its
/// segments.
pub fn unlikely(body: &Body<f64>) -> Option<String> {
    let length = |own: Segment| Some(body.segments[own].length);
    let proportion = disproportionate(length).map(|(_, said)| format!("of the subject, {said}"));
    // Stature, and so the mass that is usual for it, is told from the thigh.
    proportion
        .or_else(|| unlikely_mass(body))
        .or_else(|| unlikely_segment(body))
}

fn unlikely_segment(body: &Body<f64>) -> Option<String> {
    let mean = Person::new(body.height, body.mass(), Sex::Male)
        .body()
        .ok()?;
    let crossed = LEFT.into_iter().find(|(left, _)| {
        let [left, right] = [*left, left.mirrored()].map(|own| body.segments[own].joint_offset.x);
        left <= right
    });
    if let Some((_, joint)) = crossed {
        return Some(format!(
            "the left {joint} of the subject is right of the right one: the sides of its segments are exchanged"
        ));
    }
    let limbs = || Segment::ALL.into_iter().filter(|own| !TRUNK.contains(own));
    let mass = |own: Segment| body.segments[own].mass;
    let odd_mass = limbs().find_map(|own| {
        let (here, usual) = (mass(own), mean.segments[own].mass);
        let other = mass(own.mirrored());
        let is_usual = RATIOS.contains(&(here / usual)) && here / other < SIDES_APART;
        (!is_usual).then(|| {
            format!(
                "{} of the subject weighs {here:.2} kg, its counterpart {other:.2} kg; the mean person's {usual:.2} kg: one of them is wrong",
                own.name()
            )
        })
    });
    odd_mass.or_else(|| limbs().find_map(|own| unlikely_solid(body, &mean, own)))
}

/// A segment whose mass is distributed as in nobody.
fn unlikely_solid(body: &Body<f64>, mean: &Body<f64>, own: Segment) -> Option<String> {
    let name = own.name();
    let gyration = |of: &Body<f64>| {
        let segment = &of.segments[own];
        (segment.inertia.trace() / segment.mass).sqrt()
    };
    let (here, usual) = (gyration(body), gyration(mean));
    if !RATIOS.contains(&(here / usual)) {
        return Some(format!(
            "the inertia of {name} of the subject is that of a solid {:.2} times as large as the mean person's: is it in kg m2, about the centre of gravity?",
            here / usual
        ));
    }
    let (segment, usual) = (&body.segments[own], &mean.segments[own]);
    let apart = (segment.cg - usual.cg).norm();
    (apart > CG_APART * segment.length.max(usual.length)).then(|| {
        format!(
            "the centre of gravity of {name} of the subject is {apart:.2} m from the mean person's: is it in axes of the segment, from its proximal joint?"
        )
    })
}

/// Why nobody has the mass of a body, judged by its limbs.
fn unlikely_mass(body: &Body<f64>) -> Option<String> {
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
    let recorded = |own: Segment| recorded(header, own);
    let ratio = stature(&limbs(&recorded, |own| MODELLED[0](body, own)));
    let ratio = ratio.filter(|ratio| (ratio - 1.0).abs() > APART);
    let uneven = uneven(body, recorded);
    let uneven = uneven.into_iter().map(|(segment, message)| Warning {
        segment: Some(segment.name().to_owned()),
        ..remark(message, false)
    });
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
    let odd = disproportionate(recorded).map(|(segment, said)| Warning {
        segment: Some(segment.name().to_owned()),
        ..remark(format!("of the recorded person, {said}"), true)
    });
    let unlikely = unlikely(body).filter(|_| stated);
    let unlikely = unlikely.map(|message| remark(message, true));
    (other.into_iter().chain(odd))
        .chain(uneven)
        .chain(unlikely)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_mvnx::header::{PointDefinition, SegmentDefinition};
    use nalgebra::Vector3;

    use crate::subject::Subject;

    /// The header of a recording of a person whose limbs are as long as those of a body.
    fn header(body: &Body<f64>) -> Header {
        let mut header = Header::default();
        for (name, from, to, own) in BONES {
            for (side, segment) in SIDES.into_iter().zip(own) {
                let point = |joint: &str, length: f64| PointDefinition {
                    label: format!("j{side}{joint}"),
                    position: Vector3::z() * -length,
                };
                header.segments.push(SegmentDefinition {
                    label: format!("{side}{name}"),
                    points: vec![point(from, 0.0), point(to, body.segments[segment].length)],
                });
            }
        }
        header
    }

    #[test]
    fn a_segment_that_nobody_has_is_named() {
        let body = Subject::default().body();
        assert_eq!(unlikely(&body), None);
        let said = |own: Segment, change: fn(&mut bodyflight_core::SegmentParameters<f64>)| {
            let mut wrong = body;
            change(&mut wrong.segments[own]);
            unlikely(&wrong).unwrap_or_default()
        };
        for (said, words) in [
            (
                said(Segment::LeftUpperArm, |own| own.mass = 20.0),
                "l_upperarm of the subject weighs 20.00 kg, its counterpart 2.",
            ),
            (
                said(Segment::RightForearm, |own| own.mass *= 1.6),
                "r_forearm of the subject weighs",
            ),
            (
                said(Segment::LeftThigh, |own| own.inertia *= 10.0),
                "the inertia of l_thigh of the subject is that of a solid 3.1",
            ),
            (
                said(Segment::RightShank, |own| own.cg = -own.cg),
                "the centre of gravity of r_shank",
            ),
            (
                said(Segment::LeftThigh, |own| own.joint_offset.x *= -1.1),
                "the left hip of the subject is right of the right one",
            ),
        ] {
            assert!(said.contains(words), "{words}: {said}");
        }
    }

    #[test]
    fn limbs_that_nobody_has_beside_each_other_are_named() {
        let body = Subject::default().body();
        let mut exchanged = body;
        for (arm, leg) in [
            (Segment::LeftUpperArm, Segment::LeftThigh),
            (Segment::LeftForearm, Segment::LeftShank),
        ] {
            exchanged.segments[arm].length = body.segments[leg].length;
            exchanged.segments[leg].length = body.segments[arm].length;
        }
        let said = compared(&header(&exchanged), &body, false);
        let words = "of the recorded person, the left arm is 0.";
        let is_said = |said: &Warning| said.is_fault && said.message.contains(words);
        assert!(said.iter().any(is_said), "{said:?}");
        assert!(
            unlikely(&exchanged)
                .unwrap()
                .contains("of the subject, the left arm is")
        );
    }

    #[test]
    fn a_limb_of_another_length_on_one_side_is_named_with_both_lengths() {
        let body = Subject::default().body();
        let recorded = header(&body);
        assert_eq!(compared(&recorded, &body, true), []);
        let mut wrong = body;
        wrong.segments[Segment::RightThigh].length *= 1.15;
        let said = compared(&recorded, &wrong, true);
        assert_eq!(said.len(), 1, "{said:?}");
        assert_eq!(said[0].segment.as_deref(), Some("r_thigh"));
        let words = "in the recording (0.87 times), l_thigh 1.00 times";
        assert!(said[0].message.contains(words), "{said:?}");
        // A table may list where the next joint is, and nothing else.
        let mut wrong = body;
        wrong.segments[Segment::RightShank].joint_offset *= 1.15;
        let said = compared(&recorded, &wrong, true);
        assert!(
            said.len() == 1 && said[0].message.contains(words),
            "{said:?}"
        );
        assert_eq!(said[0].segment.as_deref(), Some("r_thigh"));
    }
}
