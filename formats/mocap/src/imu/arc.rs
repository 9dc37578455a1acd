//! Sensors of arms that turn on the spot.
//!
//! An arm that swings about its joint takes its sensor along an arc, and the sensor feels it: twelve centimetres from an
//! elbow, half a turn within a second is several m/s2. A sensor that turns on the arm, as a strap does that gives way, turns the
//! same but feels nothing of it. What it feels beyond the joint lies between what it would if the arm kept its angle to the
//! neighbour, and what it would if the arm went with the sensor; a regression shows where. An arm that turns about itself feels the
//! same either way: then nothing follows.
//!
//! A sensor close to its joint feels little of any arc. So the march shows first how much each feels while it is sound.
//!
//! Legs are left out. In steps a thigh or a shank feels as little as a third of its arc: muscles swing and heels strike.

use std::collections::VecDeque;

use bodyflight_core::Segment;
use bodyflight_core::suit::joint::Felt;
use bodyflight_core::suit::set::{Suit, pairs_of};
use nalgebra::{Matrix2, Matrix3, Matrix3x2, Vector2, Vector3};

/// The segments that are watched.
const ARMS: [Segment; 4] = [
    Segment::LeftUpperArm,
    Segment::LeftForearm,
    Segment::RightUpperArm,
    Segment::RightForearm,
];
/// Time over which forces are averaged (s).
const PIECE: f64 = 0.05;
/// Angle by which a limb must swing, seen from its neighbour (rad), and the longest time for it (pieces).
const SWING: f64 = 2.0;
const LONGEST: usize = 40;
/// Time before and after the swing that counts too (pieces).
const AROUND: usize = 2;
/// Share of what it felt while it was sound that a sensor must feel less of, by so many standard errors.
const SHARE: f64 = 0.5;
const SURE: f64 = 3.0;
/// Pieces on the ground that are taken together, and how far a sensor may lie from where the model has it, as a share of its
/// distance from the joint, standard deviation.
const TOGETHER: usize = 40;
const MISPLACED: f64 = 0.35;
/// Least noise of the mean force of a piece (m/s2), and pieces in a row whose noise is alike.
const NOISE: f64 = 0.3;
const ALIKE: f64 = 2.0;

/// A sensor that turned on its segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Turned {
    /// When it began (s).
    pub(super) begin_s: f64,
    /// How far its segment would have swung (rad).
    pub(super) by: f64,
    /// Share of the arc that it felt.
    pub(super) share: f64,
}

/// A short time.
#[derive(Debug, Clone, Copy)]
struct Piece {
    end_s: f64,
    /// From the joint to the sensor (m, axes of the neighbour), at the end.
    lever: Vector3<f64>,
    /// Force beyond that at the joint (m/s2, reference axes): what is felt, and what would be if the arm goes with the sensor.
    felt: Vector3<f64>,
    swinging: Vector3<f64>,
    /// The same for a lever in axes of the neighbour, if the arm keeps its angle to it.
    kept: Matrix3<f64>,
}

/// One arm's sensor.
#[derive(Debug, Default)]
struct Arm {
    /// The last sample, and the begin of the piece.
    last: Option<[Felt<f64>; 2]>,
    begin: Option<[Felt<f64>; 2]>,
    /// Integral of the difference of the forces since then (m/s), and time (s).
    difference: Vector3<f64>,
    time: f64,
    pieces: VecDeque<Piece>,
    known: Known,
    turned: Option<Turned>,
}

/// Share of its arc that a sensor felt on the ground: sums of its force and its arc (m2/s4), and pieces.
#[derive(Debug, Default)]
struct Known {
    product: f64,
    square: f64,
    all: f64,
    count: f64,
}

impl Known {
    fn take(&mut self, pieces: &VecDeque<Piece>) {
        let count = pieces.len().max(1) as f64;
        let sum = |part: fn(&Piece) -> Vector3<f64>| pieces.iter().map(part).sum::<Vector3<f64>>();
        let (felt, swinging) = (sum(|p| p.felt) / count, sum(|p| p.swinging) / count);
        for piece in pieces {
            let (felt, swinging) = (piece.felt - felt, piece.swinging - swinging);
            self.product += felt.dot(&swinging);
            self.square += swinging.norm_squared();
            self.all += felt.norm_squared();
        }
        self.count += count;
    }

    /// The share with its standard error; without any motion what the model says.
    fn share(&self) -> [f64; 2] {
        let prior = 1.0 / (MISPLACED * MISPLACED);
        if self.square <= 0.0 {
            return [1.0, MISPLACED];
        }
        let share = self.product / self.square;
        let noise = (self.all - share * self.product) / (3.0 * self.count);
        let weight = self.square / (ALIKE * noise.max(NOISE * NOISE));
        let together = prior + weight;
        [(prior + weight * share) / together, (1.0 / together).sqrt()]
    }
}

/// Watches the arms in a flight, after they were seen on the ground.
#[derive(Debug)]
pub(super) struct Arcs {
    arms: [Arm; ARMS.len()],
    is_flying: bool,
}

