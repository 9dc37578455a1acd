//! Dynamic time warping of two recordings over the movements of the body: angular velocity and joints.
//!
//! First one constant shift is found, at which the movements resemble each other most; then time is warped around it,
//! within a band (Sakoe and Chiba 1978), so that memory and time are bounded.

use bodyflight_core::{Posture, Segment};

use super::track::{Track, averaged, whole};

/// Most rows of a recording while times are matched, and the highest rate of rows (Hz).
const ROWS: usize = 2000;
const RATE: f64 = 20.0;
/// Angular velocity (rad/s) and rotation of a joint (rad) that count the same while times are matched: who moves slowly also
/// turns slowly, so that angular velocities must not decide.
const SPIN: f64 = 3.0;
const JOINT: f64 = 0.3;
/// Factor on the angular velocity when likeness is judged: it tells maneuvers apart, and joints have errors.
const WEIGHT: f64 = 6.0;
/// Numbers of a row: angular velocity, and a rotation for each joint.
const NUMBERS: usize = 3 + 3 * (Segment::ALL.len() - 1);
/// The band: this share of the rows, and at least this time (s).
const BAND: f64 = 0.15;
const BAND_AT_LEAST: f64 = 2.0;
/// Cost of a step that stretches time, as a share of the mean distance without warping.
const STRETCH: f64 = 0.1;
/// Time over which the matched times are averaged (s).
const SMOOTHED_OVER: f64 = 0.5;
/// Smallest share of the shorter recording in which a shift must overlap, and smallest overlap (s).
const OVERLAP: f64 = 0.5;
const OVERLAP_AT_LEAST: f64 = 1.0;

type Row = [f32; NUMBERS];

/// The movements of a recording, at even times.
pub(super) struct Movements {
    begin: f64,
    step: f64,
    rows: Vec<Row>,
}

/// The time between rows at which both recordings have few enough (s).
pub(super) fn step(tracks: [&Track; 2]) -> f64 {
    let longest = tracks.map(|track| track.span()[1] - track.span()[0]);
    (longest[0].max(longest[1]) / (ROWS - 1) as f64).max(1.0 / RATE)
}

impl Movements {
    /// The movements of a recording, relative to its mean posture.
    pub(super) fn of(track: &Track, step: f64) -> Self {
        let [begin, end] = track.span();
        let mean = Posture::mean(track.frames.iter().map(|frame| &frame.posture));
        let spin = [0, 1, 2].map(|axis: usize| {
            track.smoothed(step.max(0.2), |seen| {
                seen.angular_velocity.components[axis] / SPIN
            })
        });
        let count = whole(((end - begin) / step).floor()) + 1;
        let rows = (0..count).map(|k| {
            let time = begin + k as f64 * step;
            let posture = track.posture(time);
            let frame = track.frames.partition_point(|frame| frame.time < time);
            let frame = frame.min(track.frames.len() - 1);
            let joints = Segment::ALL.into_iter().skip(1).flat_map(|segment| {
                let [now, mean] = [&posture, &mean].map(|one| *one.parent_from_segment(segment));
                let turn = (now * mean.inverse()).scaled_axis() / JOINT;
                [turn.x, turn.y, turn.z]
            });
            let mut row = [0.0; NUMBERS];
            let numbers = spin.iter().map(|axis| axis[frame]).chain(joints);
            for (place, number) in row.iter_mut().zip(numbers) {
                #[expect(clippy::cast_possible_truncation, reason = "no more digits are needed")]
                let number = number as f32;
                *place = number;
            }
            row
        });
        Self {
            begin,
            step,
            rows: rows.collect(),
        }
    }

    fn time(&self, row: f64) -> f64 {
        self.begin + row * self.step
    }

    /// The row at a time (s).
    fn at(&self, time: f64) -> &Row {
        let row = whole((time - self.begin) / self.step);
        &self.rows[row.min(self.rows.len() - 1)]
    }
}

/// How much two series of movements resemble each other: their correlation, 1 if they are proportional.
fn correlation<'a>(pairs: impl Iterator<Item = (&'a Row, &'a Row)> + Clone) -> f64 {
    let mut mean = [[0.0_f32; NUMBERS]; 2];
    let mut count = 0.0_f32;
    for (a, b) in pairs.clone() {
        count += 1.0;
        for (sums, row) in mean.iter_mut().zip([a, b]) {
            for (sum, number) in sums.iter_mut().zip(row) {
                *sum += number;
            }
        }
    }
    let [mut both, mut one, mut two] = [0.0_f64; 3];
    for (a, b) in pairs {
        for k in 0..NUMBERS {
            let weight = if k < 3 { WEIGHT * WEIGHT } else { 1.0 };
            let [a, b] = [a[k] - mean[0][k] / count, b[k] - mean[1][k] / count].map(f64::from);
            both += weight * a * b;
            one += weight * a * a;
            two += weight * b * b;
        }
    }
    let size = (one * two).sqrt();
    if size > 0.0 { both / size } else { 0.0 }
}

/// How much the movements resemble each other at matched times.
pub(super) fn similarity([a, b]: [&Movements; 2], times: &[(f64, f64)]) -> f64 {
    correlation(times.iter().map(|(one, two)| (a.at(*one), b.at(*two))))
}

