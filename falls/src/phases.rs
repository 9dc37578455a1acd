//! The phases of a jump: aircraft, exit, fall, opening, canopy, ground.
//!
//! No threshold ends a phase. Each phase has ranges of what it looks like, in a table, and the phases follow one
//! another as on a jump; of all ways to divide the track, the one that fits best as a whole is found by dynamic
//! programming (a hidden Markov chain, Viterbi). Its borders are then put where the vertical velocity has its kinks.

use bodyflight_core::air::GRAVITY;
use nalgebra::{DMatrix, DVector, Vector3};
use schemars::JsonSchema;
use serde::Serialize;

use crate::atmosphere::Atmosphere;
use crate::{Sample, slopes};

/// A phase of a jump.
#[derive(Debug, Clone, Copy, PartialEq, Eq, JsonSchema, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// Standing or walking.
    Ground,
    /// In the aircraft.
    Aircraft,
    /// After leaving it, gathering speed downwards.
    Exit,
    /// Free fall, or flight in a wingsuit.
    Fall,
    /// From the deployment to the open canopy.
    Opening,
    /// Under the open canopy.
    Canopy,
}

/// Number of phases.
const COUNT: usize = 6;

impl Phase {
    /// All phases in the order of a jump.
    pub const ALL: [Self; COUNT] = [
        Self::Ground,
        Self::Aircraft,
        Self::Exit,
        Self::Fall,
        Self::Opening,
        Self::Canopy,
    ];

    /// Name for people.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ground => "ground",
            Self::Aircraft => "aircraft",
            Self::Exit => "exit",
            Self::Fall => "fall",
            Self::Opening => "opening",
            Self::Canopy => "canopy",
        }
    }
}

/// What phases are told by: vertical velocity, speed across, speed (m/s), vertical acceleration (m/s2), angle of the
/// way below the horizon (rad), logarithm of the drag factor (of m2/kg).
const FEATURES: usize = 6;

/// How far outside of its range a feature costs one.
const SCALES: [f64; FEATURES] = [2.0, 4.0, 4.0, 1.2, 0.09, 0.15];

/// Most that one feature of one sample costs: a sample that is wrong decides nothing alone.
const MOST: f64 = 12.0;

const ANY: [f64; 2] = [-1e9, 1e9];

/// Largest drag factor of a body and least of an opening canopy (m2/kg), as logarithm: 0.016.
const OPENED: f64 = -4.135;

/// Ranges of the features in each phase: wide enough for slow and fast falls, wingsuits, helicopters and swoops.
const RANGES: [[[f64; 2]; FEATURES]; COUNT] = [
    // Ground: at rest or walking.
    [[-0.8, 0.8], [0.0, 6.0], ANY, [-0.6, 0.6], ANY, ANY],
    // Aircraft: a flat way, steady.
    [
        [-14.0, 20.0],
        [25.0, 110.0],
        ANY,
        [-1.5, 1.5],
        [-0.45, 0.22],
        ANY,
    ],
    // Exit: nothing carries.
    [[-45.0, 3.0], ANY, ANY, [-12.0, -4.5], ANY, [-1e9, OPENED]],
    // Fall: a steep way, fast, with the drag of a body.
    [
        [-140.0, -5.0],
        ANY,
        [24.0, 150.0],
        [-7.0, 9.0],
        [0.2, 1.6],
        [-1e9, OPENED],
    ],
    // Opening: slowed down hard, by more than a body.
    [
        [-140.0, -3.0],
        ANY,
        [6.0, 150.0],
        [2.0, 80.0],
        ANY,
        [OPENED, 1e9],
    ],
    // Canopy: slow, carried.
    [
        [-32.0, 2.0],
        ANY,
        [2.0, 34.0],
        [-4.5, 4.5],
        ANY,
        [OPENED, 1e9],
    ],
];

/// Cost of going from one phase (row) to another (column), in the order of [`Phase::ALL`].
const STEPS: [[f64; COUNT]; COUNT] = {
    const USUAL: f64 = 8.0;
    const SELDOM: f64 = 60.0;
    const ODD: f64 = 150.0;
    const NEVER: f64 = 800.0;
    [
        [0.0, ODD, NEVER, NEVER, NEVER, ODD],
        [ODD, 0.0, USUAL, NEVER, NEVER, NEVER],
        [NEVER, ODD, 0.0, USUAL, USUAL, ODD],
        [NEVER, NEVER, SELDOM, 0.0, USUAL, ODD],
        [NEVER, NEVER, NEVER, SELDOM, 0.0, USUAL],
        // A canopy that is cut away.
        [USUAL, NEVER, ODD, NEVER, SELDOM, 0.0],
    ]
};

/// Time around a sample from which its acceleration is taken (s).
const REACH: f64 = 0.6;

