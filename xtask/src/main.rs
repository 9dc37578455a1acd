//! Tasks of the project: `cargo xtask <verb>`.

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
}

fn main() -> ExitCode {
    let result = match Cli::parse().verb {
        Verb::Test => test::test(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            run::say(&format!("failed: {message}"));
            ExitCode::FAILURE
        }
    }
}
