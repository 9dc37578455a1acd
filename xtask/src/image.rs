//! Images for the unit: building, and looking into them.

use std::path::{Path, PathBuf};
use std::process::Command;

use object::{Object, ObjectSection, ObjectSymbol, SectionKind};

use crate::budgets::Budgets;
use crate::run::{Result, cargo_in, root, run, say, target_folder};

/// The unit's processor: Cortex-M4 with single precision hardware.
const TARGET: &str = "thumbv7em-none-eabihf";

/// Builds an image of the workspace and gives its path.
pub(crate) fn build(package: &str, name: &str) -> Result<PathBuf> {
    install_target(TARGET)?;
    let package = ["--package", package, "--bin", name];
    let rest = ["--target", TARGET, "--profile", "firmware", "--locked"];
    let arguments = [&["build"], &package[..], &rest[..]].concat();
    cargo_in(&root(), &arguments, &[])?;
    Ok(target_folder()?.join(TARGET).join("firmware").join(name))
}

/// Builds the image of a board that is a workspace of its own.
pub(crate) fn build_board(board: &str) -> Result<PathBuf> {
    install_target(TARGET)?;
    let folder = target_folder()?.join("boards");
    let target = folder.display().to_string();
    let arguments = [
        "build",
        "--profile",
        "firmware",
        "--locked",
        "--target-dir",
        &target,
    ];
    let board = root().join("firmware/boards").join(board);
    cargo_in(&board, &arguments, &[])?;
    Ok(folder.join(TARGET).join("firmware").join("unit"))
}

/// A target of the compiler, by rustup where it is missing.
pub(crate) fn install_target(target: &str) -> Result<()> {
    let installed = Command::new("rustup")
        .args(["target", "list", "--installed"])
        .output();
    match installed {
        Ok(output)
            if String::from_utf8_lossy(&output.stdout)
                .lines()
                .any(|line| line == target) =>
        {
            Ok(())
        }
        Ok(_) => run("rustup", &["target", "add", target]),
        // Without rustup the compiler may still have the target; the build will tell.
        Err(_) => Ok(()),
    }
}

/// Checks an image against its budget: vectors where flash begins, sizes, nothing in double precision.
pub(crate) fn check(path: &Path, name: &str) -> Result<()> {
    let budgets = Budgets::read()?;
    let (budget, board) = budgets.image(name)?;
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
        "{name}: flash {flash} B of {}, static RAM {static_ram} B of {}, board {} B",
        budget.flash_bytes, budget.static_ram_bytes, board.ram_bytes
    ));
    if flash > budget.flash_bytes || static_ram > budget.static_ram_bytes {
        return Err("the image is larger than budgets.toml allows".into());
    }
    let names = file
        .symbols()
        .filter_map(|symbol| symbol.name().ok().map(str::to_owned));
    // The image of the tests makes its body from measures, by tables in double precision.
    let converts = |symbol: &str| name == "on-target" && symbol == "__aeabi_d2f";
    let soft_double: Vec<String> = names
        .filter(|symbol| symbol.starts_with("__aeabi_d") && !converts(symbol))
        .collect();
    if !soft_double.is_empty() {
        return Err(format!(
            "double precision in software was linked: {soft_double:?}"
        ));
    }
    Ok(())
}
