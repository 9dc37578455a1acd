//! The phases of a track: aircraft, exit, fall, opening, canopy, ground.
//!
//! Phases are not separated by thresholds. A table gives each phase a range for each feature, and phases follow one
//! another as on a jump. Of all ways to divide the track, dynamic programming finds the one that fits best as a whole
//! (a hidden Markov chain, Viterbi). No feature separates a fall from a canopy by its speed over ground, since a canopy
//! that runs with the wind is as fast as a wingsuit: what counts is how fast energy is lost, how large the aerodynamic
//! force is for the speed, and the opening between them. [`crate::jumps`] finds the jumps among the phases.

use bodyflight_core::air::GRAVITY;
use nalgebra::Vector3;
use serde::Serialize;

use crate::force::{drag_factor, force_factor, specific_force};
use crate::{Sample, longest_step, slopes};

/// A phase of a jump.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// Standing or walking, before a flight.
    Ground,
    /// In the aircraft.
    Aircraft,
    /// After leaving the aircraft, accelerating downwards.
    Exit,
    /// Free fall, or flight in a wingsuit.
    Fall,
    /// A wingsuit pulling up, which trades speed for height.
    Flare,
    /// From the deployment to the open canopy.
    Opening,
    /// Under the open canopy.
    Canopy,
    /// On the ground after a flight.
    Landed,
}

/// Number of states; a canopy has two: in steady flight, and in a fast turn or dive.
const COUNT: usize = 9;

/// The phase of each state, in the order of a jump.
const PHASES: [Phase; COUNT] = [
    Phase::Ground,
    Phase::Aircraft,
    Phase::Exit,
    Phase::Fall,
    Phase::Flare,
    Phase::Opening,
    Phase::Canopy,
    Phase::Canopy,
    Phase::Landed,
];

/// Features that distinguish phases: vertical velocity, horizontal speed, speed (m/s), vertical acceleration (m/s2),
/// loss of energy per weight (m/s: the sink speed of a steady descent), logarithms of the force factor, aerodynamic
/// force over mass and dynamic pressure, and of its part against the motion (of m2/kg).
const FEATURES: usize = 7;

/// Which features depend on the horizontal motion.
const BY_HORIZONTAL: [bool; FEATURES] = [false, true, true, false, false, true, true];

/// Largest cost of one feature of one sample, so that no single bad sample is decisive.
const MOST: f64 = 12.0;

/// Range of a feature in a phase. Outside, the cost grows with the square of the distance; it is one at `scale`.
#[derive(Clone, Copy)]
struct Range {
    low: f64,
    high: f64,
    scale: f64,
}

const fn range(low: f64, high: f64, scale: f64) -> Range {
    Range { low, high, scale }
}

const ANY: Range = range(-1e9, 1e9, 1.0);

/// What a state looks like.
struct Look {
    features: [Range; FEATURES],
    /// Cost of each sample: above zero for phases that do not last.
    each: f64,
}

