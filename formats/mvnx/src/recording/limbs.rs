//! Every segment's own velocity and angular velocity, which are redundant too: no verb uses those of the limbs, but if
//! they belong to another motion than positions and attitudes, neither can be believed.

use bodyflight_core::{Segment, SegmentArray};
use nalgebra::{UnitQuaternion, Vector3};

use super::agreement::{Agreement, NONE};
use super::plausibility::Attitudes;
use super::warning::Warning;

/// Time over which rotations and displacements are compared (s), the rotation (rad) that ends a comparison before, and
/// the fewest comparisons that are judged.
const PIECE: f64 = 0.2;
const FAR: f64 = 1.0;
const LEAST: u32 = 8;
/// Angular velocity of a segment (rad/s, root mean square) that its attitudes show clearly.
const TURNS: f64 = 0.5;
/// Correlation below which two angular velocities do not belong together, and above which a factor between them is one
/// of units.
const ASKEW: f64 = 0.5;
const SAME: f64 = 0.9;
/// Relative difference of two angular velocities or of two paths beyond which units differ.
const APART: f64 = 0.3;
/// Path (m) that is long compared with the motion of a limb about the body.
const PATH: f64 = 50.0;
/// Rotation in one frame (rad) that the angular velocities do not explain, the longest frame in which it is judged (s), and
/// the least number of frames for each.
const JUMPS: f64 = 0.35;
const FRAME: f64 = 0.05;
const SELDOM: u64 = 30;
/// Frames at the beginning that may be the posture of a calibration, and what derives velocities from it.
const BEGINS: u64 = 3;

/// Position (m), velocity (m/s) and angular velocity (rad/s) of a segment in inertial axes, as far as they are recorded.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Moving {
    pub(super) position: Option<Vector3<f64>>,
    pub(super) velocity: Option<Vector3<f64>>,
    pub(super) angular_velocity: Option<Vector3<f64>>,
}

/// Sums since a time.
#[derive(Debug, Clone, Copy)]
struct Piece {
    begin: f64,
    from: UnitQuaternion<f64>,
    /// The same in the axes of the pelvis, and rotation against it.
    from_pelvis: UnitQuaternion<f64>,
    turned: Vector3<f64>,
    turned_in_pelvis: Vector3<f64>,
    moved: Vector3<f64>,
    by_velocity: Vector3<f64>,
}

/// An attitude that jumps.
#[derive(Debug, Clone, Copy)]
struct Jump {
    index: u64,
    time: f64,
    /// Rotation in this frame, and the part of it that the angular velocity does not explain (rad).
    angle: f64,
    unexplained: f64,
}

#[derive(Debug, Clone, Copy, Default)]
struct Part {
    piece: Option<Piece>,
    rates: Agreement,
    /// Against the pelvis, whose own rotation would hide a posture of another time.
    relative: Agreement,
    pieces: u32,
    /// Length of the path according to the positions, and to the velocities (m).
    paths: [f64; 2],
    /// Rotation since the frame before (rad), where there are no angular velocities to explain the next.
    last_turn: Option<Vector3<f64>>,
    /// The jump that is explained worst, and their number.
    jump: Option<Jump>,
    jumps: u64,
}

/// What is checked of a limb: whether the pelvis is sound in it, its name, what contradicts, and whether it is absent.
type Check = (
    bool,
    &'static str,
    fn(&Part) -> Option<String>,
    fn(&Part) -> bool,
);

/// What has been seen of the segments.
#[derive(Debug, Clone, Default)]
pub(super) struct Limbs {
    parts: Option<SegmentArray<Part>>,
    frames: u64,
}

/// A frame of all segments.
#[derive(Debug, Clone, Copy)]
pub(super) struct Snapshot<'a> {
    pub(super) index: u64,
    pub(super) time: f64,
    pub(super) attitudes: &'a Attitudes,
    pub(super) moving: &'a SegmentArray<Moving>,
}

