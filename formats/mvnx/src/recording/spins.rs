//! Attitudes and angular velocities of the pelvis, second by second: what agrees on the whole may be wrong for a while, and
//! what agrees over a second may be noise from frame to frame. A constant bias of the gyroscope is no fault of a recording.

use nalgebra::{UnitQuaternion, Vector3};

use super::agreement::{Agreement, Zeros};
use super::gyroscope::{Gyroscope, Turned};

/// Time over which the two may part (s), and the rotation that noise and slow errors of rates do not explain: an angle (rad)
/// and a share of the way.
const PIECE: f64 = 1.0;
const PARTED: f64 = 0.4;
const PARTED_SHARE: f64 = 0.15;
/// Most times that are kept in which the two part.
const MOST: usize = 1000;
/// Largest bias of a gyroscope (rad/s).
const LARGEST_BIAS: f64 = 0.9;
/// Time over which single differences are averaged (s), the fewest such times, and the mean difference of the two (rad/s) that
/// is mostly noise.
const BRIEF: f64 = 0.1;
const LEAST: u32 = 20;
const SCATTERS: f64 = 1.5;
/// Correlation about an axis below which the two have opposite signs, and the least angular velocity about it (rad/s, root
/// mean square).
const OPPOSITE: f64 = -0.7;
const TURNS: f64 = 0.1;
/// The axes about which signs are compared: of the world, and of the body.
const AXES: [[&str; 3]; 2] = [["north", "west", "up"], ["left", "dorsal", "cranial"]];

/// Rotation since a time (s): by attitudes, by angular velocities, and the longer of both ways (rad).
#[derive(Debug, Clone, Copy)]
struct Piece {
    begin: f64,
    by_attitudes: Vector3<f64>,
    by_rates: Vector3<f64>,
    ways: [f64; 2],
    /// What the angular velocities turn further than the attitudes, in axes of the body (rad).
    further: Vector3<f64>,
}

/// Rotation by attitudes and by rates (rad) since a time (s), in axes of the world and of the body.
#[derive(Debug, Clone, Copy)]
struct Brief {
    begin: f64,
    turned: [[Vector3<f64>; 2]; 2],
    /// Angular acceleration at its begin, in axes of the body (rad/s2).
    acceleration: Vector3<f64>,
}

/// A time in which the two part (s), and what the angular velocities turn further, in axes of the body (rad).
#[derive(Debug, Clone, Copy)]
struct Parted {
    span: [f64; 2],
    further: Vector3<f64>,
    limit: f64,
}

/// What has been seen of the rotation.
#[derive(Debug, Clone, Default)]
pub(super) struct Spins {
    piece: Option<Piece>,
    parted: Vec<Parted>,
    /// Length of all pieces (s), and what the angular velocities turn further in them.
    length: f64,
    further: Vector3<f64>,
    brief: Option<Brief>,
    /// Angular acceleration between the last two frames, in axes of the body (rad/s2).
    acceleration: Option<Vector3<f64>>,
    /// The two about each axis of the world and of the body.
    about: [[Agreement; 3]; 2],
    gyroscope: Gyroscope,
    briefs: u32,
    scatter: f64,
    zeros: Zeros,
}

