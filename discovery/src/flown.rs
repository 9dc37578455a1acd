//! Simulates a stretch and the readings of its sensors.

use bodyflight_core::dynamics::{Inputs, Motion, PostureSample, State};
use bodyflight_core::effect::sensors::Moving;
use bodyflight_core::frame::Vector;
use nalgebra::{DVector, Vector3};

use super::motion_history::MotionHistory;
use super::prepared::{Prepared, Steps, posture};
use super::stretch::{CHANNELS, Channels, NUMBERS, ROWS, Stretch, difference, moved};
use super::track::Track;
use super::window::Push;

/// Maximum number of iterations to find the true motion for a measured one, and the difference over all channels at
/// which they stop.
const BEHIND_STEPS: usize = 12;
const BEHIND_CLOSE: f64 = 1e-9;

/// Longest sensor delay for which the motion before a stretch is computed (s); longer ones count as this one.
const LONGEST_DELAY: f64 = 0.33;

impl Prepared<'_> {
    /// Simulates the stretch from its smoothed start, changed by `start`, with an optional push in one window.
    pub fn fly(&self, start: &Channels, push: Option<Push>) -> Flown {
        let grid = self.stretch.grid;
        let count = self.count;
        let first = self.stretch.first;
        let times = &self.track.times;
        let begin_time = times[first] - times[0];
        let duration = (times[first + grid.frames()] - times[first]) / count as f64;
        let time = |k: usize| begin_time + duration * k as f64;
        let (kept, stride) = match self.steps {
            Steps::Short => (grid.parts, 1),
            Steps::Long => (1, grid.stride),
        };
        let mut seen = Vec::with_capacity(count / kept + 1);
        let measured = moved(&self.stretch.start, start);
        seen.push(measured);
        let sensors = &self.model.sensors;
        let late = sensors.velocity_latency != 0.0 || sensors.rate_lag != 0.0;
        let past = if late {
            self.past(&measured)
        } else {
            Vec::new()
        };
        let begin = self.true_start(&measured, &past);
        let mut history = MotionHistory::default();
        for (earlier, change) in past.iter().rev() {
            history.push(begin_time - earlier, shifted(&Moving::of(&begin), change));
        }
        let mut state = self.start_state(&begin);
        let mut motions = Vec::with_capacity(count);
        let dynamics = &self.model.dynamics;
        for k in 0..count {
            let frame = first + (2 * k + 1) * grid.frames() / (2 * count);
            let inputs = self.model.inputs(&self.track.inputs[frame]);
            let body = self.interval(k);
            let (_, sample) = body;
            let apply = |state: &mut State<f64>, time: f64| {
                let loads = &self.model.applied;
                loads.push(dynamics, state, body, time, 0.5 * duration);
            };
            apply(&mut state, time(k));
            let window = k * ROWS / count;
            state = self.stepped(&state, sample, &inputs, window, duration);
            apply(&mut state, time(k + 1));
            if let Some(push) = push
                && push.window == window
            {
                push.act_on(&mut state, sample, duration);
            }
            let motion = self.end_motion(&state, k + 1);
            if late {
                history.push(time(k + 1), Moving::of(&motion));
            }
            motions.push(motion);
        }
        for (k, motion) in motions.iter().enumerate() {
            if (k + 1) % kept != 0 {
                continue;
            }
            let now = time(k + 1);
            let past = |delay: f64| {
                history
                    .at(now - delay)
                    .unwrap_or_else(|| Moving::of(motion))
            };
            seen.push(sensors.observe(motion, past, now));
        }
        Flown { seen, stride }
    }
    /// The state after a step in a window of the stretch.
    fn stepped(
        &self,
        state: &State<f64>,
        sample: &PostureSample<f64>,
        inputs: &Inputs<f64>,
        window: usize,
        duration: f64,
    ) -> State<f64> {
        let dynamics = &self.model.dynamics;
        match &self.varied {
            None => dynamics.step(state, sample, inputs, duration),
            Some(varied) => {
                let (dynamics, inputs) = varied.applied(window, dynamics, inputs);
                dynamics.step(state, sample, &inputs, duration)
            }
        }
    }

    /// The motion before a start: how much earlier it is (s), and by how much velocity and angular velocity differ.
    ///
    /// The motion comes from a simulation backwards in time. The measurement itself would not do, because its noise
    /// also enters the first comparisons, and a sensor that follows this noise would seem late.
    fn past(&self, start: &Motion<f64>) -> Vec<(f64, [Vector3<f64>; 2])> {
        let grid = self.stretch.grid;
        let first = self.stretch.first;
        let times = &self.track.times;
        let delay = self.model.sensors.posture_delay;
        let length = grid.frames() as f64;
        let at = |frame: usize| {
            let place = 2.0 * (frame as f64 - first as f64) / length - 1.0;
            self.joints
                .correct(&posture(self.track, frame as f64, delay), place)
        };
        let now = Moving::of(start);
        let mut past = vec![(0.0, [Vector3::zeros(); 2])];
        let mut state: Option<State<f64>> = None;
        let mut frame = first;
        let sensors = &self.model.sensors;
        let longest = sensors.velocity_latency.max(sensors.rate_lag);
        while times[first] - times[frame] < longest.min(LONGEST_DELAY) && frame >= grid.back {
            let before = frame - grid.back;
            let duration = times[frame] - times[before];
            let sample = self
                .model
                .dynamics
                .between(&at(before), &at(frame), duration);
            let inputs = self.model.inputs(&self.track.inputs[before]);
            let from = state.unwrap_or_else(|| State::from_motion(start, &sample));
            let then = self.model.dynamics.step(&from, &sample, &inputs, -duration);
            let moving = Moving::of(&then.motion(&sample));
            let change = [
                moving.velocity.components - now.velocity.components,
                moving.angular_velocity.components - now.angular_velocity.components,
            ];
            past.push((times[first] - times[before], change));
            (state, frame) = (Some(then), before);
        }
        past
    }

    fn true_start(&self, measured: &Motion<f64>, past: &[(f64, [Vector3<f64>; 2])]) -> Motion<f64> {
        let time = self.track.times[self.stretch.first] - self.track.times[0];
        behind(measured, |start| {
            let now = Moving::of(start);
            let at = |delay: f64| {
                let after = past.partition_point(|(earlier, _)| *earlier < delay);
                let (Some((late, from)), Some((early, to))) =
                    (past.get(after), past.get(after.saturating_sub(1)))
                else {
                    return past.last().map_or(now, |(_, change)| shifted(&now, change));
                };
                let share = if late > early {
                    (delay - early) / (late - early)
                } else {
                    0.0
                };
                shifted(&now, &[0, 1].map(|k| to[k] + (from[k] - to[k]) * share))
            };
            self.model.sensors.observe(start, at, time)
        })
    }
}

