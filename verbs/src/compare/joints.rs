//! Differences of joint angles between aligned recordings, and which of them the suits cannot explain.

use bodyflight_core::body::joint_angle::JointAngle;
use bodyflight_core::tolerances::Tolerances;
use bodyflight_core::{Posture, Segment};
use serde::Serialize;

use super::align::Matched;
use super::track::Track;

/// Standard deviations by which a difference must exceed the errors of the joints before it is named: with 45 angles,
/// one in fifty pairs of equal flights then has any beyond it.
const NAMED: f64 = 3.5;
/// A difference ends where it is below this share of what it began with.
const ENDS: f64 = 0.7;
/// Shortest time for which a difference must last, or be gone (s).
const LASTS: f64 = 0.3;
/// Time after its beginning over which a difference is averaged (s).
pub const WINDOW: f64 = 2.0;

/// Postures of both recordings at matched times, and how they differ.
#[derive(Debug, Clone)]
pub struct Differences {
    /// The angles, in the order of the numbers.
    pub angles: Vec<JointAngle>,
    /// Times in A and B (s since frame 0).
    pub times: Vec<(f64, f64)>,
    /// For each time and angle: the angle in A, in B, how much further B is turned (rad), and its standard deviation.
    pub rows: Vec<Vec<[f64; 4]>>,
}

/// An angle over the time compared.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Summary {
    /// Name of joint and angle.
    pub joint: String,
    /// Mean angle in A (rad).
    pub a_rad: f64,
    /// Mean angle in B (rad).
    pub b_rad: f64,
    /// Mean of how much further B is turned, about the axes of the joint's parent (rad).
    pub difference_rad: f64,
    /// Root mean square of it (rad).
    pub rms_difference_rad: f64,
    /// Standard deviation of the difference by the errors of both suits and of the alignment (rad).
    pub deviation_rad: f64,
    /// Mean of the difference that must be exceeded to be named (rad).
    pub least_named_rad: f64,
}

/// A difference beyond the errors of the joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Which angle.
    pub angle: usize,
    /// Times in A (s since frame 0).
    pub span: [f64; 2],
    /// Mean of the difference over its first seconds, at most [`WINDOW`] (rad).
    pub mean: f64,
    /// Standard deviation of it (rad).
    pub deviation: f64,
}

/// Errors of a joint of one recording about an axis (rad): constant or slow, for a joint that is turned by an angle (rad).
fn joint_deviation(tolerances: &Tolerances, turned: f64) -> f64 {
    let constant = tolerances.joint_deg.to_radians();
    let wander = tolerances.wander_deg.to_radians();
    constant.hypot(wander).hypot(tolerances.bend * turned)
}

fn turned(posture: &Posture<f64>, segment: Segment) -> f64 {
    posture.parent_from_segment(segment).angle()
}

impl Differences {
    /// Compares postures at the frames of A.
    pub fn of([a, b]: [&Track; 2], matched: &Matched) -> Self {
        let angles: Vec<JointAngle> = JointAngle::all().collect();
        let [begin, end] = matched.span();
        let frames = a.between(begin, end);
        let times: Vec<(f64, f64)> = frames
            .iter()
            .map(|frame| (frame.time, matched.b_at(frame.time)))
            .collect();
        let apart = matched.alignment.deviation_s;
        let rows = (frames.iter().zip(&times)).map(|(frame, (_, time))| {
            let (one, two) = (&frame.posture, b.posture(*time));
            // How fast the joints of B move, for errors of the alignment.
            let (before, after) = (b.posture(time - 0.05), b.posture(time + 0.05));
            let of = |angle: &JointAngle| {
                let own = [(a, one), (b, &two)].map(|(track, posture)| {
                    let turned = turned(posture, angle.segment);
                    joint_deviation(&track.flight.tolerances, turned)
                });
                let rate = angle.difference(&before, &after) / 0.1;
                [
                    angle.value(one),
                    angle.value(&two),
                    angle.difference(one, &two),
                    own[0].hypot(own[1]).hypot(rate * apart),
                ]
            };
            angles.iter().map(of).collect()
        });
        Self {
            rows: rows.collect(),
            angles,
            times,
        }
    }

    /// The difference of an angle over time in A (s since frame 0), in rad.
    pub fn curve(&self, angle: usize) -> Vec<(f64, f64)> {
        let times = self.times.iter().map(|(time, _)| *time);
        times
            .zip(self.rows.iter().map(|row| row[angle][2]))
            .collect()
    }

    /// All angles over the time compared.
    pub fn summaries(&self) -> Vec<Summary> {
        let count = self.rows.len().max(1) as f64;
        let summary = |(k, angle): (usize, &JointAngle)| {
            let mean = |of: &dyn Fn(&[f64; 4]) -> f64| {
                self.rows.iter().map(|row| of(&row[k])).sum::<f64>() / count
            };
            let deviation_rad = mean(&|numbers| numbers[3]);
            Summary {
                joint: angle.to_string(),
                a_rad: mean(&|numbers| numbers[0]),
                b_rad: mean(&|numbers| numbers[1]),
                difference_rad: mean(&|numbers| numbers[2]),
                rms_difference_rad: mean(&|numbers| numbers[2] * numbers[2]).sqrt(),
                deviation_rad,
                least_named_rad: NAMED * deviation_rad,
            }
        };
        self.angles.iter().enumerate().map(summary).collect()
    }

    /// For each angle the first time at which it differs by more than the errors of the joints explain, in order of time.
    pub fn found(&self) -> Vec<Found> {
        let mut found: Vec<Found> = (0..self.angles.len())
            .filter_map(|angle| self.first(angle))
            .collect();
        // What begins together is ordered by size.
        let size = |found: &Found| (found.mean / found.deviation).abs();
        found.sort_by(|a, b| {
            let by_time = a.span[0].total_cmp(&b.span[0]);
            by_time.then(size(b).total_cmp(&size(a)))
        });
        found
    }

    fn first(&self, angle: usize) -> Option<Found> {
        let at = |k: usize| self.rows[k][angle];
        let time = |k: usize| self.times[k].0;
        let count = self.rows.len();
        let mut begin = 0;
        while begin < count {
            let sense = at(begin)[2].signum();
            let over = |k: usize, share: f64| sense * at(k)[2] > share * NAMED * at(k)[3];
            if !over(begin, 1.0) {
                begin += 1;
                continue;
            }
            // Short dips do not end it.
            let mut last = begin;
            let mut k = begin + 1;
            while k < count && time(k) - time(last) <= LASTS {
                if over(k, ENDS) {
                    last = k;
                }
                k += 1;
            }
            let lasts_to_end = last + 1 == count && time(last) - time(begin) > 0.5 * LASTS;
            if time(last) - time(begin) < LASTS && !lasts_to_end {
                begin = last + 1;
                continue;
            }
            let until = (begin..=last).take_while(|k| time(*k) <= time(begin) + WINDOW);
            let first: Vec<[f64; 4]> = until.map(at).collect();
            let mean = |place: usize| {
                first.iter().map(|numbers| numbers[place]).sum::<f64>() / first.len() as f64
            };
            return Some(Found {
                angle,
                span: [time(begin), time(last)],
                mean: mean(2),
                deviation: mean(3),
            });
        }
        None
    }
}
