//! Quantities as NumPy arrays, all in one archive that `numpy.load` opens.
//!
//! The first axis of an array is the frame, then come segments and components. `about.json` in the archive lists units
//! and meanings.

use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde_json::json;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::quantity::{Of, Quantity, Sink};
use bodyflight_core::Segment;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::AtomicFile;

/// Arrays of at least this size (bytes) are stored as large (ZIP64) entries.
const LARGE: usize = 1 << 31;

/// An archive being written; its numbers are kept in memory until it is finished.
pub struct NpzArchive {
    file: AtomicFile,
    quantities: Vec<Quantity>,
    numbers: Vec<Vec<f64>>,
    rows: usize,
    path: PathBuf,
}

impl NpzArchive {
    /// Creates the file.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be written to.
    pub fn create(path: &Path, quantities: Vec<Quantity>) -> Result<Self> {
        Ok(Self {
            file: AtomicFile::create(path)?,
            numbers: vec![Vec::new(); quantities.len()],
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
        for (quantity, numbers) in self.quantities.iter().zip(&mut self.numbers) {
            let until = from + quantity.width();
            numbers.extend_from_slice(row.get(from..until).unwrap_or_default());
            from = until;
        }
        self.rows += 1;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        let Self {
            file,
            quantities,
            numbers,
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
        for (quantity, numbers) in quantities.iter().zip(&numbers) {
            let is_large = numbers.len() * size_of::<f64>() >= LARGE;
            let name = format!("{}.npy", quantity.array());
            archive
                .start_file(name, stored.large_file(is_large))
                .map_err(refused)?;
            let mut bytes = header(rows, &quantity.shape());
            bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
            archive.write_all(&bytes).map_err(system)?;
        }
        archive.finish().map_err(refused)?.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