/// The motion with velocity and angular velocity changed.
fn shifted(moving: &Moving<f64>, change: &[Vector3<f64>; 2]) -> Moving<f64> {
    Moving {
        velocity: Vector::from_components(moving.velocity.components + change[0]),
        angular_velocity: Vector::from_components(moving.angular_velocity.components + change[1]),
    }
}

/// The true motion for which `observe` returns the measured one.
pub(super) fn behind(
    measured: &Motion<f64>,
    observe: impl Fn(&Motion<f64>) -> Motion<f64>,
) -> Motion<f64> {
    let mut motion = *measured;
    for _ in 0..BEHIND_STEPS {
        let missing = difference(measured, &observe(&motion));
        motion = moved(&motion, &missing);
        if missing.norm() < BEHIND_CLOSE {
            break;
        }
    }
    motion
}

/// Number of channels of the attitude, which come first.
const ATTITUDE: usize = 3;

/// Sensor readings of a simulated stretch.
#[derive(Debug, Clone)]
pub struct Flown {
    /// Readings at the start and after each interval.
    seen: Vec<Motion<f64>>,
    /// Number of frames in an interval.
    stride: usize,
}

impl Flown {
    /// Residuals, measured less simulated, averaged over the frames of each window after its start.
    pub fn missing(&self, track: &Track, stretch: &Stretch) -> DVector<f64> {
        let intervals = stretch.grid.window / self.stride;
        let weights = weights(intervals, self.stride);
        let mut averages = DVector::zeros(NUMBERS);
        for (k, seen) in self.seen.iter().enumerate() {
            let measured = &track.measured[stretch.first + k * self.stride];
            let difference = difference(measured, seen);
            let mut add = |row: usize, weights: &Channels| {
                let mut mean = averages.rows_mut(row * CHANNELS, CHANNELS);
                mean += difference.component_mul(weights);
            };
            let (row, place) = (k / intervals, k % intervals);
            if row < ROWS {
                add(row, &weights[place]);
            }
            if place == 0 && row > 0 {
                add(row - 1, &weights[intervals]);
            }
        }
        averages
    }

