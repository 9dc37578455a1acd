//! Jumps with known times: files of many kinds with known faults, and simulated jumps of each kind.

#![expect(clippy::panic, reason = "tests may panic: that is how they fail")]

#[path = "jumps/faults.rs"]
mod faults;
#[path = "jumps/simulated.rs"]
mod simulated;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use bodyflight_falls::Sample;
use bodyflight_falls::channels::{Channel, Checked, Given, Remedy, checked};
use bodyflight_falls::fall::{Jump, Settings, analysed};
use bodyflight_falls::verdict::Verdict;
use bodyflight_shared_data::shared;
use bodyflight_tracks::read;
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use serde_json::Value;
use simulated::{Flown, Kind, flown};

/// The folder of files with known faults, or `None` with a visible notice.
fn cases() -> Option<PathBuf> {
    shared("cases/tracks")
}

fn jumps(checked: &Checked) -> Vec<Jump> {
    let settings = Settings {
        motion: checked.motion,
        ..Settings::default()
    };
    analysed(&checked.samples, &settings)
}

fn of_file(path: &Path) -> (Checked, Vec<Jump>) {
    let track = read(path).unwrap_or_else(|problem| panic!("{problem}"));
    let checked = checked(&track.samples, track.given);
    let jumps = jumps(&checked);
    (checked, jumps)
}

#[test]
fn files_with_known_faults_have_the_right_times() {
    let Some(folder) = cases() else {
        return;
    };
    let truth = std::fs::read_to_string(folder.join("truth.json")).unwrap();
    let truth: BTreeMap<String, Value> = serde_json::from_str(&truth).unwrap();
    for (name, truth) in &truth {
        let path = folder.join(name);
        if name == "x.igc" || name == "x.nmea" {
            let problem = read(&path).unwrap_err().to_string();
            let format = name.trim_start_matches("x.").to_uppercase();
            assert!(problem.contains(&format), "{problem}");
            continue;
        }
        let (_, jumps) = of_file(&path);
        if truth.is_null() {
            assert!(jumps.is_empty(), "{name}: {jumps:?}");
            continue;
        }
        let expected = |key: &str| truth[key].as_f64();
        let (exit, opening) = match expected("exit") {
            Some(exit) => (exit, expected("opening").unwrap()),
            // The README says what is right; the jump is the plain one.
            None => (40.0, 100.0),
        };
        let count = if name.starts_with("13-two") { 2 } else { 1 };
        assert_eq!(jumps.len(), count, "{name}");
        let times = jumps[0].times;
        let off = |boundary: Option<bodyflight_falls::boundary::Boundary>, true_time: f64| {
            let boundary = boundary.unwrap_or_else(|| panic!("{name}: {times:?}"));
            let off = (boundary.time - true_time).abs();
            assert!(off < 1.0, "{name}: {boundary:?}, true {true_time}");
            assert!(
                off < 4.0 * boundary.deviation + 0.3,
                "{name}: {boundary:?}, true {true_time}"
            );
        };
        off(times.exit, exit);
        off(times.opening, opening);
        assert_ne!(jumps[0].verdict, Verdict::Uncertain, "{name}");
        if times.fall[1] - times.fall[0] > 40.0 && !name.starts_with("20-") {
            let ballistic = jumps[0].drag.map_or(f64::NAN, |[drag, _]| 1.0 / drag);
            assert!(
                (ballistic / 150.0 - 1.0).abs() < 0.04,
                "{name}: {ballistic}"
            );
        }
    }
}

