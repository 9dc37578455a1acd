//! Firmware images for boards: whether a file is complete, whether its signature is valid, and how it is copied onto a
//! board's drive.
//!
//! Signatures are in minisign's format (Ed25519), in a file beside the image. The boot programs of the boards do not
//! verify signatures, so they are checked here, before anything is written.

#[cfg_attr(not(feature = "signatures"), path = "image/without_signatures.rs")]
mod signature;

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::input;

/// The file that a boot program shows on its drive.
const DRIVE_FILE: &str = "INFO_UF2.TXT";

/// A board that accepts images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Board {
    /// Accepts UF2 files on its USB drive.
    #[serde(rename = "rp2350-pico2")]
    Pico2,
    /// Accepts flat images over DFU.
    #[serde(rename = "stm32f405")]
    Stm32f405,
}

/// A complete image.
#[derive(Debug)]
pub struct Image {
    path: PathBuf,
    bytes: Vec<u8>,
    /// The board it is built for.
    pub board: Board,
}

impl Image {
    /// Reads an image.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, or is not a complete image for one of the boards.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = input::image(path)?;
        let board = if uf2::is_begun(&bytes) {
            uf2::check(&bytes).map(|()| Board::Pico2)
        } else if flat::is_image(&bytes) {
            Ok(Board::Stm32f405)
        } else {
            Err("neither a UF2 file nor a flat image for the STM32F405".to_owned())
        };
        let board = board.map_err(|what| {
            Problem::bad_input(format!("this is not a complete image: {what}"))
                .in_file(path)
                .help("`cargo xtask unit` builds unit.uf2 and unit.bin")
        })?;
        Ok(Self {
            path: path.to_owned(),
            bytes,
            board,
        })
    }

    /// Size of the file (bytes).
    pub fn length(&self) -> usize {
        self.bytes.len()
    }

    /// Copies the image onto the drive shown by a board's boot program.
    ///
    /// # Errors
    /// Returns an error if the image is for another kind of board, if the folder is not such a drive, or if the copy is
    /// interrupted.
    pub fn copy_to(&self, drive: &Path) -> Result<()> {
        if self.board != Board::Pico2 {
            return Err(
                Problem::bad_input("only UF2 files can be copied onto a drive").in_file(&self.path),
            );
        }
        let info = drive.join(DRIVE_FILE);
        let shown = std::fs::read_to_string(&info).map_err(|error| {
            Problem::system("read", &info, error)
                .help("hold BOOTSEL while the board is plugged in; the drive RP2350 appears")
        })?;
        if !shown.contains("RP2350") {
            return Err(Problem::bad_input(
                "expected the drive of an RP2350, found that of another board",
            )
            .in_file(&info));
        }
        let place = drive.join("UNIT.UF2");
        let copied = File::create(&place)
            .and_then(|mut file| file.write_all(&self.bytes).and_then(|()| file.sync_all()));
        match copied {
            // The board restarts on the last block, and its drive disappears.
            Err(_) if !info.exists() => Ok(()),
            copied => copied.map_err(|error| {
                Problem::system("write", &place, error)
                    .help("the boot program is in ROM and still works: copy the image again")
            }),
        }
    }
}

/// UF2, <https://github.com/microsoft/uf2>, as `cargo xtask unit` writes it.
mod uf2 {
    const BLOCK: usize = 512;
    const FIRST: u32 = 0x0a32_4655;
    const SECOND: u32 = 0x9e5d_5157;
    const LAST: u32 = 0x0ab1_6f30;
    /// Family of secure Arm images for the RP2350.
    const FAMILY: u32 = 0xe48b_ff59;
    const FLASH: std::ops::Range<u32> = 0x1000_0000..0x1040_0000;

    fn word(block: &[u8], number: usize) -> u32 {
        let place = block.get(4 * number..).and_then(|rest| rest.first_chunk());
        place.copied().map_or(0, u32::from_le_bytes)
    }

    pub(super) fn is_begun(bytes: &[u8]) -> bool {
        word(bytes, 0) == FIRST
    }

    /// Checks that every block is present, in order, and addressed to this chip's flash.
    pub(super) fn check(bytes: &[u8]) -> Result<(), String> {
        let count = bytes.len() / BLOCK;
        if !bytes.len().is_multiple_of(BLOCK) {
            return Err(format!("it ends within block {count}"));
        }
        for (number, block) in bytes.chunks_exact(BLOCK).enumerate() {
            if [word(block, 0), word(block, 1), word(block, 127)] != [FIRST, SECOND, LAST] {
                return Err(format!("block {number} is damaged"));
            }
            if word(block, 5) as usize != number || word(block, 6) as usize != count {
                let wanted = word(block, 6);
                return Err(format!(
                    "block {number} of {count} is numbered {} of {wanted}",
                    word(block, 5)
                ));
            }
            if word(block, 7) != FAMILY {
                return Err(format!(
                    "block {number} is for another chip, {:#010x}",
                    word(block, 7)
                ));
            }
            if !FLASH.contains(&word(block, 3)) {
                return Err(format!(
                    "block {number} is addressed to {:#010x}, outside flash",
                    word(block, 3)
                ));
            }
        }
        Ok(())
    }
}

