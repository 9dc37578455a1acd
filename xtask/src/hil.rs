//! `cargo xtask hil`: hardware in the loop without hardware.

use std::path::Path;
use std::process::Command;

use serde::Deserialize;

use crate::on_target::install_qemu;
use crate::run::{Result, cargo, root, say};
use crate::unit::unit;

/// What a stream reports, as far as it is judged here.
#[derive(Deserialize)]
struct Report {
    sent: u32,
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

/// Streams a flight to the unit in QEMU and to the virtual unit, at its own rate and then through faults.
pub(crate) fn hil(seconds: u32) -> Result<()> {
    let image = unit()?;
    install_qemu()?;
    cargo(&["build", "--locked", "--package", "bodyflight"])?;
    let folder = root().join("target/hil");
    let flight = folder.join("flight.toml");
    bodyflight(&["synth", "tracking", "--seed", "1", "--out"], &[&folder])?;
    let seconds = seconds.to_string();
    let image = image.display().to_string();
    for target in [vec!["--qemu", &image], vec!["--virtual"]] {
        let name = target[0];
        let mut arguments = vec!["--json", "stream", "--seconds", &seconds];
        arguments.extend(&target);
        let mut report = stream(&arguments, &flight)?;
        // A process of a busy machine may be stopped for longer than a deadline; a machine of its own is not.
        for _ in 0..2 {
            if name == "--virtual" && report.unit.deadline_missed > 0 {
                say("deadlines missed: the machine is busy, once more");
                report = stream(&arguments, &flight)?;
            }
        }
        say(&format!(
            "{name}: {} samples, {} missing, {} dropped; {} of {} estimates equal, {} deadline misses; \
             latency {:.2} ms, 99 % {:.2} ms; stack free {} B",
            report.sent,
            report.unit.missing,
            report.unit.dropped_oldest,
            report.estimates.equal,
            report.estimates.expected,
            report.unit.deadline_missed,
            report.latency.median_ms,
            report.latency.p99_ms,
            report.unit.stack_free,
        ));
        judge(name, &report)?;
        // Damaged, lost and overtaken frames; the desktop is given the same.
        let faults = ["--drop", "0.05", "--corrupt", "0.05", "--reorder", "0.02"];
        arguments.extend(faults);
        arguments.extend(["--speed", "max"]);
        let report = stream(&arguments, &flight)?;
        say(&format!(
            "{name} through faults: {} samples, {} missing; {} of {} estimates equal",
            report.sent, report.unit.missing, report.estimates.equal, report.estimates.expected
        ));
    }
    Ok(())
}

/// The flight at its own rate: everything arrives, in time, and is logged.
fn judge(name: &str, report: &Report) -> Result<()> {
    let Unit {
        missing,
        dropped_oldest,
        deadline_missed,
        ..
    } = report.unit;
    if missing + dropped_oldest + deadline_missed > 0 {
        return Err(format!(
            "{name}: {missing} samples missing, {dropped_oldest} dropped, {deadline_missed} deadlines missed"
        ));
    }
    if report.estimates.expected == 0 {
        return Err(format!("{name}: no estimates"));
    }
    match (name, report.log_lines, report.log_malformed) {
        ("--qemu", Some(1..), Some(0)) | ("--virtual", None, None) => Ok(()),
        (_, lines, malformed) => Err(format!(
            "{name}: {lines:?} log lines and {malformed:?} malformed: expected some, and none"
        )),
    }
}

fn stream(arguments: &[&str], flight: &Path) -> Result<Report> {
    let output = bodyflight(arguments, &[flight])?;
    serde_json::from_str(&output).map_err(|error| format!("the report: {error}"))
}

/// Runs the program that was built; what it prints.
fn bodyflight(arguments: &[&str], paths: &[&Path]) -> Result<String> {
    let shown: Vec<String> = paths
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    let line = format!("bodyflight {} {}", arguments.join(" "), shown.join(" "));
    say(&format!("$ {line}"));
    let output = Command::new(root().join("target/debug/bodyflight"))
        .args(arguments)
        .args(paths)
        .output()
        .map_err(|error| format!("{line}: {error}"))?;
    if !output.status.success() {
        let errors = String::from_utf8_lossy(&output.stderr);
        return Err(format!("{line}: {}: {errors}", output.status));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
