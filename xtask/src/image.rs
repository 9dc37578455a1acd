//! Builds and inspects images for the unit.

use std::path::{Path, PathBuf};
use std::process::Command;

use object::{Object, ObjectSection, ObjectSymbol, SectionKind};

use crate::budgets::Budgets;
use crate::run::{Result, cargo_in, root, run, say, target_folder};

/// Compiler target of a Cortex-M4 with a single-precision floating-point unit.
const M4: &str = "thumbv7em-none-eabihf";

/// Compiler target of a Cortex-M33 with a single-precision floating-point unit.
const M33: &str = "thumbv8m.main-none-eabihf";

/// Builds an image of the workspace for a Cortex-M4 and returns its path.
pub(crate) fn build(package: &str, name: &str) -> Result<PathBuf> {
    install_target(M4)?;
    let package = ["--package", package, "--bin", name];
    let rest = ["--target", M4, "--profile", "firmware", "--locked"];
    let arguments = [&["build"], &package[..], &rest[..]].concat();
    cargo_in(&root(), &arguments, &[])?;
    Ok(target_folder()?.join(M4).join("firmware").join(name))
}

/// Builds an image of a board with its own workspace, in a separate folder below `boards`, since images of several
/// boards have the same name.
pub(crate) fn build_board(board: &str, name: &str) -> Result<PathBuf> {
    let processor = match board {
        "stm32f405" => M4,
        _ => M33,
    };
    install_target(processor)?;
    let folder = target_folder()?.join("boards");
    let target = folder.display().to_string();
    let arguments = [
        "build",
        "--profile",
        "firmware",
        "--locked",
        "--bin",
        name,
        "--target-dir",
        &target,
    ];
    let source = root().join("firmware/boards").join(board);
    cargo_in(&source, &arguments, &[])?;
    let built = folder.join(processor).join("firmware").join(name);
    let image = folder.join(board).join(name);
    let copy = |from: &Path, to: &Path| {
        std::fs::create_dir_all(folder.join(board)).and_then(|()| std::fs::copy(from, to))
    };
    copy(&built, &image).map_err(|error| format!("{}: {error}", image.display()))?;
    Ok(image)
}

/// Installs a compiler target with rustup if it is missing.
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
        // Without rustup the compiler may still have the target; otherwise the build fails with a clear error.
        Err(_) => Ok(()),
    }
}

/// Checks an image against its budget: vector table at the start of flash, sizes, no double precision.
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
            "the vector table is at {:#x}, but flash starts at {:#x}: another memory.x was linked",
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
    // Test images compute their body from measurements, with tables in double precision; the unit receives its body
    // from the host.
    if name.starts_with("on-target") {
        return Ok(());
    }
    let names = file
        .symbols()
        .filter_map(|symbol| symbol.name().ok().map(str::to_owned));
    let soft_double: Vec<String> = names
        .filter(|symbol| symbol.starts_with("__aeabi_d"))
        .collect();
    if !soft_double.is_empty() {
        return Err(format!(
            "double precision in software was linked: {soft_double:?}"
        ));
    }
    Ok(())
}
