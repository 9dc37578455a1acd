//! Channels with faults of many kinds: flights and public tracks that are changed as broken loggers and converters do.

#[path = "faults/kinds.rs"]
mod kinds;

use bodyflight_falls::Sample;
use bodyflight_falls::boundary::Boundary;
use bodyflight_falls::channels::{Channel, Checked, Given, Remedy, checked};
use bodyflight_falls::fall::Jump;
use bodyflight_falls::verdict::Verdict;
use bodyflight_shared_data::shared;
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};

use super::jumps;
use super::simulated::{Kind, flown};
use kinds::FAULTS;

const GIVEN: Given = Given {
    places: true,
    velocities: true,
    speeds: false,
};

/// A track without a fault.
struct Track {
    name: String,
    samples: Vec<Sample>,
    /// Range of the true exit, and true opening (s).
    exit: [f64; 2],
    opening: f64,
    /// The jumps that are found.
    right: Vec<Jump>,
    /// Findings that are made already.
    findings: Vec<(Channel, Remedy)>,
}

impl Track {
    fn new(name: String, samples: Vec<Sample>, exit: [f64; 2], opening: f64) -> Self {
        let checked = checked(&samples, GIVEN);
        Self {
            name,
            samples,
            exit,
            opening,
            right: jumps(&checked),
            findings: findings(&checked),
        }
    }
}

fn findings(checked: &Checked) -> Vec<(Channel, Remedy)> {
    let found = checked.findings.iter();
    found
        .map(|finding| (finding.channel, finding.remedy))
        .collect()
}

/// Tracks to change: flights of several kinds, and two public tracks with a clean reception at several rates and
/// noises.
fn tracks() -> Vec<Track> {
    let mut tracks = Vec::new();
    for kind in [
        Kind::FreeFall,
        Kind::HopAndPop,
        Kind::Wingsuit,
        Kind::Tandem,
    ] {
        for seed in 0..4 {
            let flown = flown(kind, seed);
            tracks.push(Track::new(
                format!("{kind:?} {seed}"),
                flown.samples,
                [flown.exit; 2],
                flown.opening,
            ));
        }
    }
    let Some(folder) = shared("data/flysight") else {
        return tracks;
    };
    // The wingsuit leaves the aircraft's stream first, and falls four seconds later.
    for (name, exit, opening) in [
        ("speed_skydiving_411.csv", [30.7, 30.7], 69.4),
        ("_703_14-41-39.CSV", [511.5, 515.6], 619.7),
    ] {
        let Ok(track) = bodyflight_tracks::read(&folder.join("skyderby").join(name)) else {
            panic!("{name} is not readable");
        };
        for (place, rate) in [1.0, 5.0, 20.0].into_iter().enumerate() {
            let random = &mut ChaCha8Rng::seed_from_u64(place as u64);
            let noise = random.random_range(0.0..0.2);
            let samples = resampled(&track.samples, rate, noise, random);
            let first = track.samples[0].time;
            tracks.push(Track::new(
                format!("{name} {rate}"),
                samples,
                exit.map(|time| time + first),
                opening + first,
            ));
        }
    }
    tracks
}

/// A track at another rate, with more noise.
fn resampled(samples: &[Sample], rate: f64, noise: f64, random: &mut ChaCha8Rng) -> Vec<Sample> {
    let mut drawn = || {
        let mut one = || -> f64 { StandardNormal.sample(random) };
        Vector3::new(one(), one(), one()) * noise
    };
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
        return Vec::new();
    };
    let mut resampled = Vec::new();
    for number in 0_u32.. {
        let time = first.time + f64::from(number) / rate;
        if time > last.time {
            break;
        }
        let next = samples
            .partition_point(|other| other.time <= time)
            .min(samples.len() - 1);
        let (from, to) = (samples[next - 1], samples[next]);
        if to.time - from.time > 1.5 {
            continue;
        }
        let share = (time - from.time) / (to.time - from.time);
        resampled.push(Sample {
            time,
            position: from.position.lerp(&to.position, share) + drawn() * 5.0,
            velocity: from.velocity.lerp(&to.velocity, share) + drawn(),
        });
    }
    resampled
}

/// Whether an analysis of a changed track says what is true of it.
fn is_right(jump: &Jump, track: &Track) -> bool {
    let is_near = |one: Option<Boundary>, [from, to]: [f64; 2]| {
        one.is_none_or(|one| {
            let most = 1.5 + 3.0 * one.deviation;
            (from - most..=to + most).contains(&one.time)
        })
    };
    let apart = |a: Option<[f64; 2]>, b: Option<[f64; 2]>| Some((a?[0] / b?[0]).ln().abs());
    let is_same = |other: &Jump| {
        let has_drag = other.verdict == Verdict::Explained;
        (!has_drag || apart(jump.drag, other.drag).is_some_and(|apart| apart < 0.2))
            && (jump.fastest - other.fastest).abs() < 0.15 * other.fastest + 1.0
    };
    is_near(jump.times.exit, track.exit)
        && is_near(jump.times.opening, [track.opening; 2])
        && track.right.iter().any(is_same)
}

#[test]
fn every_fault_is_named_and_none_is_explained_with_wrong_numbers() {
    let tracks = tracks();
    let mut failed = Vec::new();
    for fault in FAULTS {
        let (mut named, mut wrong) = (0, Vec::new());
        for (place, track) in tracks.iter().enumerate() {
            let mut changed = track.samples.clone();
            (fault.change)(&mut changed, &mut ChaCha8Rng::seed_from_u64(place as u64));
            let checked = checked(&changed, GIVEN);
            let found = findings(&checked);
            named += usize::from(fault.found.iter().any(|expected| {
                let known =
                    |finding| expected.contains(finding) || track.findings.contains(finding);
                expected.iter().all(|expected| found.contains(expected)) && found.iter().all(known)
            }));
            for jump in jumps(&checked) {
                if jump.verdict == Verdict::Explained && !is_right(&jump, track) {
                    wrong.push(format!(
                        "{}: {:?}, {:?}",
                        track.name, jump.times, checked.findings
                    ));
                }
            }
        }
        eprintln!(
            "{}: named on {named} of {}, {} wrong",
            fault.name,
            tracks.len(),
            wrong.len()
        );
        if (named as f64) < fault.least * tracks.len() as f64 || !wrong.is_empty() {
            failed.push(format!(
                "{}: named on {named} of {}, {wrong:#?}",
                fault.name,
                tracks.len()
            ));
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}
