//! Sensors, receivers and hosts that say something wrong, through the unit's application without a board: what is estimated
//! in the meantime must not be believed, and what is clean again must be soon.
//!
//! `BODYFLIGHT_FAULT_FLIGHTS="NAME ..."` takes other flights: bundled maneuvers (`belly-turns`) and flights of the independent
//! simulator (`wind-slow-104/flight-1`).

mod clocks;
mod delays;
mod faults;
mod situations;

use std::ops::Range;

use bodyflight_core::Posture;
use bodyflight_core::link::EstimateFlags;
use bodyflight_emulator::sensed::Sensed;
use bodyflight_emulator::tampered::{Judged, Sent, fly, longest_lie};
use bodyflight_laboratory::sensor_bytes::{Raw, SensorBytes};
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_unit::stream::sample_of;

use clocks::{CLOCKS, PACES};
use faults::FAULTS;
use situations::{SITUATIONS, carried};

/// Time during which something is wrong, and length of the flights (s).
const WRONG: Range<f64> = 9.0..13.0;
const LENGTH: f64 = 17.0;
/// Longest time for which a consistent estimate may be off by more than five of its deviations (s).
const LONGEST: f64 = 0.5;

/// Flights: one from the exit on by our own model, and one of the independent simulator, whose person and postures the unit
/// does not know.
const FLIGHTS: &str = "exit-and-tracking none-mixed-102/flight-0";

fn flights() -> Vec<(String, Sensed)> {
    let asked = std::env::var("BODYFLIGHT_FAULT_FLIGHTS");
    let names = asked.as_deref().unwrap_or(FLIGHTS).split_whitespace();
    let flights = names.filter_map(|name| {
        let sensed = if name.contains('/') {
            Sensed::of(name, LENGTH, &SensorBytes::TYPICAL).unwrap()
        } else {
            let sensed = Sensed::of_maneuver(name, LENGTH, &SensorBytes::TYPICAL);
            Some(sensed.unwrap())
        };
        Some((name.to_string(), sensed?))
    });
    flights.collect()
}

/// Time from `since` (s) to the next estimate that agrees with the measurements.
fn back(found: &[Judged], since: f64) -> f64 {
    let agreeing = |judged: &&Judged| judged.time > since && judged.is_consistent();
    (found.iter().find(agreeing)).map_or(f64::INFINITY, |judged| judged.time - since)
}

/// Share of the estimates within a time with any of these flags.
fn share(found: &[Judged], within: Range<f64>, flags: EstimateFlags) -> f64 {
    let within = found.iter().filter(|judged| within.contains(&judged.time));
    let all: Vec<_> = within
        .map(|judged| judged.estimate.flags.intersects(flags))
        .collect();
    all.iter().filter(|&&has| has).count() as f64 / all.len().max(1) as f64
}

fn agreeing(found: &[Judged], within: Range<f64>) -> f64 {
    let within = found.iter().filter(|judged| within.contains(&judged.time));
    let all: Vec<_> = within.map(Judged::is_consistent).collect();
    all.iter().filter(|&&agrees| agrees).count() as f64 / all.len().max(1) as f64
}

#[test]
fn what_is_wrong_for_a_while_is_neither_believed_nor_remembered() {
    let (mut all, mut within, mut failed) = (0, 0, Vec::new());
    for (flight, sensed) in flights() {
        let clean = Sent::of(&sensed.bytes);
        let [first, last] =
            [WRONG.start, WRONG.end].map(|at| clean.partition_point(|sent| sent.time < at));
        let mut see = |name: &str, sent: &[Sent], clean_since: f64| {
            let found = fly(&sensed, sent);
            let (lie, quantity) = longest_lie(&found, &(0.0..LENGTH));
            let back = back(&found, clean_since);
            let row = format!("{flight}, {name}: {lie:.2} s {quantity}, back after {back:.2} s");
            println!("{row}");
            all += 1;
            within += u32::from(back <= 2.0);
            if lie > LONGEST {
                failed.push(row);
            }
        };
        for (name, change) in &FAULTS {
            let mut sent = clean.clone();
            change.apply(&mut sent[first..last]);
            see(name, &sent, WRONG.end);
        }
        for (name, change, silent) in CLOCKS {
            let mut sent = clean.clone();
            change(&mut sent, first);
            see(name, &sent, clean[first + silent].time);
        }
    }
    println!("{within} of {all} back within two seconds");
    assert!(failed.is_empty(), "{failed:#?}");
    assert!(
        f64::from(within) > 0.9 * f64::from(all),
        "{within} of {all}"
    );
}

#[test]
fn a_clock_of_another_rate_is_named() {
    let (_, sensed) = flights().swap_remove(0);
    for (pace, is_named) in PACES {
        let mut sent = Sent::of(&sensed.bytes);
        for sent in &mut sent {
            sent.ticks = (f64::from(sent.ticks) * pace) as u32;
        }
        let found = fly(&sensed, &sent);
        let named = share(&found, 3.0..LENGTH, EstimateFlags::RATE);
        let agreeing = agreeing(&found, 3.0..LENGTH);
        let (lie, _) = longest_lie(&found, &(0.0..LENGTH));
        println!("{pace}: named {named:.2}, agreeing {agreeing:.2}, lie {lie:.2} s");
        let limits = if is_named { (0.99, 0.0) } else { (0.0, 0.8) };
        assert!(named >= limits.0 && (named > 0.0) == is_named, "{pace}");
        assert!(
            (agreeing > 0.0) != is_named && agreeing >= limits.1,
            "{pace}"
        );
        assert!(lie < LONGEST, "{pace}: {lie}");
    }
}

