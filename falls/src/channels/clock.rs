//! The clock against the rows and against the motion.
//!
//! A receiver measures at a fixed rate, so its rows count time. A logger that stamps them with a clock of its own shows
//! that clock's error as a step that is not quite the rate's. Whether the clock or the rate is wrong, positions and
//! velocities tell if the difference is large enough: a displacement is a velocity times the true time.

use super::compare::{Channel, Finding, MOVES, Remedy, displacement, windows};
use crate::{Sample, longest_step, median};

/// Usual rates of receivers (Hz).
const RATES: [f64; 8] = [1.0, 2.0, 4.0, 5.0, 8.0, 10.0, 20.0, 25.0];

/// Smallest deviation of the clock that is reported, and the largest at which a rate is still recognised, as fractions.
const LEAST: f64 = 1e-4;
const LIKE_RATE: f64 = 0.02;

/// Largest deviation of rows from a regular grid, as a fraction of the step, and in any case (s), at which they count
/// time: the loop of a program that asks a receiver now and then is less regular.
const REGULAR: f64 = 0.02;
const ROUNDED: f64 = 2e-3;

/// Fewest rows that count time.
const FEWEST: usize = 100;

/// Range of ratios of positions to velocities that may come from a clock; beyond it, units explain them.
const CLOCK: [f64; 2] = [0.7, 1.4];

/// Deviations within which two ratios agree, and beyond which they do not.
const AGREE: f64 = 2.5;
const DISAGREE: f64 = 4.0;

/// A number with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Estimate {
    value: f64,
    deviation: f64,
}

impl Estimate {
    fn from(&self, other: f64) -> f64 {
        (self.value - other).abs() / self.deviation
    }
}

/// Compares the clock with the rows and the motion; corrects it where both agree. `has_places` says whether there are
/// horizontal positions beside the velocities; without velocities, it is `None`. Returns whether the clock is good
/// enough.
pub(super) fn checked(
    samples: &mut [Sample],
    has_places: Option<bool>,
    findings: &mut Vec<Finding>,
) -> bool {
    let ratio = has_places.and_then(|has_places| ratio(samples, has_places));
    let scale = ratio
        .filter(|ratio| ratio.deviation < 0.01)
        .map_or(1.0, |ratio| ratio.value);
    let Some(step) = step(samples) else {
        return !odd(ratio, has_places, findings);
    };
    let rates = RATES.map(|rate| (rate, step * rate));
    // Near the rate by the clock of the motion, or else by its own: a clock that runs a quarter fast makes five rows a
    // second look like four.
    let like = |by: f64| {
        let mut near = rates.iter();
        near.find(|(_, off)| (off * by - 1.0).abs() < LIKE_RATE)
    };
    let Some(&(rate, fast)) = like(scale).or_else(|| like(1.0)) else {
        return !odd(ratio, has_places, findings);
    };
    let drift = fast - 1.0;
    if drift.abs() < LEAST {
        return true;
    }
    let by_clock = ratio.map(|ratio| (ratio.from(1.0), ratio.from(1.0 / fast)));
    let rows = format!(
        "at {rate:.0} rows a second, the clock runs {} {}",
        share(drift),
        if drift > 0.0 { "fast" } else { "slow" }
    );
    let span = match samples {
        [first, .., last] => last.time - first.time,
        _ => 0.0,
    };
    match by_clock {
        // The rate is an odd one.
        Some((clock, rows)) if clock < AGREE && rows > DISAGREE => true,
        Some((clock, rows_agree)) if rows_agree < AGREE && clock > DISAGREE => {
            let start = samples.first().map_or(0.0, |first| first.time);
            for sample in samples {
                sample.time = start + (sample.time - start) / fast;
            }
            findings.push(Finding {
                channel: Channel::Clock,
                remedy: Remedy::Converted,
                sentence: format!(
                    "{rows}, and positions and velocities agree with the rows: times are corrected"
                ),
            });
            true
        }
        _ => {
            findings.push(Finding {
                channel: Channel::Clock,
                remedy: Remedy::Reported,
                sentence: format!(
                    "{rows}, or the rows have another rate: times may be off by {:.2} s at the end of the track",
                    (span * drift / fast).abs()
                ),
            });
            drift.abs() < ODD
        }
    }
}

/// Smallest deviation from one, as a fraction, of a ratio of positions to velocities that is reported without rows that
/// count time.
const ODD: f64 = 0.015;

/// Reports a ratio that is the same along both axes, as that of a wrong clock, where no rows confirm it. Returns
/// whether it is.
fn odd(ratio: Option<Estimate>, has_places: Option<bool>, findings: &mut Vec<Finding>) -> bool {
    let is_odd =
        |ratio: &Estimate| ratio.from(1.0) > 2.0 * DISAGREE && (ratio.value - 1.0).abs() > ODD;
    let found = ratio.filter(|ratio| has_places == Some(true) && is_odd(ratio));
    if let Some(ratio) = found {
        findings.push(Finding {
            channel: Channel::Clock,
            remedy: Remedy::Reported,
            sentence: format!(
                "positions change {:.3} times as fast as all velocities say: the clock may be wrong, which the rows do not tell",
                ratio.value
            ),
        });
    }
    found.is_some()
}

