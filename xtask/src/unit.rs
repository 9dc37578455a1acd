//! `cargo xtask unit`: the images of the unit, and files for flashing without a probe.

use std::path::PathBuf;

use crate::image;
use crate::run::{Result, say};
use crate::uf2;

/// Images of boards that are separate workspaces: board, program and display name.
const IMAGES: [[&str; 3]; 3] = [
    ["stm32f405", "unit", "image for the STM32F405"],
    ["rp2350-pico2", "node", "node for a limb"],
    ["rp2350-pico2", "unit", "image for the Raspberry Pi Pico 2"],
];

/// Images of the unit.
pub(crate) struct Images {
    /// Image that QEMU runs with a host.
    pub(crate) qemu: PathBuf,
    /// Image that QEMU runs with storage, without a host.
    pub(crate) alone: PathBuf,
    /// Images of the boards, each as ELF and in the format of its bootloader, in a folder named after the board.
    pub(crate) flashed: Vec<PathBuf>,
}

/// Builds and checks the images for all boards.
pub(crate) fn unit() -> Result<Images> {
    let mut flashed = Vec::new();
    for [board, program, name] in IMAGES {
        let image = image::build_board(board, program)?;
        image::check(&image, &format!("{program}-{board}"))?;
        say(&format!("{name}: {}", image.display()));
        let (file, way) = if board == "rp2350-pico2" {
            (
                uf2::convert(&image, uf2::RP2350)?,
                "to be copied to its drive",
            )
        } else {
            (uf2::flatten(&image)?, "for its boot loader")
        };
        say(&format!("{way}: {}", file.display()));
        flashed.extend([image, file]);
    }
    let qemu = image::build("board-qemu-lm3s6965", "unit")?;
    image::check(&qemu, "unit")?;
    say(&format!("image for QEMU: {}", qemu.display()));
    let alone = image::build_board("qemu-an505", "unit")?;
    image::check(&alone, "unit-qemu-an505")?;
    say(&format!("with storage: {}", alone.display()));
    Ok(Images {
        qemu,
        alone,
        flashed,
    })
}