    /// Difference from another simulation with the same stride: the residuals of the other less those of this one. The
    /// difference between the two attitudes would not do, because rotations do not add up: it departs from that of the
    /// residuals by half the residual.
    pub fn less(&self, other: &Self, track: &Track, stretch: &Stretch) -> DVector<f64> {
        other.missing(track, stretch) - self.missing(track, stretch)
    }
}

/// Weights of the simulated frames of a window, from its start to its end, for the mean over all frames after the start.
///
/// The load of a step is constant, so between simulated frames velocities are straight, and the attitude is a parabola.
fn weights(intervals: usize, stride: usize) -> Vec<Channels> {
    let frames = intervals * stride;
    let mut weights = vec![Channels::zeros(); intervals + 1];
    for frame in 1..=frames {
        let place = frame as f64 / stride as f64;
        let before = frame.div_ceil(stride) - 1;
        let after = place - before as f64;
        let straight = [(before, 1.0 - after), (before + 1, after)];
        for (at, weight) in straight {
            let mut velocities = weights[at].rows_mut(ATTITUDE, CHANNELS - ATTITUDE);
            velocities.add_scalar_mut(weight);
        }
        // A parabola through the nearest frames of the window.
        let middle = before.clamp(1, intervals.max(2) - 1);
        let after = place - middle as f64;
        let parabola = [
            (middle - 1, 0.5 * after * (after - 1.0)),
            (middle, 1.0 - after * after),
            (middle + 1, 0.5 * after * (after + 1.0)),
        ];
        let of_attitude = if intervals < 2 {
            &straight[..]
        } else {
            &parabola
        };
        for (at, weight) in of_attitude {
            weights[*at].rows_mut(0, ATTITUDE).add_scalar_mut(*weight);
        }
    }
    weights
        .iter()
        .map(|weight| weight / frames as f64)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Weights give the mean of a parabola in attitude and of a straight line in the velocities.
    #[test]
    fn a_mean_over_few_simulated_frames_is_that_over_all() {
        for (intervals, stride) in [(1, 1), (12, 1), (2, 6), (3, 4), (4, 6)] {
            let frames = intervals * stride;
            let mean = |power: i32| {
                let each = (1..=frames).map(|frame| (frame as f64 / stride as f64).powi(power));
                each.sum::<f64>() / frames as f64
            };
            for power in 0..=2 {
                let weights = weights(intervals, stride);
                let sum = weights.iter().enumerate();
                let sum: Channels = sum.map(|(k, weight)| weight * (k as f64).powi(power)).sum();
                assert!((sum[0] - mean(power)).abs() < 1e-12, "{intervals} {stride}");
                if power < 2 {
                    assert!((sum[8] - mean(power)).abs() < 1e-12, "{intervals} {stride}");
                }
            }
        }
    }
}
