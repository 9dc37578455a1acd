//! Postures that no body takes: joints bent the wrong way or turned round, sides that are crossed or copied. Single frames
//! prove nothing; if it is most of a recording, or goes far for a while, an axis, a sign, a label or a side is wrong.

use bodyflight_core::{Posture, Segment, SegmentArray};
use nalgebra::{UnitQuaternion, Vector3};

use super::plausibility::SAME;
use super::warning::Warning;
use crate::xsens::xsens_from_segment;

/// Share of the frames in which a posture is impossible that proves it wrong, and the fewest such frames.
const SHARE: f64 = 0.5;
const LEAST: u64 = 3;
/// Shortest time (s) that a joint must be beyond what nobody reaches at all, so that it is no wrong frame or two.
const A_WHILE: f64 = 0.2;

/// Cosine of half the bend of a joint, above 150 degrees, that leaves the turn about the length open.
const FOLDED: f64 = 0.26;

/// Which way the segment's distal end, and its front, point in the axes of its parent: x left, y dorsal, z cranial.
fn down(posture: &Posture<f64>, segment: Segment) -> Vector3<f64> {
    posture.parent_from_segment(segment) * -Vector3::z()
}

fn front(posture: &Posture<f64>, segment: Segment) -> Vector3<f64> {
    posture.parent_from_segment(segment) * -Vector3::y()
}

/// The angle (rad) by which a segment is turned about its length against its parent; none where it is folded back on it, so
/// that length and parent leave the angle open.
fn about_length(posture: &Posture<f64>, segment: Segment) -> f64 {
    let turned = posture.parent_from_segment(segment);
    // Of a rotation, the part about the length, and then a bend about an axis across it.
    if turned.k.hypot(turned.w) < FOLDED {
        return 0.0;
    }
    2.0 * (turned.k / turned.w).atan()
}

/// The angle (rad) to a plane, given its sine.
fn beyond(sine: f64) -> f64 {
    sine.clamp(-1.0, 1.0).asin()
}

/// The angle (rad) between two directions, given its cosine.
fn apart(cosine: f64) -> f64 {
    cosine.clamp(-1.0, 1.0).acos()
}

/// The angle (rad) by which a segment is bent against the line of its parent.
fn bend(posture: &Posture<f64>, segment: Segment) -> f64 {
    apart(-down(posture, segment).z)
}

/// How far the joint at a segment is beyond that of the other side, in lengths of the segment between it and the trunk.
fn crosses(posture: &Posture<f64>, left: Segment) -> f64 {
    let reaches = |own: Segment| own.parent().map_or(0.0, |inner| down(posture, inner).x);
    reaches(left.mirrored()) - reaches(left)
}

fn either(left: Segment, is_wrong: impl Fn(Segment) -> bool) -> bool {
    is_wrong(left) || is_wrong(left.mirrored())
}

/// What a body cannot do.
struct Check {
    /// The segments that are judged, on both sides if each is by itself; the first one gives it its name.
    segments: &'static [Segment],
    /// The fault in words.
    said: &'static str,
    /// How far a segment goes, in rad, or in lengths of a segment if it `crosses`.
    measure: fn(&Posture<f64>, Segment) -> f64,
    /// What nobody exceeds in most of a recording.
    mostly: f64,
    /// What nobody exceeds for a while, with a margin for limbs whose sensors are badly worn.
    ever: Option<f64>,
}

