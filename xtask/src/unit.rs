//! `cargo xtask unit`: the images of the unit, and what is flashed without a probe.

use std::path::PathBuf;

use crate::image;
use crate::run::{Result, say};
use crate::uf2;

/// Boards that are workspaces of their own: name, its name for people.
const BOARDS: [[&str; 2]; 2] = [
    ["stm32f405", "STM32F405"],
    ["rp2350-pico2", "Raspberry Pi Pico 2"],
];

/// Images of the unit.
pub(crate) struct Images {
    /// The one that QEMU runs.
    pub(crate) qemu: PathBuf,
    /// Those of boards, each as ELF and as what its boot program takes, in a folder of the board's name.
    pub(crate) flashed: Vec<PathBuf>,
}

/// Builds and checks the images for all boards.
pub(crate) fn unit() -> Result<Images> {
    let mut flashed = Vec::new();
    for [board, name] in BOARDS {
        let image = image::build_board(board, "unit")?;
        image::check(&image, &format!("unit-{board}"))?;
        say(&format!("image for the {name}: {}", image.display()));
        let (file, way) = if board == "rp2350-pico2" {
            (
                uf2::convert(&image, uf2::RP2350)?,
                "to be dropped on its drive",
            )
        } else {
            (uf2::flatten(&image)?, "for its boot program")
        };
        say(&format!("{way}: {}", file.display()));
        flashed.extend([image, file]);
    }
    let qemu = image::build("board-qemu-lm3s6965", "unit")?;
    image::check(&qemu, "unit")?;
    say(&format!("image for QEMU: {}", qemu.display()));
    Ok(Images { qemu, flashed })
}