/// The contents of an STM32F405's flash, from its first byte.
mod flat {
    const FLASH: u32 = 0x0800_0000;
    const FLASH_BYTES: usize = 1 << 20;
    /// Core-coupled memory and main SRAM.
    const STACKS: [std::ops::RangeInclusive<u32>; 2] =
        [0x1000_0000..=0x1001_0000, 0x2000_0000..=0x2002_0000];

    /// Whether it starts with an initial stack pointer and a reset vector that are valid on this chip.
    pub(super) fn is_image(bytes: &[u8]) -> bool {
        let word = |place| {
            let rest = bytes.get(place..).and_then(|rest| rest.first_chunk());
            rest.copied().map(u32::from_le_bytes)
        };
        let (Some(stack), Some(start)) = (word(0), word(4)) else {
            return false;
        };
        let inside = (start & !1)
            .checked_sub(FLASH)
            .is_some_and(|offset| (offset as usize) < bytes.len());
        bytes.len() <= FLASH_BYTES
            && start & 1 == 1
            && inside
            && STACKS.iter().any(|stacks| stacks.contains(&stack))
    }
}

#[cfg(test)]
#[allow(clippy::cast_possible_truncation, reason = "small numbers of a test")]
mod tests {
    use super::*;

    /// A file of `count` blocks.
    pub(super) fn file(count: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        for number in 0..count {
            let words = [
                0x0a32_4655,
                0x9e5d_5157,
                0x2000,
                0x1000_0000 + 256 * number,
                256,
                number,
                count,
                0xe48b_ff59,
            ];
            bytes.extend(words.iter().flat_map(|word: &u32| word.to_le_bytes()));
            bytes.extend((0..476).map(|place| (place * 7 + number) as u8));
            bytes.extend(0x0ab1_6f30_u32.to_le_bytes());
        }
        bytes
    }

    pub(super) struct Shelf(tempfile::TempDir);

    impl Shelf {
        pub(super) fn new() -> Self {
            Self(tempfile::tempdir().unwrap())
        }

        pub(super) fn put(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
            let path = self.0.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            path
        }
    }

    #[test]
    fn damage_of_an_image_is_named() {
        let shelf = Shelf::new();
        let message = |bytes: &[u8]| {
            let read = Image::read(&shelf.put("unit.uf2", bytes));
            read.map(|image| image.board)
                .map_err(|problem| problem.to_string())
        };
        let whole = file(3);
        assert_eq!(message(&whole).unwrap(), Board::Pico2);
        let mut turned = whole.clone();
        turned[512] ^= 1;
        let mut other = whole.clone();
        other[28] ^= 1;
        let mut elsewhere = whole.clone();
        elsewhere[15] = 0x20;
        for (bytes, said) in [
            (&whole[..700], "ends within block 1"),
            (&whole[..1024], "block 0 of 2 is numbered 0 of 3"),
            (&turned[..], "block 1 is damaged"),
            (&other[..], "another chip"),
            (&elsewhere[..], "outside flash"),
            (&b"hello"[..], "neither"),
            (&vec![0; (16 << 20) + 1][..], "at most 16 MiB"),
        ] {
            let found = message(bytes).unwrap_err();
            assert!(found.contains(said), "{found}");
        }
    }

    #[test]
    fn a_flat_image_begins_with_a_stack_and_an_instruction() {
        let shelf = Shelf::new();
        let image = |stack: u32, start: u32| {
            let mut bytes = vec![0; 1024];
            bytes[..4].copy_from_slice(&stack.to_le_bytes());
            bytes[4..8].copy_from_slice(&start.to_le_bytes());
            Image::read(&shelf.put("unit.bin", bytes)).map(|image| image.board)
        };
        assert_eq!(image(0x1001_0000, 0x0800_0189).unwrap(), Board::Stm32f405);
        for (stack, start) in [
            (0x1001_0000, 0x0800_0188),
            (0x1001_0000, 0x0800_0401),
            (0x3000_0000, 0x0800_0189),
        ] {
            assert!(image(stack, start).is_err(), "{stack:#x} {start:#x}");
        }
    }

    #[test]
    fn an_image_is_copied_onto_the_drive_of_its_board_and_nowhere_else() {
        let (shelf, drive) = (Shelf::new(), Shelf::new());
        let image = Image::read(&shelf.put("unit.uf2", file(2))).unwrap();
        let folder = drive.0.path();
        assert!(image.copy_to(folder).is_err(), "any folder");
        drive.put(
            DRIVE_FILE,
            "UF2 Bootloader v3.0\r\nModel: Raspberry Pi RP2\r\nBoard-ID: RPI-RP2\r\n",
        );
        assert!(image.copy_to(folder).is_err(), "another board");
        drive.put(
            DRIVE_FILE,
            "UF2 Bootloader v1.0\r\nModel: Raspberry Pi RP2350\r\nBoard-ID: RP2350\r\n",
        );
        image.copy_to(folder).unwrap();
        assert_eq!(std::fs::read(folder.join("UNIT.UF2")).unwrap(), file(2));
    }
}