impl Spins {
    /// Takes the rotation between two frames (rad), the angular velocities in both (rad/s), all in inertial axes, the time
    /// of the second and the time between them (s), and the attitude then.
    pub(super) fn see(
        &mut self,
        time: f64,
        duration: f64,
        turn: &Vector3<f64>,
        [before, now]: [&Vector3<f64>; 2],
        inertial_from_body: &UnitQuaternion<f64>,
    ) {
        let by_rates = 0.5 * (before + now) * duration;
        let in_body = |turn: &Vector3<f64>| inertial_from_body.inverse_transform_vector(turn);
        let acceleration = in_body(&((now - before) / duration));
        let brief = self.brief.get_or_insert(Brief {
            begin: time - duration,
            turned: [[Vector3::zeros(); 2]; 2],
            acceleration: self.acceleration.unwrap_or(acceleration),
        });
        self.acceleration = Some(acceleration);
        let both = [[*turn, by_rates], [in_body(turn), in_body(&by_rates)]];
        for (sums, turned) in brief.turned.iter_mut().flatten().zip(both.iter().flatten()) {
            *sums += turned;
        }
        let brief = *brief;
        if time - brief.begin >= BRIEF {
            self.end_brief(time - brief.begin, &brief, acceleration);
        }
        self.zeros.see(time, turn, now);
        let piece = self.piece.get_or_insert_with(|| Piece {
            begin: time - duration,
            by_attitudes: Vector3::zeros(),
            by_rates: Vector3::zeros(),
            ways: [0.0; 2],
            further: Vector3::zeros(),
        });
        piece.by_attitudes += turn;
        piece.by_rates += by_rates;
        piece.ways[0] += turn.norm();
        piece.ways[1] += by_rates.norm();
        piece.further += in_body(&(by_rates - turn));
        if time - piece.begin < PIECE {
            return;
        }
        self.length += time - piece.begin;
        self.further += piece.further;
        let apart = (piece.by_attitudes - piece.by_rates).norm();
        let limit = PARTED + PARTED_SHARE * piece.ways[0].max(piece.ways[1]);
        if apart > limit && self.parted.len() < MOST {
            self.parted.push(Parted {
                span: [piece.begin, time],
                further: piece.further,
                limit,
            });
        }
        self.piece = None;
    }

    /// Takes the rotations of a brief time of this length (s), and the angular acceleration at its end.
    fn end_brief(&mut self, length: f64, brief: &Brief, acceleration: Vector3<f64>) {
        let [[by_attitudes, by_rates], in_body] = brief.turned;
        self.briefs += 1;
        self.scatter += (by_attitudes - by_rates).norm() / length;
        self.gyroscope.see(&Turned {
            time: length,
            by_attitudes: in_body[0],
            by_rates: in_body[1],
            bends: acceleration - brief.acceleration,
        });
        for (about, [expected, found]) in self.about.iter_mut().zip(&brief.turned) {
            for (axis, agreement) in about.iter_mut().enumerate() {
                let along = |turned: &Vector3<f64>| Vector3::x() * (turned[axis] / length);
                agreement.add(&along(expected), &along(found));
            }
        }
        self.brief = None;
    }

    /// Angular velocities with the opposite sign about one axis, in a sentence.
    pub(super) fn opposite(&self) -> Option<String> {
        if self.briefs < LEAST {
            return None;
        }
        let least = TURNS * TURNS * f64::from(self.briefs);
        let names = AXES.iter().flatten();
        let all = self.about.iter().flatten().zip(names);
        let (agreement, axis) = all
            .filter(|(agreement, _)| agreement.expected.min(agreement.found) > least)
            .min_by(|(a, _), (b, _)| a.correlation().total_cmp(&b.correlation()))?;
        let correlation = agreement.correlation();
        (correlation < OPPOSITE).then(|| {
            format!(
                "about the {axis} axis, the angular velocities of the pelvis have the opposite sign of those of the attitudes (correlation {correlation:.2}): the sign of that axis is wrong"
            )
        })
    }

    /// Times in which the two part by more than a bias (rad/s, axes of the body) explains, each with how far (rad).
    fn unexplained(&self, bias: Vector3<f64>) -> impl DoubleEndedIterator<Item = (&Parted, f64)> {
        let apart = move |part: &Parted| {
            let [begin, end] = part.span;
            (part.further - bias * (end - begin)).norm()
        };
        let all = self.parted.iter().map(move |part| (part, apart(part)));
        all.filter(|(part, apart)| *apart > part.limit)
    }

    /// A constant bias of the gyroscope (rad/s, axes of the body): the mean difference, if a gyroscope may have it and it
    /// explains where the two part.
    fn bias(&self) -> Vector3<f64> {
        let mean = self.further / self.length.max(PIECE);
        let explains = self.parted.is_empty() || self.unexplained(mean).count() < self.parted.len();
        if mean.norm() < LARGEST_BIAS && explains {
            mean
        } else {
            Vector3::zeros()
        }
    }

    /// Errors of the gyroscope that are worth telling, in a sentence.
    pub(super) fn of_gyroscope(&self) -> Option<String> {
        self.gyroscope.errors()
    }

