//! Places the boundaries between phases, each with its uncertainty.
//!
//! An exit is the kink of the vertical velocity. An opening is where the vertical force departs from that of the body,
//! which is compared with dynamic pressure, so that it makes no difference whether the fall still accelerates. If no
//! fix was received around a boundary, the height lost meanwhile tells when it was.

use bodyflight_core::air::GRAVITY;
use nalgebra::{Matrix3, Vector3};

use crate::atmosphere::Atmosphere;
use crate::force::{drag_factor, specific_force};
use crate::{Sample, connected, median, slopes};

/// A moment at which one phase becomes another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Boundary {
    /// Time (s).
    pub time: f64,
    /// Standard deviation of the time (s).
    pub deviation: f64,
}

/// Step between the times that are tried (s).
const STEP: f64 = 0.05;

/// Smallest credible deviation (s).
const LEAST: f64 = 0.1;

/// Fewest samples, or intervals between them, that determine a boundary.
const FEWEST: usize = 5;

/// Side of a kink on which the slope changes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Before the kink.
    Before,
    /// After it.
    After,
}

/// Sum of squares for each time tried.
#[derive(Default)]
struct Tried(Vec<(f64, f64)>);

impl Tried {
    /// The time of the least squares, with the range of times that fit nearly as well; `count` values were fitted.
    fn best(&self, count: usize, interval: f64) -> Option<Boundary> {
        let (time, least) = (self.0.iter().copied()).min_by(|a, b| a.1.total_cmp(&b.1))?;
        let freedom = count.saturating_sub(4).max(1) as f64;
        let limit = least * (1.0 + 1.0 / freedom) + 1e-12;
        let near: Vec<f64> = (self.0.iter())
            .filter(|(_, squares)| *squares <= limit)
            .map(|(time, _)| *time)
            .collect();
        let width = near.last()? - near.first()?;
        Some(Boundary {
            time,
            deviation: (0.5 * width).hypot(0.3 * interval).max(LEAST),
        })
    }
}

/// Time near `near` (s) at which two lines fitted to the vertical velocity meet with the least squares.
///
/// The lines are fitted over `reach` (s) before and after, as far as no fix is missing.
pub fn kink(samples: &[Sample], near: f64, reach: [f64; 2], side: Side) -> Option<Boundary> {
    let part = connected(samples, near, [near - reach[0], near + reach[1]]);
    let (first, last) = (part.first()?.time, part.last()?.time);
    if part.len() < FEWEST {
        return None;
    }
    let interval = (last - first) / (part.len() - 1) as f64;
    let mut tried = Tried::default();
    let mut place = first + 0.4;
    while place < last - 0.4 {
        let rows = part.iter().map(|sample| {
            let since = sample.time - place;
            let turned = match side {
                Side::Before => since.min(0.0),
                Side::After => since.max(0.0),
            };
            (Vector3::new(1.0, since, turned), sample.velocity.z)
        });
        if let Some((_, squares)) = fitted(rows) {
            tried.0.push((place, squares));
        }
        place += STEP;
    }
    tried.best(part.len(), interval)
}

/// Least squares for three unknowns: the unknowns, and the sum of squares that is left.
fn fitted(rows: impl Iterator<Item = (Vector3<f64>, f64)> + Clone) -> Option<(Vector3<f64>, f64)> {
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for (row, value) in rows.clone() {
        normal += row * row.transpose();
        right += row * value;
    }
    // A column without values takes no part.
    for axis in 0..3 {
        normal[(axis, axis)] += 1e-9;
    }
    let solved = normal.cholesky()?.solve(&right);
    let squares = rows.map(|(row, value)| (value - row.dot(&solved)).powi(2));
    Some((solved, squares.sum()))
}

/// How the area may grow: powers of time, from a bag that is out at once to a canopy that inflates ever faster.
const GROWS: [i32; 3] = [0, 1, 2];

