//! `cargo xtask test`.

use std::process::Command;

use crate::run::{Result, cargo, run};

/// The unit's processor: Cortex-M4 with single precision hardware.
const TARGET: &str = "thumbv7em-none-eabihf";

/// Every test of the project.
pub(crate) fn test() -> Result<()> {
    install_target()?;
    cargo(&["test", "--workspace", "--locked"])?;
    cargo(&[
        "build",
        "--package",
        "bodyflight-core",
        "--target",
        TARGET,
        "--release",
        "--locked",
    ])
}

/// The compiler's target for the unit, by rustup where it is missing.
fn install_target() -> Result<()> {
    let installed = Command::new("rustup")
        .args(["target", "list", "--installed"])
        .output();
    match installed {
        Ok(output)
            if String::from_utf8_lossy(&output.stdout)
                .lines()
                .any(|line| line == TARGET) =>
        {
            Ok(())
        }
        Ok(_) => run("rustup", &["target", "add", TARGET]),
        // Without rustup the compiler may still have the target; the build will tell.
        Err(_) => Ok(()),
    }
}