/// Samples a second that the costs of the steps are made for.
const RATE: f64 = 5.0;

/// Longest time that one sample stands for (s).
const LONGEST: f64 = 1.0;

/// A phase over a part of the track.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stretch {
    /// Which one.
    pub phase: Phase,
    /// First sample.
    pub first: usize,
    /// The sample after the last.
    pub end: usize,
}

/// A track divided into phases.
pub fn divided(samples: &[Sample]) -> Vec<Stretch> {
    let accelerations = slopes(samples, REACH);
    let mut costs = [0.0; COUNT];
    let mut from: Vec<[u8; COUNT]> = Vec::with_capacity(samples.len());
    for (index, sample) in samples.iter().enumerate() {
        let next = samples.get(index + 1).unwrap_or(sample).time;
        let weight = (next - sample.time).clamp(0.02, LONGEST) * RATE;
        let own = emission(sample, &accelerations[index]);
        let mut best = [(f64::INFINITY, 0); COUNT];
        for (to, best) in best.iter_mut().enumerate() {
            for (phase, (cost, steps)) in (0_u8..).zip(costs.iter().zip(&STEPS)) {
                let step = if index == 0 { 0.0 } else { steps[to] };
                let cost = cost + step;
                if cost < best.0 {
                    *best = (cost, phase);
                }
            }
        }
        for (phase, cost) in costs.iter_mut().enumerate() {
            *cost = best[phase].0 + weight * own[phase];
        }
        from.push(best.map(|(_, phase)| phase));
    }
    let mut phase = (0..COUNT)
        .min_by(|a, b| costs[*a].total_cmp(&costs[*b]))
        .unwrap_or(0);
    let mut stretches: Vec<Stretch> = Vec::new();
    for (index, from) in from.iter().enumerate().rev() {
        match stretches.last_mut() {
            Some(stretch) if stretch.phase == Phase::ALL[phase] => stretch.first = index,
            _ => stretches.push(Stretch {
                phase: Phase::ALL[phase],
                first: index,
                end: index + 1,
            }),
        }
        phase = usize::from(from[phase]);
    }
    stretches.reverse();
    stretches
}

/// What a sample costs in each phase.
fn emission(sample: &Sample, acceleration: &Vector3<f64>) -> [f64; COUNT] {
    let (up, across) = (sample.velocity.z, sample.across());
    let speed = sample.velocity.norm();
    let force = acceleration + Vector3::z() * GRAVITY;
    let pressure = 0.5 * Atmosphere::Standard.density(sample.height()) * speed.max(1.0).powi(3);
    let drag = (-force.dot(&sample.velocity) / pressure).max(1e-6).ln();
    let features = [up, across, speed, acceleration.z, (-up).atan2(across), drag];
    RANGES.map(|ranges| {
        let outside = features.iter().zip(ranges).zip(SCALES);
        outside
            .map(|((value, [low, high]), scale)| {
                let outside = (low - value).max(value - high).max(0.0) / scale;
                (outside * outside).min(MOST)
            })
            .sum()
    })
}

/// The times of a jump (s); `None` for what the track does not show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Times {
    /// The aircraft is left.
    pub exit: Option<f64>,
    /// First and last moment of the fall that are on the track.
    pub fall: [f64; 2],
    /// The fall begins to be slowed down by the canopy.
    pub opening: Option<f64>,
    /// The canopy carries.
    pub canopy: Option<f64>,
    /// The canopy has landed.
    pub landing: Option<f64>,
}

/// The times of the longest fall of a track; `None` where it has none.
pub fn times(samples: &[Sample], stretches: &[Stretch]) -> Option<Times> {
    // Who is slowed down as by a canopy and falls on has pulled out of a dive, with a wingsuit.
    let falls = |place: usize| match stretches[place].phase {
        Phase::Exit | Phase::Fall => true,
        Phase::Opening => stretches
            .get(place + 1)
            .is_some_and(|next| next.phase == Phase::Fall),
        _ => false,
    };
    let mut falling: Vec<[usize; 2]> = Vec::new();
    for place in 0..stretches.len() {
        match falling.last_mut() {
            Some(last) if falls(place) && last[1] == place => last[1] = place + 1,
            _ if falls(place) => falling.push([place, place + 1]),
            _ => {}
        }
    }
    let time = |index: usize| samples[index.min(samples.len() - 1)].time;
    let duration =
        |places: &[usize; 2]| time(stretches[places[1] - 1].end) - time(stretches[places[0]].first);
    let [first, end] = falling
        .into_iter()
        .max_by(|a, b| duration(a).total_cmp(&duration(b)))?;
    // A head-down flyer who bails out looks like a second exit: only what comes after an aircraft is one.
    let before = first.checked_sub(1).map(|place| stretches[place].phase);
    let begin = time(stretches[first].first);
    let exit = match before {
        Some(_) if stretches[first].phase == Phase::Exit => {
            kink(samples, begin, [4.0, 2.5], Side::After)
        }
        _ => None,
    };
    let last = time(stretches[end - 1].end);
    let after = stretches.get(end).map(|stretch| stretch.phase);
    let opening = match after {
        Some(Phase::Opening) => kink(samples, last, [4.0, 1.5], Side::After),
        Some(Phase::Canopy) => Some(last),
        _ => None,
    };
    let canopy_place =
        (end..stretches.len()).find(|place| stretches[*place].phase == Phase::Canopy);
    let canopy = canopy_place.and_then(|place| {
        let begin = time(stretches[place].first);
        kink(samples, begin, [2.0, 4.0], Side::Before).or(Some(begin))
    });
    let landing = canopy_place.and_then(|place| {
        let ground = stretches[place..]
            .iter()
            .find(|stretch| stretch.phase == Phase::Ground)?;
        Some(time(ground.first))
    });
    Some(Times {
        exit,
        fall: [exit.unwrap_or(begin), opening.unwrap_or(last)],
        opening,
        canopy,
        landing,
    })
}