impl Limbs {
    /// Takes two frames that follow each other.
    pub(super) fn see(&mut self, before: Snapshot<'_>, here: Snapshot<'_>) {
        self.frames += 1;
        if self.frames <= BEGINS {
            return;
        }
        let parts = self
            .parts
            .get_or_insert_with(|| SegmentArray::from_fn(|_| Part::default()));
        for (segment, part) in parts.iter_mut() {
            part.see(segment, before, here);
        }
    }

    /// Forgets what is compared across a gap.
    pub(super) fn interrupt(&mut self) {
        for (_, part) in self.parts.iter_mut().flat_map(SegmentArray::iter_mut) {
            part.piece = None;
            part.last_turn = None;
        }
    }

    /// What contradicts: attitudes that jump, and of the limbs, where the pelvis is `sound` in both, angular velocities
    /// and velocities.
    pub(super) fn warnings(&self, last: (u64, f64), sound: [bool; 2]) -> Vec<Warning> {
        let Some(parts) = &self.parts else {
            return Vec::new();
        };
        let mut warnings = self.jumps(parts);
        let kinds: [Check; 2] = [
            (sound[0], "angular velocities", Part::rates_apart, |part| {
                part.rates.is_empty()
            }),
            (sound[1], "velocities", Part::paths_apart, |part| {
                part.paths[1] < NONE * part.paths[0]
            }),
        ];
        for (_, name, apart, is_empty) in kinds.into_iter().filter(|(is_sound, ..)| *is_sound) {
            let limbs = || parts.iter().filter(|(own, _)| *own != Segment::Pelvis);
            // Other programs write zeros for what only the pelvis has.
            if limbs().all(|(_, part)| is_empty(part)) {
                continue;
            }
            let found: Vec<_> = limbs()
                .filter_map(|(segment, part)| Some((segment.name(), apart(part)?)))
                .collect();
            let Some((first, what)) = found.first() else {
                continue;
            };
            let names: Vec<&str> = found.iter().map(|(name, _)| *name).collect();
            warnings.push(Warning {
                segment: Some((*first).to_owned()),
                ..Warning::fault(
                    last.0,
                    [0.0, last.1],
                    format!(
                        "the {name} of {} do not belong to the motion of these segments: {what}",
                        names.join(", ")
                    ),
                )
            });
        }
        warnings
    }

    fn jumps(&self, parts: &SegmentArray<Part>) -> Vec<Warning> {
        let jumping = parts.iter().filter_map(|(segment, part)| {
            let jump = part.jump.filter(|_| SELDOM * part.jumps < self.frames)?;
            Some((segment, part.jumps, jump))
        });
        // One sentence for all that jump together, by the first of them.
        let mut all: Vec<_> = jumping.collect();
        all.sort_by_key(|(_, _, jump)| jump.index);
        let Some((segment, jumps, jump)) = all.first().copied() else {
            return Vec::new();
        };
        let others = match all.len() {
            1 => String::new(),
            count => format!(", as do {} other segments", count - 1),
        };
        vec![Warning {
            segment: Some(segment.name().to_owned()),
            ..Warning::fault(
                jump.index,
                [jump.time; 2],
                format!(
                    "{} turns by {:.0} degrees in one frame at {:.3} s, {jumps} times in all{others}, against its angular velocity",
                    segment.name(),
                    jump.angle.to_degrees(),
                    jump.time
                ),
            )
        }]
    }
}

