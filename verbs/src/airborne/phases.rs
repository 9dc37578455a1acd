//! Parts of a recording in which the centre of mass moves on a parabola.

use nalgebra::{Matrix3, Vector3};

/// Half the time over which the acceleration of the centre of mass is fitted (s), more if that holds too few frames.
const HALF: f64 = 0.06;
/// Fewest frames of such a fit.
const LEAST: usize = 5;
/// Largest difference of an acceleration from that of gravity (m/s2): a tilted vertical or a wrong rate stays within
/// it, and the lightest contact that moves a body does not.
const APART: f64 = 4.0;
/// Longest gap between two parts of a phase (s), in which the limbs move faster than the body's model follows, and the
/// largest distance from their common parabola (m): a touch in between leaves it.
const GAP: f64 = 0.35;
const JOINED: f64 = 0.03;
/// Distance from the parabola at which a phase ends (m), and in standard deviations of its core.
const LEAVES: f64 = 0.006;
const DEVIATIONS: f64 = 4.0;
/// Time at both ends that is left out (s): contact begins gently.
const MARGIN: f64 = 0.015;
/// Shortest phase (s).
const SHORTEST: f64 = 0.15;

/// A parabola fitted to places: position, velocity, half of the acceleration, about a time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Parabola {
    about: f64,
    coefficients: [Vector3<f64>; 3],
}

impl Parabola {
    /// Least squares; `None` if the times do not determine it.
    pub(super) fn fitted(times: &[f64], places: &[Vector3<f64>]) -> Option<Self> {
        let about = 0.5 * (times.first()? + times.last()?);
        let mut normal = Matrix3::zeros();
        let mut sums = Matrix3::zeros();
        for (time, place) in times.iter().zip(places) {
            let tau = time - about;
            let row = Vector3::new(1.0, tau, tau * tau);
            normal += row * row.transpose();
            sums += row * place.transpose();
        }
        let solved = normal.try_inverse()? * sums;
        Some(Self {
            about,
            coefficients: [0, 1, 2].map(|k| solved.row(k).transpose()),
        })
    }

    pub(super) fn at(&self, time: f64) -> Vector3<f64> {
        let tau = time - self.about;
        let [place, velocity, half] = self.coefficients;
        place + velocity * tau + half * (tau * tau)
    }

    pub(super) fn acceleration(&self) -> Vector3<f64> {
        2.0 * self.coefficients[2]
    }
}

/// Half the time of a fit around a frame (s): at the rate of video, a tenth of a second has three frames.
fn half(times: &[f64]) -> f64 {
    let frames = times.len().saturating_sub(1).max(1);
    let length = times.last().zip(times.first());
    let frame = length.map_or(0.0, |(last, first)| (last - first) / frames as f64);
    HALF.max((LEAST / 2) as f64 * frame)
}

/// Whether the centre of mass falls freely around a frame.
fn falls(times: &[f64], centres: &[Vector3<f64>], frame: usize, half: f64, gravity: f64) -> bool {
    let (begin, end) = (times[frame] - half, times[frame] + half);
    if begin < times[0] - 1e-6 || end > times[times.len() - 1] + 1e-6 {
        return false;
    }
    let first = times.partition_point(|time| *time < begin - 1e-6);
    let last = times.partition_point(|time| *time <= end + 1e-6);
    let fitted = (last - first >= LEAST)
        .then(|| Parabola::fitted(&times[first..last], &centres[first..last]))
        .flatten();
    fitted.is_some_and(|fit| (fit.acceleration() + Vector3::z() * gravity).norm() < APART)
}

/// First and last frame of each phase, in which the acceleration of the centre of mass is near `gravity` (m/s2): that of
/// the Earth, or what a wrong rate or scale makes of it.
pub fn found(times: &[f64], centres: &[Vector3<f64>], gravity: f64) -> Vec<[usize; 2]> {
    let half = half(times);
    let falling: Vec<usize> = (0..times.len())
        .filter(|frame| falls(times, centres, *frame, half, gravity))
        .collect();
    let runs = falling.chunk_by(|a, b| b - a == 1);
    let mut cores: Vec<[usize; 2]> = Vec::new();
    for run in runs {
        let [first, last] = [run[0], run[run.len() - 1]];
        match cores.last_mut() {
            Some(before)
                if are_one(
                    times,
                    centres,
                    [before[0], last],
                    first - before[1],
                    gravity,
                ) =>
            {
                before[1] = last;
            }
            _ => cores.push([first, last]),
        }
    }
    let mut phases: Vec<[usize; 2]> = Vec::new();
    for core in cores {
        let Some([first, last]) = extended(times, centres, core, half) else {
            continue;
        };
        let begin = times[first] + if first > 0 { MARGIN } else { 0.0 };
        let end = times[last] - if last + 1 < times.len() { MARGIN } else { 0.0 };
        let first = times.partition_point(|time| *time < begin);
        let last = times.partition_point(|time| *time <= end).saturating_sub(1);
        let apart = phases.last().is_none_or(|[_, before]| *before < first);
        if last > first && times[last] - times[first] >= SHORTEST && apart {
            phases.push([first, last]);
        }
    }
    phases
}

