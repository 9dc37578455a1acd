//! Input files: plain, compressed by gzip or xz, or standard input.
//!
//! Files opened here are remembered, so that no output replaces them. Devices and named pipes are refused, and files
//! read as a whole are limited in size.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use flate2::bufread::MultiGzDecoder;
use lzma_rust2::XzReader;

use crate::diagnostic::{Problem, Result};
use crate::file_kind::{self, FileKind};

/// The name for standard input.
pub const STANDARD_INPUT: &str = "-";

/// Bytes read at once.
const BUFFER: usize = 1 << 16;

/// Largest settings file (bytes).
const LARGEST_TEXT: u64 = 16 << 20;

/// Largest board image, as UF2 (bytes): more than any board's flash holds.
const LARGEST_IMAGE: u64 = 16 << 20;

/// Largest file held in memory as a whole, uncompressed (bytes).
const LARGEST_WHOLE: u64 = 256 << 20;

/// Largest recording of another system (bytes): what a compressed one may unpack to, and a plain one, which is no larger
/// in memory than on the disk.
const LARGEST_UNPACKED: u64 = 1 << 30;
const LARGEST_MOVEMENT: u64 = 4 << 30;

/// Files that this process reads.
static CLAIMED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// An open file, decompressed while it is read.
pub type Input = BufReader<Box<dyn Read + Send>>;

/// First bytes of compressed files.
const GZIP: [u8; 2] = [0x1F, 0x8B];
const XZ: [u8; 6] = [0xFD, b'7', b'z', b'X', b'Z', 0];

/// Remembers a file that is or will be read: no output may replace it.
pub fn claim(path: &Path) {
    // A file that does not exist has no content to lose.
    if let Ok(path) = path.canonicalize() {
        let mut claimed = CLAIMED.lock().unwrap_or_else(PoisonError::into_inner);
        claimed.insert(path);
    }
}

/// The files that this process reads, or will read.
pub fn claimed() -> Vec<PathBuf> {
    let claimed = CLAIMED.lock().unwrap_or_else(PoisonError::into_inner);
    claimed.iter().cloned().collect()
}

/// Whether this process reads a file, under any of its names.
pub fn is_claimed(path: &Path) -> bool {
    path.canonicalize().is_ok_and(|path| {
        let claimed = CLAIMED.lock().unwrap_or_else(PoisonError::into_inner);
        claimed.contains(&path)
    })
}

/// Opens a file for reading; `-` is standard input. Input compressed with gzip or xz, recognised by its first bytes, is
/// decompressed.
///
/// # Errors
/// Returns an error if the file cannot be opened, is not a file, or its first bytes cannot be read.
pub fn open(path: &Path) -> Result<Input> {
    let plain: Box<dyn Read + Send> = if path == Path::new(STANDARD_INPUT) {
        Box::new(io::stdin())
    } else {
        Box::new(file(path)?)
    };
    unpacked(plain).map_err(|error| Problem::system("read", path, error))
}

/// Opens a file for reading, without decompression.
///
/// # Errors
/// Returns an error if the file cannot be opened, or is a folder, a device or a named pipe: those never end, or give
/// nothing until somebody writes to them.
pub fn file(path: &Path) -> Result<File> {
    let refused = |error| Problem::system("read", path, error);
    let kind = std::fs::metadata(path).map_err(refused)?.file_type();
    if kind.is_dir() {
        return Err(folder(path));
    }
    // Pipes between commands, such as a shell's <(command), have no name in the file system.
    if !kind.is_file() && path.canonicalize().is_ok() {
        return Err(
            Problem::bad_input("expected a file, found a device or a pipe")
                .in_file(path)
                .help("write the data to a file first; recordings and tracks can also come from standard input, as -"),
        );
    }
    let file = File::open(path).map_err(refused)?;
    claim(path);
    Ok(file)
}

/// The kind of a file, decompressed if necessary; `None` if it cannot be read or has no known kind.
pub fn kind(path: &Path) -> Option<FileKind> {
    // Standard input could be read only once.
    if path == Path::new(STANDARD_INPUT) || !path.is_file() {
        return None;
    }
    let mut head = Vec::with_capacity(file_kind::HEAD);
    let mut part = open(path).ok()?.take(file_kind::HEAD as u64);
    part.read_to_end(&mut head).ok()?;
    FileKind::of_head(&head)
}

/// The problem of a folder where a file belongs.
fn folder(path: &Path) -> Problem {
    let help = if path.join("flight.toml").is_file() {
        "it has a flight.toml, so verbs on flights take it, as in bodyflight simulate FOLDER; here, give a file inside it"
    } else {
        "give a file inside it"
    };
    Problem::bad_input("this is a folder, not a file")
        .in_file(path)
        .help(help)
}