impl Part {
    fn see(&mut self, segment: Segment, before: Snapshot<'_>, here: Snapshot<'_>) {
        let duration = here.time - before.time;
        let (from, to) = (before.attitudes[segment], here.attitudes[segment]);
        let (old, new) = (before.moving[segment], here.moving[segment]);
        let pelvis = [before, here].map(|of| of.attitudes[Segment::Pelvis]);
        let half =
            |a: Option<Vector3<f64>>, b: Option<Vector3<f64>>| Some(0.5 * (a? + b?) * duration);
        let turn = (to * from.inverse()).scaled_axis();
        let by_rate = half(old.angular_velocity, new.angular_velocity);
        let unexplained = (by_rate.or(self.last_turn))
            .filter(|_| duration <= FRAME)
            .map_or(0.0, |expected| (turn - expected).norm());
        if unexplained > JUMPS {
            self.jumps += 1;
            if self.jump.is_none_or(|jump| unexplained > jump.unexplained) {
                self.jump = Some(Jump {
                    index: here.index,
                    time: here.time,
                    angle: turn.norm(),
                    unexplained,
                });
            }
        }
        self.last_turn = Some(turn);
        let piece = self.piece.get_or_insert(Piece {
            begin: before.time,
            from,
            from_pelvis: pelvis[0].inverse() * from,
            turned: Vector3::zeros(),
            turned_in_pelvis: Vector3::zeros(),
            moved: Vector3::zeros(),
            by_velocity: Vector3::zeros(),
        });
        piece.turned += by_rate.unwrap_or_default();
        let [old_pelvis, new_pelvis] =
            [before, here].map(|of| of.moving[Segment::Pelvis].angular_velocity);
        if let Some((own, of_pelvis)) = by_rate.zip(half(old_pelvis, new_pelvis)) {
            piece.turned_in_pelvis += pelvis[0].inverse() * (own - of_pelvis);
        }
        if let Some((moved, by_velocity)) = (new.position.zip(old.position))
            .map(|(new, old)| new - old)
            .zip(half(old.velocity, new.velocity))
        {
            piece.moved += moved;
            piece.by_velocity += by_velocity;
        }
        let time = here.time - piece.begin;
        if time < PIECE && piece.from.angle_to(&to) < FAR {
            return;
        }
        if by_rate.is_some() {
            let turned = (to * piece.from.inverse()).scaled_axis();
            self.rates.add(&(turned / time), &(piece.turned / time));
            let turned = (pelvis[1].inverse() * to * piece.from_pelvis.inverse()).scaled_axis();
            self.relative
                .add(&(turned / time), &(piece.turned_in_pelvis / time));
            self.pieces += 1;
        }
        self.paths[0] += piece.moved.norm();
        self.paths[1] += piece.by_velocity.norm();
        self.piece = None;
    }

    fn rates_apart(&self) -> Option<String> {
        let count = f64::from(self.pieces.max(1));
        let is_clear = |of: &Agreement| (of.expected / count).sqrt() > TURNS;
        if self.pieces < LEAST {
            return None;
        }
        if is_clear(&self.rates) && self.rates.is_empty() {
            return Some("they are empty".to_owned());
        }
        let (scale, correlation) = (self.rates.scale(), self.rates.correlation());
        if is_clear(&self.rates) && correlation > SAME && (scale - 1.0).abs() > APART {
            return Some(format!("they are {scale:.2} times those of the attitudes"));
        }
        let all = [&self.rates, &self.relative].into_iter();
        let lowest = all
            .filter(|of| is_clear(of))
            .map(Agreement::correlation)
            .min_by(f64::total_cmp)?;
        (lowest < ASKEW).then(|| {
            format!(
                "they have a correlation of {lowest:.2} with the change of the attitudes, as if they were of another time"
            )
        })
    }