const CHECKS: [Check; 13] = [
    Check {
        segments: &[Segment::LeftShank, Segment::RightShank],
        said: "the knees are bent forwards",
        // The heel goes backwards, which is dorsal.
        measure: |posture, shank| beyond(-down(posture, shank).y),
        mostly: 0.2,
        ever: Some(0.8),
    },
    Check {
        segments: &[Segment::LeftShank, Segment::RightShank],
        said: "the knees are bent sideways",
        measure: |posture, shank| beyond(down(posture, shank).x.abs()),
        mostly: 0.7,
        ever: Some(0.9),
    },
    // A bent knee turns by 30 to 45 degrees about the shank; recorded shanks, and those of sensors badly worn, stay within it.
    Check {
        segments: &[Segment::LeftShank, Segment::RightShank],
        said: "the shanks are turned about their length against the thighs",
        measure: |posture, shank| about_length(posture, shank).abs(),
        mostly: 0.87,
        ever: Some(1.57),
    },
    Check {
        segments: &[Segment::LeftForearm, Segment::RightForearm],
        said: "the elbows are bent backwards",
        measure: |posture, forearm| beyond(down(posture, forearm).y),
        mostly: 0.35,
        ever: Some(0.8),
    },
    // Heels reach the buttocks at 155 degrees, and hands the shoulders at 150.
    Check {
        segments: &[Segment::LeftShank, Segment::RightShank],
        said: "the knees are folded flat",
        measure: bend,
        mostly: 2.8,
        ever: Some(2.9),
    },
    Check {
        segments: &[Segment::LeftForearm, Segment::RightForearm],
        said: "the elbows are folded flat",
        measure: bend,
        mostly: 2.8,
        ever: Some(2.9),
    },
    Check {
        segments: &[Segment::LeftThigh, Segment::RightThigh],
        said: "a thigh is bent backwards",
        measure: |posture, thigh| beyond(down(posture, thigh).y),
        mostly: 1.12,
        ever: Some(1.12),
    },
    Check {
        segments: &[Segment::LeftFoot, Segment::RightFoot],
        said: "a foot points backwards",
        measure: |posture, foot| apart(-front(posture, foot).y),
        mostly: 1.93,
        ever: Some(1.93),
    },
    Check {
        segments: &[Segment::LeftHand, Segment::RightHand],
        said: "a wrist is bent beyond its range",
        measure: bend,
        mostly: 1.93,
        ever: Some(1.93),
    },
    Check {
        segments: &[Segment::Head],
        said: "the head is turned round on the neck",
        measure: |posture, head| apart(-front(posture, head).y),
        mostly: 1.93,
        ever: Some(1.93),
    },
    Check {
        segments: &[Segment::Thorax],
        said: "the chest is turned round against the pelvis",
        measure: |posture, thorax| {
            let turned =
                posture.parent_from_segment(Segment::Abdomen) * posture.parent_from_segment(thorax);
            apart((turned * Vector3::y()).y)
        },
        mostly: 1.93,
        ever: Some(1.93),
    },
    // Legs and arms cross less; the distance of hips and shoulders is left out of it.
    Check {
        segments: &[Segment::LeftShank],
        said: "the left knee is right of the right knee",
        measure: |posture, shank| crosses(posture, shank),
        mostly: 0.45,
        ever: None,
    },
    Check {
        segments: &[Segment::LeftForearm],
        said: "the left elbow is right of the right elbow",
        measure: |posture, forearm| crosses(posture, forearm),
        mostly: 1.45,
        ever: None,
    },
];

/// Segments of the left side that are compared with their counterparts.
const LEFT: [Segment; 4] = [
    Segment::LeftUpperArm,
    Segment::LeftForearm,
    Segment::LeftThigh,
    Segment::LeftShank,
];

/// The attitude of a segment against the pelvis in MVN's axes, in which a copied one is the same.
fn as_recorded(
    turned: &SegmentArray<UnitQuaternion<f64>>,
    segment: Segment,
) -> UnitQuaternion<f64> {
    let [pelvis, own] =
        [Segment::Pelvis, segment].map(|segment| *xsens_from_segment(segment).quaternion());
    pelvis * turned[segment] * own.inverse()
}

/// Least half of the rotation (rad) about other axes than the lateral one: a segment that turns only about that one has the
/// attitude of its mirror image, so both sides may have it.
const SIDEWAYS: f64 = 0.02;