/// How each state looks: wide enough for slow and fast falls, wingsuits, balloons, cliffs, helicopters, swoops and
/// strong winds.
const LOOKS: [Look; COUNT] = {
    const REST: [Range; FEATURES] = [
        range(-0.8, 0.8, 2.0),
        range(0.0, 6.0, 4.0),
        ANY,
        range(-0.6, 0.6, 1.2),
        ANY,
        ANY,
        ANY,
    ];
    [
        // Ground: at rest or walking.
        Look {
            features: REST,
            each: 0.0,
        },
        // Aircraft, also a balloon or a paraglider: a path without long pushes, climbing or descending.
        Look {
            features: [
                range(-35.0, 20.0, 2.5),
                ANY,
                ANY,
                range(-1.5, 1.5, 1.8),
                ANY,
                ANY,
                ANY,
            ],
            each: 0.0,
        },
        // Exit: nearly weightless.
        Look {
            features: [
                range(-50.0, 5.0, 2.5),
                ANY,
                ANY,
                range(-12.0, -4.0, 1.2),
                ANY,
                range(-1e9, -3.5, 0.25),
                ANY,
            ],
            each: 0.0,
        },
        // Fall: loses more energy than a canopy, and has less area for its weight (0.03 m2/kg).
        Look {
            features: [
                range(-160.0, -3.0, 2.5),
                ANY,
                range(20.0, 170.0, 4.0),
                range(-7.0, 9.0, 1.2),
                range(7.0, 1e9, 3.0),
                range(-1e9, -3.5, 0.25),
                ANY,
            ],
            each: 0.0,
        },
        // Flare: lift slows the descent; the drag is still that of a body, not that of a canopy (0.018 m2/kg).
        Look {
            features: [
                range(-22.0, 15.0, 2.5),
                ANY,
                range(17.0, 90.0, 4.0),
                range(-9.5, 20.0, 1.2),
                ANY,
                ANY,
                range(-1e9, -4.0, 0.25),
            ],
            each: 1.5,
        },
        // Opening: decelerated by more area than a body has (0.014 m2/kg).
        Look {
            features: [
                range(-160.0, -2.0, 2.5),
                ANY,
                range(4.0, 160.0, 4.0),
                range(1.5, 80.0, 1.2),
                ANY,
                range(-4.27, 1e9, 0.25),
                range(-4.6, 1e9, 0.25),
            ],
            each: 0.0,
        },
        // Canopy: loses little energy, and has a large area for its weight (0.018 m2/kg, in a strong tailwind).
        Look {
            features: [
                range(-25.0, 4.0, 2.5),
                ANY,
                range(4.0, 36.0, 4.0),
                range(-5.0, 8.0, 1.2),
                range(-8.0, 14.0, 3.0),
                range(-4.0, 1e9, 0.25),
                ANY,
            ],
            each: 0.0,
        },
        // Canopy in a dive, which lasts for some seconds.
        Look {
            features: [
                range(-45.0, 4.0, 2.5),
                ANY,
                range(4.0, 55.0, 4.0),
                range(-10.0, 20.0, 1.2),
                ANY,
                range(-4.6, 1e9, 0.25),
                ANY,
            ],
            each: 0.4,
        },
        // Landed: like the ground.
        Look {
            features: REST,
            each: 0.0,
        },
    ]
};

/// Cost of the transition from one phase (row) to another (column), in the order of [`PHASES`].
const STEPS: [[f64; COUNT]; COUNT] = {
    const USUAL: f64 = 8.0;
    const FEW: f64 = 20.0;
    const SELDOM: f64 = 60.0;
    const ODD: f64 = 150.0;
    const NEVER: f64 = 800.0;
    [
        // From the ground, also over a cliff's edge.
        [0.0, FEW, FEW, NEVER, NEVER, NEVER, ODD, NEVER, NEVER],
        [FEW, 0.0, USUAL, NEVER, NEVER, NEVER, NEVER, NEVER, NEVER],
        [NEVER, ODD, 0.0, USUAL, NEVER, USUAL, ODD, NEVER, NEVER],
        [NEVER, NEVER, SELDOM, 0.0, USUAL, USUAL, ODD, NEVER, NEVER],
        [NEVER, NEVER, NEVER, USUAL, 0.0, USUAL, ODD, NEVER, NEVER],
        // A canopy that does not open well is cut away; a wingsuit pulls out of a dive.
        [NEVER, NEVER, ODD, SELDOM, NEVER, 0.0, USUAL, SELDOM, NEVER],
        [NEVER, NEVER, ODD, NEVER, NEVER, NEVER, 0.0, USUAL, USUAL],
        [NEVER, NEVER, NEVER, NEVER, NEVER, NEVER, USUAL, 0.0, FEW],
        [ODD, ODD, NEVER, NEVER, NEVER, NEVER, NEVER, NEVER, 0.0],
    ]
};

/// Cost of any later phase after a gap, in which the phases between were missed.
const MISSED: f64 = 15.0;

/// Places of the aircraft and of the canopy among the states.
const AIRCRAFT: usize = 1;
const CANOPY: usize = 6;

/// An aircraft that sinks steeply (m/s) is fast (m/s); the cost of each sample of one that is not. A wingsuit over a
/// cliff hardly pushes at its exit, and may open without slowing its descent, so that little else tells it from an
/// aircraft.
const STEEP: f64 = 8.0;
const FAST: f64 = 42.0;
const UNLIKELY: f64 = 0.4;

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

