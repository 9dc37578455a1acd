//! Channels that are late: displacements against the integral of velocities, at several lags.
//!
//! A logger can write a channel late, by filters and queues, but not early. So the later of two channels is the wrong
//! one, and is moved back.

use std::cell::Cell;

use super::compare::{Channel, Finding, Remedy, displacements};
use crate::{Sample, longest_step};

/// Steps between the lags that are tried (s), their number and largest, and the smallest that is mended: filters of
/// receivers delay by half a second.
const STEP: f64 = 0.1;
const STEPS: i32 = 40;
const LAGS: f64 = STEP * STEPS as f64;
const LATE: f64 = 0.8;

/// The same for lags that no filter or queue makes, and the misfit (m, root mean square) from which on they are sought.
const FAR_STEP: f64 = 0.5;
const FAR_STEPS: i32 = 60;
const FAR_EVERY: f64 = 1.0;
const FAR_MISFIT: f64 = 1.5;

/// Least time between the displacements that are compared (s).
const EVERY: f64 = 0.2;

/// Half of the time over which displacements are compared (s).
const HALF: f64 = 1.0;

/// Change of the velocity within `HALF` on either side that shows a lag (m/s).
const CHANGES: f64 = 5.0;

/// Fewest comparisons, and the largest share of the misfit without a lag that is left with it.
const FEWEST: usize = 5;
const LEFT: f64 = 0.4;

/// Largest difference that counts in full (m).
const CLIPPED: f64 = 8.0;

/// A channel over time that is interpolated, and nowhere across missing fixes.
struct Line<'a> {
    times: &'a [f64],
    values: Vec<f64>,
    gap: f64,
    /// Where the last value was found, since the next one is near.
    near: Cell<usize>,
}

/// The first place whose time is not before `time`, sought from the place `near` in steps that double.
fn first_from(times: &[f64], time: f64, near: usize) -> usize {
    let (mut low, mut high) = (near, near);
    let mut step = 1;
    while low > 0 && times[low - 1] >= time {
        low = low.saturating_sub(step);
        step *= 2;
    }
    while high < times.len() && times[high] < time {
        high = (high + step).min(times.len());
        step *= 2;
    }
    low + times[low..high].partition_point(|own| *own < time)
}

impl<'a> Line<'a> {
    const fn new(times: &'a [f64], values: Vec<f64>, gap: f64) -> Self {
        Self {
            times,
            values,
            gap,
            near: Cell::new(0),
        }
    }

    fn at(&self, time: f64) -> Option<f64> {
        let next = first_from(self.times, time, self.near.get());
        self.near.set(next);
        let before = next.checked_sub(1)?;
        let (from, to) = (self.times[before], *self.times.get(next)?);
        if to - from > self.gap {
            return None;
        }
        let share = (time - from) / (to - from);
        Some(self.values[before] + share * (self.values[next] - self.values[before]))
    }
}

/// One axis: positions, velocities, and the integral of these.
struct Axis<'a> {
    places: Line<'a>,
    speeds: Line<'a>,
    displacements: Line<'a>,
}

impl<'a> Axis<'a> {
    /// From samples and their times.
    fn new(samples: &[Sample], times: &'a [f64], axis: usize) -> Self {
        let gap = longest_step(samples);
        let line = |values: Vec<f64>| Line::new(times, values, gap);
        Self {
            places: line(samples.iter().map(|sample| sample.position[axis]).collect()),
            speeds: line(samples.iter().map(|sample| sample.velocity[axis]).collect()),
            displacements: line(displacements(samples, axis, gap)),
        }
    }

    /// Times at which the velocity changes.
    fn changes(&self) -> Vec<f64> {
        let changes = |time: &f64| {
            let ends = (self.speeds.at(time - HALF)).zip(self.speeds.at(time + HALF));
            ends.is_some_and(|(from, to)| (to - from).abs() > CHANGES)
        };
        self.places.times.iter().copied().filter(changes).collect()
    }

    /// Mean square of the displacements less those by velocities that are read `lag` (s) later, near `times`; and their
    /// number.
    fn misfit(&self, times: &[f64], lag: f64) -> (f64, usize) {
        let off = |time: &f64| {
            let displacement = |line: &Line<'_>, lag: f64| {
                Some(line.at(time + lag + HALF)? - line.at(time + lag - HALF)?)
            };
            let off = displacement(&self.places, 0.0)? - displacement(&self.displacements, lag)?;
            Some(off.abs().min(CLIPPED).powi(2))
        };
        let squares: Vec<f64> = times.iter().filter_map(off).collect();
        (squares.iter().sum(), squares.len())
    }
}

/// Uncertainty of times after a channel was moved (s): lags of different channels of one logger differ by as much.
pub(super) const UNCERTAIN: f64 = 0.4;

/// What was found of a channel's time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Timing {
    /// It is right, as far as the motion shows.
    Right,
    /// The later channel was moved back.
    Moved,
    /// The channels are of different times, and it is not known which of them is wrong.
    Doubted,
}