/// On which side of a kink the slope is another one.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Before,
    After,
}

/// Where two lines of the vertical velocity meet, near a time (s): the kink that leaves the least squares.
///
/// The line is fitted over `reach` (s) before and after.
fn kink(samples: &[Sample], near: f64, reach: [f64; 2], side: Side) -> Option<f64> {
    const STEP: f64 = 0.05;
    let within = |sample: &&Sample| (near - reach[0]..=near + reach[1]).contains(&sample.time);
    let part: Vec<&Sample> = samples.iter().filter(within).collect();
    let (first, last) = (part.first()?.time, part.last()?.time);
    if part.len() < 6 {
        return None;
    }
    let mut best: Option<(f64, f64)> = None;
    let mut place = first + 0.4;
    while place < last - 0.4 {
        let slopes = DMatrix::from_fn(part.len(), 3, |row, column| {
            let since = part[row].time - place;
            match column {
                0 => 1.0,
                1 => since,
                _ if side == Side::Before => since.min(0.0),
                _ => since.max(0.0),
            }
        });
        let values =
            DVector::from_iterator(part.len(), part.iter().map(|sample| sample.velocity.z));
        let normal = (slopes.transpose() * &slopes).cholesky()?;
        let line = normal.solve(&(slopes.transpose() * &values));
        let left = (values - slopes * line).norm_squared();
        if best.is_none_or(|(least, _)| left < least) {
            best = Some((left, place));
        }
        place += STEP;
    }
    best.map(|(_, place)| place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::{EXIT, Jump, jump};

    fn found(jumped: &Jump) -> Times {
        let samples = jump(jumped);
        times(&samples, &divided(&samples)).unwrap()
    }

    #[test]
    fn a_jump_is_divided_where_it_was_flown() {
        let slow = Jump {
            rate: 1.0,
            ..Jump::default()
        };
        let head_down = Jump {
            drag: vec![(0.0, 1.0 / 153.0), (15.0, 1.0 / 320.0), (35.0, 1.0 / 150.0)],
            ..Jump::default()
        };
        for (jumped, allowed) in [(Jump::default(), 0.5), (head_down, 0.5), (slow, 1.0)] {
            let times = found(&jumped);
            let off = |time: Option<f64>, flown: f64| (time.unwrap() - flown).abs();
            assert!(off(times.exit, EXIT) < allowed, "{times:?}");
            assert!(
                off(times.opening, EXIT + jumped.opening) < allowed + 0.3,
                "{times:?}"
            );
            let canopy = times.canopy.unwrap() - EXIT - jumped.opening;
            assert!((1.0..5.0).contains(&canopy), "{times:?}");
            assert!(times.landing.is_some());
        }
    }

    #[test]
    fn a_track_that_stays_in_the_aircraft_has_no_fall() {
        let samples = jump(&Jump::default());
        let inside: Vec<Sample> = samples
            .into_iter()
            .filter(|sample| sample.time < EXIT)
            .collect();
        assert_eq!(times(&inside, &divided(&inside)), None);
        assert_eq!(times(&[], &divided(&[])), None);
    }

    #[test]
    fn a_track_that_begins_in_the_fall_has_no_exit() {
        let samples = jump(&Jump::default());
        let late: Vec<Sample> = samples
            .into_iter()
            .filter(|sample| sample.time > EXIT + 20.0)
            .collect();
        let times = times(&late, &divided(&late)).unwrap();
        assert_eq!(times.exit, None);
        assert!(times.opening.is_some());
    }
}
