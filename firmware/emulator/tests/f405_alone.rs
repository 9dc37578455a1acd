//! The unit without a host: a stored configuration, power, and the bytes of a sensor and a receiver in real time.
//!
//! The flights are those of an independent simulator (`shared/flights`): its person differs from the one that is
//! configured, and flies in postures that the unit, which assumes the H-pose, does not know.

use std::fmt::Write as _;
use std::sync::LazyLock;

use bodyflight_core::link::fault::Random;
use bodyflight_emulator::faults::{FAULTS, Fault, two_at_a_time};
use bodyflight_emulator::sensed::{Errors, Sensed, is_consistent};
use bodyflight_emulator::{Flight, Host, Options};
use bodyflight_laboratory::sensor_bytes::SensorBytes;

/// The unit must estimate again within this time after a fault (us).
const BACK: u64 = 2_000_000;
/// Time after power-on at which the sensor begins (us).
const BEGIN: u64 = 300_000;

/// What a host would stream; none of it is sent here.
static FLIGHT: LazyLock<Flight> = LazyLock::new(|| Flight::of("tracking", "auto").unwrap());

/// A unit that has been configured and left alone, with its power on since 0.
fn left(sensed: &Sensed, seed: u64) -> Host {
    let options = Options {
        seed,
        ..Options::new()
    };
    let mut host = Host::power(&options, &FLIGHT).unwrap();
    host.store_and_leave(&sensed.setup).unwrap();
    host
}

/// Sends the sensor's bytes of `from` to `to` (s) at the times that follow from `begin` (us); none at all for those that
/// `harm` withholds.
fn play(
    host: &mut Host,
    sensed: &Sensed,
    begin: u64,
    [from, to]: [f64; 2],
    mut harm: impl FnMut(f64, &[u8]) -> Vec<u8>,
) {
    let wanted = sensed
        .bytes
        .iter()
        .filter(|(time, _)| (from..to).contains(time));
    for (time, bytes) in wanted {
        let due = begin + (time * 1e6) as u64;
        let bytes = harm(*time, bytes);
        if !bytes.is_empty() {
            host.chip.send(due, "sensor", &bytes).unwrap();
        }
        host.listen(due).unwrap();
    }
}

/// Errors of the estimates that arrived `from` a time (us) on.
fn errors(host: &Host, sensed: &Sensed, begin: u64, from: u64) -> Errors {
    let late = host.estimates.iter().filter(|(at, _)| *at >= from);
    // The sample is as old as a packet, an update and the estimate's frame take.
    sensed.errors(late.map(|(at, estimate)| ((at - begin) as f64 * 1e-6 - 0.008, estimate)))
}

#[test]
#[ignore = "needs the image: cargo xtask f405"]
fn power_and_a_sensor_are_all_that_the_unit_needs() {
    let mut table = String::from(
        "| flight | estimates | consistent | velocity, horizontal, vertical (m/s) | attitude (deg) |\n|---|---|---|---|---|\n",
    );
    for name in ["none-slow-101/flight-0", "wind-slow-104/flight-0"] {
        let Some(sensed) = Sensed::of(name, 9.0, &SensorBytes::TYPICAL).unwrap() else {
            return;
        };
        let mut host = left(&sensed, 3);
        let begin = host.chip.now() + BEGIN;
        play(&mut host, &sensed, begin, [0.0, 8.9], |_, bytes| {
            bytes.to_vec()
        });
        host.listen(begin + 9_000_000).unwrap();
        assert_eq!(host.resets.len(), 1, "restarted: {:?}", host.resets);
        // The first two seconds belong to the start: the receiver has to answer.
        let from = begin + 2_000_000;
        let found = errors(&host, &sensed, begin, from);
        writeln!(
            table,
            "| {name} | {} | {:.0} % | {:.2}, {:.2} | {:.2} |",
            found.count,
            100.0 * found.consistent,
            found.horizontal,
            found.vertical,
            found.attitude.to_degrees()
        )
        .unwrap();
        eprintln!("{table}");
        assert!(found.count > 6.5 * 28.0, "{found:?}");
        assert!(found.horizontal < 0.4 && found.vertical < 0.8, "{found:?}");
        assert!(found.attitude < 0.02, "{found:?}");
        // The host comes back after the landing.
        let flown = host.estimates.len();
        host.greet().unwrap();
        let (flights, damaged) = host.log().unwrap();
        assert_eq!(damaged, 0);
        let read: usize = flights.iter().map(|flight| flight.lengths()[1]).sum();
        // What is still in memory is not in the log: a quarter of a second.
        assert!(
            (flown - 30..=flown + 10).contains(&read),
            "{read} of {flown}"
        );
    }
    eprintln!("{table}");
}