/// Finds the lag of the velocities along some axes behind the positions, and moves the later of both back, if a logger can
/// be so late.
pub(super) fn checked(
    samples: &mut [Sample],
    axes: &[usize],
    [places, velocities]: [Channel; 2],
    findings: &mut Vec<Finding>,
) -> Timing {
    let Some(lag) = lag(samples, axes) else {
        return Timing::Right;
    };
    let (late, name, other) = if lag > 0.0 {
        (velocities, velocities.name(), places.name())
    } else {
        (places, places.name(), velocities.name())
    };
    if lag.abs() > LAGS {
        findings.push(Finding {
            channel: late,
            remedy: Remedy::Reported,
            sentence: format!(
                "the {name} are {:.1} s later than the {other}, which no logger is: one of them is of another time",
                lag.abs()
            ),
        });
        return Timing::Doubted;
    }
    let gap = longest_step(samples);
    let times: Vec<f64> = samples.iter().map(|sample| sample.time).collect();
    for &axis in axes {
        let value = |sample: &Sample| {
            if lag > 0.0 {
                sample.velocity[axis]
            } else {
                sample.position[axis]
            }
        };
        let line = Line::new(&times, samples.iter().map(value).collect(), gap);
        for sample in samples.iter_mut() {
            // Where the later value is missing, at the end, the last one moves on.
            if let Some(moved) = line.at(sample.time + lag.abs()) {
                if lag > 0.0 {
                    sample.velocity[axis] = moved;
                } else {
                    sample.position[axis] = moved;
                }
            } else if lag < 0.0 {
                sample.position[axis] += sample.velocity[axis] * lag.abs();
            }
        }
    }
    findings.push(Finding {
        channel: late,
        remedy: Remedy::Converted,
        sentence: format!(
            "the {name} are {:.1} s later than the {other}: they are moved back",
            lag.abs()
        ),
    });
    Timing::Moved
}

/// The lag (s) that the motion shows clearly, beyond [`LAGS`] if one there explains what no shorter one does.
fn lag(samples: &[Sample], axes: &[usize]) -> Option<f64> {
    let times: Vec<f64> = samples.iter().map(|sample| sample.time).collect();
    let lines: Vec<(Axis<'_>, Vec<f64>)> = axes
        .iter()
        .map(|axis| Axis::new(samples, &times, *axis))
        .map(|line| {
            let changes = line.changes();
            (line, changes)
        })
        .collect();
    let near = Tried::new(&lines, STEP, STEPS, EVERY);
    if let Some(lag) = near.best() {
        return (lag.abs() >= LATE).then_some(lag);
    }
    let far = Tried::new(&lines, FAR_STEP, FAR_STEPS, FAR_EVERY);
    let is_apart = far.misfit(0.0)? > FAR_MISFIT * FAR_MISFIT;
    let lag = is_apart.then(|| far.best()).flatten()?;
    (lag.abs() > LAGS).then_some(lag)
}

/// Lags that are tried.
struct Tried<'a> {
    lines: &'a [(Axis<'a>, Vec<f64>)],
    /// Times at which each axis is compared (s).
    times: Vec<Vec<f64>>,
    step: f64,
    steps: i32,
}

impl<'a> Tried<'a> {
    /// Lags in steps (s), as many to either side, compared at times that are so far apart (s).
    fn new(lines: &'a [(Axis<'a>, Vec<f64>)], step: f64, steps: i32, every: f64) -> Self {
        let within = step * f64::from(steps);
        // A late velocity changes late: all times within the lags around are compared.
        let near = |(line, changes): &(Axis<'_>, Vec<f64>)| {
            let is_near = |time: &f64| {
                let next = changes.partition_point(|other| *other < *time - within);
                changes
                    .get(next)
                    .is_some_and(|other| *other <= *time + within)
            };
            let mut near: Vec<f64> = line.places.times.iter().copied().filter(is_near).collect();
            near.dedup_by(|time, before| *time - *before < every);
            near
        };
        Self {
            lines,
            times: lines.iter().map(near).collect(),
            step,
            steps,
        }
    }

    /// Mean square of what a lag (s) leaves (m2); `None` if there is too little to compare.
    fn misfit(&self, lag: f64) -> Option<f64> {
        let (mut squares, mut count) = (0.0, 0);
        for ((line, _), times) in self.lines.iter().zip(&self.times) {
            let own = line.misfit(times, lag);
            squares += own.0;
            count += own.1;
        }
        (count >= FEWEST).then(|| squares / count as f64)
    }

    /// The lag (s) that leaves the least, if it leaves much less than none does and is within those tried.
    fn best(&self) -> Option<f64> {
        let each = (-self.steps..=self.steps).filter_map(|step| {
            let lag = f64::from(step) * self.step;
            Some((lag, self.misfit(lag)?))
        });
        let (lag, least) = each.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let is_inside = lag.abs() < (f64::from(self.steps) - 0.5) * self.step;
        (is_inside && least < LEFT * self.misfit(0.0)?).then_some(lag)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_found_from_anywhere() {
        let times = [0.0, 1.0, 1.0, 2.0, 5.0, 9.0, 9.5];
        for near in 0..=times.len() {
            for time in [-1.0, 0.0, 0.5, 1.0, 1.5, 2.0, 8.0, 9.0, 9.2, 9.5, 10.0] {
                let found = first_from(&times, time, near);
                assert_eq!(
                    found,
                    times.partition_point(|own| *own < time),
                    "{near}, {time}"
                );
            }
        }
    }
}