    fn paths_apart(&self) -> Option<String> {
        let [by_positions, by_velocities] = self.paths;
        let longest = by_positions.max(by_velocities);
        ((by_velocities - by_positions).abs() > APART * longest && longest > PATH).then(|| {
            format!(
                "a path of {by_positions:.1} m by positions, {by_velocities:.1} m by velocities"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE: f64 = 100.0;

    /// A pelvis that rolls fast and a forearm that waves beside it; `change` spoils what is recorded of a segment.
    fn said(change: impl Fn(Segment, f64, &mut UnitQuaternion<f64>, &mut Moving)) -> Vec<Warning> {
        let mut seen = Limbs::default();
        let mut last: Option<(Attitudes, SegmentArray<Moving>)> = None;
        for index in 0..500_u64 {
            let time = index as f64 / RATE;
            let rolls = Vector3::x() * 3.0;
            let body = UnitQuaternion::from_scaled_axis(rolls * time);
            let mut attitudes = SegmentArray::from_fn(|_| body);
            let mut moving = SegmentArray::from_fn(|_| Moving {
                position: Some(Vector3::z() * -50.0 * time),
                velocity: Some(Vector3::z() * -50.0),
                angular_velocity: Some(rolls),
            });
            let (waves, rate) = (Vector3::z() * (4.0 * time).sin(), 4.0 * (4.0 * time).cos());
            attitudes[Segment::LeftForearm] = body * UnitQuaternion::from_scaled_axis(waves);
            moving[Segment::LeftForearm].angular_velocity =
                Some(rolls + body * (Vector3::z() * rate));
            for (segment, own) in moving.iter_mut() {
                change(segment, time, &mut attitudes[segment], own);
            }
            if let Some((turned, moved)) = &last {
                let snapshot = |index, time, attitudes, moving| Snapshot {
                    index,
                    time,
                    attitudes,
                    moving,
                };
                seen.see(
                    snapshot(index - 1, time - 1.0 / RATE, turned, moved),
                    snapshot(index, time, &attitudes, &moving),
                );
            }
            last = Some((attitudes, moving));
        }
        seen.warnings((499, 4.99), [true; 2])
    }

    fn spoiled(of: Segment, change: fn(f64, &mut Moving)) -> String {
        let warnings = said(|segment, time, _, moving| {
            if segment == of {
                change(time, moving);
            }
        });
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        assert!(warnings[0].is_fault && warnings[0].segment.as_deref() == Some(of.name()));
        warnings[0].message.clone()
    }

    #[test]
    fn limbs_that_move_as_they_say_are_sound() {
        assert_eq!(said(|_, _, _, _| {}), []);
        // Other programs write zeros for all limbs.
        let zeros = said(|segment, _, _, moving| {
            if segment != Segment::Pelvis {
                moving.velocity = Some(Vector3::zeros());
                moving.angular_velocity = Some(Vector3::zeros());
            }
        });
        assert_eq!(zeros, []);
    }

    #[test]
    fn a_limb_whose_velocities_are_of_another_motion_is_named() {
        let limb = Segment::LeftForearm;
        let empty = spoiled(limb, |_, moving| {
            moving.angular_velocity = Some(Vector3::zeros())
        });
        assert!(empty.contains("they are empty"), "{empty}");
        let degrees = spoiled(limb, |_, moving| {
            moving.angular_velocity = moving.angular_velocity.map(|rate| rate * 57.3);
        });
        assert!(degrees.contains("57.28 times"), "{degrees}");
        // The body rolls faster than the limb waves, which hides a wave of another time.
        let late = spoiled(limb, |time, moving| {
            let body = UnitQuaternion::from_scaled_axis(Vector3::x() * 3.0 * time);
            let rate = -4.0 * (4.0 * time).cos();
            moving.angular_velocity = Some(Vector3::x() * 3.0 + body * (Vector3::z() * rate));
        });
        assert!(late.contains("of another time"), "{late}");
        let still = spoiled(limb, |_, moving| moving.velocity = Some(Vector3::zeros()));
        assert!(still.contains("0.0 m by velocities"), "{still}");
    }

    #[test]
    fn an_attitude_that_jumps_is_named_with_its_time() {
        let jumps = said(|segment, time, attitude, _| {
            if segment == Segment::RightFoot && time > 2.5 {
                *attitude *= UnitQuaternion::from_scaled_axis(Vector3::y());
            }
        });
        let message = &jumps[0].message;
        assert!(
            message.contains("r_foot turns by 57 degrees in one frame at 2.510 s, 1 times"),
            "{message}"
        );
    }
}
