//! `cargo xtask python`: the Python package, its wheel and its tests; and Python environments for other tasks.

use std::path::{Path, PathBuf};

use crate::run::{Result, build_program, cargo_in, root, run, run_in, target_folder};
use crate::viewer;

/// Python packages needed to build and test the package.
const REQUIREMENTS: &str = "python/requirements-test.txt";

/// Builds the wheel, installs it in a separate environment, and runs the package's tests with it.
pub(crate) fn python() -> Result<()> {
    // The program in the wheel includes the page.
    if !root().join("host/viewer/dist/viewer.html").is_file() {
        viewer::build()?;
    }
    let python = environment("python", REQUIREMENTS)?;
    let wheel = wheel(&python)?;
    let python = python.display().to_string();
    let wheel = wheel.display().to_string();
    let pip = [
        "-m",
        "pip",
        "install",
        "--quiet",
        "--no-deps",
        "--force-reinstall",
    ];
    run(
        &python,
        &[&pip[..], &["--disable-pip-version-check", &wheel]].concat(),
    )?;
    build_program()?;
    let program = target_folder()?.join("debug/bodyflight");
    let variables = [("BODYFLIGHT", program.display().to_string())];
    run_in(
        &root().join("python"),
        &python,
        &["-m", "pytest", "--quiet"],
        &variables,
    )
}

/// Builds the wheel alone and returns its path.
pub(crate) fn build_wheel() -> Result<PathBuf> {
    wheel(&environment("python", REQUIREMENTS)?)
}

/// Builds the wheel in `wheels` of the target folder.
fn wheel(python: &Path) -> Result<PathBuf> {
    let target = target_folder()?;
    let folder = target.join("wheels");
    let _ = std::fs::remove_dir_all(&folder);
    let out = folder.display().to_string();
    let maturin = python.with_file_name("maturin").display().to_string();
    // The folder is shared with the workspace; profiles keep their builds apart.
    let variables = [(
        "CARGO_TARGET_DIR",
        target.join("python").display().to_string(),
    )];
    // The module and the library of co-simulation units are built at once: built separately, their dependencies would
    // have other features and be compiled twice.
    let feature = "--features=bodyflight-python/extension-module";
    let both = ["build", "--release", "--locked", "--workspace", feature];
    cargo_in(&root().join("python"), &both, &variables)?;
    take_library(&target.join("python/release"))?;
    let arguments = ["build", "--release", "--locked", "--out", &out];
    run_in(&root().join("python"), &maturin, &arguments, &variables)?;
    let entries = std::fs::read_dir(&folder).map_err(|error| format!("{out}: {error}"))?;
    let mut wheels = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let found = wheels.find(|path| path.extension().is_some_and(|end| end == "whl"));
    found.ok_or_else(|| format!("{out}: maturin built no wheel"))
}

/// Copies the library of co-simulation units to the package's files.
fn take_library(built: &Path) -> Result<()> {
    use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
    let name = format!("{DLL_PREFIX}bodyflight_fmu{DLL_SUFFIX}");
    let to = root().join("python/lib/bodyflight").join(&name);
    let from = built.join(&name);
    std::fs::copy(&from, &to)
        .map(|_| ())
        .map_err(|error| format!("{}: {error}", from.display()))
}

/// Creates an environment in the target folder with the packages of a requirements file; returns its Python.
pub(crate) fn environment(name: &str, requirements: &str) -> Result<PathBuf> {
    let folder = target_folder()?.join("environments").join(name);
    let python = folder.join("bin/python");
    let requirements = root().join(requirements);
    let wanted = std::fs::read_to_string(&requirements)
        .map_err(|error| format!("{}: {error}", requirements.display()))?;
    let marker = folder.join("installed.txt");
    if std::fs::read_to_string(&marker).is_ok_and(|installed| installed == wanted) {
        return Ok(python);
    }
    let advice = |error| format!("{error}: this task needs Python 3.10 with venv and pip");
    run("python3", &["-m", "venv", &folder.display().to_string()]).map_err(advice)?;
    let list = requirements.display().to_string();
    let pip = [
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
        "-r",
        &list,
    ];
    run(&python.display().to_string(), &pip).map_err(advice)?;
    std::fs::write(&marker, wanted).map_err(|error| format!("{}: {error}", marker.display()))?;
    Ok(python)
}