/// Largest ratio of the squares left at which another power fits nearly as well as the best.
const NEARLY: f64 = 1.15;

/// Time before the rough time of an opening from which the body's drag is taken (s), and time after it that is searched.
const BEFORE: f64 = 6.0;
const AFTER: f64 = 4.0;

/// Longest fall that still has much of the aircraft's speed (s); whether it glides is not yet known.
const HOP: f64 = 12.0;

/// Longest time from the start of an opening to the largest sink speed of a short fall (s).
const GATHERS: f64 = 2.0;

/// Share of the speed at which the shape of an opening no longer tells of its start.
const SLOWED: f64 = 0.8;

/// Middle, dynamic pressure (Pa) and braking force over mass (m/s2) of each interval between two samples, until the shape
/// of the opening no longer tells of its start. The force is vertical, or along the path if the fall glides.
fn intervals(part: &[Sample], near: f64, glides: bool) -> Vec<(f64, f64, f64)> {
    let speed = |velocity: &Vector3<f64>| {
        if glides { velocity.norm() } else { -velocity.z }
    };
    let usual = part
        .iter()
        .filter(|sample| (sample.time - near).abs() < 2.0);
    let usual = usual
        .map(|sample| speed(&sample.velocity))
        .fold(0.0, f64::max);
    let mut intervals: Vec<(f64, f64, f64)> = Vec::with_capacity(part.len());
    for pair in part.windows(2) {
        let duration = pair[1].time - pair[0].time;
        let velocity = 0.5 * (pair[0].velocity + pair[1].velocity);
        // From here on the shape of the opening no longer tells of its start.
        if pair[1].time > near && speed(&velocity) < SLOWED * usual {
            break;
        }
        let density = Atmosphere::Standard.density(pair[0].height());
        let pressure = 0.5 * density * velocity.norm() * speed(&velocity);
        let force = specific_force(&((pair[1].velocity - pair[0].velocity) / duration));
        let braking = if glides {
            -force.dot(&velocity) / velocity.norm().max(1.0)
        } else {
            force.z
        };
        intervals.push((0.5 * (pair[0].time + pair[1].time), pressure, braking));
    }
    intervals
}

/// The start of an opening near `near` (s), in a fall that began at `begin` (s), and not before `earliest` (s).
///
/// In each interval between two samples, the vertical force, or that along the path of a fall that glides, is dynamic
/// pressure times the drag factor: that of the body until the opening begins, which changes linearly if the fall glides,
/// since the flyer slows down first, and then one that grows with a power of time. The force is a mean over the
/// interval, and over `averaged` (s) on either side if velocities are such means.
pub fn opening(
    samples: &[Sample],
    near: f64,
    [begin, earliest]: [f64; 2],
    averaged: f64,
) -> Option<Boundary> {
    let part = connected(samples, near, [(near - BEFORE).max(earliest), near + AFTER]);
    let is_long = near - begin > HOP;
    let glides = part.iter().filter(|sample| sample.time < near);
    let glides = median(glides.map(|sample| sample.across() / (-sample.velocity.z).max(1.0)));
    let glides = is_long && glides.is_some_and(|glide| glide > 1.0);
    let intervals = intervals(part, near, glides);
    if intervals.len() < FEWEST {
        return None;
    }
    let (first, last) = (intervals[0].0, intervals[intervals.len() - 1].0);
    let interval = (last - first) / (intervals.len() - 1) as f64;
    let reach = (0.5 * interval).hypot(averaged);
    // After a short fall, the area grows enough to stop the acceleration within seconds; before that, the body still
    // turns out of the aircraft's stream.
    let peak = part.iter().filter(|sample| sample.time < near + 1.0);
    let peak = peak.max_by(|a, b| b.velocity.z.total_cmp(&a.velocity.z));
    let soonest = match peak {
        Some(peak) if !is_long => peak.time - GATHERS,
        _ if glides => least_braked(part, near),
        _ => first,
    };
    let placed = GROWS.map(|power| {
        let mut tried = Tried::default();
        let mut place = (first + interval).max(soonest);
        while place < last {
            let rows = intervals.iter().map(|&(time, pressure, force)| {
                let grown = mean_power(time - place, reach, power);
                let slower = if glides { (time - near) / BEFORE } else { 0.0 };
                (Vector3::new(1.0, grown, slower) * pressure, force)
            });
            if let Some((factors, squares)) = fitted(rows)
                && factors.y > 0.0
            {
                tried.0.push((place, squares));
            }
            place += STEP;
        }
        let least = tried.0.iter().map(|(_, squares)| *squares);
        let least = least.fold(f64::INFINITY, f64::min);
        Some((tried.best(intervals.len(), interval)?, least))
    });
    let placed: Vec<(Boundary, f64)> = placed.into_iter().flatten().collect();
    let (best, least) = *placed.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    // How the canopy grows is not known. One that grows ever faster seems to start before anything is seen of it, so the
    // opening is not before the middle of what nearly fits.
    let near = placed
        .iter()
        .filter(|(_, squares)| *squares <= NEARLY * least);
    let times = near.map(|(near, _)| near.time);
    let (first, last) = times.fold((best.time, best.time), |(first, last), time| {
        (first.min(time), last.max(time))
    });
    Some(Boundary {
        time: best.time.max(0.5 * (first + last)),
        deviation: best.deviation.hypot(0.5 * (last - first)),
    })
}

