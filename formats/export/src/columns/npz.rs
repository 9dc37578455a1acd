//! Quantities as NumPy arrays, all in one archive that `numpy.load` opens.
//!
//! The first axis of an array is the frame, then come segments and components. `about.json` in the archive lists units
//! and meanings. An array comes after the other in the archive, all numbers of a frame come at once: until the last frame
//! they wait in a file without a name beside the archive.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde_json::json;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::quantity::{Of, Quantity, Sink};
use bodyflight_core::Segment;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::AtomicFile;

/// Arrays of at least this size (bytes) are stored as large (ZIP64) entries.
const LARGE: u64 = 1 << 31;

/// Bytes of the arrays that are kept in memory.
const KEPT: usize = 8 << 20;

/// Arrays that grow together: pieces of all of them in a file, and what came after those.
struct Growing {
    file: File,
    arrays: Vec<Array>,
    kept: usize,
}

/// One of them.
#[derive(Clone, Default)]
struct Array {
    /// Where its pieces are in the file: place and length.
    pieces: Vec<(u64, u64)>,
    kept: Vec<u8>,
}

impl Growing {
    fn create(folder: &Path, count: usize) -> std::io::Result<Self> {
        Ok(Self {
            file: tempfile::tempfile_in(folder)?,
            arrays: vec![Array::default(); count],
            kept: 0,
        })
    }

    fn push(&mut self, array: usize, numbers: &[f64]) {
        if let Some(array) = self.arrays.get_mut(array) {
            let bytes = numbers.iter().flat_map(|number| number.to_le_bytes());
            array.kept.extend(bytes);
            self.kept += size_of_val(numbers);
        }
    }

    /// Moves what is kept to the file once it is enough.
    fn settle(&mut self) -> std::io::Result<()> {
        if self.kept < KEPT {
            return Ok(());
        }
        let mut place = self.file.stream_position()?;
        for array in &mut self.arrays {
            self.file.write_all(&array.kept)?;
            let length = array.kept.len() as u64;
            array.pieces.push((place, length));
            array.kept.clear();
            place += length;
        }
        self.kept = 0;
        Ok(())
    }

    /// Size of an array (bytes).
    fn size(&self, array: usize) -> u64 {
        self.arrays.get(array).map_or(0, |array| {
            let pieces = array.pieces.iter().map(|(_, length)| length);
            pieces.sum::<u64>() + array.kept.len() as u64
        })
    }

    /// Writes an array.
    fn copy(&mut self, array: usize, out: &mut impl Write) -> std::io::Result<()> {
        let Some(array) = self.arrays.get(array) else {
            return Ok(());
        };
        for (place, length) in &array.pieces {
            self.file.seek(SeekFrom::Start(*place))?;
            std::io::copy(&mut (&self.file).take(*length), out)?;
        }
        out.write_all(&array.kept)
    }
}

/// An archive being written.
pub struct NpzArchive {
    file: AtomicFile,
    quantities: Vec<Quantity>,
    growing: Growing,
    rows: usize,
    path: PathBuf,
}

impl NpzArchive {
    /// Creates the file.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be written to.
    pub fn create(path: &Path, quantities: Vec<Quantity>) -> Result<Self> {
        let folder = path.parent().filter(|path| !path.as_os_str().is_empty());
        let growing = Growing::create(folder.unwrap_or(Path::new(".")), quantities.len());
        Ok(Self {
            file: AtomicFile::create(path)?,
            growing: growing.map_err(|error| Problem::system("write", path, error))?,
            quantities,
            rows: 0,
            path: path.to_path_buf(),
        })
    }
}

