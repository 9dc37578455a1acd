//! Images for the unit: building, and looking into them.

use std::path::PathBuf;
use std::process::Command;

use object::{Object, ObjectSection, ObjectSymbol, SectionKind};

use crate::budgets::Board;
use crate::run::{Result, cargo, root, run, say};

/// The unit's processor: Cortex-M4 with single precision hardware.
const TARGET: &str = "thumbv7em-none-eabihf";

/// Builds an image of the workspace and gives its path.
pub(crate) fn build(package: &str, name: &str) -> Result<PathBuf> {
    install_target()?;
    let package = ["--package", package, "--bin", name];
    let rest = ["--target", TARGET, "--profile", "firmware", "--locked"];
    cargo(&[&["build"], &package[..], &rest[..]].concat())?;
    let folder =
        std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from);
    Ok(folder.join(TARGET).join("firmware").join(name))
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

/// Checks an image against its board: vectors where flash begins, sizes, no arithmetic in double precision.
pub(crate) fn check(path: &PathBuf, board: &Board) -> Result<()> {
    let bytes = std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let file =
        object::File::parse(&*bytes).map_err(|error| format!("{}: {error}", path.display()))?;
    let vectors = file
        .section_by_name(".vector_table")
        .ok_or("the image has no vector table")?;
    if vectors.address() != board.flash_origin {
        return Err(format!(
            "the vector table lies at {:#x}, flash begins at {:#x}: another memory.x was linked",
            vectors.address(),
            board.flash_origin
        ));
    }
    let size = |kinds: &[SectionKind]| -> u64 {
        let sections = file
            .sections()
            .filter(|section| kinds.contains(&section.kind()));
        sections.map(|section| section.size()).sum()
    };
    let data = size(&[SectionKind::Data]);
    let flash = size(&[
        SectionKind::Text,
        SectionKind::ReadOnlyData,
        SectionKind::ReadOnlyString,
    ]) + data;
    let static_ram = size(&[SectionKind::UninitializedData]) + data;
    say(&format!(
        "flash {flash} B of {}, static RAM {static_ram} B of {}",
        board.flash_bytes, board.ram_bytes
    ));
    if flash > board.flash_bytes || static_ram > board.static_ram_bytes {
        return Err("the image is larger than budgets.toml allows".into());
    }
    // Conversions of table constants at start-up are no arithmetic.
    let arithmetic = [
        "__aeabi_dadd",
        "__aeabi_dsub",
        "__aeabi_drsub",
        "__aeabi_dmul",
        "__aeabi_ddiv",
    ];
    let names = file
        .symbols()
        .filter_map(|symbol| symbol.name().ok().map(str::to_owned));
    let soft_double: Vec<String> = names
        .filter(|name| arithmetic.contains(&name.as_str()))
        .collect();
    if !soft_double.is_empty() {
        return Err(format!(
            "double precision in software was linked: {soft_double:?}"
        ));
    }
    Ok(())
}