/// Radians that are read as degrees: no leg is bent, by this angle (rad), and no joint moves by more than that one (rad) from
/// where it began, though most move, by this one (rad) at least, and something does in this number of frames. A pose that is
/// held by hand in a simulation moves a few joints.
const STRETCHED: f64 = 0.06;
const STIRS: f64 = 0.1;
const LEAST_STIRRED: f64 = 1e-4;
const LEAST_STRETCHED: u64 = 100;
const MOST: usize = Segment::ALL.len() / 2;
const LEGS: [Segment; 2] = [Segment::LeftThigh, Segment::LeftShank];

/// Whether no leg is bent and no joint has moved far (rad) from where it began.
fn is_stretched(posture: &Posture<f64>, moved: &[f64]) -> bool {
    let bends = |own: Segment| posture.parent_from_segment(own).angle() > STRETCHED;
    !LEGS.into_iter().any(|left| either(left, bends)) && moved.iter().all(|angle| *angle <= STIRS)
}

/// Frames on end in which a joint is beyond what nobody reaches.
#[derive(Debug, Clone, Copy)]
struct Beyond {
    segment: Segment,
    first: (u64, f64),
    last: f64,
    frames: u64,
    /// How far it goes (rad).
    furthest: f64,
}

impl Beyond {
    fn length(&self) -> f64 {
        self.last - self.first.1
    }
}

/// What has been seen of one check.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    /// Frames beyond what nobody exceeds for long.
    wrong: u64,
    /// On either side, the frames that are beyond what nobody exceeds at all.
    now: [Option<Beyond>; 2],
    longest: Option<Beyond>,
}

impl Seen {
    /// Takes a posture at a frame and its time (s).
    fn see(&mut self, check: &Check, (index, time): (u64, f64), posture: &Posture<f64>) {
        let mut is_wrong = false;
        for (segment, now) in check.segments.iter().zip(&mut self.now) {
            let far = (check.measure)(posture, *segment);
            is_wrong |= far > check.mostly;
            if check.ever.is_none_or(|ever| far <= ever) {
                *now = None;
                continue;
            }
            let run = now.get_or_insert(Beyond {
                segment: *segment,
                first: (index, time),
                last: time,
                frames: 0,
                furthest: far,
            });
            run.last = time;
            run.frames += 1;
            run.furthest = run.furthest.max(far);
            if (self.longest).is_none_or(|longest| run.length() >= longest.length()) {
                self.longest = Some(*run);
            }
        }
        self.wrong += u64::from(is_wrong);
    }

    /// What is wrong in a sentence, in a recording of so many frames that ends with this one at this time (s).
    fn warning(&self, check: &Check, frames: u64, last: (u64, f64)) -> Option<Warning> {
        let said = check.said;
        if is_most(self.wrong, frames) {
            let message = format!(
                "{said} in {} of {frames} frames: an axis, a sign, a label or a side is wrong",
                self.wrong
            );
            let first = check.segments.first();
            return first.map(|own| fault(*own, last.0, [0.0, last.1], message));
        }
        let run = self.longest?;
        (run.frames >= LEAST && run.length() >= A_WHILE).then(|| {
            let (from, to) = (run.first.1, run.last);
            let message = format!(
                "{said} at {} by up to {:.0} degrees from {from:.3} to {to:.3} s, which nobody can: an axis, a label or a marker is wrong there",
                run.segment.name(),
                run.furthest.to_degrees()
            );
            fault(run.segment, run.first.0, [from, to], message)
        })
    }
}

fn is_most(count: u64, of: u64) -> bool {
    #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
    let share = count as f64 / of.max(1) as f64;
    count >= LEAST && share > SHARE
}

fn fault(segment: Segment, frame: u64, span_s: [f64; 2], message: String) -> Warning {
    Warning {
        segment: Some(segment.name().to_owned()),
        ..Warning::fault(frame, span_s, message)
    }
}