/// The header of an array, version 1.0 of the format.
fn header(rows: usize, shape: &[usize]) -> Vec<u8> {
    let mut lengths = format!("{rows},");
    for length in shape {
        let _ = write!(lengths, " {length},");
    }
    let mut text =
        format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({lengths}), }}").into_bytes();
    // The numbers start at a multiple of 64 bytes; magic, version and length take 10.
    let whole = (text.len() + 11).next_multiple_of(64);
    text.resize(whole - 11, b' ');
    text.push(b'\n');
    let length = u16::try_from(text.len()).unwrap_or(u16::MAX);
    [&b"\x93NUMPY\x01\x00"[..], &length.to_le_bytes(), &text].concat()
}

/// Units, components and meanings, by array name.
fn about(quantities: &[Quantity]) -> String {
    let arrays = quantities.iter().map(|quantity| {
        let segments: &[_] = match quantity.of {
            Of::Body => &[],
            Of::Segments => &Segment::ALL.map(Segment::name),
        };
        let about = json!({
            "unit": quantity.unit.symbol,
            "meaning": quantity.meaning,
            "segments": segments,
            "parts": quantity.parts,
        });
        (quantity.array(), about)
    });
    serde_json::Value::Object(arrays.collect()).to_string()
}

impl Sink for NpzArchive {
    fn write(&mut self, row: &[f64]) -> Result<()> {
        let mut from = 0;
        for (place, quantity) in self.quantities.iter().enumerate() {
            let until = from + quantity.width();
            let numbers = row.get(from..until).unwrap_or_default();
            self.growing.push(place, numbers);
            from = until;
        }
        self.rows += 1;
        let settled = self.growing.settle();
        settled.map_err(|error| Problem::system("write", &self.path, error))
    }

    fn finish(self: Box<Self>) -> Result<()> {
        let Self {
            file,
            quantities,
            mut growing,
            rows,
            path,
        } = *self;
        let refused = |error: zip::result::ZipError| {
            Problem::refused("cannot write the archive")
                .in_file(&path)
                .caused_by(error)
        };
        let system = |error| Problem::system("write", &path, error);
        let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        let mut archive = ZipWriter::new(file);
        archive.start_file("about.json", stored).map_err(refused)?;
        archive
            .write_all(about(&quantities).as_bytes())
            .map_err(system)?;
        for (place, quantity) in quantities.iter().enumerate() {
            let is_large = growing.size(place) >= LARGE;
            let name = format!("{}.npy", quantity.array());
            archive
                .start_file(name, stored.large_file(is_large))
                .map_err(refused)?;
            let header = header(rows, &quantity.shape());
            archive.write_all(&header).map_err(system)?;
            growing.copy(place, &mut archive).map_err(system)?;
        }
        archive.finish().map_err(refused)?.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_moved_to_the_file_and_what_was_kept_is_one_array() {
        let folder = tempfile::tempdir().unwrap();
        let mut growing = Growing::create(folder.path(), 2).unwrap();
        let rows = 2 * KEPT / 24 + 100;
        for row in 0..rows {
            growing.push(0, &[row as f64]);
            growing.push(1, &[-1.0, row as f64]);
            growing.settle().unwrap();
            assert!(growing.kept < KEPT);
        }
        let first: Vec<u8> = (0..rows).flat_map(|r| (r as f64).to_le_bytes()).collect();
        for (array, width) in [(0, 8), (1, 16)] {
            let mut bytes = Vec::new();
            growing.copy(array, &mut bytes).unwrap();
            assert_eq!(growing.size(array), (width * rows) as u64);
            let lasts = bytes.chunks_exact(width).flat_map(|row| &row[width - 8..]);
            assert!(bytes.len() == width * rows && lasts.eq(&first));
        }
    }

    #[test]
    fn numbers_begin_at_an_aligned_offset() {
        for (rows, shape) in [(0, &[][..]), (3, &[4]), (123_456, &[16, 3])] {
            let header = header(rows, shape);
            assert!(header.len().is_multiple_of(64), "{}", header.len());
            assert_eq!(header.last(), Some(&b'\n'));
            let text = String::from_utf8_lossy(&header);
            assert!(text.contains(&format!("'shape': ({rows},")), "{text}");
        }
    }
}