/// A sensor of rates and forces alone, three seconds at rest before.
const RAW: Raw = Raw {
    rest: 3.0,
    bias: 0.01,
    scale: 0.005,
    magnetometer: None,
};

#[test]
fn nobody_who_is_carried_is_estimated_as_falling() {
    let typical = SensorBytes::TYPICAL;
    let like = Sensed::of_maneuver("exit-and-tracking", 1.0, &typical).unwrap();
    let sensors = [
        ("all sensors", typical, 0.0),
        (
            "no accelerometer",
            SensorBytes {
                specific_force: None,
                ..typical
            },
            0.05,
        ),
        (
            "no orientation",
            SensorBytes {
                raw: Some(RAW),
                ..typical
            },
            0.0,
        ),
        // Nothing tells a velocity then but that of a fall.
        (
            "no receiver",
            SensorBytes {
                receiver_rate: 0.0,
                ..typical
            },
            0.1,
        ),
    ];
    for (name, path) in SITUATIONS {
        for (kind, sensor, most) in &sensors {
            let sensed = carried(&like, path, sensor);
            let found = fly(&sensed, &Sent::of(&sensed.bytes));
            let agreeing = agreeing(&found, 3.0..12.0);
            let named = share(&found, 3.0..12.0, EstimateFlags::SUPPORTED);
            println!("{name}, {kind}: {agreeing:.2} agree, {named:.2} supported");
            assert!(agreeing <= *most, "{name}, {kind}: {agreeing}");
        }
    }
}

/// The posture that a host tells at a frame.
type Told = fn(&[FlightFrame], usize) -> Posture<f64>;

/// What a host may say of the posture, wrongly.
const POSTURES: [(&str, Told); 5] = [
    ("as it is", |frames, at| frames[at].posture),
    ("frozen", |frames, _| frames[0].posture),
    ("frozen in flight", |frames, at| {
        let frozen = frames.partition_point(|frame| frame.time < WRONG.start);
        frames[at.min(frozen)].posture
    }),
    ("stale by a second", |frames, at| {
        frames[at.saturating_sub(120)].posture
    }),
    ("mirrored", |frames, at| frames[at].posture.mirrored()),
];

#[test]
fn a_wrong_posture_misleads_nobody_about_the_motion() {
    for name in ["none-mixed-102", "none-wide-103"] {
        let flight = format!("{name}/flight-0");
        let Some(sensed) = Sensed::of(&flight, LENGTH, &SensorBytes::TYPICAL).unwrap() else {
            return;
        };
        let clean = Sent::of(&sensed.bytes);
        for (kind, posture) in POSTURES {
            let mut sent = clean.clone();
            for (at, sent) in sent.iter_mut().enumerate() {
                let frame = FlightFrame {
                    posture: posture(&sensed.frames, at),
                    ..sensed.frames[at]
                };
                sent.posture = Some(sample_of(&frame));
            }
            let found = fly(&sensed, &sent);
            let (lie, quantity) = longest_lie(&found, &(0.0..LENGTH));
            let agreeing = agreeing(&found, 3.0..LENGTH);
            println!("{name}, {kind}: {agreeing:.2} agree, {lie:.2} s {quantity}");
            // A mirrored posture shows as muscle input that reverses: in the motion nothing is wrong.
            let longest = if quantity == "muscle input" {
                2.0
            } else {
                LONGEST
            };
            assert!(lie <= longest, "{name}, {kind}: {lie} {quantity}");
            assert!(kind != "as it is" || agreeing > 0.9, "{name}: {agreeing}");
        }
    }
}

/// A levelled attitude is integrated, with errors that add up: the error bars include them.
#[test]
fn the_error_bars_of_a_levelled_attitude_hold() {
    let sensor = SensorBytes {
        raw: Some(Raw {
            bias: 0.01,
            scale: 0.01,
            ..RAW
        }),
        ..SensorBytes::TYPICAL
    };
    let (mut squares, mut count) = (0.0, 0.0);
    for seed in 0..6 {
        let sensor = SensorBytes { seed, ..sensor };
        let sensed = Sensed::of_maneuver("exit-and-tracking", 12.0, &sensor).unwrap();
        let shifted: Vec<_> = Sent::of(&sensed.bytes);
        for judged in fly(&sensed, &shifted) {
            if judged.time > 0.0 && judged.is_consistent() {
                let pairs = judged.error[0].iter().zip(&judged.deviation[0]);
                squares += pairs
                    .map(|(error, bar)| f64::from(error / bar).powi(2))
                    .sum::<f64>();
                count += 3.0;
            }
        }
    }
    let mean = squares / count;
    println!("mean square of the attitude's error in its deviations: {mean:.2}, {count}");
    assert!(count > 3000.0 && mean < 1.5, "{mean} of {count}");
}
