//! `cargo xtask unit`: the images of the unit.

use std::path::PathBuf;

use crate::image;
use crate::run::{Result, say};

/// Builds and checks the images for all boards; the path of the one for QEMU.
pub(crate) fn unit() -> Result<PathBuf> {
    let board = image::build_board("stm32f405")?;
    image::check(&board, "unit-stm32f405")?;
    say(&format!("image for the STM32F405: {}", board.display()));
    let qemu = image::build("board-qemu-lm3s6965", "unit")?;
    image::check(&qemu, "unit")?;
    say(&format!("image for QEMU: {}", qemu.display()));
    Ok(qemu)
}
