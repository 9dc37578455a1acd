//! Injects every kind of fault several times at random moments: the unit must be back within two seconds and report the
//! right cause.

use std::fmt::Write as _;
use std::sync::LazyLock;

use bodyflight_core::link::fault::Random;
use bodyflight_core::link::{HelloAcknowledge, StreamMode};
use bodyflight_emulator::faults::{FAULTS, Fault, two_at_a_time};
use bodyflight_emulator::{Flight, Host, Options, Provoked, RATE};
use bodyflight_firmware::fault::Kind;

/// Repetitions of each fault: five, or as many as `BODYFLIGHT_F405_TIMES` says.
static TIMES: LazyLock<u32> = LazyLock::new(|| {
    let times = std::env::var("BODYFLIGHT_F405_TIMES");
    times.map_or(5, |times| times.parse().unwrap())
});

/// The unit must be back within this time (us).
const BACK: u64 = 2_000_000;
/// Samples until the filter has filled its window and returns estimates.
const WINDOW: u32 = 64;

/// What goes wrong.
#[derive(Clone, Copy, PartialEq)]
enum Wrong {
    /// The unit starts again.
    Restart(Fault),
    /// Errors reported by the receiver.
    Line(&'static str),
    /// A lost frame.
    Drop,
    /// The cable is unplugged and plugged in again.
    Replug,
}

struct Case {
    name: &'static str,
    wrong: Wrong,
}

fn cases() -> Vec<Case> {
    let restarts = FAULTS.map(|fault| (fault.name, Wrong::Restart(fault)));
    let others = [
        ("frame dropped", Wrong::Drop),
        ("noise on a byte", Wrong::Line("noise")),
        ("framing error", Wrong::Line("framing")),
        ("overrun", Wrong::Line("overrun")),
        ("unplugged for a while", Wrong::Replug),
    ];
    let all = restarts.into_iter().chain(others);
    all.map(|(name, wrong)| Case { name, wrong }).collect()
}

struct Row {
    name: &'static str,
    slowest_ms: f64,
    missing: u32,
    faults: Vec<String>,
}

#[test]
#[ignore = "needs the image: cargo xtask f405"]
fn the_unit_is_back_within_two_seconds_and_reports_the_cause() {
    let flight = Flight::of("tracking", "auto").unwrap();
    let cases = cases();
    let rows = two_at_a_time(cases.len(), |index| {
        let row = round(&cases[index], index as u64, &flight);
        eprintln!(
            "{}: slowest {:.0} ms, {} faults",
            row.name,
            row.slowest_ms,
            row.faults.len()
        );
        row
    });
    let faults: Vec<&String> = rows.iter().flat_map(|row| &row.faults).collect();
    let table = table(&rows);
    eprintln!("{table}");
    if let Some(path) = std::env::var_os("BODYFLIGHT_F405_TABLE") {
        std::fs::write(path, &table).unwrap();
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

fn table(rows: &[Row]) -> String {
    let mut text = String::from(
        "| fault | runs | resumed | slowest (ms) | reported correctly | samples missing |\n|---|---|---|---|---|---|\n",
    );
    for row in rows {
        let times = *TIMES as usize;
        let good = times - row.faults.len().min(times);
        writeln!(
            text,
            "| {} | {times} | {good} | {:.0} | {good} | {} |",
            row.name, row.slowest_ms, row.missing
        )
        .unwrap();
    }
    text
}

/// Repeats one fault on its own chip.
fn round(case: &Case, seed: u64, flight: &Flight) -> Row {
    let mut row = Row {
        name: case.name,
        slowest_ms: 0.0,
        missing: 0,
        faults: Vec::new(),
    };
    let mut random = Random::new(seed + 1);
    let options = Options {
        seed,
        ..Options::new()
    };
    let mut host = Host::power(&options, flight).unwrap();
    host.connect(StreamMode::Paced).unwrap();
    host.fly(WINDOW).unwrap();
    for time in 0..*TIMES {
        host.fly(below(&mut random, 20)).unwrap();
        let mut failed = |what: String| row.faults.push(format!("{} {time}: {what}", case.name));
        match go_wrong(case, &mut host, &mut random) {
            Ok((took, missing)) => {
                row.slowest_ms = row.slowest_ms.max(took as f64 / 1e3);
                row.missing += missing;
                if took > BACK {
                    failed(format!("back after {took} us"));
                }
                if matches!(case.wrong, Wrong::Restart(_)) && !host.agreement().holds() {
                    failed(format!("{:?}", host.agreement()));
                }
            }
            Err(what) => {
                failed(what);
                // The next repetition begins with a fresh chip.
                host = Host::power(&options, flight).unwrap();
                host.connect(StreamMode::Paced).unwrap();
                host.fly(WINDOW).unwrap();
            }
        }
    }
    row
}

fn below(random: &mut Random, bound: usize) -> u32 {
    u32::try_from(random.below(bound)).unwrap()
}

/// Injects the fault; returns the time until the next estimate (us) and the number of missing samples.
fn go_wrong(case: &Case, host: &mut Host, random: &mut Random) -> Result<(u64, u32), String> {
    let offset = u64::from(below(random, 1_000_000 / RATE as usize));
    host.listen(host.chip.now() + offset)?;
    let begin = host.chip.now();
    match case.wrong {
        Wrong::Restart(fault) => {
            let before = host.greeting.ok_or("no greeting")?;
            let sent = host.sent();
            let provoked = fault.provoke(&mut host.chip)?;
            let begin = provoked.map_or(begin, |provoked| provoked.at);
            while host
                .greeting
                .is_some_and(|now| now.boot_id == before.boot_id)
            {
                if host.chip.now() > begin + BACK {
                    return Err(format!("silent after it: {:?}", host.chip.look()?));
                }
                host.listen(host.chip.now() + 1_000)?;
            }
            let now = host.greeting.ok_or("no greeting")?;
            check(&fault, &before, &now, sent, provoked)?;
            let resets = host.status.map_or(0, |status| status.watchdog_resets);
            host.connect(StreamMode::Paced)?;
            let more = host.status.map_or(0, |status| status.watchdog_resets) - resets;
            let by_watchdog = u32::from(fault.kind == Some(Kind::Watchdog));
            if fault.kind.is_some() && more != by_watchdog {
                return Err(format!("{more} more starts by the watchdog"));
            }
            host.fly(WINDOW)?;
            back(host, begin, 0)
        }
        Wrong::Line(error) => {
            // Some bytes of a frame are damaged.
            let at = begin + u64::from(below(random, 3_000));
            let noise: Vec<u8> = (0..=below(random, 3))
                .map(|_| random.bits() as u8)
                .collect();
            host.chip.send_broken(at, "host", &noise, error, true)?;
            let before = host.missing()?;
            host.fly(24)?;
            let missing = host.missing()?.wrapping_sub(before);
            let counted = host.status.ok_or("no report")?;
            let counted = if error == "overrun" {
                counted.uart_overrun
            } else {
                counted.uart_framing
            };
            if counted == 0 {
                return Err("the error was not counted".into());
            }
            if missing > 3 {
                return Err(format!("{missing} samples missing"));
            }
            back(host, begin, missing)
        }
        Wrong::Drop => {
            let before = host.missing()?;
            let lost = 1 + below(random, 10);
            let first = host.sent();
            host.fly_harmed(24, |number, frame| {
                (number - first >= lost).then_some(frame)
            })?;
            let missing = host.missing()?.wrapping_sub(before);
            if missing != lost {
                return Err(format!(
                    "{missing} samples missing of {lost} that were dropped"
                ));
            }
            back(host, begin, missing)
        }
        Wrong::Replug => {
            let sparks: Vec<u8> = (0..below(random, 40))
                .map(|_| random.bits() as u8)
                .collect();
            host.chip
                .send_broken(begin, "host", &sparks, "framing", true)?;
            let away = u64::from(below(random, 700_000));
            host.chip
                .send_broken(begin + away, "host", &sparks, "noise", true)?;
            host.listen(begin + away)?;
            host.connect(StreamMode::Paced)?;
            host.fly(WINDOW)?;
            back(host, begin, 0)
        }
    }
}

/// Checks that the unit reports the right cause.
fn check(
    fault: &Fault,
    before: &HelloAcknowledge,
    now: &HelloAcknowledge,
    sent: u32,
    provoked: Option<Provoked>,
) -> Result<(), String> {
    let wrong = |what: &str| Err(format!("{what}: {now:?}, provoked {provoked:?}"));
    if !fault.is_reported(now) {
        return wrong("the cause or the kind");
    }
    if fault.cause == 1 && now.fault_resets != before.fault_resets + 1 {
        return wrong("the count of faults");
    }
    let Some(kind) = fault.kind else {
        return Ok(());
    };
    let address = provoked.map_or(0, |provoked| provoked.address);
    let known = !matches!(kind, Kind::StackOverflow | Kind::Watchdog | Kind::Panic);
    if known && now.fault_address != address || kind == Kind::Panic && now.fault_address == 0 {
        return wrong("the address");
    }
    // The unit is processing the most recent samples.
    if now.fault_sequence >= sent || now.fault_sequence + 8 < sent {
        return wrong("the sample in work");
    }
    Ok(())
}

/// Time from `begin` to the first estimate.
fn back(host: &Host, begin: u64, missing: u32) -> Result<(u64, u32), String> {
    let first = host.estimates.iter().find(|(at, _)| *at > begin);
    let (at, _) = first.ok_or("no estimate after it")?;
    Ok((at - begin, missing))
}