/// Divides a track into phases; `has_horizontal` says whether the horizontal motion is known.
pub fn divided(samples: &[Sample], has_horizontal: bool) -> Vec<Stretch> {
    let accelerations = slopes(samples, REACH);
    let gap = longest_step(samples);
    let mut costs = [0.0; COUNT];
    let mut from: Vec<[u8; COUNT]> = Vec::with_capacity(samples.len());
    for (index, sample) in samples.iter().enumerate() {
        let next = samples.get(index + 1).unwrap_or(sample).time;
        let weight = (next - sample.time).clamp(0.02, LONGEST) * RATE;
        let own = emission(sample, &accelerations[index], has_horizontal);
        let is_after_gap = index > 0 && sample.time - samples[index - 1].time > gap;
        let mut best = [(f64::INFINITY, 0); COUNT];
        for (to, best) in best.iter_mut().enumerate() {
            for (phase, cost) in (0_u8..).zip(&costs) {
                let step = if index == 0 {
                    0.0
                } else {
                    step(usize::from(phase), to, is_after_gap)
                };
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
            Some(stretch) if stretch.phase == PHASES[phase] => stretch.first = index,
            _ => stretches.push(Stretch {
                phase: PHASES[phase],
                first: index,
                end: index + 1,
            }),
        }
        phase = usize::from(from[phase]);
    }
    stretches.reverse();
    stretches
}

/// Cost of going from one phase to another between two samples.
fn step(from: usize, to: usize, is_after_gap: bool) -> f64 {
    let usual = STEPS[from][to];
    let is_later = to > from || (from >= CANOPY && to < 2);
    if is_after_gap && is_later {
        usual.min(MISSED)
    } else {
        usual
    }
}

/// Speed (m/s) below which dynamic pressure is too small for a factor: just after the exit from a cliff, errors of the
/// acceleration would make it as large as that of a canopy.
pub const SLOW: f64 = 20.0;

/// Cost of a sample in each phase.
fn emission(sample: &Sample, acceleration: &Vector3<f64>, has_horizontal: bool) -> [f64; COUNT] {
    let speed = sample.velocity.norm();
    let force = specific_force(acceleration);
    let features = [
        sample.velocity.z,
        sample.across(),
        speed,
        acceleration.z,
        -force.dot(&sample.velocity) / GRAVITY,
        force_factor(sample, acceleration, SLOW).max(1e-9).ln(),
        drag_factor(sample, acceleration).max(1e-9).ln(),
    ];
    let mut costs = LOOKS.map(|look| {
        let known = features.iter().zip(look.features).zip(BY_HORIZONTAL);
        let known = known.filter(|(_, by_horizontal)| has_horizontal || !by_horizontal);
        let outside = known.map(|((value, range), _)| {
            let outside = (range.low - value).max(value - range.high).max(0.0) / range.scale;
            (outside * outside).min(MOST)
        });
        look.each + outside.sum::<f64>()
    });
    if has_horizontal && sample.velocity.z < -STEEP && speed < FAST {
        costs[AIRCRAFT] += UNLIKELY;
    }
    costs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::{EXIT, Jump, jump};

    #[test]
    fn a_jump_has_its_phases_in_order() {
        let samples = jump(&Jump::default());
        let phases: Vec<Phase> = divided(&samples, true)
            .iter()
            .map(|stretch| stretch.phase)
            .collect();
        let expected = [
            Phase::Aircraft,
            Phase::Exit,
            Phase::Fall,
            Phase::Opening,
            Phase::Canopy,
            Phase::Landed,
        ];
        assert_eq!(phases, expected);
        assert_eq!(divided(&[], true), []);
    }

    #[test]
    fn a_flight_in_the_aircraft_is_nothing_else() {
        let mut inside = jump(&Jump::default());
        inside.retain(|sample| sample.time < EXIT);
        let phases = divided(&inside, true);
        assert!(
            phases
                .iter()
                .all(|stretch| stretch.phase == Phase::Aircraft)
        );
    }
}
