//! `cargo xtask release`: builds everything that is published, in one folder.

use std::path::{Path, PathBuf};

use crate::image::install_target;
use crate::python;
use crate::run::{Result, cargo_in, root, run, run_in, say, target_folder, without_paths};
use crate::supply;
use crate::unit::unit;
use crate::viewer;

/// Targets for which programs are built. All code is Rust and linked by the toolchain's own linker, without a C
/// compiler.
const MACHINES: [&str; 2] = ["x86_64-unknown-linux-musl", "aarch64-unknown-linux-musl"];

/// Files next to the program in an archive.
const BESIDE: [&str; 4] = ["README.md", "CHANGELOG.md", "LICENSE-MIT", "LICENSE-APACHE"];

/// Shells whose completions are in an archive, and the names of their files.
const SHELLS: [[&str; 2]; 3] = [
    ["bash", "bodyflight.bash"],
    ["zsh", "_bodyflight"],
    ["fish", "bodyflight.fish"],
];

/// Builds programs with their page, man pages and completions, the wheel, images for boards, and the bill of materials
/// into `release` of the target folder, with checksums.
pub(crate) fn release() -> Result<()> {
    let folder = target_folder()?.join("release-files");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).map_err(failed(&folder))?;
    viewer::check()?;
    let programs = MACHINES
        .map(|machine| build_program(&root(), target_folder()?, machine))
        .into_iter()
        .collect::<Result<Vec<_>>>()?;
    // Man pages are written by the program that runs on this machine.
    let native = programs.first().ok_or("no program was built")?;
    let pages = target_folder()?.join("release-pages");
    write_pages(native, &pages)?;
    for (machine, program) in MACHINES.iter().zip(&programs) {
        archive(machine, program, &pages, &folder)?;
    }
    for file in unit()?.flashed {
        let board = file.parent().and_then(Path::file_name).unwrap_or_default();
        let name = format!("bodyflight-{}-{}", board.display(), name_of(&file));
        copy(&file, &folder.join(name))?;
    }
    let wheel = python::tested_wheel("dist")?;
    copy(&wheel, &folder.join(name_of(&wheel)))?;
    copy(&supply::list_parts()?, &folder.join("sbom.json"))?;
    checksums(&folder)?;
    say(&format!("release: {}", folder.display()));
    Ok(())
}

fn failed(path: &Path) -> impl Fn(std::io::Error) -> String {
    let path = path.to_owned();
    move |error| format!("{}: {error}", path.display())
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    std::fs::copy(from, to).map_err(failed(from))?;
    Ok(())
}

fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// Builds the program of the sources in `folder`, and returns its path below the folder `target`.
fn build_program(folder: &Path, target: &Path, machine: &str) -> Result<PathBuf> {
    install_target(machine)?;
    let variable = format!("CARGO_TARGET_{}", machine.to_uppercase().replace('-', "_"));
    let [linker, flags] = ["LINKER", "RUSTFLAGS"].map(|of| format!("{variable}_{of}"));
    let variables = [
        (linker.as_str(), "rust-lld".to_owned()),
        (&flags, without_paths()?),
        ("CARGO_TARGET_DIR", target.display().to_string()),
    ];
    let arguments = [
        "build",
        "--profile",
        "dist",
        "--locked",
        "--package",
        "bodyflight",
        "--features",
        "full",
        "--target",
        machine,
    ];
    cargo_in(folder, &arguments, &variables)?;
    Ok(target.join(machine).join("dist/bodyflight"))
}

/// Builds the program of the last commit twice, in folders of different names, and compares the bytes.
pub(crate) fn reproduce() -> Result<()> {
    let [machine, _] = MACHINES;
    let stage = target_folder()?.join("reproduced");
    std::fs::create_dir_all(&stage).map_err(failed(&stage))?;
    // One archive for both: a commit may be made between them.
    let archive = stage.join("sources.tar").display().to_string();
    run("git", &["archive", "--output", &archive, "HEAD"])?;
    let mut programs = Vec::new();
    for name in ["one", "another-one"] {
        let folder = stage.join(name);
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).map_err(failed(&folder))?;
        run(
            "tar",
            &["-xf", &archive, "-C", &folder.display().to_string()],
        )?;
        let program = build_program(&folder, &folder.join("target"), machine)?;
        programs.push(std::fs::read(&program).map_err(failed(&program))?);
    }
    let [one, other] = &programs[..] else {
        return Err("expected two programs".to_owned());
    };
    if one != other {
        return Err(format!(
            "the two programs differ, {} and {} bytes: see {}",
            one.len(),
            other.len(),
            stage.display()
        ));
    }
    say(&format!(
        "two builds of {machine} are equal: {} bytes",
        one.len()
    ));
    Ok(())
}

/// Man pages and completions, as the program itself writes them.
fn write_pages(program: &Path, folder: &Path) -> Result<()> {
    let _ = std::fs::remove_dir_all(folder);
    let program = program.display().to_string();
    let man = folder.join("man");
    run(&program, &["man", "--out", &man.display().to_string()])?;
    let completions = folder.join("completions");
    std::fs::create_dir_all(&completions).map_err(failed(&completions))?;
    for [shell, name] in SHELLS {
        let output = std::process::Command::new(&program)
            .args(["completions", shell])
            .output()
            .map_err(|error| format!("{program}: {error}"))?;
        let file = completions.join(name);
        std::fs::write(&file, output.stdout).map_err(failed(&file))?;
    }
    Ok(())
}

/// Packs `bodyflight-VERSION-MACHINE.tar.gz`, which contains one folder.
fn archive(machine: &str, program: &Path, pages: &Path, folder: &Path) -> Result<()> {
    let [major, minor, patch] = bodyflight_core::VERSION;
    let name = format!("bodyflight-{major}.{minor}.{patch}-{machine}");
    let stage = target_folder()?.join("release-stage");
    let inside = stage.join(&name);
    let _ = std::fs::remove_dir_all(&stage);
    std::fs::create_dir_all(&inside).map_err(failed(&inside))?;
    copy(program, &inside.join("bodyflight"))?;
    for file in BESIDE {
        copy(&root().join(file), &inside.join(file))?;
    }
    for part in ["man", "completions"] {
        let part = pages.join(part).display().to_string();
        run("cp", &["-r", &part, &inside.display().to_string()])?;
    }
    let file = folder.join(format!("{name}.tar.gz")).display().to_string();
    // The same bytes whenever and by whomever it is packed.
    run(
        "tar",
        &[
            "--sort=name",
            "--mtime=@0",
            "--owner=0",
            "--group=0",
            "--numeric-owner",
            "--use-compress-program=gzip -n",
            "-cf",
            &file,
            "-C",
            &stage.display().to_string(),
            &name,
        ],
    )
}

/// Writes `SHA256SUMS` for `sha256sum --check`.
fn checksums(folder: &Path) -> Result<()> {
    let entries = std::fs::read_dir(folder).map_err(failed(folder))?;
    let mut names: Vec<String> = entries
        .flatten()
        .map(|entry| name_of(&entry.path()))
        .collect();
    names.sort();
    let output = std::process::Command::new("sha256sum")
        .args(&names)
        .current_dir(folder)
        .output()
        .map_err(|error| format!("sha256sum: {error}"))?;
    let file = folder.join("SHA256SUMS");
    std::fs::write(&file, output.stdout).map_err(failed(&file))?;
    run_in(
        folder,
        "sha256sum",
        &["--check", "--quiet", "SHA256SUMS"],
        &[],
    )
}
