//! Tasks of the project: `cargo xtask <verb>`.

mod book;
mod budgets;
mod f405;
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
    /// Pass every test: on this machine, and for the unit's processor. Installs what is missing.
    Test,
    /// Run the core on the boards' processors in QEMU: same bits as here, cost within the budgets.
    OnTarget,
    /// Build the images of the unit for all boards, check their sizes, and make what is flashed without a probe.
    Unit,
    /// Run the image for the STM32F405 on an emulated chip: the desktop's estimates, and back after every fault.
    F405 {
        /// Write the table of faults into docs/unit.md.
        #[arg(long)]
        table: bool,
    },
    /// Hide effects, look for them, and write how often they were found: docs/discovery.json, its tables and figure.
    DiscoveryBench {
        /// Seeds, of some 280 pairs of flights each.
        #[arg(long, default_value_t = 1)]
        seeds: u32,
        /// The first of them.
        #[arg(long, default_value_t = 0)]
        first_seed: u32,
        /// Forget the pairs that were flown before.
        #[arg(long)]
        fresh: bool,
    },
    /// Build the viewer's page, which the program takes in when it is built next.
    Viewer {
        /// Pass its tests in a browser too.
        #[arg(long)]
        test: bool,
        /// Make the pictures of the README too.
        #[arg(long)]
        pictures: bool,
    },
    /// Stream a flight to the unit in QEMU, on the emulated STM32F405 and to the virtual unit: nothing lost, nothing late,
    /// the same bits.
    Hil {
        /// Seconds of flight, at the rate of the recording.
        #[arg(long, default_value_t = 30)]
        seconds: u32,
    },
    /// Build the Python package, install its wheel in an environment of its own, and run its tests.
    Python,
    /// Fuzz what takes bytes of strangers, by coverage: a minute each. Installs a nightly compiler and cargo-fuzz.
    Fuzz {
        /// Targets; all where none is named.
        targets: Vec<String>,
        /// Inputs for each, in place of a minute.
        #[arg(long)]
        runs: Option<u64>,
        /// Seconds for each.
        #[arg(long, default_value_t = 60, conflicts_with = "runs")]
        seconds: u64,
    },
    /// Run tests of the core in miri, little-endian and big-endian. Installs a nightly compiler.
    Miri,
    /// Hours of streaming in virtual time through faults, restarts and clocks that wrap; killed processes, full disks.
    Soak {
        /// Hours of flight.
        #[arg(long, default_value_t = 1)]
        hours: u32,
        /// Write what estimates were worth by the hour into docs/unit.md.
        #[arg(long)]
        table: bool,
    },
    /// Build everything that is handed out: programs, man pages, wheel, images, list of parts, checksums.
    Release,
    /// Build the pages as a book, and follow its links.
    Book,
    /// Check lock files, licences and sources of what the program is made of, and list it: sbom.json.
    Supply {
        /// Look up known holes too, which needs a network.
        #[arg(long)]
        advisories: bool,
    },
}

fn main() -> ExitCode {
    let result = match Cli::parse().verb {
        Verb::Test => test::test(),
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
        Verb::Release => release::release(),
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
