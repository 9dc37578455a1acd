//! Columns as Parquet: 64-bit numbers, with unit and meaning in the metadata of each field, and facts about the flight in
//! those of the file.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, RecordBatch};
use arrow_schema::{DataType, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;

use super::quantity::{Quantity, Sink};
use crate::about::{About, PROGRAM};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::AtomicFile;

/// Rows per group: half a minute of flight, which is what is held in memory.
const GROUP: usize = 8192;

/// A table being written.
pub struct ParquetTable {
    writer: ArrowWriter<AtomicFile>,
    schema: Arc<Schema>,
    columns: Vec<Vec<f64>>,
    rows: usize,
    path: PathBuf,
}

impl ParquetTable {
    /// Creates the file.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be written to.
    pub fn create(path: &Path, quantities: &[Quantity], about: &About) -> Result<Self> {
        let fields = quantities.iter().flat_map(|quantity| {
            let about = HashMap::from([
                ("unit".to_owned(), quantity.unit.symbol.to_owned()),
                ("meaning".to_owned(), quantity.meaning.to_owned()),
            ]);
            let columns = quantity.columns().into_iter();
            columns.map(move |name| {
                Field::new(name, DataType::Float64, true).with_metadata(about.clone())
            })
        });
        let fields: Vec<Field> = fields.collect();
        let columns = vec![Vec::with_capacity(GROUP); fields.len()];
        let schema = Arc::new(Schema::new(fields));
        let facts = about.facts.iter();
        let facts = facts.map(|(name, fact)| KeyValue::new(name.clone(), fact.clone()));
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            // Values hardly ever repeat, so a dictionary would only take space.
            .set_dictionary_enabled(false)
            .set_created_by(PROGRAM.to_owned())
            .set_key_value_metadata(Some(facts.collect()))
            .build();
        let file = AtomicFile::create(path)?;
        let writer = ArrowWriter::try_new(file, schema.clone(), Some(properties));
        Ok(Self {
            writer: writer.map_err(|error| refused(path, error))?,
            schema,
            columns,
            rows: 0,
            path: path.to_path_buf(),
        })
    }

    /// Writes the buffered rows as a group.
    fn flush(&mut self) -> Result<()> {
        if self.rows == 0 {
            return Ok(());
        }
        let arrays = self.columns.iter_mut().map(|column| {
            let numbers = column.drain(..);
            let present = numbers.map(|number| (!number.is_nan()).then_some(number));
            Arc::new(Float64Array::from_iter(present)) as ArrayRef
        });
        let arrays = arrays.collect();
        self.rows = 0;
        let batch = RecordBatch::try_new(self.schema.clone(), arrays)
            .map_err(|error| refused(&self.path, error))?;
        self.writer
            .write(&batch)
            .and_then(|()| self.writer.flush())
            .map_err(|error| refused(&self.path, error))
    }
}

fn refused(path: &Path, error: impl std::error::Error + Send + Sync + 'static) -> Problem {
    Problem::refused("cannot write the table")
        .in_file(path)
        .caused_by(error)
}

impl Sink for ParquetTable {
    fn write(&mut self, row: &[f64]) -> Result<()> {
        for (column, number) in self.columns.iter_mut().zip(row) {
            column.push(*number);
        }
        self.rows += 1;
        if self.rows < GROUP {
            return Ok(());
        }
        self.flush()
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        self.flush()?;
        let Self { writer, path, .. } = *self;
        let file = writer.into_inner().map_err(|error| refused(&path, error))?;
        file.finish()
    }
}
