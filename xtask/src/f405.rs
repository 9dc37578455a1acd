//! `cargo xtask f405`: flies the STM32F405's image on an emulated chip and injects faults.

use std::path::Path;

use crate::image;
use crate::page;
use crate::python;
use crate::run::{LIBRARIES, Result, cargo_in, root, target_folder};

/// Python packages that the emulator needs.
const REQUIREMENTS: &str = "firmware/emulator/requirements.txt";

/// Repetitions of each fault in every test run, and for the table in the documentation.
const TIMES: [&str; 2] = ["2", "20"];

/// Tests on the chip; the flight in real time is part of `hil`.
const TESTS: [&str; 3] = ["f405_alone", "f405_chip", "f405_faults"];

/// Runs every test on the emulated chip; `write` puts the table of faults into the documentation.
pub(crate) fn f405(write: bool) -> Result<()> {
    let image = image::build_board("stm32f405", "unit")?;
    image::check(&image, "unit-stm32f405")?;
    let table = target_folder()?.join("f405-faults.md");
    let variables = [
        ("BODYFLIGHT_F405_TABLE", table.display().to_string()),
        (
            "BODYFLIGHT_F405_TIMES",
            TIMES[usize::from(write)].to_owned(),
        ),
    ];
    test(&TESTS, &image, &variables)?;
    if write {
        page::put("faults", &table)?;
    }
    Ok(())
}

/// Streams a flight in real time: nothing may be lost or late, and every estimate must equal the desktop's; then flies with
/// sensors on the limbs alone.
pub(crate) fn paced(seconds: u32) -> Result<()> {
    let image = image::build_board("stm32f405", "unit")?;
    test(
        &["f405_paced", "f405_limbs"],
        &image,
        &[("BODYFLIGHT_F405_SECONDS", seconds.to_string())],
    )
}

/// Runs tests on the chip. They are built with all libraries, so that earlier builds are reused.
fn test(names: &[&str], image: &Path, variables: &[(&str, String)]) -> Result<()> {
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
    let selected: Vec<&str> = names.iter().flat_map(|name| ["--test", name]).collect();
    let options = ["--locked", "--", "--ignored", "--nocapture"];
    let arguments = [&["test"], &LIBRARIES[..], &selected, &options].concat();
    cargo_in(&root(), &arguments, &all)
}
