//! `cargo xtask viewer`: the viewer's page, its tests in a browser, and the pictures of the README.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::image::install_target;
use crate::run::{
    PROGRAM, Result, build_full_program, cargo, cargo_in, root, run, run_in, target_folder,
    without_paths,
};

/// Oldest version of Node that can build the page.
const LEAST_NODE: u32 = 20;

/// Compiler target of the page.
const TARGET: &str = "wasm32-unknown-unknown";

/// Names under which the browser may be installed.
const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

fn folder() -> PathBuf {
    root().join("host/viewer")
}

/// The page that programs include. It is part of the repository, so that nobody needs Node to build a program.
const PAGE: &str = "verbs/data/viewer.html";

/// Builds the page anew.
pub(crate) fn build() -> Result<()> {
    build_to(&root().join(PAGE))
}

/// Builds the page and compares it with the one in the repository.
pub(crate) fn check() -> Result<()> {
    let built = target_folder()?.join("viewer.html");
    build_to(&built)?;
    let read =
        |path: &Path| std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()));
    if read(&built)? == read(&root().join(PAGE))? {
        return Ok(());
    }
    Err(format!(
        "{PAGE} differs from what its sources give: cargo xtask viewer builds it anew"
    ))
}

fn build_to(page: &Path) -> Result<()> {
    install_node()?;
    install_target(TARGET)?;
    let arguments = [
        "build",
        "--locked",
        "--profile",
        "viewer",
        "--package",
        "bodyflight-viewer",
        "--target",
        TARGET,
    ];
    // Messages of dependencies' panics hold the paths of their sources, which differ from machine to machine.
    let flags = (
        "CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUSTFLAGS",
        without_paths()?,
    );
    cargo_in(&root(), &arguments, &[flags])?;
    let wasm = target_folder()?.join(format!("{TARGET}/viewer/bodyflight_viewer.wasm"));
    let wasm = wasm
        .canonicalize()
        .map_err(|error| format!("{}: {error}", wasm.display()))?;
    let folder = folder();
    run_in(&folder, "npm", &["ci", "--no-audit", "--no-fund"], &[])?;
    run_in(&folder, "npm", &["run", "--silent", "check"], &[])?;
    let variables = [
        ("BODYFLIGHT_WASM", wasm.display().to_string()),
        ("BODYFLIGHT_PAGE", page.display().to_string()),
    ];
    run_in(&folder, "npm", &["run", "--silent", "build"], &variables)
}

/// Runs the page's tests in a browser; screenshots are left in `pictures` of the target folder.
pub(crate) fn test() -> Result<()> {
    let browser = install_browser()?;
    build_full_program()?;
    cargo(&[
        "build",
        "--locked",
        "--release",
        "--package",
        "bodyflight-viewer",
        "--example",
        "keys",
    ])?;
    node(
        &browser,
        &[
            "--test",
            "--test-concurrency=1",
            "tests/ticks.test.mjs",
            "tests/replay.test.mjs",
            "tests/fly.test.mjs",
            "tests/coach.test.mjs",
            "tests/compare.test.mjs",
            "tests/live.test.mjs",
            "tests/phone.test.mjs",
        ],
    )
}

/// Makes the pictures of the README, `docs/*.jpg`.
pub(crate) fn pictures() -> Result<()> {
    let browser = install_browser()?;
    build_full_program()?;
    node(&browser, &["pictures.mjs"])
}

fn node(browser: &str, arguments: &[&str]) -> Result<()> {
    let target = target_folder()?;
    let built = |path: &str| target.join(path).display().to_string();
    let variables = [
        ("BODYFLIGHT", built(PROGRAM)),
        ("BODYFLIGHT_NATIVE", built("release/examples/keys")),
        ("BODYFLIGHT_CHROMIUM", browser.to_owned()),
        ("BODYFLIGHT_OUTPUT", built("pictures")),
    ];
    run_in(&folder(), "node", arguments, &variables)
}

fn output_of(program: &str) -> Option<String> {
    let output = Command::new(program)
        .arg("--version")
        .stderr(Stdio::null())
        .output()
        .ok()?;
    output
        .status
        .success()
        .then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Installs Node with npm by apt-get if it is missing.
fn install_node() -> Result<()> {
    let version = || {
        let text = output_of("node")?;
        let major = text.trim().trim_start_matches('v').split('.').next()?;
        major.parse::<u32>().ok()
    };
    let good =
        || version().is_some_and(|version| version >= LEAST_NODE) && output_of("npm").is_some();
    if good() {
        return Ok(());
    }
    if version().is_none() {
        apt_get(&["nodejs", "npm"])?;
    }
    if good() {
        Ok(())
    } else {
        Err(format!(
            "the page needs Node {LEAST_NODE} or later with npm: install it by hand (nodejs.org)"
        ))
    }
}

/// Installs Chromium by apt-get if it is missing.
fn install_browser() -> Result<String> {
    let found = || {
        BROWSERS
            .into_iter()
            .find(|name| output_of(name).is_some())
            .and_then(path_of)
    };
    if let Some(browser) = found() {
        return Ok(browser);
    }
    apt_get(&["chromium"])?;
    found().ok_or_else(|| "no Chromium was found: install it by hand".to_owned())
}

fn path_of(program: &str) -> Option<String> {
    let folders = std::env::var_os("PATH")?;
    let path = std::env::split_paths(&folders)
        .map(|folder| folder.join(program))
        .find(|path| path.is_file())?;
    Some(path.display().to_string())
}

fn apt_get(packages: &[&str]) -> Result<()> {
    let advice = |_| {
        format!(
            "{} is missing and apt-get cannot install it here: install it by hand",
            packages.join(", ")
        )
    };
    run("apt-get", &["update", "-qq"]).map_err(advice)?;
    let arguments = [
        &["install", "-y", "-qq", "--no-install-recommends"],
        packages,
    ]
    .concat();
    run("apt-get", &arguments).map_err(advice)
}
