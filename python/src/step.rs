//! One step of many environments: those side by side on all cores, and the rest.

use bodyflight_core::dynamics::PostureSample;
use bodyflight_core::four::Four;
use bodyflight_core::math::Lanes;
use bodyflight_viewer::cockpit::CONTROLS;
use nalgebra::SimdBool;
use rayon::ThreadPool;
use rayon::prelude::*;

use crate::observed::observation;
use crate::side_by_side::{Flights, SIDE_BY_SIDE, Together, columns};
use crate::skydiver::Course;
use crate::skydivers::RUN;
use crate::task::{Environment, Judged, TERMS, Task, WIDTH};
use crate::threads::on_all_cores;

/// Where results of neighbouring environments are written, one of each for every environment.
pub(crate) struct Rows<'a> {
    pub(crate) seen: &'a mut [[f32; WIDTH]],
    pub(crate) rewards: &'a mut [f32],
    pub(crate) terms: &'a mut [[f32; TERMS.len()]],
    pub(crate) success: &'a mut [bool],
    pub(crate) terminated: &'a mut [bool],
    pub(crate) truncated: &'a mut [bool],
}

impl<'a> Rows<'a> {
    /// Returns the rows of the first `count` environments, or of all if there are fewer, and the others.
    fn split(self, count: usize) -> (Self, Self) {
        let count = count.min(self.seen.len());
        let (seen, seen_after) = self.seen.split_at_mut(count);
        let (rewards, rewards_after) = self.rewards.split_at_mut(count);
        let (terms, terms_after) = self.terms.split_at_mut(count);
        let (success, success_after) = self.success.split_at_mut(count);
        let (terminated, terminated_after) = self.terminated.split_at_mut(count);
        let (truncated, truncated_after) = self.truncated.split_at_mut(count);
        let first = Self {
            seen,
            rewards,
            terms,
            success,
            terminated,
            truncated,
        };
        let others = Self {
            seen: seen_after,
            rewards: rewards_after,
            terms: terms_after,
            success: success_after,
            terminated: terminated_after,
            truncated: truncated_after,
        };
        (first, others)
    }

    /// Writes what the environment in a lane has given.
    fn write<T: Lanes<Element = f32>>(&mut self, row: usize, judged: &Judged<T>, lane: usize) {
        self.seen[row] = judged.seen.map(|value| value.extract(lane));
        self.rewards[row] = judged.reward.extract(lane);
        self.terms[row] = judged.terms.map(|value| value.extract(lane));
        let holds = |flags: T::SimdBool| flags.bitmask() >> lane & 1 != 0;
        self.success[row] = holds(judged.success);
        self.terminated[row] = holds(judged.terminated);
        self.truncated[row] = holds(judged.truncated);
    }

    /// Observes an environment that stays as it has begun.
    fn rest(&mut self, row: usize, environment: &Environment<f32>) {
        self.seen[row] = environment.observe(&observation(&environment.skydiver.motion));
    }
}

/// Actions of neighbouring environments, and which of these rest.
#[derive(Clone, Copy)]
pub(crate) struct Given<'a> {
    pub(crate) actions: &'a [[f32; CONTROLS.len()]],
    pub(crate) resting: &'a [bool],
}

impl Given<'_> {
    /// Returns what is given for the environments from this index on.
    fn from(self, first: usize) -> Self {
        Self {
            actions: self.actions.get(first..).unwrap_or_default(),
            resting: self.resting.get(first..).unwrap_or_default(),
        }
    }
}

/// Flies one step in every environment that does not rest; the courses are those of one and of four flights.
pub(crate) fn fly(
    all: &mut Flights<Environment<Four>>,
    (course, course_of_four): (&Course<f32>, &Course<Four>),
    task: &Task,
    given: Given<'_>,
    rows: Rows<'_>,
    pool: &ThreadPool,
) {
    let (mut others, mut runs) = (rows, Vec::new());
    for fours in all.fours.chunks(RUN) {
        let (run, after) = others.split(fours.len() * SIDE_BY_SIDE);
        runs.push(run);
        others = after;
    }
    on_all_cores(pool, &mut all.fours, |fours| {
        let fours = fours.par_chunks_mut(RUN).zip(runs).enumerate();
        fours.for_each_init(PostureSample::blank, |sample, (run, (fours, mut rows))| {
            let given = given.from(run * RUN * SIDE_BY_SIDE);
            fly_fours(course_of_four, task, fours, given, &mut rows, sample);
        });
    });
    let given = given.from(all.of_fours());
    let mut sample = PostureSample::blank();
    let alone = all.rest.iter_mut();
    let alone = alone.zip(given.actions.iter().zip(given.resting));
    for (row, (environment, (action, resting))) in alone.enumerate() {
        if *resting {
            others.rest(row, environment);
        } else {
            let judged = environment.step(course, task, action, &mut sample);
            others.write(row, &judged, 0);
        }
    }
}

/// Flies one step in environments side by side.
fn fly_fours(
    course: &Course<Four>,
    task: &Task,
    fours: &mut [Environment<Four>],
    given: Given<'_>,
    rows: &mut Rows<'_>,
    sample: &mut PostureSample<Four>,
) {
    let given = given
        .actions
        .as_chunks()
        .0
        .iter()
        .zip(given.resting.as_chunks::<SIDE_BY_SIDE>().0);
    for (index, (four, (actions, resting))) in fours.iter_mut().zip(given).enumerate() {
        let before = *four;
        let judged = four.step(course, task, &columns(actions), sample);
        for (lane, resting) in resting.iter().enumerate() {
            let row = index * SIDE_BY_SIDE + lane;
            if *resting {
                let environment = before.lane(lane);
                four.put(lane, &environment);
                rows.rest(row, &environment);
            } else {
                rows.write(row, &judged, lane);
            }
        }
    }
}
