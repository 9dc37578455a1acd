//! Attitudes and angular velocities of the pelvis, second by second: what agrees on the whole may be wrong for a while, and
//! what agrees over a second may be noise from frame to frame.

use nalgebra::Vector3;

use super::agreement::Zeros;

/// Time over which the two may part (s), and the rotation that noise and slow errors of rates do not explain: an angle (rad)
/// and a share of the way.
const PIECE: f64 = 1.0;
const PARTED: f64 = 0.4;
const PARTED_SHARE: f64 = 0.15;
/// Time over which single differences are averaged (s), the fewest such times, and the mean difference of the two (rad/s) that
/// is mostly noise.
const BRIEF: f64 = 0.1;
const LEAST: u32 = 20;
const SCATTERS: f64 = 1.5;

/// Rotation since a time (s): by attitudes, by angular velocities, and the longer of both ways (rad).
#[derive(Debug, Clone, Copy)]
struct Piece {
    begin: f64,
    by_attitudes: Vector3<f64>,
    by_rates: Vector3<f64>,
    ways: [f64; 2],
}

/// What has been seen of the rotation.
#[derive(Debug, Clone, Default)]
pub(super) struct Spins {
    piece: Option<Piece>,
    /// When the two part (s), by how much at most (rad), and in how many pieces.
    parted: Option<([f64; 2], f64)>,
    pieces: u32,
    /// When the present brief time began (s), and what the two differ by since (rad).
    brief: Option<(f64, Vector3<f64>)>,
    briefs: u32,
    scatter: f64,
    zeros: Zeros,
}

impl Spins {
    /// Takes the rotation between two frames (rad), the angular velocities in both (rad/s), all in inertial axes, the time
    /// of the second and the time between them (s).
    pub(super) fn see(
        &mut self,
        time: f64,
        duration: f64,
        turn: &Vector3<f64>,
        [before, now]: [&Vector3<f64>; 2],
    ) {
        let by_rates = 0.5 * (before + now) * duration;
        let (begin, apart) = self
            .brief
            .get_or_insert((time - duration, Vector3::zeros()));
        *apart += turn - by_rates;
        if time - *begin >= BRIEF {
            self.briefs += 1;
            self.scatter += apart.norm() / (time - *begin);
            self.brief = None;
        }
        self.zeros.see(time, turn, now);
        let piece = self.piece.get_or_insert_with(|| Piece {
            begin: time - duration,
            by_attitudes: Vector3::zeros(),
            by_rates: Vector3::zeros(),
            ways: [0.0; 2],
        });
        piece.by_attitudes += turn;
        piece.by_rates += by_rates;
        piece.ways[0] += turn.norm();
        piece.ways[1] += by_rates.norm();
        if time - piece.begin < PIECE {
            return;
        }
        let apart = (piece.by_attitudes - piece.by_rates).norm();
        if apart > PARTED + PARTED_SHARE * piece.ways[0].max(piece.ways[1]) {
            self.pieces += 1;
            let (span, largest) = self.parted.get_or_insert(([piece.begin, time], apart));
            span[1] = time;
            *largest = largest.max(apart);
        }
        self.piece = None;
    }

    /// Forgets what is compared across a gap.
    pub(super) fn interrupt(&mut self) {
        self.piece = None;
        self.brief = None;
    }

    /// When attitudes and angular velocities part, in a sentence, with the time it concerns (s).
    pub(super) fn parted(&self) -> Option<(String, [f64; 2])> {
        let (span, apart) = self.parted?;
        let message = format!(
            "attitudes and angular velocities of the pelvis part by up to {:.0} degrees within a second, {} times from {:.3} to {:.3} s: one of them is wrong or missing there",
            apart.to_degrees(),
            self.pieces,
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

    /// A body that rolls at 2 rad/s, whose rates `change` spoils by time and number of the frame.
    fn seen(change: impl Fn(f64, u32, Vector3<f64>) -> Vector3<f64>) -> Spins {
        let mut spins = Spins::default();
        let rolls = Vector3::x() * 2.0;
        for index in 1..500_u32 {
            let [before, time] = [index - 1, index].map(|at| f64::from(at) / 100.0);
            let rates = [change(before, index - 1, rolls), change(time, index, rolls)];
            spins.see(time, 0.01, &(rolls * 0.01), [&rates[0], &rates[1]]);
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
        let noise =
            seen(|_, index, rate| rate + Vector3::y() * if index % 40 < 20 { 4.0 } else { -4.0 });
        assert_eq!(noise.parted(), None);
        assert!(noise.scatters().is_some());
    }
}
