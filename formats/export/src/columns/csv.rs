//! Columns as CSV, with full precision.

use std::path::Path;

use super::quantity::{Quantity, Sink};
use bodyflight_io::diagnostic::Result;
use bodyflight_io::files::CsvFile;

/// A table being written.
pub struct CsvTable(CsvFile);

impl CsvTable {
    /// Creates the file.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be written to.
    pub fn create(path: &Path, quantities: &[Quantity]) -> Result<Self> {
        let columns: Vec<String> = quantities.iter().flat_map(Quantity::columns).collect();
        CsvFile::create(path, &columns).map(Self)
    }
}

impl Sink for CsvTable {
    fn write(&mut self, row: &[f64]) -> Result<()> {
        // The shortest text that reads back as the same number; empty for a missing one.
        let field = |number: &f64| match number {
            number if number.is_nan() => String::new(),
            number => number.to_string(),
        };
        self.0.write_fields(row.iter().map(field))
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.0.finish()
    }
}
