//! Errors of an integrated attitude, seen by a receiver: the change of its velocity, less that by gravity, is the
//! integral of the specific force.
//!
//! Both are vectors of the same length. The direction of one from the other is the error of the attitude: its tilt, since
//! the integral has that of gravity in it, and its heading where the velocity changes horizontally, as after the exit and in
//! turns. As long as the heading is unknown, only a straight path tells the tilt.

use bodyflight_core::Lanes;
use bodyflight_core::math::normalized;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Standard gravity (m/s2), in single precision.
#[expect(clippy::cast_possible_truncation, reason = "to single precision")]
pub(crate) const STANDARD_GRAVITY: f32 = bodyflight_core::air::STANDARD_GRAVITY as f32;

/// Instants that are kept, and the least time between them (ticks of 0.1 ms): more than half a second, the age of a late
/// solution.
const KEPT: usize = 16;
const SPACING: u32 = 400;
/// Shortest and longest time between two solutions that are compared (ticks): long enough for a change of velocity beyond
/// its noise.
const SHORTEST: u32 = 8_000;
const LONGEST: u32 = 25_000;
/// Error of an accelerometer, constant over the time between two solutions (m/s2).
const FORCE_ERROR: f32 = 0.1;
/// Number of standard deviations by which the lengths of the two vectors may differ.
const DEVIATIONS: f32 = 4.0;
/// Error of the heading (rad) at which it is taken as found.
const FOUND: f32 = 0.08;
/// Ratio of the two horizontal vectors, turned onto each other, if they belong together.
const AGREEMENT: core::ops::Range<f32> = 0.7..1.4;
/// Share of the evidence that is kept from one comparison to the next: what drifts is forgotten.
const MEMORY: f32 = 0.98;

/// An instant and the integral of the specific force until then (m/s, inertial axes).
type Instant = (u32, Vector3<f32>);

/// The comparison of two vectors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Seen {
    /// The vertical is off by a small rotation about a horizontal axis (rad, inertial axes), with this deviation.
    Tilt(Vector3<f32>, f32),
    /// The same with a rotation about the vertical, and both deviations.
    Whole(Vector3<f32>, [f32; 2]),
    /// The heading, unknown so far, is off by this rotation, with this deviation.
    Heading(UnitQuaternion<f32>, f32),
}

/// Evidence for the heading: sums over comparisons of products along and across, of squares of the integrals, of those
/// in deviations, and of their weights.
#[derive(Debug, Clone, Copy, Default)]
struct Evidence {
    along: f32,
    across: f32,
    squares: f32,
    information: f32,
    weight: f32,
}

/// What is kept to compare.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Aiding {
    gained: Vector3<f32>,
    trail: [Instant; KEPT],
    newest: usize,
    /// The last solution that was compared: its instant, the integral then, and its velocity (m/s).
    last: Option<(Instant, Vector3<f32>)>,
    evidence: Evidence,
}

impl Aiding {
    /// Adds the specific force (m/s2, inertial axes) over `elapsed` (s) until `time` (ticks).
    pub(super) fn see(&mut self, time: u32, force: &Vector3<f32>, elapsed: f32) {
        self.gained += force * elapsed;
        let (newest, _) = self.trail[self.newest];
        if time.wrapping_sub(newest) >= SPACING {
            self.newest = (self.newest + 1) % KEPT;
            self.trail[self.newest] = (time, self.gained);
        }
    }

    /// Forgets what was seen before a gap.
    pub(super) fn interrupt(&mut self) {
        *self = Self::default();
    }

    /// Turns what is kept with the attitude.
    pub(super) fn turn(&mut self, correction: &UnitQuaternion<f32>) {
        self.gained = correction * self.gained;
        for (_, gained) in &mut self.trail {
            *gained = correction * *gained;
        }
        if let Some(((_, gained), _)) = &mut self.last {
            *gained = correction * *gained;
        }
    }

    /// The integral at a past instant, linearly between those that are kept; `None` if it is older than they are.
    fn gained_at(&self, instant: u32, now: u32) -> Option<Vector3<f32>> {
        let mut later = (now, self.gained);
        for back in 0..KEPT {
            let (time, gained) = self.trail[(self.newest + KEPT - back) % KEPT];
            let before = instant.wrapping_sub(time);
            if before < LONGEST {
                let span = later.0.wrapping_sub(time);
                let share = if span == 0 {
                    0.0
                } else {
                    before as f32 / span as f32
                };
                return Some(gained + (later.1 - gained) * share.min(1.0));
            }
            later = (time, gained);
        }
        None
    }