#[test]
fn contradictory_channels_are_named_and_not_used() {
    let Some(folder) = cases() else {
        return;
    };
    for (name, channel, remedy) in [
        ("12-feet.csv", Channel::Height, Remedy::Converted),
        ("25-zero-height.CSV", Channel::Height, Remedy::NotUsed),
        (
            "26-velD-zero.CSV",
            Channel::VerticalVelocity,
            Remedy::NotUsed,
        ),
        (
            "42-dekunu-like.CSV",
            Channel::VerticalVelocity,
            Remedy::NotUsed,
        ),
        (
            "41-gopro-unsigned.CSV",
            Channel::HorizontalVelocity,
            Remedy::NotUsed,
        ),
    ] {
        let (checked, jumps) = of_file(&folder.join(name));
        let found: Vec<_> = (checked.findings.iter())
            .map(|finding| (finding.channel, finding.remedy))
            .collect();
        assert_eq!(found, [(channel, remedy)], "{name}: {:?}", checked.findings);
        if name.starts_with("41") {
            // Wind from 63 degrees with 6.7 m/s, north and west: the direction that it blows to.
            let low = jumps[0].wind.values.last().unwrap();
            let apart = (low.velocity - nalgebra::Vector2::new(-3.0, 6.0)).norm();
            assert!(apart < 3.0 * low.deviation.norm().max(0.5), "{low:?}");
        }
    }
    let (checked, jumps) = of_file(&folder.join("22-baro-only.csv"));
    assert!(
        !checked.motion.has_horizontal && !jumps[0].wind.is_told() && jumps[0].circles.is_empty()
    );
}

/// Share of jumps of a kind whose exit and opening are within a second, and how many are explained with wrong times.
fn shares(kind: Kind, count: u64) -> ([f64; 2], Vec<String>) {
    let mut right = [0.0; 2];
    let mut wrong = Vec::new();
    for seed in 0..count {
        let Flown {
            samples,
            exit,
            opening,
            ..
        } = flown(kind, seed);
        let given = Given {
            places: true,
            velocities: true,
            speeds: false,
        };
        let checked = checked(&samples, given);
        assert_eq!(checked.findings, [], "{kind:?} {seed}");
        let found = jumps(&checked);
        let off = |jump: &Jump| {
            [(jump.times.exit, exit), (jump.times.opening, opening)].map(|(boundary, flown)| {
                boundary.map_or(f64::INFINITY, |boundary| (boundary.time - flown).abs())
            })
        };
        let best = found
            .iter()
            .map(off)
            .min_by(|a, b| (a[0] + a[1]).total_cmp(&(b[0] + b[1])));
        for (share, off) in right.iter_mut().zip(best.unwrap_or([f64::INFINITY; 2])) {
            *share += if off <= 1.0 { 1.0 / count as f64 } else { 0.0 };
        }
        for jump in &found {
            let [exit_off, opening_off] = off(jump);
            let is_wrong = exit_off > 3.0 || opening_off > 3.0;
            if jump.verdict == Verdict::Explained && is_wrong {
                wrong.push(format!(
                    "{kind:?} {seed}: {:?}, {exit} {opening}",
                    jump.times
                ));
            }
        }
    }
    (right, wrong)
}

#[test]
fn simulated_jumps_of_each_kind_have_the_right_times() {
    let mut table = String::new();
    let mut all_wrong = Vec::new();
    let mut missed = Vec::new();
    for (kind, least) in [
        (Kind::FreeFall, 0.95),
        (Kind::HopAndPop, 0.9),
        (Kind::Tandem, 0.95),
        (Kind::Speed, 0.95),
        (Kind::Base, 0.8),
        (Kind::Wingsuit, 0.8),
        (Kind::Flare, 0.8),
    ] {
        let (right, wrong) = shares(kind, 60);
        table += &format!("{kind:?}: exit {:.2}, opening {:.2}\n", right[0], right[1]);
        if right.iter().any(|share| *share + 1e-9 < least) {
            missed.push(kind);
        }
        all_wrong.extend(wrong);
    }
    eprintln!("{table}");
    assert!(missed.is_empty(), "{missed:?}\n{table}");
    assert!(all_wrong.is_empty(), "{all_wrong:#?}");
}

/// Shares of estimates of one component within one and two deviations.
fn within(off: &[f64]) -> [f64; 2] {
    [1.0, 2.0].map(|most| {
        let inside = off.iter().filter(|off| off.abs() <= most).count();
        inside as f64 / off.len().max(1) as f64
    })
}

