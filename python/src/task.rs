//! The task of an episode: what is observed, rewarded and wanted, and when it ends.

use bodyflight_core::dynamics::PostureSample;
use bodyflight_core::four::Four;
use bodyflight_core::math::{Lanes, clamp};
use bodyflight_viewer::cockpit::CONTROLS;
use nalgebra::{SimdBool, SimdValue};

use crate::observed::{Row, observation};
use crate::side_by_side::Together;
use crate::skydiver::{Course, NUMBERS, Skydiver};

/// Largest magnitude of a scaled observation, far beyond what a person flies.
pub(crate) const LIMIT: f32 = 100.0;
/// Angular velocity about one body axis at which a flight counts as tumbling (rad/s).
const TUMBLING: f32 = 15.0;
/// Reward of the step in which an episode is terminated.
const FALLEN: f32 = -10.0;

/// What every task observes of the body: indices into [`crate::observed::OBSERVED`], and the divisors that scale the values to about
/// one.
pub(crate) const SUIT: [(usize, f32); 13] = [
    (0, 1.0),
    (1, 1.0),
    (2, 1.0),
    (3, 1.0),
    (4, 1.0),
    (5, 5.0),
    (6, 5.0),
    (7, 5.0),
    (8, 60.0),
    (9, 60.0),
    (10, 60.0),
    (14, 20.0),
    (15, 60.0),
];
/// What every task observes of its goal.
pub(crate) const GOAL: [&str; 4] = [
    "turn_left_sin",
    "turn_left_cos",
    "target_ahead_m",
    "target_left_m",
];
/// Distance of the target that is scaled to one (m).
const GOAL_SCALE: f32 = 10.0;
/// Terms of a reward, in the order in which they are added.
pub(crate) const TERMS: [&str; 5] = ["upright", "effort", "nearness", "facing", "fallen"];
/// A flight is where its task wants it to be if the wanted upward direction is less than 15 degrees off, ...
const UPRIGHT: f32 = 0.966;
/// ... it turns slower than this about every axis of the body (rad/s), ...
const STILL: f32 = 0.5;
/// ... the wanted heading is less than 10 degrees off, ...
const FACING: f32 = 0.985;
/// ... and the target is nearer than this (m).
const NEAR: f32 = 0.5;
/// Numbers of an episode besides those of the flight.
pub(crate) const EPISODE: [&str; 5] = [
    "wanted_heading_sin",
    "wanted_heading_cos",
    "target_north_m",
    "target_west_m",
    "steps",
];
/// Number of the numbers that describe an environment to the bit.
pub(crate) const STATE: usize = NUMBERS + EPISODE.len();
/// Number of controls, over which the effort is averaged.
#[expect(clippy::cast_precision_loss, reason = "there are eight controls")]
const EFFORT: f32 = CONTROLS.len() as f32;
/// Number of components in an observation.
pub(crate) const WIDTH: usize = SUIT.len() + GOAL.len();

/// What is rewarded.
#[derive(Clone, Copy)]
pub(crate) struct Task {
    /// Wanted components of the upward direction: left, dorsal, cranial.
    pub(crate) up: [f32; 3],
    /// Whether facing the goal's heading is rewarded.
    pub(crate) faces: bool,
    /// Whether nearness to the goal's place is rewarded.
    pub(crate) docks: bool,
    /// Steps after which an episode is truncated.
    pub(crate) limit: u32,
}

impl Task {
    /// Cosine of the angle between the wanted upward direction and the body's.
    fn upright<T: Lanes>(&self, row: &Row<T>) -> T {
        let [left, dorsal, cranial, ..] = *row;
        let up = self.up.map(T::single);
        left * up[0] + dorsal * up[1] + cranial * up[2]
    }
}

/// One skydiver with the goal of its episode, or several side by side.
#[derive(Clone, Copy)]
pub(crate) struct Environment<T: Lanes> {
    pub(crate) skydiver: Skydiver<T>,
    /// Sine and cosine of the wanted heading.
    pub(crate) heading: (T, T),
    /// Wanted place: north, west (m).
    pub(crate) target: [T; 2],
    /// Steps since the episode began, up to [`MOST_STEPS`].
    pub(crate) steps: T,
}