/// Whether two runs with a gap of so many frames between them are one fall.
fn are_one(
    times: &[f64],
    centres: &[Vector3<f64>],
    [first, last]: [usize; 2],
    gap: usize,
    gravity: f64,
) -> bool {
    let frame = (times[last] - times[first]) / (last - first).max(1) as f64;
    let parts = (&times[first..=last], &centres[first..=last]);
    let fit = (gap as f64 * frame <= GAP).then(|| Parabola::fitted(parts.0, parts.1));
    fit.flatten().is_some_and(|fit| {
        let off = |(time, centre): (&f64, &Vector3<f64>)| (centre - fit.at(*time)).norm();
        let falls = (fit.acceleration() + Vector3::z() * gravity).norm() < APART;
        falls && parts.0.iter().zip(parts.1).map(off).fold(0.0, f64::max) < JOINED
    })
}

/// A run of falling frames, extended for as long as the centre of mass stays on the parabola.
fn extended(
    times: &[f64],
    centres: &[Vector3<f64>],
    [first, last]: [usize; 2],
    half: f64,
) -> Option<[usize; 2]> {
    let within =
        |frame: usize| times[frame] >= times[first] - half && times[frame] <= times[last] + half;
    let widest = [
        (0..=first)
            .rev()
            .take_while(|frame| within(*frame))
            .last()?,
        (last..times.len())
            .take_while(|frame| within(*frame))
            .last()?,
    ];
    // A core of a few frames does not determine a parabola: half of what its fits saw belongs to it.
    let grow = |from: usize, to: usize| (from + to) / 2;
    let [first, last] = [grow(first, widest[0]), grow(last, widest[1])];
    if last - first + 1 < LEAST {
        return None;
    }
    let fit = Parabola::fitted(&times[first..=last], &centres[first..=last])?;
    let off = |frame: usize| (centres[frame] - fit.at(times[frame])).norm();
    let squares: f64 = (first..=last).map(|frame| off(frame).powi(2)).sum();
    let limit = LEAVES.max(DEVIATIONS * (squares / (last - first + 1) as f64).sqrt());
    let on = |frame: &usize| off(*frame) < limit;
    Some([
        (widest[0]..=first).rev().take_while(on).last()?,
        (last..=widest[1]).take_while(on).last()?,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::air::GRAVITY;
    use proptest::prelude::*;

    proptest! {
        /// Crouch, push, flight, landing: only the flight is found, to a few frames.
        #[test]
        fn a_jump_is_found_and_standing_is_not(
            up in 1.2..3.5_f64,
            rate in prop::sample::select(vec![30.0, 60.0, 100.0, 120.0, 240.0]),
            noise in 0.0..0.002_f64,
            phase in 0.0..6.0_f64,
        ) {
            let (push, air) = (0.3, 2.0 * up / GRAVITY);
            let height = |time: f64| {
                let time = time - 1.0;
                if time < 0.0 { 0.0 }
                else if time < push { up / push * time * time / 2.0 }
                else if time < push + air { let t = time - push; up * push / 2.0 + up * t - GRAVITY * t * t / 2.0 }
                else { let t = (time - push - air).min(push); up * push / 2.0 - up * t + up / push * t * t / 2.0 }
            };
            let times: Vec<f64> = (0..1000).map(|k| f64::from(k) / rate).take_while(|time| *time < 3.5).collect();
            let centres: Vec<Vector3<f64>> = times.iter().map(|time| {
                // Noise of several frequencies, as markers on moving skin have.
                let n = |f: f64| noise * (f * time + phase).sin();
                Vector3::new(0.3 * time + n(91.0), n(57.0), height(*time) + n(133.0))
            }).collect();
            let found = found(&times, &centres, GRAVITY);
            prop_assert_eq!(found.len(), usize::from(air > 0.25).max(found.len().min(1)));
            for [first, last] in found {
                prop_assert!(times[first] > 1.0 + push - 0.03, "{}", times[first]);
                prop_assert!(times[last] < 1.0 + push + air + 0.03, "{}", times[last]);
                prop_assert!(times[last] - times[first] > air - 0.12);
            }
        }
    }
}
