//! Tasks of the project: `cargo xtask <verb>`.

mod book;
mod budgets;
mod f405;
mod first_build;
mod hil;
mod image;
mod nightly;
mod on_target;
mod page;
mod python;
mod release;
mod run;
mod soak;
mod supply;
mod test;
mod tool;
mod uf2;
mod unit;
mod viewer;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use nightly::Effort;

/// Tasks of the project.
#[derive(Parser)]
#[command(name = "cargo xtask")]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Run every test, on this machine and for the unit's processor. Installs what is missing.
    Test,
    /// Count the crates of the README's first command and measure its processor time, in a fresh target folder.
    FirstBuild,
    /// Run the core on the boards' processors in QEMU: same bits as on this machine, cost within the budgets.
    OnTarget,
    /// Build the unit's images for all boards, check their sizes, and write files for flashing without a probe.
    Unit,
    /// Run the image for the STM32F405 on an emulated chip: it must give the desktop's estimates and recover from every
    /// fault.
    F405 {
        /// Write the table of faults into docs/unit.md.
        #[arg(long)]
        table: bool,
    },
    /// Hide effects, search for them, and write the success rates: docs/discovery.json, its tables and figure.
    DiscoveryBench {
        /// Number of seeds, each with about 280 pairs of flights.
        #[arg(long, default_value_t = 1)]
        seeds: u32,
        /// First seed.
        #[arg(long, default_value_t = 0)]
        first_seed: u32,
        /// Discard the results of earlier runs.
        #[arg(long)]
        fresh: bool,
    },
    /// Build the viewer's page, which the next build of the program includes.
    Viewer {
        /// Also run its tests in a browser.
        #[arg(long)]
        test: bool,
        /// Also make the pictures of the README.
        #[arg(long)]
        pictures: bool,
    },
    /// Stream a flight to the unit in QEMU, on the emulated STM32F405 and to the virtual unit: nothing may be lost or
    /// late, and the bits must be the same.
    Hil {
        /// Seconds of flight, in real time.
        #[arg(long, default_value_t = 30)]
        seconds: u32,
    },
    /// Build the Python package, install its wheel in a separate environment, and run its tests.
    Python,
    /// Fuzz all parsers of untrusted bytes, guided by coverage, for a minute each. Installs a nightly compiler and
    /// cargo-fuzz.
    Fuzz {
        /// Targets; all if none is named.
        targets: Vec<String>,
        /// Number of inputs for each, instead of a minute.
        #[arg(long)]
        runs: Option<u64>,
        /// Seconds for each.
        #[arg(long, default_value_t = 60, conflicts_with = "runs")]
        seconds: u64,
    },
    /// Run tests of the core in miri, little-endian and big-endian. Installs a nightly compiler.
    Miri,
    /// Stream for hours of virtual time through faults, restarts and wrapping clocks; kill processes, fill disks.
    Soak {
        /// Hours of flight.
        #[arg(long, default_value_t = 1)]
        hours: u32,
        /// Write the quality of the estimates by the hour into docs/unit.md.
        #[arg(long)]
        table: bool,
    },
    /// Build everything that is published: programs, man pages, wheel, images, bill of materials, checksums.
    Release {
        /// Instead, build the program of the last commit twice, in different folders, and compare the bytes.
        #[arg(long)]
        reproduce: bool,
    },
    /// Build the pages as a book and check its links.
    Book,
    /// Check lock files, licences and sources of all dependencies, and list them in sbom.json.
    Supply {
        /// Also check for known vulnerabilities, which needs a network.
        #[arg(long)]
        advisories: bool,
    },
}

fn main() -> ExitCode {
    let result = match Cli::parse().verb {
        Verb::Test => test::test(),
        Verb::FirstBuild => first_build::first_build(),
        Verb::OnTarget => on_target::on_target(),
        Verb::Unit => unit::unit().map(|_| ()),
        Verb::F405 { table } => f405::f405(table),
        Verb::DiscoveryBench {
            seeds,
            first_seed,
            fresh,
        } => {
            let bench = "bench --package bodyflight-benches --bench discovery --";
            let seeds = format!("--seeds {seeds} --first-seed {first_seed}");
            let fresh = if fresh { "--fresh" } else { "" };
            let words = [bench, &seeds, fresh].join(" ");
            run::cargo(&words.split_whitespace().collect::<Vec<_>>())
        }
        Verb::Viewer { test, pictures } => viewer::build()
            .and_then(|()| if test { viewer::test() } else { Ok(()) })
            .and_then(|()| if pictures { viewer::pictures() } else { Ok(()) }),
        Verb::Hil { seconds } => hil::hil(seconds),
        Verb::Python => python::python(),
        Verb::Fuzz {
            targets,
            runs,
            seconds,
        } => {
            let effort = runs.map_or(Effort::Seconds(seconds), Effort::Runs);
            nightly::fuzz(&targets, effort)
        }
        Verb::Miri => nightly::miri(),
        Verb::Soak { hours, table } => soak::soak(hours, table),
        Verb::Release { reproduce: true } => release::reproduce(),
        Verb::Release { reproduce: false } => release::release(),
        Verb::Book => book::book(),
        Verb::Supply { advisories } => supply::supply(advisories),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            run::say(&format!("failed: {message}"));
            ExitCode::FAILURE
        }
    }
}
