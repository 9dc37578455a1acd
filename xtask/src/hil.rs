//! `cargo xtask hil`: a hardware-in-the-loop test that needs no hardware.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde::Deserialize;

use crate::f405;
use crate::on_target::install_qemu;
use crate::run::{
    LIBRARIES, PROGRAM, Result, build_full_program, cargo_in, root, run, say, target_folder,
};
use crate::unit::unit;

/// The fields of a stream's report that are checked here.
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

impl Unit {
    fn was_behind(&self) -> bool {
        self.deadline_missed + self.dropped_oldest > 0
    }
}

/// Presets of both filters: the motion filter, and the paper's reduced one.
const PRESETS: [&str; 2] = ["auto", "tracking"];

/// Number and duration of pauses of the machine; more samples arrive during a pause than the unit can queue.
const HALTS: u32 = 3;
const HALT: Duration = Duration::from_millis(300);

/// Flies the unit in QEMU alone. Streams a flight to the unit in QEMU and to the virtual unit, in real time and then with
/// faults; in QEMU also with pauses, as on a busy desktop.
pub(crate) fn hil(seconds: u32) -> Result<()> {
    let images = unit()?;
    let image = images.qemu;
    install_qemu()?;
    fly_alone(&images.alone)?;
    build_full_program()?;
    let folder = target_folder()?.join("hil");
    let flight = folder.join("flight.toml");
    Running::start(
        &["synth", "tracking", "--seed", "1", "--force", "--out"],
        &folder,
    )?
    .output()?;
    f405::paced(seconds)?;
    let seconds = seconds.to_string();
    let image = image.display().to_string();
    for target in [vec!["--qemu", &image], vec!["--virtual"]] {
        for preset in PRESETS {
            let mut arguments = vec![
                "--json",
                "stream",
                "--preset",
                preset,
                "--seconds",
                &seconds,
            ];
            arguments.extend(&target);
            stream_well(&arguments, &flight)?;
            if preset == PRESETS[0] {
                stream_badly(arguments, &flight)?;
            }
        }
    }
    Ok(())
}

/// Flies the unit in QEMU with a stored configuration and the bytes of its sensor.
fn fly_alone(image: &Path) -> Result<()> {
    let selected = [
        "--locked",
        "--test",
        "qemu_alone",
        "--",
        "--ignored",
        "--nocapture",
    ];
    let arguments = [&["test"], &LIBRARIES[..], &selected].concat();
    let variables = [("BODYFLIGHT_QEMU_IMAGE", image.display().to_string())];
    cargo_in(&root(), &arguments, &variables)
}

/// Streams the flight in real time.
fn stream_well(arguments: &[&str], flight: &Path) -> Result<()> {
    let mut report = stream(arguments, flight)?;
    // On a busy machine a process may be paused for longer than a deadline, so a second attempt is allowed.
    for _ in 0..2 {
        if is_virtual(arguments) && report.unit.was_behind() {
            say("the unit was late because the machine is busy; retrying");
            report = stream(arguments, flight)?;
        }
    }
    judge(arguments, &report)
}

/// Streams the flight on a machine with pauses, with damaged, lost and reordered frames; the desktop receives the same.
fn stream_badly(mut arguments: Vec<&str>, flight: &Path) -> Result<()> {
    if !is_virtual(&arguments) {
        let running = Running::start(&arguments, flight)?;
        running.halt_machine()?;
        judge(&arguments, &running.report()?)?;
    }
    let faults = ["--drop", "0.05", "--corrupt", "0.05", "--reorder", "0.02"];
    arguments.extend(faults);
    arguments.extend(["--speed", "max"]);
    let report = stream(&arguments, flight)?;
    say(&format!(
        "through faults: {} samples, {} missing; {} of {} estimates equal",
        report.sent, report.unit.missing, report.estimates.equal, report.estimates.expected
    ));
    if report.unit.dropped_oldest > 0 {
        return Err("samples were dropped on credit".into());
    }
    Ok(())
}

fn is_virtual(arguments: &[&str]) -> bool {
    arguments.contains(&"--virtual")
}

/// Checks a stream in real time: everything arrives in time, and is logged.
fn judge(arguments: &[&str], report: &Report) -> Result<()> {
    let name = if is_virtual(arguments) {
        "virtual"
    } else {
        "qemu"
    };
    let Report {
        sent,
        flight_s,
        wall_s,
        estimates,
        latency,
        unit,
        log_lines,
        log_malformed,
    } = report;
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
        ("qemu", Some(1..), Some(0)) | ("virtual", None, None) => Ok(()),
        (_, lines, malformed) => Err(format!(
            "{name}: {lines:?} log lines and {malformed:?} malformed: expected log lines, none of them malformed"
        )),
    }
}

fn stream(arguments: &[&str], flight: &Path) -> Result<Report> {
    Running::start(arguments, flight)?.report()
}

/// A running instance of the program.
struct Running {
    line: String,
    child: Child,
}

impl Running {
    fn start(arguments: &[&str], path: &Path) -> Result<Self> {
        let line = format!("bodyflight {} {}", arguments.join(" "), path.display());
        say(&format!("$ {line}"));
        let child = Command::new(target_folder()?.join(PROGRAM))
            .args(arguments)
            .arg(path)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| format!("{line}: {error}"))?;
        Ok(Self { line, child })
    }

    /// Repeatedly pauses the machine that the program has started.
    fn halt_machine(&self) -> Result<()> {
        let process = self.child.id();
        let signal = |name| {
            let line = format!("kill -{name} $(cat /proc/{process}/task/{process}/children)");
            run("sh", &["-c", &line])
        };
        for _ in 0..HALTS {
            std::thread::sleep(Duration::from_secs(1));
            signal("STOP")?;
            std::thread::sleep(HALT);
            signal("CONT")?;
        }
        Ok(())
    }

    /// Returns its output.
    fn output(self) -> Result<String> {
        self.end()
            .and_then(|(printed, failure)| failure.map_or(Ok(printed), Err))
    }

    /// Returns its report if it succeeds or if the unit dropped samples, which the caller judges.
    fn report(self) -> Result<Report> {
        let (printed, failure) = self.end()?;
        let report: core::result::Result<Report, _> = serde_json::from_str(&printed);
        match (report, failure) {
            (Ok(report), None) => Ok(report),
            (Ok(report), Some(_)) if report.unit.dropped_oldest > 0 => Ok(report),
            (_, Some(failure)) => Err(failure),
            (Err(error), None) => Err(format!("the report: {error}")),
        }
    }

    /// Returns its output, and the error if it failed.
    fn end(self) -> Result<(String, Option<String>)> {
        let Self { line, child } = self;
        let output = child
            .wait_with_output()
            .map_err(|error| format!("{line}: {error}"))?;
        let errors = String::from_utf8_lossy(&output.stderr);
        let failure = format!("{line}: {}: {errors}", output.status);
        let printed = String::from_utf8_lossy(&output.stdout).into_owned();
        Ok((printed, (!output.status.success()).then_some(failure)))
    }
}