/// Time over which the acceleration is taken where the drag of a gliding fall is least (s).
const SMOOTHED: f64 = 0.6;

/// Growth of the drag factor towards earlier times that shows another manoeuvre (m2/kg).
const ANOTHER: f64 = 0.003;

/// The earliest time at which the opening near `near` can begin: that of the least drag since the manoeuvre before it
/// (s). A wingsuit that pulls up brakes too, and often just before it opens.
fn least_braked(part: &[Sample], near: f64) -> f64 {
    let accelerations = slopes(part, SMOOTHED);
    let mut least = (near, f64::INFINITY);
    for (sample, acceleration) in part.iter().zip(&accelerations).rev() {
        if sample.time > near {
            continue;
        }
        let drag = drag_factor(sample, acceleration);
        if drag < least.1 {
            least = (sample.time, drag);
        } else if drag > least.1 + ANOTHER {
            break;
        }
    }
    least.0 - SMOOTHED
}

/// Mean of a power of time over `reach` on either side of `since`; the power is zero before time zero.
fn mean_power(since: f64, reach: f64, power: i32) -> f64 {
    let integral = |time: f64| time.max(0.0).powi(power + 1) / f64::from(power + 1);
    (integral(since + reach) - integral(since - reach)) / (2.0 * reach)
}

/// Uncertainty of a height at a fix after others were missing (m).
const HEIGHT: f64 = 8.0;

/// Uncertainty of the speed of a simulated fall, as a fraction.
const SPEED: f64 = 0.1;

/// The exit between the last fix in the aircraft and the first one of the fall, `before` and `after` in `samples`.
///
/// A point falls from the aircraft's path with the drag factor of the fall; the exit that leads to the height and
/// vertical velocity of the first fix is taken.
pub fn exit_in_gap(samples: &[Sample], before: usize, after: usize) -> Option<Boundary> {
    let (from, to) = (samples.get(before)?, samples.get(after)?);
    let drag = drag_after(&samples[after..])?;
    let mut tried = Tried::default();
    let mut place = from.time;
    while place < to.time {
        let start = from.position + from.velocity * (place - from.time);
        let (position, velocity) = fallen(start, from.velocity, drag, to.time - place);
        let speed = 1.0 + SPEED * to.velocity.z.abs();
        let squares = ((position.z - to.height()) / HEIGHT).powi(2)
            + ((velocity.z - to.velocity.z) / speed).powi(2);
        tried.0.push((place, squares));
        place += STEP;
    }
    let (time, least) = (tried.0.iter().copied()).min_by(|a, b| a.1.total_cmp(&b.1))?;
    let gap = to.time - from.time;
    // An exit that explains neither height nor speed is only bracketed.
    if least > 9.0 {
        return Some(Boundary {
            time: 0.5 * (from.time + to.time),
            deviation: gap / 12.0_f64.sqrt(),
        });
    }
    let near = (tried.0.iter()).filter(|(_, squares)| *squares <= least + 1.0);
    let near: Vec<f64> = near.map(|(time, _)| *time).collect();
    let width = near.last()? - near.first()?;
    Some(Boundary {
        time,
        deviation: (0.5 * width).max(0.3),
    })
}

