//! The command line: one file per verb, for its arguments and output. The work itself is in the library.

mod airborne;
mod arguments;
mod compare;
mod demo;
mod discover;
mod estimate;
mod export;
mod fall;
mod figures;
mod fly;
mod fmu;
mod hide;
mod import;
mod inspect;
mod interrupt;
mod monitor;
mod mvn;
mod outputs;
mod ports;
mod reproduce;
mod schema;
mod sensitivity;
mod several;
#[cfg_attr(not(feature = "full"), path = "cli/without_shell.rs")]
mod shell;
mod simulate;
mod slimevr;
mod stream;
mod synth;
mod technique;
mod terminal;
mod trim;
mod tune;
mod unit;
mod validate;
mod view;
mod watch;

use std::ffi::OsString;

use bodyflight_io::diagnostic::{Kind, Problem, Result};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

/// Simulate, estimate and stream human body flight.
#[derive(Parser)]
#[command(
    name = "bodyflight",
    version,
    after_help = "Exit codes: 0 done, 2 bad input or usage, 3 refused by the system, 4 disagreement, 5 an estimate that should not be trusted, 130 Ctrl-C.\n\
                  Start with: bodyflight demo"
)]
struct Cli {
    /// Print the result as JSON, and errors as one line of JSON on standard error.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    Demo(demo::Args),
    Airborne(airborne::Args),
    Import(import::Args),
    Compare(compare::Args),
    Inspect(inspect::Args),
    Simulate(simulate::Args),
    Reproduce(reproduce::Args),
    Sensitivity(sensitivity::Args),
    Technique(technique::Args),
    Estimate(estimate::Args),
    Export(export::Args),
    Trim(trim::Args),
    Synth(synth::Args),
    Tune(tune::Args),
    Discover(discover::Args),
    Hide(hide::Args),
    View(view::Args),
    Fall(fall::Args),
    Fly(fly::Args),
    Figures(figures::Args),
    Fmu(fmu::Args),
    Stream(stream::Args),
    Unit(unit::Args),
    Validate(validate::Args),
    Ports(ports::Args),
    Monitor(monitor::Args),
    Mvn(mvn::Args),
    Slimevr(slimevr::Args),
    Schema(schema::Args),
    Completions(shell::Completions),
    Man(shell::Man),
}

/// Runs the verb that the arguments name, and returns the exit code. The first argument is the program's name.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments = terminal::keep_arguments(arguments);
    let cli = match parsed(arguments) {
        Ok(cli) => cli,
        Err(error) => return terminal::print_usage(&error),
    };
    let json = cli.json;
    interrupt::listen(move || terminal::print_problem(Problem::interrupted(), json));
    match run(&cli).and_then(|()| terminal::finish()) {
        // For verbs that run until Ctrl-C this is success, but the exit code still stops a script that calls them.
        Ok(()) if bodyflight_io::interrupt::requested() => Kind::Interrupted.exit_code(),
        Ok(()) => 0,
        Err(problem) => {
            let code = problem.kind.exit_code();
            terminal::print_problem(problem, json);
            code
        }
    }
}

/// The command line as shells and the parser see it.
fn command() -> clap::Command {
    arguments::with_negative_numbers(Cli::command())
}

fn parsed(arguments: &[OsString]) -> core::result::Result<Cli, clap::Error> {
    let matches = command().try_get_matches_from(arguments)?;
    Cli::from_arg_matches(&matches)
}

fn run(cli: &Cli) -> Result<()> {
    match &cli.verb {
        Verb::Demo(args) => demo::run(args, cli.json),
        Verb::Airborne(args) => airborne::run(args, cli.json),
        Verb::Compare(args) => compare::run(args, cli.json),
        Verb::Import(args) => import::run(args, cli.json),
        Verb::Inspect(args) => inspect::run(args, cli.json),
        Verb::Simulate(args) => simulate::run(args, cli.json),
        Verb::Reproduce(args) => reproduce::run(args, cli.json),
        Verb::Sensitivity(args) => sensitivity::run(args, cli.json),
        Verb::Technique(args) => technique::run(args, cli.json),
        Verb::Estimate(args) => estimate::run(args, cli.json),
        Verb::Export(args) => export::run(args, cli.json),
        Verb::Trim(args) => trim::run(args, cli.json),
        Verb::Synth(args) => synth::run(args, cli.json),
        Verb::Tune(args) => tune::run(args, cli.json),
        Verb::Discover(args) => discover::run(args, cli.json),
        Verb::Hide(args) => hide::run(args, cli.json),
        Verb::View(args) => view::run(args, cli.json),
        Verb::Fall(args) => fall::run(args, cli.json),
        Verb::Fly(args) => fly::run(args, cli.json),
        Verb::Figures(args) => figures::run(args, cli.json),
        Verb::Fmu(args) => fmu::run(args, cli.json),
        Verb::Stream(args) => stream::run(args, cli.json),
        Verb::Validate(args) => validate::run(args, cli.json),
        Verb::Unit(args) => unit::run(args, cli.json),
        Verb::Ports(args) => ports::run(args, cli.json),
        Verb::Monitor(args) => monitor::run(args, cli.json),
        Verb::Mvn(args) => mvn::run(args, cli.json),
        Verb::Slimevr(args) => slimevr::run(args, cli.json),
        Verb::Schema(args) => schema::run(args, cli.json),
        Verb::Completions(args) => shell::completions(args, command()),
        Verb::Man(args) => shell::man(args, command(), cli.json),
    }
}