/// What goes wrong without a host.
#[derive(Clone, Copy)]
enum Wrong {
    /// The unit starts again.
    Restart(Fault),
    /// Errors on the sensor's line.
    Line(&'static str),
    /// Packets of the sensor lost.
    Drop,
    /// The sensor's cable is unplugged for up to 0.7 s.
    Replug,
    /// The sensor restarts: its counter and clock begin again.
    SensorRestart,
}

/// Each fault by its name.
fn cases() -> Vec<(&'static str, Wrong)> {
    let restarts = FAULTS.map(|fault| (fault.name, Wrong::Restart(fault)));
    let others = [
        ("noise on the sensor's line", Wrong::Line("noise")),
        ("framing error on the sensor's line", Wrong::Line("framing")),
        ("overrun on the sensor's line", Wrong::Line("overrun")),
        ("packets of the sensor lost", Wrong::Drop),
        ("sensor unplugged for a while", Wrong::Replug),
        ("sensor restarts", Wrong::SensorRestart),
    ];
    restarts.into_iter().chain(others).collect()
}

struct Row {
    slowest_ms: f64,
    faults: Vec<String>,
}

#[test]
#[ignore = "needs the image: cargo xtask f405"]
fn the_unit_alone_is_back_within_two_seconds_and_reports_the_cause() {
    // A repetition begins with a flight of its own, which takes five times as long as one with a host.
    let times = std::env::var("BODYFLIGHT_F405_TIMES").map_or(5, |times| times.parse().unwrap());
    let times: usize = (times / 5).max(1);
    let Some(sensed) = Sensed::of("none-slow-101/flight-0", 6.0, &SensorBytes::TYPICAL).unwrap()
    else {
        return;
    };
    let cases = cases();
    let rows = two_at_a_time(cases.len(), |index| {
        let (name, wrong) = cases[index];
        let row = round(name, wrong, index as u64, times, &sensed);
        let faults = row.faults.len();
        eprintln!("alone, {name}: {:.0} ms, {faults} faults", row.slowest_ms);
        row
    });
    let mut table = String::from(
        "| fault, without a host | runs | back within 2 s and right | slowest (ms) |\n|---|---|---|---|\n",
    );
    for ((name, _), row) in cases.iter().zip(&rows) {
        let good = times - row.faults.len().min(times);
        writeln!(
            table,
            "| {name} | {times} | {good} | {:.0} |",
            row.slowest_ms
        )
        .unwrap();
    }
    eprintln!("{table}");
    let faults: Vec<_> = rows.iter().flat_map(|row| &row.faults).collect();
    assert!(faults.is_empty(), "{faults:#?}");
}

/// Repeats one fault, each time on a fresh flight of a few seconds.
fn round(name: &str, wrong: Wrong, seed: u64, times: usize, sensed: &Sensed) -> Row {
    let mut random = Random::new(seed + 77);
    let mut row = Row {
        slowest_ms: 0.0,
        faults: Vec::new(),
    };
    for time in 0..times {
        let mut host = left(sensed, seed);
        match go_wrong(&mut host, sensed, wrong, &mut random) {
            Ok(took) => {
                row.slowest_ms = row.slowest_ms.max(took as f64 / 1e3);
                if took > BACK {
                    row.faults
                        .push(format!("{name} {time}: back after {took} us"));
                }
            }
            Err(what) => row.faults.push(format!("{name} {time}: {what}")),
        }
    }
    row
}

/// Flies 1 to 2 s, injects the fault, flies on for 2.8 s; returns the time until the next good estimate (us).
fn go_wrong(
    host: &mut Host,
    sensed: &Sensed,
    wrong: Wrong,
    random: &mut Random,
) -> Result<u64, String> {
    let begin = host.chip.now() + BEGIN;
    let at = 1.0 + random.below(1000) as f64 * 1e-3;
    let end = at + 2.8;
    play(host, sensed, begin, [0.0, at], |_, bytes| bytes.to_vec());
    let fault_at = host.chip.now();
    let before = host.greeting.ok_or("no greeting")?;
    if !host
        .estimates
        .iter()
        .any(|(_, estimate)| is_consistent(estimate))
    {
        return Err("no good estimate before it".into());
    }
    let mut begun = fault_at;
    let mut away = 0.0;
    match wrong {
        Wrong::Restart(fault) => {
            let provoked = fault.provoke(&mut host.chip)?;
            begun = provoked.map_or(fault_at, |provoked| provoked.at);
        }
        Wrong::Line(error) => {
            let noise: Vec<u8> = (0..=random.below(8)).map(|_| random.bits() as u8).collect();
            host.chip
                .send_broken(fault_at + 500, "sensor", &noise, error, true)?;
        }
        Wrong::Drop => away = 0.01 * (1 + random.below(10)) as f64,
        Wrong::Replug => {
            let sparks: Vec<u8> = (0..random.below(40)).map(|_| random.bits() as u8).collect();
            host.chip
                .send_broken(fault_at, "sensor", &sparks, "framing", true)?;
            away = 0.001 * random.below(700) as f64;
        }
        Wrong::SensorRestart => {}
    }
    let restarted = matches!(wrong, Wrong::SensorRestart);
    play(host, sensed, begin, [at + away, end], |_, bytes| {
        if restarted {
            from_zero(bytes, at, f64::from(sensed.setup.configure.sample_rate))
        } else {
            bytes.to_vec()
        }
    });
    host.listen(begin + (end * 1e6) as u64 + 50_000)?;
    if let Wrong::Restart(fault) = wrong {
        let now = host.greeting.ok_or("no greeting")?;
        if now.boot_id == before.boot_id {
            return Err("it did not start again".into());
        }
        if !fault.is_reported(&now) {
            return Err(format!("it reports {now:?}"));
        }
    } else if host.resets.len() > 1 {
        return Err(format!("it started again: {:?}", host.resets));
    }
    let resumed = begun + (away * 1e6) as u64;
    let next = host
        .estimates
        .iter()
        .find(|(at, estimate)| *at > resumed + 5_000 && is_consistent(estimate));
    let (back, _) = next.ok_or("no good estimate after it")?;
    let took = back - begun;
    // From two seconds later on it is right.
    let found = errors(host, sensed, begin, begun + BACK);
    if found.horizontal > 0.6 || found.vertical > 1.2 || found.attitude > 0.03 {
        return Err(format!("wrong: {found:?}"));
    }
    Ok(took - (away * 1e6) as u64)
}

/// A packet of a sensor that began to count at `begin` (s): its counter and clock are the first two items.
fn from_zero(bytes: &[u8], begin: f64, rate: f64) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let rate_ticks = (begin * 10_000.0) as u32;
    let ticks = u32::from_be_bytes(bytes[12..16].try_into().unwrap()) - rate_ticks;
    bytes[12..16].copy_from_slice(&ticks.to_be_bytes());
    let counter = (f64::from(ticks) * 1e-4 * rate).round() as u16;
    bytes[7..9].copy_from_slice(&counter.to_be_bytes());
    let length = usize::from(bytes[3]) + 5;
    bytes[length - 1] = 0;
    let sum = bytes[1..length]
        .iter()
        .fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    bytes[length - 1] = sum.wrapping_neg();
    bytes
}
