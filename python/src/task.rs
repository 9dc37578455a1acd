//! The task of an episode: what is observed, rewarded and wanted, and when it ends.

use bodyflight_core::math::{Real, clamp};
use bodyflight_viewer::cockpit::CONTROLS;

use crate::skydiver::{NUMBERS, Skydiver};
use crate::skydivers::Row;

/// Largest magnitude of a scaled observation, far beyond what a person flies.
pub(crate) const LIMIT: f32 = 100.0;
/// Angular velocity about one body axis at which a flight counts as tumbling (rad/s).
const TUMBLING: f32 = 15.0;
/// Reward of the step in which an episode is terminated.
const FALLEN: f32 = -10.0;

/// What every task observes of the body: indices into [`crate::skydivers::OBSERVED`], and the divisors that scale the values to about
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
    fn upright(&self, row: &Row) -> f32 {
        let [left, dorsal, cranial, ..] = *row;
        left * self.up[0] + dorsal * self.up[1] + cranial * self.up[2]
    }
}

/// One skydiver with the goal of its episode.
#[derive(Clone, Copy)]
pub(crate) struct Environment {
    pub(crate) skydiver: Skydiver,
    /// Sine and cosine of the wanted heading.
    pub(crate) heading: (f32, f32),
    /// Wanted place: north, west (m).
    pub(crate) target: [f32; 2],
    /// Steps since the episode began.
    pub(crate) steps: u32,
}

/// Whether the body spins faster than [`TUMBLING`], or its motion is no longer finite.
pub(crate) fn is_tumbling(row: &Row) -> bool {
    let [_, _, _, _, _, left, dorsal, cranial, ..] = *row;
    let spins = [left, dorsal, cranial].map(f32::abs);
    !row.iter().all(|value| value.is_finite()) || spins.iter().any(|spin| *spin > TUMBLING)
}

impl Environment {
    /// Sine and cosine of the wanted heading minus that of the body.
    fn turn_left(&self, row: &Row) -> (f32, f32) {
        let [_, _, _, sine, cosine, ..] = *row;
        let (wanted_sine, wanted_cosine) = self.heading;
        (
            wanted_sine * cosine - wanted_cosine * sine,
            wanted_cosine * cosine + wanted_sine * sine,
        )
    }

    /// Returns the way from the body to the target: north, west (m).
    fn way(&self, row: &Row) -> [f32; 2] {
        let [.., north, west, _, _, _] = *row;
        let [to_north, to_west] = self.target;
        [to_north - north, to_west - west]
    }

    /// The horizontal direction of the goal (north, west; length 1), if the task has one that is not reached.
    pub(crate) fn toward(&self, task: &Task, row: &Row) -> Option<[f32; 2]> {
        let [north, west] = self.way(row);
        let distance = self.distance(row);
        let (sine, cosine) = self.heading;
        if task.docks {
            (distance > NEAR).then(|| [north / distance, west / distance])
        } else {
            task.faces.then_some([cosine, sine])
        }
    }

    pub(crate) fn observe(&self, row: &Row) -> [f32; WIDTH] {
        let [_, _, _, sine, cosine, ..] = *row;
        let (turn_sine, turn_cosine) = self.turn_left(row);
        let [north, west] = self.way(row);
        let goal = [
            turn_sine,
            turn_cosine,
            (north * cosine + west * sine) / GOAL_SCALE,
            (west * cosine - north * sine) / GOAL_SCALE,
        ];
        let suit = SUIT
            .iter()
            .map(|(index, scale)| row.get(*index).map_or(0.0, |value| value / scale));
        let mut seen = [0.0; WIDTH];
        for (place, value) in seen.iter_mut().zip(suit.chain(goal)) {
            // A flight may tumble until its numbers overflow.
            *place = if value.is_nan() {
                0.0
            } else {
                clamp(value, -LIMIT, LIMIT)
            };
        }
        seen
    }

    /// Distance of the target (m).
    fn distance(&self, row: &Row) -> f32 {
        let [north, west] = self.way(row);
        (north * north + west * west).root()
    }

    /// Terms of the reward, in the order of [`TERMS`].
    pub(crate) fn terms(
        &self,
        task: &Task,
        row: &Row,
        action: &[f32; CONTROLS.len()],
        fallen: bool,
    ) -> [f32; TERMS.len()] {
        if fallen {
            return [0.0, 0.0, 0.0, 0.0, FALLEN];
        }
        let effort = action.iter().map(|share| share * share).sum::<f32>() / EFFORT;
        let nearness = match task.docks {
            true => std::f32::consts::E.power(-0.5 * self.distance(row)),
            false => 0.0,
        };
        let facing = match task.faces {
            true => 0.5 * (1.0 + self.turn_left(row).1),
            false => 0.0,
        };
        let upright = 0.5 * (1.0 + task.upright(row));
        [upright, -0.01 * effort, nearness, facing, 0.0]
    }

    /// Whether the body is still, and where the task wants it to be.
    pub(crate) fn succeeds(&self, task: &Task, row: &Row) -> bool {
        let [_, _, _, _, _, left, dorsal, cranial, ..] = *row;
        let still = [left, dorsal, cranial]
            .iter()
            .all(|spin| spin.abs() < STILL);
        still
            && task.upright(row) > UPRIGHT
            && (!task.faces || self.turn_left(row).1 > FACING)
            && (!task.docks || self.distance(row) < NEAR)
    }

    /// Returns all that the environment consists of.
    pub(crate) fn numbers(&self) -> [f32; STATE] {
        let ((sine, cosine), [north, west]) = (self.heading, self.target);
        #[expect(
            clippy::cast_precision_loss,
            reason = "episodes have hundreds of steps"
        )]
        let episode = [sine, cosine, north, west, self.steps as f32];
        let mut numbers = [0.0; STATE];
        let all = self.skydiver.numbers().into_iter().chain(episode);
        for (place, number) in numbers.iter_mut().zip(all) {
            *place = number;
        }
        numbers
    }
}