/// The text of a settings file of this kind.
///
/// # Errors
/// Returns an error if it certainly is a file of another kind, and for the reasons given at [`text`].
pub fn settings(path: &Path, wanted: FileKind) -> Result<String> {
    let is_settings = |found: &FileKind| {
        use FileKind::{Flight, Mapping, Model, Preset, Subject, Text};
        [Flight, Mapping, Model, Preset, Subject, Text].contains(found)
    };
    // Whether a kind of settings is the wanted one, only the whole text shows.
    let found = kind(path).filter(|found| !is_settings(found));
    if let Some(problem) = wanted.mistaken(found) {
        return Err(problem.in_file(path));
    }
    let text = text(path)?;
    match wanted.mistaken_text(&text) {
        Some(problem) => Err(problem.in_file(path)),
        None => Ok(text),
    }
}

/// The text of a settings file.
///
/// # Errors
/// Returns an error if the file cannot be read, is not UTF-8, or is larger than 16 MiB.
pub fn text(path: &Path) -> Result<String> {
    utf_8(limited(file(path)?, path, LARGEST_TEXT)?, path)
}

/// The bytes of a board image, without decompression.
///
/// # Errors
/// Returns an error if the file cannot be read or is larger than 16 MiB.
pub fn image(path: &Path) -> Result<Vec<u8>> {
    limited(file(path)?, path, LARGEST_IMAGE)
}

/// The bytes of a recorded movement, decompressed.
///
/// # Errors
/// Returns an error if the file cannot be read, is larger than 4 GiB, or unpacks to more than 1 GiB and its own size.
pub fn movement(path: &Path) -> Result<Vec<u8>> {
    let size = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
    if size > LARGEST_MOVEMENT {
        return Err(too_large(path, LARGEST_MOVEMENT).help("cut the recording into parts"));
    }
    let limit = size.max(LARGEST_UNPACKED);
    limited_of(size, open(path)?, path, limit)
}

/// Converts the bytes of a file to text.
///
/// # Errors
/// Returns an error that names the line if they are not UTF-8.
pub fn utf_8(bytes: Vec<u8>, path: &Path) -> Result<String> {
    String::from_utf8(bytes).map_err(|error| {
        let valid = error.utf8_error().valid_up_to();
        let before = error.as_bytes().get(..valid).unwrap_or_default();
        let lines = before.iter().filter(|byte| **byte == b'\n').count();
        Problem::bad_input("expected text in UTF-8")
            .in_file(path)
            .at_line(lines as u64 + 1)
    })
}

/// The bytes of a file, decompressed.
///
/// # Errors
/// Returns an error if the file cannot be read or is larger than 256 MiB.
pub fn bytes(path: &Path) -> Result<Vec<u8>> {
    let size = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
    limited_of(size, open(path)?, path, LARGEST_WHOLE)
}

fn limited(input: impl Read, path: &Path, limit: u64) -> Result<Vec<u8>> {
    limited_of(0, input, path, limit)
}

/// The same, for an input of at least so many bytes, for which room is made at once.
fn limited_of(size: u64, input: impl Read, path: &Path, limit: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let room = usize::try_from(size.min(limit)).unwrap_or(0);
    // Without the room, growing by doubling is tried, and fails in its own way.
    let _ = bytes.try_reserve_exact(room);
    input
        .take(limit + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| Problem::system("read", path, error))?;
    if bytes.len() as u64 > limit {
        return Err(too_large(path, limit));
    }
    Ok(bytes)
}

fn too_large(path: &Path, limit: u64) -> Problem {
    let message = format!("expected at most {} MiB, found more", limit >> 20);
    Problem::bad_input(message).in_file(path)
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
    fn compressed_files_are_read_like_plain_ones() {
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
    fn files_above_the_limit_are_refused() {
        let path = Path::new("subject.toml");
        assert_eq!(limited(&[7_u8; 10][..], path, 10).unwrap().len(), 10);
        let problem = limited(io::repeat(7), path, 3 << 20).unwrap_err();
        assert_eq!(
            problem.to_string(),
            "subject.toml: expected at most 3 MiB, found more"
        );
    }

    #[test]
    fn a_plain_movement_may_be_larger_than_an_unpacked_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("long.csv");
        let file = File::create(&path).unwrap();
        // A file with a hole takes no space on the disk.
        file.set_len(LARGEST_MOVEMENT + 1).unwrap();
        let problem = movement(&path).unwrap_err();
        assert!(
            problem.to_string().contains("at most 4096 MiB"),
            "{problem}"
        );
        assert!(problem.help.unwrap().contains("parts"));
    }

    #[test]
    fn inputs_are_recognised_by_any_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        std::fs::write(&path, "mass = 80").unwrap();
        assert!(!is_claimed(&path));
        assert_eq!(text(&path).unwrap(), "mass = 80");
        let inside = folder.path().join("inside");
        std::fs::create_dir(&inside).unwrap();
        assert!(is_claimed(&inside.join("../a.toml")));
        assert!(!is_claimed(&folder.path().join("b.toml")));
    }

    #[test]
    fn invalid_text_is_reported_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        std::fs::write(&path, b"mass = 80\n\xFF").unwrap();
        let problem = text(&path).unwrap_err().to_string();
        assert!(
            problem.ends_with("a.toml:2: expected text in UTF-8"),
            "{problem}"
        );
    }

    #[test]
    fn a_truncated_compressed_file_is_an_error() {
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
