//! Tasks of the project: `cargo xtask <verb>`.

mod budgets;
mod image;
mod on_target;
mod run;
mod test;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

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
    /// Run the core on the unit's processor in QEMU: same bits as here, cost within the budgets.
    OnTarget,
}

fn main() -> ExitCode {
    let result = match Cli::parse().verb {
        Verb::Test => test::test(),
        Verb::OnTarget => on_target::on_target(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            run::say(&format!("failed: {message}"));
            ExitCode::FAILURE
        }
    }
}