/// What has been seen of the postures.
#[derive(Debug, Clone, Default)]
pub(super) struct Anatomy {
    frames: u64,
    seen: [Seen; CHECKS.len()],
    last: Option<SegmentArray<UnitQuaternion<f64>>>,
    /// Frames in which a segment moves and has another attitude than its mirror image.
    moving: [u64; LEFT.len()],
    copied: [u64; LEFT.len()],
    /// The first posture, frames in which no leg is bent and no joint far from there, which joints have stirred, and frames in
    /// which a segment moves.
    first: Option<Posture<f64>>,
    stretched: u64,
    stirred: [bool; Segment::ALL.len()],
    moved: u64,
}

impl Anatomy {
    /// Takes the posture of a good frame at a time (s), and the same relative to the pelvis.
    pub(super) fn see(
        &mut self,
        at: (u64, f64),
        posture: &Posture<f64>,
        turned: &SegmentArray<UnitQuaternion<f64>>,
    ) {
        self.frames += 1;
        for (seen, check) in self.seen.iter_mut().zip(&CHECKS) {
            seen.see(check, at, posture);
        }
        let first = self.first.get_or_insert(*posture);
        let moved = Segment::ALL.map(|own| {
            let began = first.parent_from_segment(own);
            posture.parent_from_segment(own).angle_to(began)
        });
        self.stretched += u64::from(is_stretched(posture, &moved));
        for (stirred, moved) in self.stirred.iter_mut().zip(moved) {
            *stirred |= moved > LEAST_STIRRED;
        }
        let last = self.last.replace(*turned);
        let differs = |a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>| {
            (a.coords - b.coords)
                .amax()
                .min((a.coords + b.coords).amax())
                > SAME
        };
        self.moved += u64::from(last.as_ref().is_some_and(|last| {
            let pairs = last.values().zip(turned.values());
            pairs.into_iter().any(|(last, here)| differs(last, here))
        }));
        for (place, left) in LEFT.into_iter().enumerate() {
            // Two segments at rest may well be parallel.
            let moves = (last.as_ref()).is_some_and(|last| differs(&last[left], &turned[left]));
            let [own, other] = [left, left.mirrored()].map(|own| as_recorded(turned, own));
            let is_its_own_image = own.i.hypot(own.k) < SIDEWAYS;
            let tells = moves && !is_its_own_image;
            self.moving[place] += u64::from(tells);
            self.copied[place] += u64::from(tells && !differs(&own, &other));
        }
    }

