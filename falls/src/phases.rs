//! The phases of a jump: aircraft, exit, fall, opening, canopy, ground.
//!
//! Phases are not separated by thresholds. A table gives each phase a range for each feature, and phases follow one
//! another as on a jump. Of all ways to divide the track, dynamic programming finds the one that fits best as a whole
//! (a hidden Markov chain, Viterbi). Boundaries are then placed at the kinks of the vertical velocity.

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
    /// After leaving the aircraft, accelerating downwards.
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

/// Features that distinguish phases: vertical velocity, horizontal speed, speed (m/s), vertical acceleration (m/s2),
/// angle of the flight path below the horizon (rad), logarithm of the drag factor (of m2/kg).
const FEATURES: usize = 6;

/// Distance outside its range at which a feature has a cost of one; the cost grows with the square of the distance.
const SCALES: [f64; FEATURES] = [2.0, 4.0, 4.0, 1.2, 0.09, 0.15];

/// Largest cost of one feature of one sample, so that no single bad sample is decisive.
const MOST: f64 = 12.0;

const ANY: [f64; 2] = [-1e9, 1e9];

/// Logarithm of the drag factor (m2/kg) that separates a body from an opening canopy: 0.016.
const OPENED: f64 = -4.135;

/// Ranges of the features in each phase: wide enough for slow and fast falls, wingsuits, helicopters and swoops.
const RANGES: [[[f64; 2]; FEATURES]; COUNT] = [
    // Ground: at rest or walking.
    [[-0.8, 0.8], [0.0, 6.0], ANY, [-0.6, 0.6], ANY, ANY],
    // Aircraft: a flat, steady path.
    [
        [-14.0, 20.0],
        [25.0, 110.0],
        ANY,
        [-1.5, 1.5],
        [-0.45, 0.22],
        ANY,
    ],
    // Exit: nearly weightless.
    [[-45.0, 3.0], ANY, ANY, [-12.0, -4.5], ANY, [-1e9, OPENED]],
    // Fall: a steep path, fast, with the drag of a body.
    [
        [-140.0, -5.0],
        ANY,
        [24.0, 150.0],
        [-7.0, 9.0],
        [0.2, 1.6],
        [-1e9, OPENED],
    ],
    // Opening: decelerated by more drag than a body has.
    [
        [-140.0, -3.0],
        ANY,
        [6.0, 150.0],
        [2.0, 80.0],
        ANY,
        [OPENED, 1e9],
    ],
    // Canopy: slow, in steady flight.
    [
        [-32.0, 2.0],
        ANY,
        [2.0, 34.0],
        [-4.5, 4.5],
        ANY,
        [OPENED, 1e9],
    ],
];

/// Cost of the transition from one phase (row) to another (column), in the order of [`Phase::ALL`].
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
        // A canopy that is cut away leads back to an exit.
        [USUAL, NEVER, ODD, NEVER, SELDOM, 0.0],
    ]
};

/// Time around a sample from which its acceleration is taken (s).
const REACH: f64 = 0.6;

/// Sample rate for which the transition costs are defined (Hz).
const RATE: f64 = 5.0;

/// Longest time that one sample represents (s).
const LONGEST: f64 = 1.0;

/// A part of the track in one phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stretch {
    /// The phase.
    pub phase: Phase,
    /// Index of the first sample.
    pub first: usize,
    /// Index after the last sample.
    pub end: usize,
}

/// Divides a track into phases.
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

/// Cost of a sample in each phase.
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
    /// Exit from the aircraft.
    pub exit: Option<f64>,
    /// Start and end of the fall, as far as it is on the track.
    pub fall: [f64; 2],
    /// Start of the deceleration by the canopy.
    pub opening: Option<f64>,
    /// Time from which the canopy is open.
    pub canopy: Option<f64>,
    /// Landing under canopy.
    pub landing: Option<f64>,
}

/// The times of the longest fall of a track; `None` if there is none.
pub fn times(samples: &[Sample], stretches: &[Stretch]) -> Option<Times> {
    // A deceleration as by a canopy that is followed by further fall is a wingsuit pulling out of a dive.
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
    // A head-down flyer who changes to belly flight resembles a second exit, so an exit must follow an aircraft phase.
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

/// Side of a kink on which the slope changes.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Before,
    After,
}

/// Time near `near` (s) at which two lines fitted to the vertical velocity meet with the least squares.
///
/// The lines are fitted over `reach` (s) before and after.
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
    fn a_jump_is_divided_at_its_true_phases() {
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