    /// Compares the change since the last solution; `instant` is that of the solution, `now` that of the last specific
    /// force (ticks), `deviation` that of each component of the velocity (m/s), `tilt_error` that of the attitude (rad),
    /// whose heading is known or not.
    pub(super) fn solution(
        &mut self,
        [instant, now]: [u32; 2],
        velocity: &Vector3<f32>,
        deviation: f32,
        (tilt_error, is_heading_known): (f32, bool),
    ) -> Option<Seen> {
        let gained = self.gained_at(instant, now)?;
        if let Some(((before, _), _)) = self.last
            && instant.wrapping_sub(before) < SHORTEST
        {
            return None;
        }
        // The origin follows, so that the numbers stay small.
        self.gained -= gained;
        self.trail
            .iter_mut()
            .for_each(|(_, other)| *other -= gained);
        let last = self.last.replace(((instant, Vector3::zeros()), *velocity));
        let ((before, from), old) = last?;
        let ticks = instant.wrapping_sub(before);
        if ticks > LONGEST {
            return None;
        }
        let elapsed = ticks as f32 * 1e-4;
        let found = gained - from;
        let expected = velocity - old + Vector3::z() * (STANDARD_GRAVITY * elapsed);
        let deviation = core::f32::consts::SQRT_2 * deviation + FORCE_ERROR * elapsed;
        let (length, apart) = (expected.norm(), found.norm() - expected.norm());
        // No attitude explains vectors of other lengths: a wrong solution, a hit, or a gap.
        if apart.abs() > DEVIATIONS * deviation || length < DEVIATIONS * deviation {
            return None;
        }
        let turn = found.cross(&expected) / (length * length);
        let tilt = Vector3::new(turn.x, turn.y, 0.0);
        let square = found.xy().norm_squared().max(f32::MIN_POSITIVE);
        let along = found.xy().dot(&expected.xy());
        let across = found.x * expected.y - found.y * expected.x;
        if is_heading_known {
            let heading = Vector3::z() * (across / square);
            let errors = [deviation / length, deviation / square.root()];
            // The direction of a vector that is not longer than its error is none.
            return Some(if errors[1] < 1.0 {
                Seen::Whole(tilt + heading, errors)
            } else {
                Seen::Tilt(tilt, errors[0])
            });
        }
        let before = self.evidence;
        let evidence = Evidence {
            along: MEMORY * before.along + along,
            across: MEMORY * before.across + across,
            squares: MEMORY * before.squares + square,
            information: MEMORY * before.information + square / (deviation * deviation),
            weight: MEMORY * before.weight + 1.0,
        };
        self.evidence = evidence;
        let Evidence {
            along,
            across,
            squares,
            information,
            weight,
        } = evidence;
        let both = (along * along + across * across).root();
        // A tilt turns gravity into an acceleration, always the same, which no mean removes.
        let of_gravity = tilt_error * STANDARD_GRAVITY * elapsed;
        let error = (1.0 / information + of_gravity * of_gravity * weight / squares).root();
        if error < FOUND && AGREEMENT.contains(&(both / squares)) {
            self.evidence = Evidence::default();
            return Some(Seen::Heading(
                about_vertical(along / both, across / both),
                error,
            ));
        }
        // What is horizontal points anywhere as long as the heading is unknown.
        let is_straight = expected.xy().norm() < deviation;
        is_straight.then_some(Seen::Tilt(tilt, deviation / length))
    }
}

