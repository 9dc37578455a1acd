//! Kinds of faults, as broken loggers and converters make them.

use bodyflight_falls::Sample;
use bodyflight_falls::channels::{Channel, Remedy};
use nalgebra::Vector3;
use rand::{RngExt, rngs::ChaCha8Rng};

const FOOT: f64 = 0.3048;
const KNOT: f64 = 0.514_444;
const KMH: f64 = 1.0 / 3.6;

/// A fault, and what must be said of it.
pub(super) struct Fault {
    pub(super) name: &'static str,
    pub(super) change: fn(&mut Vec<Sample>, &mut ChaCha8Rng),
    /// The findings that may be made: one of these sets, in any order.
    pub(super) found: &'static [&'static [(Channel, Remedy)]],
    /// Share of the tracks on which the fault must be named.
    pub(super) least: f64,
}

fn each(samples: &mut [Sample], change: impl Fn(&mut Sample)) {
    samples.iter_mut().for_each(change);
}

/// Delays the channels of one kind.
fn delay(samples: &mut [Sample], by: f64, axes: &[usize], velocities: bool) {
    let before = samples.to_vec();
    for sample in samples.iter_mut() {
        let time = sample.time - by;
        let next = before.partition_point(|other| other.time < time);
        let (Some(from), Some(to)) = (
            next.checked_sub(1).map(|place| before[place]),
            before.get(next),
        ) else {
            continue;
        };
        let share = (time - from.time) / (to.time - from.time);
        for &axis in axes {
            if velocities {
                sample.velocity[axis] =
                    from.velocity[axis] + share * (to.velocity[axis] - from.velocity[axis]);
            } else {
                sample.position[axis] =
                    from.position[axis] + share * (to.position[axis] - from.position[axis]);
            }
        }
    }
}

fn any(random: &mut ChaCha8Rng, from: f64, to: f64) -> f64 {
    let size = random.random_range(from..to);
    if random.random_bool(0.5) { size } else { -size }
}

const HEIGHT: Channel = Channel::Height;
const DOWN: Channel = Channel::VerticalVelocity;
const CLOCK: Channel = Channel::Clock;
const ACROSS: Channel = Channel::HorizontalVelocity;