    /// Its scale about the axes of the body, if it is worth telling.
    pub(super) fn gyroscope_scale(&self) -> Option<[f64; 3]> {
        self.gyroscope.scale()
    }

    /// Forgets what is compared across a gap.
    pub(super) fn interrupt(&mut self) {
        self.piece = None;
        self.brief = None;
        self.acceleration = None;
    }

    /// When attitudes and angular velocities part, but for a bias, in a sentence, with the time it concerns (s).
    pub(super) fn parted(&self) -> Option<(String, [f64; 2])> {
        let mut parted = self.unexplained(self.bias());
        let (first, largest) = parted.next()?;
        let (count, last, largest) = parted
            .fold((1, first, largest), |(count, _, largest), (part, apart)| {
                (count + 1, part, largest.max(apart))
            });
        let span = [first.span[0], last.span[1]];
        let message = format!(
            "attitudes and angular velocities of the pelvis part by up to {:.0} degrees within a second, {} times from {:.3} to {:.3} s: one of them is wrong or missing there",
            largest.to_degrees(),
            count,
            span[0],
            span[1]
        );
        Some((message, span))
    }

    /// Angular velocities that are exactly zero although the body turns, in a sentence, with the time of the first (s).
    pub(super) fn empty(&self) -> Option<(String, f64)> {
        let (empty, turning, first) = self.zeros.found()?;
        let message = format!(
            "the angular velocity of the pelvis is exactly zero about an axis in {empty} of {turning} frames that turn about it, first at {first:.3} s: it is missing there"
        );
        Some((message, first))
    }

    /// Angular velocities that are mostly noise, in a sentence.
    pub(super) fn scatters(&self) -> Option<String> {
        let mean = self.scatter / f64::from(self.briefs.max(1));
        (self.briefs >= LEAST && mean > SCATTERS).then(|| {
            format!(
                "the angular velocities of the pelvis scatter by {mean:.1} rad/s about those of the attitudes; expected less than {SCATTERS} rad/s"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Angular velocity of a body that rolls (rad/s).
    fn rolls() -> Vector3<f64> {
        Vector3::x() * 2.0
    }

    /// A body that rolls, whose rates `change` spoils by time and number of the frame.
    fn seen(change: impl Fn(f64, u32, Vector3<f64>) -> Vector3<f64>) -> Spins {
        let mut spins = Spins::default();
        let rolls = rolls();
        for index in 1..500_u32 {
            let [before, time] = [index - 1, index].map(|at| f64::from(at) / 100.0);
            let rates = [change(before, index - 1, rolls), change(time, index, rolls)];
            let attitude = UnitQuaternion::from_scaled_axis(rolls * time);
            spins.see(
                time,
                0.01,
                &(rolls * 0.01),
                [&rates[0], &rates[1]],
                &attitude,
            );
        }
        spins
    }

    #[test]
    fn rates_that_fail_for_a_while_and_rates_of_noise_are_told() {
        let sound = seen(|_, _, rate| 1.03 * rate);
        assert_eq!((sound.parted(), sound.scatters()), (None, None));
        let empty = seen(|time, _, rate| {
            if (2.0..2.5).contains(&time) {
                0.0 * rate
            } else {
                rate
            }
        });
        let (said, span) = empty.parted().unwrap();
        assert!(
            said.contains("part by up to 57 degrees within a second, 1 times"),
            "{said}"
        );
        assert!((span[0] - 2.0).abs() < 0.02, "{span:?}");
        let (said, first) = empty.empty().unwrap();
        assert!(
            said.contains("in 50 of 499 frames") && (first - 2.0).abs() < 1e-9,
            "{said}"
        );
        let biased = seen(|time, _, rate| {
            let attitude = UnitQuaternion::from_scaled_axis(rolls() * time);
            rate + attitude * Vector3::new(0.4, 0.4, -0.4)
        });
        assert_eq!(biased.parted(), None);
        assert!((biased.bias() - Vector3::new(0.4, 0.4, -0.4)).amax() < 0.01);
        assert!(biased.of_gyroscope().is_some());
        let noise =
            seen(|_, index, rate| rate + Vector3::y() * if index % 40 < 20 { 4.0 } else { -4.0 });
        assert_eq!(noise.parted(), None);
        assert!(noise.scatters().is_some());
    }
}