#[test]
fn winds_of_simulated_jumps_are_as_far_off_as_they_say() {
    let (mut falls, mut canopies) = (Vec::new(), Vec::new());
    for seed in 0..120 {
        let kind = [Kind::FreeFall, Kind::Tandem, Kind::HopAndPop][(seed % 3) as usize];
        let flight = flown(kind, seed);
        let given = Given {
            places: true,
            velocities: true,
            speeds: false,
        };
        for jump in jumps(&checked(&flight.samples, given)) {
            let off = |wind: &bodyflight_falls::wind::Wind| {
                let off = wind.velocity - flight.wind_at(wind.height).xy();
                [off.x / wind.deviation.x, off.y / wind.deviation.y]
            };
            if jump.wind.is_told() {
                falls.extend(jump.wind.layers(500.0).iter().flat_map(off));
            }
            canopies.extend(jump.circles.iter().flat_map(|circle| off(&circle.wind)));
        }
    }
    let (of_falls, of_canopies) = (within(&falls), within(&canopies));
    eprintln!(
        "falls {} {of_falls:.2?}, canopies {} {of_canopies:.2?}",
        falls.len(),
        canopies.len()
    );
    assert!(falls.len() > 100 && canopies.len() > 100);
    for [_, two] in [of_falls, of_canopies] {
        assert!(two > 0.9, "{of_falls:.2?} {of_canopies:.2?}");
    }
}

/// Seeds of the mutated tracks; others with `BODYFLIGHT_MUTATIONS=FROM..TO`, so that a long run can be divided.
fn mutations() -> std::ops::Range<u64> {
    let Ok(asked) = std::env::var("BODYFLIGHT_MUTATIONS") else {
        return 0..200;
    };
    let ends = asked.split_once("..");
    let seeds = ends.and_then(|(from, to)| Some(from.parse().ok()?..to.parse().ok()?));
    seeds.unwrap_or_else(|| panic!("BODYFLIGHT_MUTATIONS is {asked}, expected FROM..TO"))
}

/// Changes a track as broken loggers do: rows lost, repeated, far away, channels scaled, clocks that stop or run.
fn mutate(samples: &mut Vec<Sample>, random: &mut ChaCha8Rng) {
    let all = samples.len();
    let from = random.random_range(0..all);
    let to = (from + random.random_range(1..all)).min(all);
    let factor = [0.0, -1.0, 0.02, 3.28, 1e3, 1e12][random.random_range(0..6_usize)];
    let axis = random.random_range(0..3_usize);
    match random.random_range(0..8) {
        0 => drop(samples.drain(from..to)),
        1 => samples.truncate(from.max(2)),
        2 => samples[from..to]
            .iter_mut()
            .for_each(|sample| sample.velocity[axis] *= factor),
        3 => samples[from..to]
            .iter_mut()
            .for_each(|sample| sample.position[axis] *= factor),
        4 => samples[from..]
            .iter_mut()
            .for_each(|sample| sample.time += factor.abs()),
        5 => samples[from..to]
            .iter_mut()
            .for_each(|sample| sample.velocity = Vector3::zeros()),
        6 => {
            let first = samples[from].time;
            samples[from..]
                .iter_mut()
                .for_each(|sample| sample.time = first + (sample.time - first) * 1e-3);
        }
        _ => samples[from].position[axis] += 1e12,
    }
    samples.dedup_by(|after, before| after.time <= before.time);
}

#[test]
fn mutated_tracks_neither_panic_nor_give_numbers_that_are_none() {
    let kinds = [Kind::FreeFall, Kind::HopAndPop, Kind::Wingsuit, Kind::Base];
    let flights: Vec<Flown> = (0..48)
        .map(|seed| flown(kinds[(seed % 4) as usize], seed / 4))
        .collect();
    for seed in mutations() {
        let random = &mut ChaCha8Rng::seed_from_u64(seed);
        let flight = &flights[random.random_range(0..flights.len())];
        let mut samples = flight.samples.clone();
        // Few whole tracks, and many short ones, which take much less time.
        if !seed.is_multiple_of(1000) {
            let part = flight.exit - 15.0..flight.opening.min(flight.exit + 60.0) + 30.0;
            samples.retain(|sample| part.contains(&sample.time));
            let each = samples.len().div_ceil(100);
            samples = samples.into_iter().step_by(each).collect();
        }
        for _ in 0..random.random_range(1..4) {
            if samples.len() > 4 {
                mutate(&mut samples, random);
            }
        }
        let given = Given {
            places: random.random_bool(0.8),
            velocities: random.random_bool(0.8),
            speeds: false,
        };
        for jump in jumps(&checked(&samples, given)) {
            assert!(
                jump.duration().is_finite() && jump.fastest.is_finite(),
                "{seed}"
            );
            assert!(!jump.reason.is_empty());
        }
    }
}