/// A small fraction in words.
fn share(drift: f64) -> String {
    if drift.abs() < 0.005 {
        format!("{:.0} ppm", 1e6 * drift.abs())
    } else {
        format!("{:.1} %", 100.0 * drift.abs())
    }
}

/// The mean step between regular rows (s); `None` if they are not regular enough to count time.
fn step(samples: &[Sample]) -> Option<f64> {
    let gap = longest_step(samples);
    let usual = median(samples.windows(2).map(|pair| pair[1].time - pair[0].time))?;
    let (mut numbers, mut products, mut count) = (0.0, 0.0, 0);
    let mut runs: Vec<Vec<(f64, f64)>> = Vec::new();
    for run in samples.chunk_by(|before, after| after.time - before.time <= gap) {
        let mut number = 0.0;
        let mut rows: Vec<(f64, f64)> = Vec::with_capacity(run.len());
        for (index, sample) in run.iter().enumerate() {
            if let Some(before) = index.checked_sub(1).map(|before| &run[before]) {
                number += ((sample.time - before.time) / usual).round();
            }
            rows.push((number, sample.time));
        }
        let length = rows.len() as f64;
        let sums = rows
            .iter()
            .fold((0.0, 0.0), |sum, row| (sum.0 + row.0, sum.1 + row.1));
        for row in &mut rows {
            row.0 -= sums.0 / length;
            row.1 -= sums.1 / length;
            numbers += row.0 * row.0;
            products += row.0 * row.1;
        }
        count += rows.len();
        runs.push(rows);
    }
    if count < FEWEST || numbers <= 0.0 {
        return None;
    }
    let step = products / numbers;
    let off = runs
        .iter()
        .flatten()
        .map(|(number, time)| (time - number * step).powi(2));
    let off = (off.sum::<f64>() / count as f64).sqrt();
    let is_known = off / numbers.sqrt() < 0.1 * LEAST * step;
    (is_known && off < (REGULAR * step).max(ROUNDED)).then_some(step)
}

/// Displacements by positions over those by velocities. Horizontal and vertical ones must agree; `None` if they do not,
/// or if units explain the ratio.
fn ratio(samples: &[Sample], has_places: bool) -> Option<Estimate> {
    let axes: &[&[usize]] = if has_places {
        &[&[0, 1], &[2]]
    } else {
        &[&[2]]
    };
    let estimates: Vec<Estimate> = axes
        .iter()
        .filter_map(|axes| of_axes(samples, axes))
        .filter(|estimate| estimate.deviation < 0.05)
        .collect();
    let weight = |estimate: &Estimate| estimate.deviation.powi(-2);
    let weights: f64 = estimates.iter().map(weight).sum();
    let value = estimates
        .iter()
        .map(|one| one.value * weight(one))
        .sum::<f64>()
        / weights;
    let deviation = weights.powf(-0.5);
    let agree = estimates
        .iter()
        .all(|one| (one.value - value).abs() < AGREE * one.deviation + 0.01 * value);
    let is_clock = (CLOCK[0]..CLOCK[1]).contains(&value);
    (estimates.len() == axes.len() && agree && is_clock).then_some(Estimate { value, deviation })
}

/// Number of parts of a track, each of which is left out in turn for the deviation of a ratio.
const PARTS: usize = 10;

fn of_axes(samples: &[Sample], axes: &[usize]) -> Option<Estimate> {
    let mut sums = [[0.0; 2]; PARTS];
    let windows = windows(samples);
    let count = windows.len().max(1);
    let mut moving = 0;
    for (place, window) in windows.into_iter().enumerate() {
        let [first, last] = window;
        let by_place = samples[last].position - samples[first].position;
        let by_velocity = displacement(samples, window);
        let square: f64 = axes.iter().map(|axis| by_velocity[*axis].powi(2)).sum();
        if square.sqrt() < MOVES {
            continue;
        }
        moving += 1;
        let part = &mut sums[place * PARTS / count];
        part[0] += axes
            .iter()
            .map(|axis| by_place[*axis] * by_velocity[*axis])
            .sum::<f64>();
        part[1] += square;
    }
    if moving < 2 * PARTS {
        return None;
    }
    let total = |without: usize| {
        let kept = (0..PARTS).filter(|part| *part != without);
        kept.fold([0.0, 0.0], |sum, part| {
            [sum[0] + sums[part][0], sum[1] + sums[part][1]]
        })
    };
    let of = |[product, square]: [f64; 2]| (square > 0.0).then(|| product / square);
    let value = of(total(PARTS))?;
    let spread: f64 = (0..PARTS)
        .filter_map(|part| Some((of(total(part))? - value).powi(2)))
        .sum();
    let deviation = (spread * (PARTS as f64 - 1.0) / PARTS as f64).sqrt();
    // Velocities of receivers are good to a few parts in ten thousand at best.
    Some(Estimate {
        value,
        deviation: deviation.hypot(3e-4),
    })
}