impl Arcs {
    pub(super) fn new() -> Self {
        Self {
            arms: ARMS.map(|_| Arm::default()),
            is_flying: false,
        }
    }

    /// Takes what the sensors of the arms and their neighbours feel at a time of the flight (s), negative before it, `step` (s) after
    /// the last.
    pub(super) fn take(&mut self, time: f64, step: f64, suit: &Suit<f64, 16, { pairs_of(16) }>) {
        let is_flying = time >= 0.0;
        for (segment, arm) in ARMS.into_iter().zip(&mut self.arms) {
            if is_flying && !self.is_flying {
                arm.fly();
            }
            arm.take(time, step, suit.felt(segment), is_flying);
        }
        self.is_flying = is_flying;
    }

    /// The sensors that turned on the spot.
    pub(super) fn turned(&self) -> impl Iterator<Item = (Segment, Turned)> {
        let each = ARMS.into_iter().zip(&self.arms);
        each.filter_map(|(segment, arm)| Some((segment, arm.turned?)))
    }
}

impl Arm {
    fn fly(&mut self) {
        self.pieces.clear();
        self.restart(None);
    }

    fn take(&mut self, time: f64, step: f64, felt: Option<[Felt<f64>; 2]>, is_flying: bool) {
        let (Some(now), Some(last), Some(begin)) = (felt, self.last, self.begin) else {
            self.pieces.clear();
            self.restart(felt);
            return;
        };
        let gap = |[own, neighbour]: [Felt<f64>; 2]| own.force - neighbour.force;
        self.difference += (gap(last) + gap(now)) * (0.5 * step);
        self.time += step;
        self.last = felt;
        if self.time < PIECE - 0.5 * step {
            return;
        }
        let turning = [0, 1].map(|of| {
            let [before, now] = [begin[of], now[of]].map(|felt| {
                let axes = felt.attitude.to_rotation_matrix().into_inner();
                felt.rate.cross_matrix() * axes
            });
            (now - before) / self.time
        });
        let [to_own, to_neighbour] = [0, 1].map(|of| now[of].attitude.inverse() * now[of].to_joint);
        self.pieces.push_back(Piece {
            end_s: time,
            lever: now[1].attitude.inverse() * -now[0].to_joint,
            felt: self.difference / self.time - turning[1] * to_neighbour,
            swinging: -turning[0] * to_own,
            kept: turning[1],
        });
        self.restart(felt);
        if !is_flying {
            if self.pieces.len() >= TOGETHER {
                self.known.take(&self.pieces);
                self.pieces.clear();
            }
            return;
        }
        if self.pieces.len() > LONGEST + 2 * AROUND + 1 {
            self.pieces.pop_front();
        }
        if self.turned.is_none() {
            self.turned = self.swing();
        }
    }

    fn restart(&mut self, felt: Option<[Felt<f64>; 2]>) {
        (self.last, self.begin) = (felt, felt);
        self.difference = Vector3::zeros();
        self.time = 0.0;
    }

    /// The swing that has just ended, if its arc was not felt.
    fn swing(&self) -> Option<Turned> {
        let end = self.pieces.len().checked_sub(1 + AROUND)?;
        let to = self.pieces.get(end)?;
        let (begin, from, by) = (end.saturating_sub(LONGEST)..end).rev().find_map(|begin| {
            let from = self.pieces.get(begin)?;
            let by = from.lever.angle(&to.lever);
            (by > SWING).then_some((begin, from, by))
        })?;
        let around = self.pieces.range(begin.saturating_sub(AROUND)..);
        let [share, error] =
            share(around.map(|piece| [piece.felt, piece.swinging, piece.kept * from.lever]))?;
        let [known, off] = self.known.share();
        let is_less =
            share + SURE * error < SHARE * known && share + SURE * error.hypot(off) < known;
        is_less.then_some(Turned {
            begin_s: from.end_s,
            by,
            share,
        })
    }
}

/// Share of its arc that a sensor feels, with its standard error, by what it feels, what it would if the arm goes with it, and
/// what it would if the arm keeps its angle (m/s2). What is felt all the time is an error of an attitude.
fn share(pieces: impl Iterator<Item = [Vector3<f64>; 3]> + Clone) -> Option<[f64; 2]> {
    let count = pieces.clone().count() as f64;
    let mut mean = [Vector3::zeros(); 3];
    for piece in pieces.clone() {
        for (mean, part) in mean.iter_mut().zip(piece) {
            *mean += part / count;
        }
    }
    let (mut square, mut product, mut all) = (Matrix2::zeros(), Vector2::zeros(), 0.0);
    for piece in pieces {
        let [felt, swinging, kept] = [0, 1, 2].map(|of| piece[of] - mean[of]);
        let arcs = Matrix3x2::from_columns(&[swinging, kept]);
        square += arcs.transpose() * arcs;
        product += arcs.transpose() * felt;
        all += felt.norm_squared();
    }
    // Where the body does not turn, nothing shows how much the sensor feels of that.
    square[(1, 1)] += NOISE * NOISE;
    let inverse = square.try_inverse()?;
    let shares = inverse * product;
    let noise = ((all - shares.dot(&product)) / (3.0 * count)).max(NOISE * NOISE);
    let found = [shares.x, (ALIKE * noise * inverse[(0, 0)]).sqrt()];
    found
        .iter()
        .all(|number| number.is_finite())
        .then_some(found)
}