/// The constant shift at which the movements resemble each other most: the first rows that belong together.
fn shift([a, b]: [&Movements; 2]) -> Option<(usize, usize)> {
    let [n, m] = [a.rows.len(), b.rows.len()];
    let least = whole(OVERLAP * n.min(m) as f64).max(whole(OVERLAP_AT_LEAST / a.step));
    let starts = (0..m)
        .rev()
        .map(|j| (0, j))
        .chain((1..n).map(|i| (i, 0)))
        .filter(|(i, j)| (n - i).min(m - j) >= least);
    let like = |(i, j): (usize, usize)| correlation(a.rows[i..].iter().zip(&b.rows[j..]));
    // With equal likeness the longer overlap wins.
    let scored = starts.map(|start| (like(start), start));
    let best = scored.max_by(|x, y| x.0.total_cmp(&y.0))?;
    Some(best.1)
}

fn distance(a: &Row, b: &Row) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| f64::from((a - b) * (a - b)));
    squares.sum::<f64>().sqrt()
}

/// Matched times of both recordings (s), in ascending order. None if too little overlaps.
pub(super) fn warped(movements: [&Movements; 2]) -> Option<Vec<(f64, f64)>> {
    let (i0, j0) = shift(movements)?;
    let [a, b] = movements;
    let (one, two) = (&a.rows[i0..], &b.rows[j0..]);
    let n = one.len().min(two.len());
    let (one, two) = (&one[..n], &two[..n]);
    let band = whole(BAND * n as f64)
        .max(whole(BAND_AT_LEAST / a.step))
        .min(n - 1);
    let typical = one
        .iter()
        .zip(two)
        .map(|(a, b)| distance(a, b))
        .sum::<f64>()
        / n as f64;
    let path = path(n, band, typical, |i, j| distance(&one[i], &two[j]));
    let offsets: Vec<f64> = path.iter().map(|(i, j)| *j as f64 - *i as f64).collect();
    let smooth = averaged(&offsets, whole(0.5 * SMOOTHED_OVER / a.step));
    let times = path.iter().zip(smooth).map(|((i, _), offset)| {
        let row = *i as f64;
        (a.time(i0 as f64 + row), b.time(j0 as f64 + row + offset))
    });
    Some(times.collect())
}

/// The cheapest path through the table of distances within the band, from any of the first rows to any of the last.
///
/// Time is stretched at most twice: a step goes one row on in both, or two in one of them (Sakoe and Chiba's slope
/// constraint P = 1, symmetric weights). Rows left out at the ends cost as much as typical ones, steps that stretch a
/// part of that.
fn path(
    n: usize,
    band: usize,
    typical: f64,
    distance: impl Fn(usize, usize) -> f64,
) -> Vec<(usize, usize)> {
    let width = 2 * band + 1;
    // Column of the band in which j lies on row i.
    let column = |i: usize, j: usize| j + band - i;
    let stretched = STRETCH * typical;
    let mut steps = vec![0_u8; n * width];
    let mut costs = [vec![f64::INFINITY; width], vec![f64::INFINITY; width]];
    let mut apart = vec![f64::INFINITY; width];
    let mut end = (f64::INFINITY, (n - 1, n - 1));
    for i in 0..n {
        let mut here = vec![f64::INFINITY; width];
        let columns = i.saturating_sub(band)..=(i + band).min(n - 1);
        for j in columns.clone() {
            here[column(i, j)] = distance(i, j);
        }
        let mut row = vec![f64::INFINITY; width];
        for j in columns {
            let place = column(i, j);
            let own = here[place];
            let mut best = (f64::INFINITY, 0_u8);
            let mut offer = |cost: f64, step: u8| {
                if cost < best.0 {
                    best = (cost, step);
                }
            };
            if i == 0 || j == 0 {
                offer(typical * (i + j) as f64 + own, 0);
            }
            if i > 0 && j > 0 {
                offer(costs[0][place] + 2.0 * own, 1);
            }
            if i > 0 && j > 1 && place > 0 {
                offer(
                    costs[0][place - 1] + 2.0 * here[place - 1] + own + stretched,
                    2,
                );
            }
            if i > 1 && j > 0 && place + 1 < width {
                offer(
                    costs[1][place + 1] + 2.0 * apart[place + 1] + own + stretched,
                    3,
                );
            }
            row[place] = best.0;
            steps[i * width + place] = best.1;
            if i == n - 1 || j == n - 1 {
                let cost = best.0 + typical * (2 * (n - 1) - i - j) as f64;
                if cost < end.0 {
                    end = (cost, (i, j));
                }
            }
        }
        let [last, _] = costs;
        costs = [row, last];
        apart = here;
    }
    let (mut i, mut j) = end.1;
    let mut path = vec![(i, j)];
    loop {
        match steps[i * width + column(i, j)] {
            1 => (i, j) = (i - 1, j - 1),
            2 => (i, j) = (i - 1, j - 2),
            3 => (i, j) = (i - 2, j - 1),
            _ => break,
        }
        path.push((i, j));
    }
    path.reverse();
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_follows_a_known_warp() {
        let warp = |x: f64| x + 6.0 * (x / 40.0).sin();
        let signal = |x: f64| (0.11 * x).sin() + (0.037 * x).cos();
        let n = 300;
        let path = path(n, 20, 0.3, |i, j| {
            (signal(i as f64) - signal(warp(j as f64))).abs()
        });
        let inside = path.iter().filter(|(i, _)| (30..270).contains(i));
        let worst = inside
            .map(|(i, j)| (*i as f64 - warp(*j as f64)).abs())
            .fold(0.0, f64::max);
        assert!(worst <= 2.5, "{worst}");
    }
}
