//! Running other programs, visibly.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What went wrong, in a sentence.
pub(crate) type Result<T> = core::result::Result<T, String>;

/// Writes a line for the person who started the task.
pub(crate) fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// The root of the project.
pub(crate) fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Runs a command in the root of the project; its output goes to the terminal.
pub(crate) fn run(program: &str, arguments: &[&str]) -> Result<()> {
    run_in(&root(), program, arguments, &[])
}

/// Runs a command in a folder, with environment variables.
pub(crate) fn run_in(
    folder: &Path,
    program: &str,
    arguments: &[&str],
    variables: &[(&str, String)],
) -> Result<()> {
    let line = format!("{program} {}", arguments.join(" "));
    say(&format!("$ {line}"));
    let status = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .envs(variables.iter().map(|(name, value)| (name, value)))
        .status()
        .map_err(|error| format!("cannot start {program}: {error}"))?;
    if status.success() {
        Ok(())
    } else {
        Err(format!("{line}: {status}"))
    }
}

/// Runs cargo with these arguments.
pub(crate) fn cargo(arguments: &[&str]) -> Result<()> {
    cargo_in(&root(), arguments, &[])
}

/// Builds the program, `target/debug/bodyflight`.
pub(crate) fn build_program() -> Result<()> {
    build_as_tested(&["--bin", "bodyflight"])
}

/// Builds a part of the workspace as `cargo test --workspace` does: what that has built is not built again.
pub(crate) fn build_as_tested(part: &[&str]) -> Result<()> {
    let workspace = ["build", "--locked", "--profile", "test", "--workspace"];
    // With one of the tests: what tests depend on switches on features of what the program depends on.
    let a_test = ["--test", "cli"];
    cargo(&[&workspace[..], part, &a_test].concat())
}

/// Runs cargo in a folder with these arguments and environment variables.
pub(crate) fn cargo_in(
    folder: &Path,
    arguments: &[&str],
    variables: &[(&str, String)],
) -> Result<()> {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    run_in(folder, &cargo, arguments, variables)
}
