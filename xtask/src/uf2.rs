//! Files for flashing without a probe: UF2 files, which are copied to a board's USB drive, and raw flash contents,
//! which a boot loader writes over USB (DFU).
//!
//! UF2 is specified at <https://github.com/microsoft/uf2>: blocks of 512 bytes, each with its address.

use std::path::{Path, PathBuf};

use object::Endianness;
use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{FileHeader, ProgramHeader};

use crate::run::Result;

/// Family of secure ARM images for the RP2350.
pub(crate) const RP2350: u32 = 0xe48b_ff59;

/// First, second and last word of a block (magic numbers).
const MAGIC: [u32; 3] = [0x0a32_4655, 0x9e5d_5157, 0x0ab1_6f30];

/// Flag: the block has a family id.
const HAS_FAMILY: u32 = 0x2000;

/// Bytes of the image in a block: a flash page, which is written as a whole.
const PAGE: u32 = 256;

/// Length of a block before its last word (bytes).
const BLOCK: usize = 508;

/// Value of erased flash.
const ERASED: u8 = 0xff;

/// Writes `image.uf2` beside an image and returns its path.
pub(crate) fn convert(image: &Path, family: u32) -> Result<PathBuf> {
    write(&image.with_extension("uf2"), &blocks(&read(image)?, family))
}

/// Writes `image.bin` beside an image, from the first to the last byte of flash that it loads, and returns its path.
pub(crate) fn flatten(image: &Path) -> Result<PathBuf> {
    write(&image.with_extension("bin"), &flat(&read(image)?))
}

fn read(image: &Path) -> Result<Vec<Page>> {
    let named = |error: &dyn core::fmt::Display| format!("{}: {error}", image.display());
    let bytes = std::fs::read(image).map_err(|error| named(&error))?;
    pages(&bytes).map_err(|error| named(&error))
}

fn write(path: &Path, bytes: &[u8]) -> Result<PathBuf> {
    std::fs::write(path, bytes).map_err(|error| format!("{}: {error}", path.display()))?;
    Ok(path.to_path_buf())
}

/// A page of flash: its address and its bytes.
type Page = (u32, [u8; PAGE as usize]);

/// The pages that an image loads, in the order of their addresses.
fn pages(image: &[u8]) -> object::Result<Vec<Page>> {
    let header = FileHeader32::<Endianness>::parse(image)?;
    let endian = header.endian()?;
    let mut pages = std::collections::BTreeMap::new();
    for segment in header.program_headers(endian, image)? {
        if segment.p_type(endian) != PT_LOAD {
            continue;
        }
        // The load address, which for initial values of RAM is not the address in use.
        let begin = segment.p_paddr(endian);
        let bytes = segment.data(endian, image).unwrap_or_default();
        for (address, byte) in (begin..).zip(bytes) {
            let page = pages
                .entry(address - address % PAGE)
                .or_insert([ERASED; PAGE as usize]);
            page[(address % PAGE) as usize] = *byte;
        }
    }
    Ok(pages.into_iter().collect())
}

/// Fills gaps between pages with erased ones.
fn flat(pages: &[Page]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let first = pages.first().map_or(0, |(address, _)| *address);
    for (address, page) in pages {
        bytes.resize((address - first) as usize, ERASED);
        bytes.extend(page);
    }
    bytes
}

fn blocks(pages: &[Page], family: u32) -> Vec<u8> {
    let mut file = Vec::new();
    let count = pages.len();
    for (number, (address, page)) in pages.iter().enumerate() {
        let [first, second, last] = MAGIC;
        #[expect(
            clippy::cast_possible_truncation,
            reason = "there are fewer pages than bytes of flash"
        )]
        let words = [
            first,
            second,
            HAS_FAMILY,
            *address,
            PAGE,
            number as u32,
            count as u32,
            family,
        ];
        let end = file.len() + BLOCK;
        file.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        file.extend(page);
        file.resize(end, 0);
        file.extend(last.to_le_bytes());
    }
    file
}

#[cfg(test)]
#[allow(clippy::cast_possible_truncation, reason = "small numbers of a test")]
mod tests {
    use super::*;

    /// An ELF file with the given segments: load address and bytes.
    fn elf(segments: &[(u32, &[u8])]) -> Vec<u8> {
        let words = |words: &[u32]| -> Vec<u8> {
            words.iter().flat_map(|word| word.to_le_bytes()).collect()
        };
        let halves = |halves: &[u16]| -> Vec<u8> {
            halves.iter().flat_map(|half| half.to_le_bytes()).collect()
        };
        let mut file = b"\x7fELF\x01\x01\x01\0\0\0\0\0\0\0\0\0".to_vec();
        file.extend(halves(&[2, 40]));
        file.extend(words(&[1, 0, 52, 0, 0]));
        file.extend(halves(&[52, 32, segments.len() as u16, 40, 0, 0]));
        let mut offset = 52 + 32 * segments.len() as u32;
        for (address, bytes) in segments {
            let length = bytes.len() as u32;
            file.extend(words(&[
                PT_LOAD,
                offset,
                0x2000_0000,
                *address,
                length,
                length,
                4,
                4,
            ]));
            offset += length;
        }
        for (_, bytes) in segments {
            file.extend(*bytes);
        }
        file
    }

    fn word(block: &[u8], place: usize) -> u32 {
        u32::from_le_bytes(block[4 * place..][..4].try_into().unwrap())
    }

    #[test]
    fn a_file_holds_every_byte_at_its_load_address_and_nothing_else() {
        let code: Vec<u8> = (0..300).map(|n| (n % 251) as u8).collect();
        let image = elf(&[(0x1000_0000, &code), (0x1000_0210, &[1, 2, 3])]);
        let file = blocks(&pages(&image).unwrap(), RP2350);
        assert_eq!(file.len(), 3 * 512);
        let mut flash = vec![0u8; 0x300];
        for (number, block) in file.chunks(512).enumerate() {
            assert_eq!(word(block, 0), 0x0a32_4655);
            assert_eq!(word(block, 1), 0x9e5d_5157);
            assert_eq!(word(block, 2), 0x2000);
            assert_eq!(word(block, 4), 256);
            assert_eq!([word(block, 5), word(block, 6)], [number as u32, 3]);
            assert_eq!(word(block, 7), 0xe48b_ff59);
            assert_eq!(word(block, 127), 0x0ab1_6f30);
            let place = (word(block, 3) - 0x1000_0000) as usize;
            flash[place..place + 256].copy_from_slice(&block[32..288]);
        }
        assert_eq!(flash[..300], code);
        assert!(flash[300..0x210].iter().all(|&byte| byte == 0xff));
        assert_eq!(flash[0x210..0x213], [1, 2, 3]);
        assert!(flash[0x213..].iter().all(|&byte| byte == 0xff));
    }

    #[test]
    fn a_flat_image_has_every_byte_at_its_offset_from_the_first() {
        let image = elf(&[(0x0800_0000, &[7; 300]), (0x0800_0410, &[1, 2, 3])]);
        let bytes = flat(&pages(&image).unwrap());
        assert_eq!(bytes.len(), 0x500);
        assert_eq!(bytes[..300], [7; 300]);
        assert_eq!(bytes[0x410..0x413], [1, 2, 3]);
        let rest = bytes[300..0x410].iter().chain(&bytes[0x413..]);
        assert!(rest.into_iter().all(|&byte| byte == 0xff));
    }

    #[test]
    fn what_is_not_an_image_is_refused() {
        assert!(pages(b"hello").is_err());
    }
}
