//! `cargo xtask f405`: flies the STM32F405's image on an emulated chip and injects faults.

use std::path::Path;

use crate::image;
use crate::page;
use crate::python;
use crate::run::{Result, cargo_in, root, target_folder};

/// Python packages that the emulator needs.
const REQUIREMENTS: &str = "firmware/emulator/requirements.txt";

/// Runs every test on the emulated chip; `write` puts the table of faults into the documentation.
pub(crate) fn f405(write: bool) -> Result<()> {
    let image = image::build_board("stm32f405", "unit")?;
    image::check(&image, "unit-stm32f405")?;
    let table = target_folder()?.join("f405-faults.md");
    let place = [("BODYFLIGHT_F405_TABLE", table.display().to_string())];
    test("f405_*", &image, &place)?;
    if write {
        page::put("faults", &table)?;
    }
    Ok(())
}

/// Streams a flight in real time: nothing may be lost or late, and every estimate must equal the desktop's.
pub(crate) fn paced(seconds: u32) -> Result<()> {
    let image = image::build_board("stm32f405", "unit")?;
    test(
        "f405_paced",
        &image,
        &[("BODYFLIGHT_F405_SECONDS", seconds.to_string())],
    )
}

/// Runs tests on the chip. They are built with the workspace, so that earlier builds are reused.
fn test(name: &str, image: &Path, variables: &[(&str, String)]) -> Result<()> {
    let mut all = vec![
        ("BODYFLIGHT_F405_IMAGE", image.display().to_string()),
        (
            "BODYFLIGHT_F405_PYTHON",
            python::environment("emulator", REQUIREMENTS)?
                .display()
                .to_string(),
        ),
    ];
    all.extend_from_slice(variables);
    let arguments = [
        "test",
        "--workspace",
        "--locked",
        "--test",
        name,
        "--",
        "--ignored",
        "--nocapture",
    ];
    cargo_in(&root(), &arguments, &all)
}
