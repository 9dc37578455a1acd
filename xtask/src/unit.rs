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

/// Builds and checks the images for all boards; the path of the one for QEMU.
pub(crate) fn unit() -> Result<PathBuf> {
    for [board, name] in BOARDS {
        let image = image::build_board(board, "unit")?;
        image::check(&image, &format!("unit-{board}"))?;
        say(&format!("image for the {name}: {}", image.display()));
        if board == "rp2350-pico2" {
            let file = uf2::convert(&image, uf2::RP2350)?;
            say(&format!("to be dropped on its drive: {}", file.display()));
        } else {
            let file = uf2::flatten(&image)?;
            say(&format!("for its boot program: {}", file.display()));
        }
    }
    let qemu = image::build("board-qemu-lm3s6965", "unit")?;
    image::check(&qemu, "unit")?;
    say(&format!("image for QEMU: {}", qemu.display()));
    Ok(qemu)
}