    /// What the recording shows, which ends with this frame at this time (s). Who `travels` does not stand still.
    pub(super) fn warnings(&self, last: (u64, f64), travels: bool) -> Vec<Warning> {
        let wrong = self.seen.iter().zip(&CHECKS);
        let wrong = wrong.filter_map(|(seen, check)| seen.warning(check, self.frames, last));
        let fault = |segment, message| fault(segment, last.0, [0.0, last.1], message);
        let copied = self.copied.iter().zip(self.moving).zip(LEFT);
        let copied = copied.filter(|((count, moving), _)| is_most(**count, *moving));
        let copied = copied.map(|((count, _), left)| {
            let message = format!(
                "{} has exactly the attitude of {} in {count} of {} frames: one is a copy of the other",
                left.name(),
                left.mirrored().name(),
                self.frames
            );
            fault(left, message)
        });
        let stirred = self.stirred.iter().filter(|stirred| **stirred).count();
        let moves = self.moved >= LEAST_STRETCHED && stirred > MOST;
        let is_stretched = travels && moves && self.stretched == self.frames;
        let stretched = is_stretched.then(|| {
            let message = format!(
                "the legs are stretched and no joint moves by more than {:.0} degrees in all {} frames: are the angles radians that were read as degrees?",
                STIRS.to_degrees(),
                self.frames
            );
            Warning::fault(last.0, [0.0, last.1], message)
        });
        wrong.chain(copied).chain(stretched).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::body::pattern;

    /// What is said of a movement about a posture, which `change` spoils in a share of its frames.
    fn said(share: usize, change: impl Fn(Posture<f64>) -> Posture<f64>) -> Vec<String> {
        let mut seen = Anatomy::default();
        for index in 0..100_usize {
            let swing = 0.2 * (index as f64 / 9.0).sin();
            let neutral = pattern::neutral::<f64>();
            let moved = pattern::moved(
                &neutral,
                &[(Segment::LeftThigh, [swing, swing, swing])],
                1.0,
            );
            let moved = pattern::moved(&moved, &[(Segment::LeftUpperArm, [0.0, swing, 0.0])], 1.0);
            let posture = if index < share { change(moved) } else { moved };
            seen.see(
                (index as u64, index as f64 / 100.0),
                &posture,
                &posture.body_from_segments(),
            );
        }
        seen.warnings((99, 0.99), true)
            .into_iter()
            .map(|warning| warning.message)
            .collect()
    }

    fn turned(segment: Segment, angles: [f64; 3]) -> impl Fn(Posture<f64>) -> Posture<f64> {
        move |posture| pattern::moved(&posture, &[(segment, angles)], 1.0)
    }

    fn exchanged(posture: Posture<f64>, left: Segment) -> Posture<f64> {
        let right = left.mirrored();
        let [one, other] = [left, right].map(|own| *posture.parent_from_segment(own));
        posture.with(left, other).with(right, one)
    }

    fn copied(posture: Posture<f64>) -> Posture<f64> {
        let left = *posture.parent_from_segment(Segment::LeftThigh);
        posture.with(Segment::RightThigh, left)
    }

    #[test]
    fn what_nobody_reaches_at_all_is_named_after_a_while() {
        let knee = turned(Segment::RightShank, [0.0, 0.0, 2.2]);
        assert_eq!(said(10, &knee), Vec::<String>::new());
        let said = said(45, &knee);
        let words = "the knees are bent forwards at r_shank by up to 6";
        assert!(said.len() == 1 && said[0].starts_with(words), "{said:?}");
        assert!(said[0].contains(" from 0.000 to 0.440 s"), "{said:?}");
    }

    #[test]
    fn what_no_body_does_is_named_if_it_is_most_of_the_recording() {
        let half = std::f64::consts::PI;
        let knee = turned(Segment::RightShank, [0.0, 0.0, 1.6]);
        assert_eq!(said(100, |posture| posture), Vec::<String>::new());
        assert_eq!(said(45, &knee), Vec::<String>::new());
        for (said, what) in [
            (
                said(60, &knee),
                "the knees are bent forwards in 60 of 100 frames",
            ),
            (
                said(100, turned(Segment::Head, [half, 0.0, 0.0])),
                "the head is turned round",
            ),
            (
                said(100, turned(Segment::Thorax, [half, 0.0, 0.0])),
                "the chest is turned round",
            ),
            (
                said(100, turned(Segment::LeftFoot, [half, 0.0, 0.0])),
                "a foot points backwards",
            ),
            (
                said(100, turned(Segment::LeftHand, [0.0, 0.0, half])),
                "a wrist is bent",
            ),
            (
                said(100, turned(Segment::LeftForearm, [0.0, 1.4, 0.0])),
                "the elbows are folded flat",
            ),
            (
                said(100, turned(Segment::RightShank, [0.0, 0.0, -1.9])),
                "the knees are folded flat",
            ),
            (
                said(100, turned(Segment::RightThigh, [0.0, 0.0, -1.5])),
                "a thigh is bent backwards",
            ),
            (
                said(100, |posture| exchanged(posture, Segment::LeftThigh)),
                "the left knee is right",
            ),
            (
                said(100, |posture| exchanged(posture, Segment::LeftUpperArm)),
                "the left elbow is right",
            ),
            (
                said(100, copied),
                "l_thigh has exactly the attitude of r_thigh in 99 of 100",
            ),
        ] {
            assert!(
                said.iter().any(|said| said.contains(what)),
                "{what}: {said:?}"
            );
        }
    }
}