/// The rotation about the vertical with this cosine and sine.
fn about_vertical(cosine: f32, sine: f32) -> UnitQuaternion<f32> {
    // Two forms of the half angle, each exact where the other is not.
    let [w, z] = if cosine > 0.0 {
        [1.0 + cosine, sine]
    } else if sine < 0.0 {
        [-sine, cosine - 1.0]
    } else {
        [sine, 1.0 - cosine]
    };
    normalized(Quaternion::new(w, 0.0, 0.0, z))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is seen in `seconds` of a body that speeds up to and fro with this acceleration (m/s2) along an axis that turns,
    /// while the heading is off by `heading` (rad); solutions five times a second, 0.1 s old.
    fn seen(acceleration: f32, heading: f32, is_known: bool) -> std::vec::Vec<Seen> {
        seen_tilted(
            acceleration,
            0.4,
            heading,
            (Vector3::zeros(), 0.001),
            is_known,
        )
    }

    /// The same with a rate of that axis (rad/s) and a tilt (rad), and its deviation.
    fn seen_tilted(
        acceleration: f32,
        rate: f32,
        heading: f32,
        (tilt, tilt_error): (Vector3<f32>, f32),
        is_known: bool,
    ) -> std::vec::Vec<Seen> {
        let mut aiding = Aiding::default();
        let off = UnitQuaternion::from_scaled_axis(tilt)
            * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -heading);
        let mut found = std::vec::Vec::new();
        let (mut velocity, mut before) = (Vector3::new(20.0, 5.0, -30.0), Vector3::zeros());
        for tick in 0..20 * 200_u32 {
            let time = tick as f32 / 200.0;
            if tick % 40 == 20 {
                before = velocity;
            }
            let turn = rate * time;
            let pushed = Vector3::new(turn.cos(), turn.sin(), 0.2) * acceleration;
            let force = off * (pushed + Vector3::z() * STANDARD_GRAVITY);
            velocity += pushed / 200.0;
            let now = (u32::MAX - 9_000).wrapping_add(tick * 50);
            aiding.see(now, &force, 1.0 / 200.0);
            if tick % 40 == 39 && tick > 100 {
                let instant = now.wrapping_sub(19 * 50);
                found.extend(aiding.solution([instant, now], &before, 0.1, (tilt_error, is_known)));
            }
        }
        found
    }

    #[test]
    fn the_heading_is_found_where_the_velocity_changes_and_only_there() {
        for heading in [0.0_f32, 0.7, 2.0, 3.1, -1.5] {
            let found = seen(5.0, heading, false)
                .into_iter()
                .find_map(|seen| match seen {
                    Seen::Heading(turn, deviation) => Some((turn, deviation)),
                    _ => None,
                });
            let (turn, deviation) = found.expect("a heading");
            let right = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading);
            assert!(turn.angle_to(&right) < 0.03, "{heading}: {turn}");
            assert!(deviation < FOUND);
        }
        let steady = seen(0.01, 1.0, false);
        assert!(
            steady.iter().all(|seen| matches!(seen, Seen::Tilt(..))),
            "{steady:?}"
        );
        assert!(!steady.is_empty());
    }

    /// A take-off run: the acceleration keeps its direction, and so does what a tilt makes of gravity.
    #[test]
    fn a_heading_is_not_found_beyond_what_the_tilt_allows() {
        let mut found = 0;
        for acceleration in [0.5_f32, 1.0, 2.0, 3.0, 5.0, 10.0] {
            for tilt in [0.0_f32, 0.01, 0.02, 0.04] {
                for k in 0..24 {
                    let heading = 0.26 * k as f32 - 3.0;
                    let towards = Vector3::new((k as f32).cos(), (k as f32).sin(), 0.0) * tilt;
                    let tilted = (towards, tilt.max(0.01));
                    let seen = seen_tilted(acceleration, 0.0, heading, tilted, false);
                    let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading);
                    for seen in seen {
                        let Seen::Heading(turn, deviation) = seen else {
                            continue;
                        };
                        found += 1;
                        let error = turn.angle_to(&heading);
                        assert!(
                            error < 2.0 * deviation,
                            "{acceleration} {tilt}: {error}, {deviation}"
                        );
                        break;
                    }
                }
            }
        }
        assert!(found > 150, "{found}");
    }

    #[test]
    fn an_attitude_that_is_right_is_left_alone() {
        for seen in seen(3.0, 0.0, true) {
            let (turn, [tilt, heading]) = match seen {
                Seen::Whole(turn, deviations) => (turn, deviations),
                Seen::Tilt(turn, tilt) => (turn, [tilt, 1.0]),
                Seen::Heading(..) => unreachable!("it is known"),
            };
            assert!(turn.xy().norm() < 0.02 && turn.z.abs() < 0.05, "{turn}");
            assert!(tilt < 0.1 && heading > 0.0);
        }
    }

    #[test]
    fn a_velocity_that_no_attitude_explains_is_not_used() {
        let mut aiding = Aiding::default();
        let up = Vector3::z() * STANDARD_GRAVITY;
        for tick in 0..400_u32 {
            aiding.see(tick * 50, &up, 1.0 / 200.0);
        }
        let velocity = Vector3::zeros();
        assert_eq!(
            aiding.solution([19_000, 19_950], &velocity, 0.1, (0.01, true)),
            None
        );
        for tick in 400..800_u32 {
            aiding.see(tick * 50, &up, 1.0 / 200.0);
        }
        let jump = Vector3::new(30.0, 0.0, 0.0);
        assert_eq!(
            aiding.solution([39_000, 39_950], &jump, 0.1, (0.01, true)),
            None
        );
        // Older than what is kept.
        assert_eq!(
            aiding.solution([10, 39_950], &jump, 0.1, (0.01, true)),
            None
        );
    }
}