#[cfg(test)]
mod tests {
    mod recorded;

    use bodyflight_core::air::STANDARD_GRAVITY;
    use nalgebra::UnitQuaternion;

    use super::*;

    const RATE: f64 = 100.0;
    /// From the joint to the sensor (m, axes of the arm).
    const LEVER: Vector3<f64> = Vector3::new(0.02, 0.0, -0.12);

    fn turn(axis: Vector3<f64>, angle: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(axis * angle)
    }

    /// From 0 to 1 within 0.4 s from 1 s on.
    fn share(time: f64) -> f64 {
        let place = ((time - 1.0) / 0.4).clamp(0.0, 1.0);
        place * place * (3.0 - 2.0 * place)
    }

    /// What a point feels that moves with a body (m, body axes), and how the sensor there turns.
    fn felt(
        time: f64,
        attitude: impl Fn(f64) -> UnitQuaternion<f64>,
        place: impl Fn(f64) -> Vector3<f64>,
        joint: Vector3<f64>,
    ) -> Felt<f64> {
        let step = 1e-3;
        let [before, now, after] = [time - step, time, time + step].map(place);
        let up = Vector3::z() * STANDARD_GRAVITY;
        let rate = (attitude(time + step) * attitude(time - step).inverse()).scaled_axis();
        Felt {
            attitude: attitude(time),
            force: (before + after - now * 2.0) / (step * step) + up,
            to_joint: attitude(time) * joint,
            rate: rate / (2.0 * step),
        }
    }

    /// What is found if the arm swung to and fro on the ground, and then the body rolls, the arm swings about its joint and its
    /// sensor turns on the spot, each by an angle at a time. A sample is lost at `lost_s`; the sensor is `nearer` to the joint
    /// than it is said to be, as a share.
    fn found(
        roll: impl Fn(f64) -> f64,
        swing: impl Fn(f64) -> UnitQuaternion<f64>,
        slip: impl Fn(f64) -> UnitQuaternion<f64>,
        [lost_s, nearer]: [f64; 2],
    ) -> Option<Turned> {
        let joint = Vector3::new(0.2, 0.0, 0.3);
        let body = |time: f64| turn(Vector3::y(), roll(time));
        let mut arm = Arm::default();
        for step in 0..400_u32 {
            let time = f64::from(step) / RATE;
            let swing = |time: f64| turn(Vector3::x(), 0.5 * (6.0 * time).sin());
            let own = felt(time, swing, |time| swing(time) * (LEVER * nearer), -LEVER);
            let neighbour = felt(
                time,
                |_| UnitQuaternion::identity(),
                |_| Vector3::zeros(),
                Vector3::zeros(),
            );
            arm.take(time, 1.0 / RATE, Some([own, neighbour]), false);
        }
        arm.fly();
        for step in 0..300_u32 {
            let time = f64::from(step) / RATE;
            let own = felt(
                time,
                |time| body(time) * swing(time) * slip(time),
                |time| body(time) * (joint + swing(time) * LEVER * nearer),
                -LEVER,
            );
            let neighbour = felt(time, body, |_| Vector3::zeros(), joint);
            let is_lost = (time - lost_s).abs() < 0.5 / RATE;
            arm.take(
                time,
                1.0 / RATE,
                (!is_lost).then_some([own, neighbour]),
                true,
            );
        }
        arm.turned
    }

    #[test]
    fn a_sensor_that_turns_on_the_spot_is_told_from_an_arm_that_swings() {
        let still = |_: f64| UnitQuaternion::identity();
        let round = |time: f64| turn(Vector3::y(), core::f64::consts::PI * share(time));
        for roll in [0.0, 4.0] {
            let rolls = |time: f64| roll * time;
            for nearer in [1.0, 0.2] {
                let swung = found(rolls, round, still, [9.0, nearer]);
                assert_eq!(swung, None, "it swings, {nearer}");
            }
            let told = found(rolls, still, round, [9.0, 1.0]).expect("it turns on the spot");
            assert!((0.8..1.4).contains(&told.begin_s), "{told:?}");
            assert!(told.by > SWING && told.share.abs() < 0.2, "{told:?}");
        }
    }

    /// Nothing follows from an arm that turns about itself, nor from a turn in which samples were lost.
    #[test]
    fn turns_that_show_nothing_are_not_told() {
        let still = |_: f64| UnitQuaternion::identity();
        let about_itself = |time: f64| turn(Vector3::z(), core::f64::consts::PI * share(time));
        assert_eq!(found(|_| 0.0, about_itself, still, [9.0, 1.0]), None);
        assert_eq!(found(|_| 0.0, still, about_itself, [9.0, 1.0]), None);
        let round = |time: f64| turn(Vector3::y(), core::f64::consts::PI * share(time));
        assert_eq!(found(|_| 0.0, still, round, [1.2, 1.0]), None);
    }
}
