//! `cargo xtask on-target`: runs the core in QEMU on each kind of processor, compares its bits with the host's and its
//! cost with the budgets.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use bodyflight_core::Body;
use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::estimator::full::Full;
use bodyflight_core::estimator::reduced::Reduced;
use bodyflight_core::estimator::trace;

use crate::budgets::Budgets;
use crate::image;
use crate::run::{Result, run, say};

const QEMU: &str = "qemu-system-arm";
const LONGEST_RUN: Duration = Duration::from_secs(120);

/// A QEMU machine and the options that select it.
struct Machine {
    board: &'static str,
    arguments: &'static [&'static str],
}

const M4: Machine = Machine {
    board: "qemu-lm3s6965",
    arguments: &["-M", "lm3s6965evb", "-cpu", "cortex-m4"],
};

const M33: Machine = Machine {
    board: "qemu-an505",
    arguments: &["-M", "mps2-an505"],
};

/// Builds the images, checks them, runs them, compares.
pub(crate) fn on_target() -> Result<()> {
    let budgets = Budgets::read()?;
    install_qemu()?;
    let image = image::build("board-qemu-lm3s6965", "on-target")?;
    image::check(&image, "on-target")?;
    judge(&budgets, &M4, &image)?;
    let image = image::build_board(M33.board, "on-target")?;
    image::check(&image, "on-target-m33")?;
    judge(&budgets, &M33, &image)?;
    overflow()?;
    logging()
}

fn judge(budgets: &Budgets, machine: &Machine, image: &Path) -> Result<()> {
    let found = run_image(machine, image)?;
    compare_traces(&found)?;
    compare_costs(budgets.costs(machine.board)?, budgets, &found)
}

/// A stack overflow on a processor with a stack limit must be reported as such, with the sample being processed.
fn overflow() -> Result<()> {
    let image = image::build_board(M33.board, "overflow")?;
    let found = run_image(&M33, &image)?;
    let told = ["reset_cause", "fault_kind", "fault_sequence"].map(|name| found.get(name));
    say(&format!("overflow: cause, kind and sample {told:?}"));
    if told.map(|value| value.map(String::as_str)) != [Some("1"), Some("3"), Some("4711")] {
        return Err("the stack overflow was not reported as one".into());
    }
    Ok(())
}

/// A panic within the logger, which panics again when the first is logged, must be reported once and as the first.
fn logging() -> Result<()> {
    let image = image::build_board(M33.board, "logging")?;
    let found = run_image(&M33, &image)?;
    let told = [
        "reset_cause",
        "fault_kind",
        "fault_sequence",
        "fault_resets",
    ];
    let told = told.map(|name| found.get(name).map(String::as_str));
    let place = found.get("fault_place").map_or("", String::as_str);
    say(&format!(
        "panic while logging: cause, kind, sample and resets {told:?} at {place}"
    ));
    if told != [Some("1"), Some("1"), Some("4712"), Some("1")] || !place.contains("logging.rs:") {
        return Err("the panic within the logger was not reported as one".into());
    }
    Ok(())
}

/// Installs QEMU for ARM with apt-get if it is missing.
pub(crate) fn install_qemu() -> Result<()> {
    let version = Command::new(QEMU)
        .arg("--version")
        .stdout(Stdio::null())
        .status();
    if version.is_ok_and(|status| status.success()) {
        return Ok(());
    }
    let advice =
        |_| format!("{QEMU} is missing and apt-get cannot install it here: install it by hand");
    run("apt-get", &["update", "-qq"]).map_err(advice)?;
    run("apt-get", &["install", "-y", "-qq", "qemu-system-arm"]).map_err(advice)
}

/// Runs an image and returns its output lines `name value`. One instruction takes 128 ns of virtual time.
fn run_image(machine: &Machine, image: &Path) -> Result<BTreeMap<String, String>> {
    say(&format!("$ {QEMU} … {}", image.display()));
    let mut child = Command::new(QEMU)
        .args(machine.arguments)
        .args(["-nographic", "-monitor", "none"])
        .args([
            "-serial",
            "null",
            "-semihosting-config",
            "enable=on,target=native",
        ])
        .args(["-icount", "shift=7,sleep=off", "-kernel"])
        .arg(image)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| format!("cannot start {QEMU}: {error}"))?;
    // With a wrong memory map the image never exits.
    let begin = Instant::now();
    while child
        .try_wait()
        .map_err(|error| error.to_string())?
        .is_none()
    {
        if begin.elapsed() > LONGEST_RUN {
            let _ = child.kill();
            return Err(format!(
                "the image did not end within {} s",
                LONGEST_RUN.as_secs()
            ));
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let output = child
        .wait_with_output()
        .map_err(|error| error.to_string())?;
    let text = String::from_utf8_lossy(&output.stdout);
    if !output.status.success() {
        let errors = String::from_utf8_lossy(&output.stderr);
        return Err(format!(
            "the image failed ({}): {text}{errors}",
            output.status
        ));
    }
    let pairs = text.lines().filter_map(|line| line.split_once(' '));
    Ok(pairs
        .map(|(name, value)| (name.to_owned(), value.to_owned()))
        .collect())
}

fn compare_traces(found: &BTreeMap<String, String>) -> Result<()> {
    let body: Body<f32> = Person::new(1.75, 75.0, Sex::Male)
        .body()
        .map_err(|e| e.to_string())?;
    let hash = |hash: core::result::Result<u64, _>| hash.map_err(|error| format!("{error:?}"));
    let reduced = hash(trace::hash::<Reduced, 30>(&body, 40))?;
    let paper = hash(trace::hash::<Full, 12>(&body, 8))?;
    for (name, here) in [
        ("trace_reduced", reduced),
        ("trace_paper", paper),
        // No number in the filter is subnormal, so flushing subnormals changes nothing.
        ("trace_reduced_flushed", reduced),
    ] {
        let here = format!("{here:#018x}");
        let there = found
            .get(name)
            .ok_or_else(|| format!("the image does not print {name}"))?;
        say(&format!("{name}: host {here}, unit {there}"));
        if *there != here {
            return Err(format!("{name}: the unit's bits differ from the host's"));
        }
    }
    Ok(())
}

fn compare_costs(
    most: &BTreeMap<String, u64>,
    budgets: &Budgets,
    found: &BTreeMap<String, String>,
) -> Result<()> {
    let measured = found.keys().filter(|name| !name.starts_with("trace_"));
    if let Some(name) = measured.into_iter().find(|name| !most.contains_key(*name)) {
        return Err(format!("budgets.toml has no row for {name}"));
    }
    let mut over = Vec::new();
    for (name, budget) in most {
        let value = found
            .get(name)
            .ok_or_else(|| format!("the image does not print {name}"))?;
        let cost: u64 = value
            .parse()
            .map_err(|error| format!("{name}: {value}: {error}"))?;
        say(&format!("{name:24} {cost:>8} of {budget}"));
        if !budgets.allows(*budget, cost) {
            over.push(name.as_str());
        }
    }
    if over.is_empty() {
        Ok(())
    } else {
        Err(format!("over budget: {}", over.join(", ")))
    }
}