/// Drag factor of the fall that begins with these samples (m2/kg).
fn drag_after(samples: &[Sample]) -> Option<f64> {
    let begin = samples.first()?.time;
    let part = connected(samples, begin, [begin, begin + 8.0]);
    let slopes = slopes(part, 0.5);
    let factors = part.iter().zip(&slopes);
    let factors = factors.map(|(sample, slope)| drag_factor(sample, slope));
    Some(median(factors)?.clamp(5e-4, 0.03))
}

/// Position and velocity of a point after some time of fall (s).
fn fallen(
    mut position: Vector3<f64>,
    mut velocity: Vector3<f64>,
    drag: f64,
    time: f64,
) -> (Vector3<f64>, Vector3<f64>) {
    let steps = (time / 0.1).ceil().clamp(1.0, 2000.0);
    let step = time / steps;
    let mut left = steps;
    while left > 0.5 {
        let density = Atmosphere::Standard.density(position.z);
        let pulled = velocity * (-0.5 * density * velocity.norm() * drag);
        let before = velocity;
        velocity += (pulled - Vector3::z() * GRAVITY) * step;
        position += 0.5 * (before + velocity) * step;
        left -= 1.0;
    }
    (position, velocity)
}

/// Time that an opening takes (s), and its spread.
const OPENS: [f64; 2] = [3.0, 1.5];

/// The opening between the last fix of the fall and the first one under canopy, from the height lost between them.
pub fn opening_in_gap(before: &Sample, after: &Sample) -> Boundary {
    let gap = after.time - before.time;
    let (falls, sinks) = (-before.velocity.z, (-after.velocity.z).max(0.0));
    let slower = (falls - sinks).max(1.0);
    let lost = before.height() - after.height();
    let fallen = (lost - sinks * gap) / slower - 0.5 * OPENS[0];
    Boundary {
        time: before.time + fallen.clamp(0.0, gap),
        deviation: (0.5 * OPENS[1])
            .hypot(HEIGHT / slower)
            .min(gap / 12.0_f64.sqrt()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_opening_begins_after_the_pull_up_before_it() {
        // A level flight whose drag factor is that of a wingsuit, of a pull-up, less after it, and that of a canopy.
        let drag = |time: f64| match time {
            ..3.0 => 0.003,
            3.0..5.0 => 0.017,
            5.0..6.0 => 0.010,
            _ => 0.010 + 0.03 * (time - 6.0),
        };
        let density = Atmosphere::Standard.density(1000.0);
        let mut speed = 50.0;
        let samples: Vec<Sample> = (0..80)
            .map(|step| {
                let time = 0.1 * f64::from(step);
                speed -= 0.1 * 0.5 * density * speed * speed * drag(time);
                Sample {
                    time,
                    position: Vector3::new(0.0, 0.0, 1000.0),
                    velocity: Vector3::new(speed, 0.0, 0.0),
                }
            })
            .collect();
        let earliest = least_braked(&samples, 7.5);
        assert!((4.5..6.0).contains(&earliest), "{earliest}");
    }
}
