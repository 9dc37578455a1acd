//! `cargo xtask hil`: hardware in the loop without hardware.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use serde::Deserialize;

use crate::on_target::install_qemu;
use crate::run::{Result, cargo, root, say};
use crate::unit::unit;

/// What a stream reports, as far as it is judged here.
#[derive(Deserialize)]
struct Report {
    sent: u32,
    flight_s: f64,
    wall_s: f64,
    estimates: Estimates,
    latency: Latency,
    unit: Unit,
    log_lines: Option<u64>,
    log_malformed: Option<u64>,
}

#[derive(Deserialize)]
struct Estimates {
    expected: u64,
    equal: u64,
}

#[derive(Deserialize)]
struct Latency {
    median_ms: f64,
    p99_ms: f64,
}

#[derive(Deserialize)]
struct Unit {
    missing: u32,
    dropped_oldest: u32,
    deadline_missed: u32,
    stack_free: u32,
}

/// Times the machine is stopped, and for how long: as many samples come meanwhile as the unit has places, twice over.
const HALTS: u32 = 3;
const HALT: Duration = Duration::from_millis(300);

/// Attempts with the virtual unit: a process of a busy machine may be stopped for longer than its queue lasts.
const ATTEMPTS: u32 = 3;

/// Streams a flight to the unit in QEMU and to the virtual unit, at its own rate and then through faults; QEMU also
/// with halts, which a busy desktop is full of.
pub(crate) fn hil(seconds: u32) -> Result<()> {
    let image = unit()?;
    install_qemu()?;
    cargo(&["build", "--locked", "--package", "bodyflight"])?;
    let folder = root().join("target/hil");
    let flight = folder.join("flight.toml");
    bodyflight(
        &["synth", "tracking", "--seed", "1", "--out"],
        &[&folder],
        |_| {},
    )?;
    let seconds = seconds.to_string();
    let image = image.display().to_string();
    for target in [vec!["--qemu", &image], vec!["--virtual"]] {
        let name = target[0];
        let mut arguments = vec!["--json", "stream", "--seconds", &seconds];
        arguments.extend(&target);
        if name == "--qemu" {
            at_own_rate(name, &arguments, &flight, |_| {})?;
            at_own_rate(name, &arguments, &flight, halt)?;
        } else {
            let mut attempt = 1;
            while let Err(why) = at_own_rate(name, &arguments, &flight, |_| {}) {
                if attempt == ATTEMPTS {
                    return Err(why);
                }
                attempt += 1;
                say(&format!("{why}; is the machine busy? once more"));
            }
        }
        // Damaged, lost and overtaken frames; the desktop is given the same.
        let faults = ["--drop", "0.05", "--corrupt", "0.05", "--reorder", "0.02"];
        arguments.extend(faults);
        arguments.extend(["--speed", "max"]);
        let report = stream(&arguments, &flight, |_| {})?;
        say(&format!(
            "{name} through faults: {} samples, {} missing; {} of {} estimates equal",
            report.sent, report.unit.missing, report.estimates.equal, report.estimates.expected
        ));
    }
    Ok(())
}

/// The flight at its own rate: everything arrives, in time, and is logged.
fn at_own_rate(
    name: &str,
    arguments: &[&str],
    flight: &Path,
    beside: impl FnOnce(u32),
) -> Result<()> {
    let Report {
        sent,
        flight_s,
        wall_s,
        estimates,
        latency,
        unit,
        log_lines,
        log_malformed,
    } = stream(arguments, flight, beside)?;
    say(&format!(
        "{name}: {flight_s:.1} s of flight in {wall_s:.1} s; {sent} samples, {} missing, {} dropped; \
         {} of {} estimates equal, {} deadline misses; latency {:.2} ms, 99 % {:.2} ms; stack free {} B",
        unit.missing,
        unit.dropped_oldest,
        estimates.equal,
        estimates.expected,
        unit.deadline_missed,
        latency.median_ms,
        latency.p99_ms,
        unit.stack_free,
    ));
    if unit.missing + unit.dropped_oldest + unit.deadline_missed > 0 {
        return Err(format!(
            "{name}: {} samples missing, {} dropped, {} deadlines missed",
            unit.missing, unit.dropped_oldest, unit.deadline_missed
        ));
    }
    if estimates.expected == 0 {
        return Err(format!("{name}: no estimates"));
    }
    match (name, log_lines, log_malformed) {
        ("--qemu", Some(1..), Some(0)) | ("--virtual", None, None) => Ok(()),
        (_, lines, malformed) => Err(format!(
            "{name}: {lines:?} log lines and {malformed:?} malformed: expected some, and none"
        )),
    }
}

/// Stops the children of a process now and then: the machine that the program has started.
fn halt(process: u32) {
    let signal = |name| {
        let line = format!("kill -{name} $(cat /proc/{process}/task/{process}/children)");
        let status = Command::new("sh").args(["-c", &line]).status();
        if !status.is_ok_and(|status| status.success()) {
            say(&format!("the machine could not be sent {name}: no halt"));
        }
    };
    for _ in 0..HALTS {
        std::thread::sleep(Duration::from_secs(1));
        signal("STOP");
        std::thread::sleep(HALT);
        signal("CONT");
    }
}

fn stream(arguments: &[&str], flight: &Path, beside: impl FnOnce(u32)) -> Result<Report> {
    let output = bodyflight(arguments, &[flight], beside)?;
    serde_json::from_str(&output).map_err(|error| format!("the report: {error}"))
}

/// Runs the program that was built and `beside` it, which is told its process; what it prints.
fn bodyflight(arguments: &[&str], paths: &[&Path], beside: impl FnOnce(u32)) -> Result<String> {
    let shown: Vec<String> = paths
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    let line = format!("bodyflight {} {}", arguments.join(" "), shown.join(" "));
    say(&format!("$ {line}"));
    let failed = |error| format!("{line}: {error}");
    let child = Command::new(root().join("target/debug/bodyflight"))
        .args(arguments)
        .args(paths)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(failed)?;
    beside(child.id());
    let output = child.wait_with_output().map_err(failed)?;
    if !output.status.success() {
        let errors = String::from_utf8_lossy(&output.stderr);
        return Err(format!("{line}: {}: {errors}", output.status));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
