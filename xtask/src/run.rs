//! Runs other programs and shows what is run.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use serde::Deserialize;

/// A result with an error message in one sentence.
pub(crate) type Result<T> = core::result::Result<T, String>;

/// Prints a line for the user.
pub(crate) fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// The root of the project.
pub(crate) fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The folder that cargo builds into: `target`, unless the environment or cargo's configuration names another one.
pub(crate) fn target_folder() -> Result<&'static Path> {
    static FOLDER: OnceLock<Result<PathBuf>> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| ask_for_target_folder(&[]));
    folder.as_deref().map_err(Clone::clone)
}

fn ask_for_target_folder(variables: &[(&str, &str)]) -> Result<PathBuf> {
    #[derive(Deserialize)]
    struct Metadata {
        target_directory: PathBuf,
    }
    let output = Command::new(cargo_program())
        .args(["metadata", "--no-deps", "--format-version=1"])
        .current_dir(root())
        .envs(variables.iter().copied())
        .output()
        .map_err(|error| format!("cannot start cargo: {error}"))?;
    if !output.status.success() {
        let errors = String::from_utf8_lossy(&output.stderr);
        return Err(format!("cargo metadata: {}: {errors}", output.status));
    }
    let metadata: Metadata = serde_json::from_slice(&output.stdout)
        .map_err(|error| format!("cargo metadata: {error}"))?;
    Ok(metadata.target_directory)
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

/// The compiler's flags that shorten the paths of dependencies' sources. Messages of their panics hold them, and they differ
/// from machine to machine.
pub(crate) fn without_paths() -> Result<String> {
    let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| Some(std::env::home_dir()?.join(".cargo")));
    let sources = home.ok_or("there is no home folder")?.join("registry/src");
    let entries = std::fs::read_dir(&sources);
    let entries = entries.map_err(|error| format!("{}: {error}", sources.display()))?;
    let flags = entries
        .flatten()
        .map(|registry| format!("--remap-path-prefix={}=registry", registry.path().display()));
    Ok(flags.collect::<Vec<_>>().join(" "))
}

/// Runs cargo with these arguments.
pub(crate) fn cargo(arguments: &[&str]) -> Result<()> {
    cargo_in(&root(), arguments, &[])
}

/// What `cargo test` needs to select every crate but the program's: libraries, their features, and tests through their
/// interfaces. With debug assertions; the program itself is tested as it is released, and the Python package by Python.
pub(crate) const LIBRARIES: [&str; 7] = [
    "--workspace",
    "--exclude",
    "bodyflight",
    "--exclude",
    "bodyflight-python",
    "--features",
    "bodyflight-unit/logs,bodyflight-unit/signatures,bodyflight-verbs/export,bodyflight-verbs/figures,bodyflight-verbs/fmu",
];

/// Place of the program in the [target folder](target_folder).
pub(crate) const PROGRAM: &str = "release/bodyflight";

/// Builds the program with everything that the first build leaves out, at [`PROGRAM`].
pub(crate) fn build_full_program() -> Result<()> {
    let program = ["build", "--locked", "--release", "--package", "bodyflight"];
    cargo(&[&program[..], &["--features", "full"]].concat())
}

/// Runs cargo in a folder with these arguments and environment variables.
pub(crate) fn cargo_in(
    folder: &Path,
    arguments: &[&str],
    variables: &[(&str, String)],
) -> Result<()> {
    run_in(folder, &cargo_program(), arguments, variables)
}

fn cargo_program() -> String {
    std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_target_folder_is_the_one_that_cargo_builds_into() {
        let found = ask_for_target_folder(&[("CARGO_TARGET_DIR", "/elsewhere/built")]);
        assert_eq!(found, Ok(PathBuf::from("/elsewhere/built")));
        // This variable sets `build.target-dir` of cargo's configuration, over which CARGO_TARGET_DIR takes precedence.
        if std::env::var_os("CARGO_TARGET_DIR").is_none() {
            let found = ask_for_target_folder(&[("CARGO_BUILD_TARGET_DIR", "/elsewhere/built")]);
            assert_eq!(found, Ok(PathBuf::from("/elsewhere/built")));
        }
    }

    #[test]
    fn this_test_was_built_into_the_target_folder() {
        let folder = target_folder().unwrap().canonicalize().unwrap();
        let test = std::env::current_exe().unwrap().canonicalize().unwrap();
        assert!(test.starts_with(&folder), "{test:?} {folder:?}");
    }
}