/// Most steps of an episode, more than six days: the largest number up to which single precision counts.
pub(crate) const MOST_STEPS: f64 = 16_777_216.0;

/// What a step of an environment gives.
pub(crate) struct Judged<T: Lanes> {
    pub(crate) seen: [T; WIDTH],
    pub(crate) reward: T,
    /// Terms of the reward, in the order of [`TERMS`].
    pub(crate) terms: [T; TERMS.len()],
    /// Whether the body is still, and where the task wants it to be.
    pub(crate) success: T::SimdBool,
    pub(crate) terminated: T::SimdBool,
    pub(crate) truncated: T::SimdBool,
}

/// Whether the body spins faster than [`TUMBLING`], or its motion is no longer finite.
fn is_tumbling<T: Lanes>(row: &Row<T>) -> T::SimdBool {
    let [up, _, _, _, _, left, dorsal, cranial, ..] = *row;
    let finite = row
        .iter()
        .fold(up.finite(), |all, value| all & value.finite());
    let tumbles = |spin: T| spin.simd_abs().simd_gt(T::single(TUMBLING));
    !finite | tumbles(left) | tumbles(dorsal) | tumbles(cranial)
}

impl<T: Lanes> Environment<T> {
    /// Flies one step with an action; `sample` is scratch memory.
    pub(crate) fn step(
        &mut self,
        course: &Course<T>,
        task: &Task,
        action: &[T; CONTROLS.len()],
        sample: &mut PostureSample<T>,
    ) -> Judged<T> {
        course.fly(&mut self.skydiver, action, sample);
        self.steps += T::one();
        let row = observation(&self.skydiver.motion);
        let fallen = is_tumbling(&row);
        let terms = self.terms(task, &row, action, fallen);
        Judged {
            seen: self.observe(&row),
            reward: terms.iter().fold(T::zero(), |sum, term| sum + *term),
            terms,
            success: !fallen & self.succeeds(task, &row),
            terminated: fallen,
            truncated: self.steps.simd_ge(T::of(f64::from(task.limit))),
        }
    }

    /// Sine and cosine of the wanted heading minus that of the body.
    fn turn_left(&self, row: &Row<T>) -> (T, T) {
        let [_, _, _, sine, cosine, ..] = *row;
        let (wanted_sine, wanted_cosine) = self.heading;
        (
            wanted_sine * cosine - wanted_cosine * sine,
            wanted_cosine * cosine + wanted_sine * sine,
        )
    }

    /// Returns the way from the body to the target: north, west (m).
    fn way(&self, row: &Row<T>) -> [T; 2] {
        let [.., north, west, _, _, _] = *row;
        let [to_north, to_west] = self.target;
        [to_north - north, to_west - west]
    }

    pub(crate) fn observe(&self, row: &Row<T>) -> [T; WIDTH] {
        let [_, _, _, sine, cosine, ..] = *row;
        let (turn_sine, turn_cosine) = self.turn_left(row);
        let [north, west] = self.way(row);
        let goal = [
            turn_sine,
            turn_cosine,
            (north * cosine + west * sine) / T::single(GOAL_SCALE),
            (west * cosine - north * sine) / T::single(GOAL_SCALE),
        ];
        let suit = SUIT.iter().map(|(index, scale)| {
            row.get(*index)
                .map_or(T::zero(), |value| *value / T::single(*scale))
        });
        let mut seen = [T::zero(); WIDTH];
        let limit = T::single(LIMIT);
        for (place, value) in seen.iter_mut().zip(suit.chain(goal)) {
            // A flight may tumble until its numbers overflow.
            let is_number = value.simd_eq(value);
            *place = is_number.if_else(|| clamp(value, -limit, limit), T::zero);
        }
        seen
    }

