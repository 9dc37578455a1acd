//! Files as they come: plain, packed by gzip or xz, or standard input.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;
use lzma_rust2::XzReader;

use crate::diagnostic::{Problem, Result};

/// A name that stands for standard input.
pub const STANDARD_INPUT: &str = "-";

/// Bytes read at once.
const BUFFER: usize = 1 << 16;

/// An open file, unpacked while it is read.
pub type Input = BufReader<Box<dyn Read + Send>>;

/// First bytes of packed files.
const GZIP: [u8; 2] = [0x1F, 0x8B];
const XZ: [u8; 6] = [0xFD, b'7', b'z', b'X', b'Z', 0];

/// Opens a file for reading; `-` is standard input. What gzip or xz has packed, told by its first bytes, is unpacked.
///
/// # Errors
/// Returns an error if the file cannot be opened or its first bytes cannot be read.
pub fn open(path: &Path) -> Result<Input> {
    let plain: Box<dyn Read + Send> = if path == Path::new(STANDARD_INPUT) {
        Box::new(io::stdin())
    } else {
        Box::new(File::open(path).map_err(|error| Problem::system("open", path, error))?)
    };
    unpacked(plain).map_err(|error| Problem::system("read", path, error))
}

fn unpacked(plain: Box<dyn Read + Send>) -> io::Result<Input> {
    let mut input = BufReader::with_capacity(BUFFER, plain);
    let head = input.fill_buf()?;
    let unpacked: Box<dyn Read + Send> = if head.starts_with(&GZIP) {
        Box::new(MultiGzDecoder::new(input))
    } else if head.starts_with(&XZ) {
        Box::new(XzReader::new(input, true))
    } else {
        return Ok(input);
    };
    Ok(BufReader::with_capacity(BUFFER, unpacked))
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn read(bytes: Vec<u8>) -> String {
        let mut text = String::new();
        unpacked(Box::new(io::Cursor::new(bytes)))
            .unwrap()
            .read_to_string(&mut text)
            .unwrap();
        text
    }

    #[test]
    fn packed_files_read_as_plain_ones() {
        let text = "a recording\n".repeat(1000);
        assert_eq!(read(text.clone().into_bytes()), text);

        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        gzip.write_all(text.as_bytes()).unwrap();
        assert_eq!(read(gzip.finish().unwrap()), text);

        let mut xz =
            lzma_rust2::XzWriter::new(Vec::new(), lzma_rust2::XzOptions::with_preset(1)).unwrap();
        xz.write_all(text.as_bytes()).unwrap();
        assert_eq!(read(xz.finish().unwrap()), text);
    }

    #[test]
    fn a_packed_file_that_is_cut_off_is_an_error() {
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        gzip.write_all(&[7; 5000]).unwrap();
        let mut bytes = gzip.finish().unwrap();
        bytes.truncate(bytes.len() - 6);
        let mut rest = Vec::new();
        let outcome = unpacked(Box::new(io::Cursor::new(bytes)))
            .unwrap()
            .read_to_end(&mut rest);
        assert!(outcome.is_err());
    }
}
