//! `cargo xtask python`: the Python package, its wheel and its tests; and Python environments for other tasks.

use std::path::{Path, PathBuf};

use crate::run::{PROGRAM, Result, build_full_program, cargo, root, run, run_in, target_folder};

/// Python packages needed to build and test the package.
const REQUIREMENTS: &str = "python/requirements-test.txt";

/// Builds the wheel as `pip install python/` does, installs it in a separate environment, and runs the package's tests.
pub(crate) fn python() -> Result<()> {
    tested_wheel("release").map(|_| ())
}

/// Does the same with a profile, and returns the wheel's path.
pub(crate) fn tested_wheel(profile: &str) -> Result<PathBuf> {
    let python = environment("python", REQUIREMENTS)?;
    let built = wheel(&python, profile)?;
    let python = python.display().to_string();
    let wheel = built.display().to_string();
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
    build_full_program()?;
    let program = target_folder()?.join(PROGRAM);
    let variables = [("BODYFLIGHT", program.display().to_string())];
    run_in(
        &root().join("python"),
        &python,
        &["-m", "pytest", "--quiet"],
        &variables,
    )?;
    Ok(built)
}

/// Builds the wheel in `wheels` of the target folder.
fn wheel(python: &Path, profile: &str) -> Result<PathBuf> {
    let target = target_folder()?;
    let folder = target.join("wheels");
    let _ = std::fs::remove_dir_all(&folder);
    let out = folder.display().to_string();
    let maturin = python.with_file_name("maturin").display().to_string();
    // The module and the library of co-simulation units are built at once: built separately, their dependencies would
    // have other features and be compiled twice.
    let build = ["build", "--profile", profile, "--locked"];
    let both = [
        "--package",
        "bodyflight-python",
        "--package",
        "bodyflight-fmu",
        "--features",
        "bodyflight-python/extension-module",
    ];
    cargo(&[&build[..], &both].concat())?;
    take_library(&target.join(profile))?;
    let arguments = [&build[..], &["--out", &out]].concat();
    run_in(&root().join("python"), &maturin, &arguments, &[])?;
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