    /// Distance of the target (m).
    fn distance(&self, row: &Row<T>) -> T {
        let [north, west] = self.way(row);
        (north * north + west * west).root()
    }

    /// Terms of the reward, in the order of [`TERMS`].
    fn terms(
        &self,
        task: &Task,
        row: &Row<T>,
        action: &[T; CONTROLS.len()],
        fallen: T::SimdBool,
    ) -> [T; TERMS.len()] {
        let (zero, one, half) = (T::zero(), T::one(), T::single(0.5));
        let squares = action.iter().fold(zero, |sum, share| sum + *share * *share);
        let effort = squares / T::single(EFFORT);
        let nearness = match task.docks {
            true => T::single(std::f32::consts::E).power(-half * self.distance(row)),
            false => zero,
        };
        let facing = match task.faces {
            true => half * (one + self.turn_left(row).1),
            false => zero,
        };
        let upright = half * (one + task.upright(row));
        let penalty = T::single(-0.01) * effort;
        let [upright, penalty, nearness, facing] =
            [upright, penalty, nearness, facing].map(|term| fallen.if_else(|| zero, || term));
        let fallen = fallen.if_else(|| T::single(FALLEN), || zero);
        [upright, penalty, nearness, facing, fallen]
    }

    /// Whether the body is still, and where the task wants it to be.
    fn succeeds(&self, task: &Task, row: &Row<T>) -> T::SimdBool {
        let [_, _, _, _, _, left, dorsal, cranial, ..] = *row;
        let still = |spin: T| spin.simd_abs().simd_lt(T::single(STILL));
        let mut succeeds = still(left) & still(dorsal) & still(cranial);
        succeeds = succeeds & task.upright(row).simd_gt(T::single(UPRIGHT));
        if task.faces {
            succeeds = succeeds & self.turn_left(row).1.simd_gt(T::single(FACING));
        }
        if task.docks {
            succeeds = succeeds & self.distance(row).simd_lt(T::single(NEAR));
        }
        succeeds
    }

    /// Returns all that the environment consists of.
    pub(crate) fn numbers(&self) -> [T; STATE] {
        let ((sine, cosine), [north, west]) = (self.heading, self.target);
        let episode = [sine, cosine, north, west, self.steps];
        let mut numbers = [T::zero(); STATE];
        let all = self.skydiver.numbers().into_iter().chain(episode);
        for (place, number) in numbers.iter_mut().zip(all) {
            *place = number;
        }
        numbers
    }
}

impl Environment<f32> {
    /// The horizontal direction of the goal (north, west; length 1), if the task has one that is not reached.
    pub(crate) fn toward(&self, task: &Task, row: &Row<f32>) -> Option<[f32; 2]> {
        let [north, west] = self.way(row);
        let distance = self.distance(row);
        let (sine, cosine) = self.heading;
        if task.docks {
            (distance > NEAR).then(|| [north / distance, west / distance])
        } else {
            task.faces.then_some([cosine, sine])
        }
    }
}

impl Together for Environment<Four> {
    type One = Environment<f32>;

    fn all(one: &Self::One) -> Self {
        Self {
            skydiver: Skydiver::all(&one.skydiver),
            heading: (Four::splat(one.heading.0), Four::splat(one.heading.1)),
            target: one.target.map(Four::splat),
            steps: Four::splat(one.steps),
        }
    }

    fn lane(&self, lane: usize) -> Self::One {
        Environment {
            skydiver: self.skydiver.lane(lane),
            heading: (self.heading.0.extract(lane), self.heading.1.extract(lane)),
            target: self.target.map(|place| place.extract(lane)),
            steps: self.steps.extract(lane),
        }
    }

    fn put(&mut self, lane: usize, one: &Self::One) {
        self.skydiver.put(lane, &one.skydiver);
        self.heading.0.replace(lane, one.heading.0);
        self.heading.1.replace(lane, one.heading.1);
        for (place, one) in self.target.iter_mut().zip(one.target) {
            place.replace(lane, one);
        }
        self.steps.replace(lane, one.steps);
    }
}