/// The faults.
pub(super) const FAULTS: &[Fault] = &[
    Fault {
        name: "none",
        change: |_, _| {},
        found: &[&[]],
        least: 1.0,
    },
    Fault {
        name: "heights in feet",
        change: |samples, _| each(samples, |sample| sample.position.z /= FOOT),
        found: &[&[(HEIGHT, Remedy::Converted)]],
        least: 1.0,
    },
    Fault {
        name: "heights in feet, velocities in knots",
        change: |samples, _| {
            each(samples, |sample| {
                sample.position.z /= FOOT;
                sample.velocity /= KNOT;
            })
        },
        found: &[&[
            (HEIGHT, Remedy::Converted),
            (DOWN, Remedy::Converted),
            (ACROSS, Remedy::Converted),
        ]],
        least: 1.0,
    },
    Fault {
        name: "heights in feet, velocities in km/h",
        change: |samples, _| {
            each(samples, |sample| {
                sample.position.z /= FOOT;
                sample.velocity /= KMH;
            })
        },
        found: &[
            &[
                (HEIGHT, Remedy::Converted),
                (DOWN, Remedy::Converted),
                (ACROSS, Remedy::Converted),
            ],
            // Gravity does not tell the units of a wingsuit that dives slowly.
            &[(DOWN, Remedy::Reported), (ACROSS, Remedy::Converted)],
        ],
        least: 1.0,
    },
    Fault {
        name: "heights in feet, sink in ft/s",
        change: |samples, _| {
            each(samples, |sample| {
                sample.position.z /= FOOT;
                sample.velocity.z /= FOOT;
            })
        },
        found: &[&[(HEIGHT, Remedy::Converted)], &[(DOWN, Remedy::Reported)]],
        least: 0.85,
    },
    Fault {
        name: "velocities in km/h",
        change: |samples, _| each(samples, |sample| sample.velocity /= KMH),
        found: &[&[(DOWN, Remedy::Converted), (ACROSS, Remedy::Converted)]],
        least: 1.0,
    },
    Fault {
        name: "sink without sign",
        change: |samples, _| {
            each(samples, |sample| {
                sample.velocity.z = -sample.velocity.z.abs()
            })
        },
        found: &[&[(DOWN, Remedy::Converted)], &[]],
        least: 0.9,
    },
    Fault {
        name: "climb without sign",
        change: |samples, _| {
            each(samples, |sample| {
                sample.velocity.z = sample.velocity.z.abs()
            })
        },
        found: &[&[(DOWN, Remedy::Converted)]],
        least: 0.9,
    },
    Fault {
        name: "no vertical velocity",
        change: |samples, _| each(samples, |sample| sample.velocity.z = 0.0),
        found: &[&[(DOWN, Remedy::NotUsed)]],
        least: 1.0,
    },
    Fault {
        name: "no velocities",
        change: |samples, _| each(samples, |sample| sample.velocity = Vector3::zeros()),
        found: &[&[(DOWN, Remedy::NotUsed), (ACROSS, Remedy::NotUsed)]],
        least: 1.0,
    },
    Fault {
        name: "no north",
        change: |samples, _| each(samples, |sample| sample.velocity.x = 0.0),
        found: &[&[(ACROSS, Remedy::NotUsed)]],
        least: 1.0,
    },
    Fault {
        name: "no heights",
        change: |samples, _| each(samples, |sample| sample.position.z = 0.0),
        found: &[&[(HEIGHT, Remedy::NotUsed)]],
        least: 1.0,
    },
    Fault {
        name: "no positions",
        change: |samples, _| {
            each(samples, |sample| {
                (sample.position.x, sample.position.y) = (0.0, 0.0)
            })
        },
        found: &[&[(Channel::Position, Remedy::NotUsed)]],
        least: 1.0,
    },
    Fault {
        name: "late sink",
        change: |samples, random| {
            let by = random.random_range(1.0..3.0);
            delay(samples, by, &[2], true)
        },
        found: &[&[(DOWN, Remedy::Converted)]],
        least: 0.9,
    },
    Fault {
        name: "late heights",
        change: |samples, random| {
            let by = random.random_range(1.0..3.0);
            delay(samples, by, &[2], false)
        },
        found: &[&[(HEIGHT, Remedy::Converted)]],
        least: 0.9,
    },
    Fault {
        name: "late velocities across",
        change: |samples, random| {
            let by = random.random_range(1.0..3.0);
            delay(samples, by, &[0, 1], true)
        },
        found: &[&[(ACROSS, Remedy::Converted)], &[(ACROSS, Remedy::NotUsed)]],
        least: 0.9,
    },
    Fault {
        name: "late velocities",
        change: |samples, random| {
            let by = random.random_range(1.0..3.0);
            delay(samples, by, &[0, 1, 2], true)
        },
        found: &[&[(DOWN, Remedy::Converted), (ACROSS, Remedy::Converted)]],
        least: 0.9,
    },
    Fault {
        name: "drifting heights",
        change: |samples, random| {
            let rate = any(random, 0.15, 0.6);
            each(samples, |sample| sample.position.z += rate * sample.time)
        },
        found: &[
            &[(HEIGHT, Remedy::Converted)],
            &[(HEIGHT, Remedy::Reported)],
        ],
        least: 0.5,
    },
    Fault {
        name: "biased sink",
        change: |samples, random| {
            let rate = any(random, 0.15, 0.6);
            each(samples, |sample| sample.velocity.z += rate)
        },
        found: &[&[(DOWN, Remedy::Converted)], &[(HEIGHT, Remedy::Reported)]],
        least: 0.5,
    },
    Fault {
        name: "a clock of another rate, 120 to 1000 ppm",
        change: |samples, random| {
            let fast = 1.0 + any(random, 1.2e-4, 1e-3);
            each(samples, |sample| sample.time *= fast)
        },
        found: &[&[(CLOCK, Remedy::Reported)]],
        least: 0.8,
    },
    Fault {
        name: "clock 1 to 25 per cent",
        change: |samples, random| {
            let fast = 1.0 + any(random, 0.01, 0.25);
            each(samples, |sample| sample.time *= fast)
        },
        found: &[&[(CLOCK, Remedy::Converted)]],
        least: 0.6,
    },
    Fault {
        name: "a clock that makes five rows a second four, and ten eight, or the reverse",
        change: |samples, random| {
            let fast = if random.random_bool(0.5) { 1.25 } else { 0.8 };
            each(samples, |sample| sample.time *= fast)
        },
        found: &[&[(CLOCK, Remedy::Converted)]],
        least: 0.6,
    },
];
