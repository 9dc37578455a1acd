//! Kinds of files that `export` writes.

use std::path::Path;

use bodyflight_io::destination::ending;
use bodyflight_io::diagnostic::Result;
use serde::Serialize;

/// A kind of file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// Compressed columns.
    Parquet,
    /// Columns as text.
    Csv,
    /// A moving body, for Foxglove.
    Mcap,
    /// Arrays, for NumPy.
    Npz,
}

impl Format {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Parquet, Self::Csv, Self::Mcap, Self::Npz];

    /// Name, which is also the file extension.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Parquet => "parquet",
            Self::Csv => "csv",
            Self::Mcap => "mcap",
            Self::Npz => "npz",
        }
    }

    /// The kind with that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.name() == name)
    }

    /// The kind of a file according to its extension.
    ///
    /// # Errors
    /// Returns an error if the extension is unknown.
    pub fn of(path: &Path) -> Result<Self> {
        let end = ending(path, &Self::ALL.map(Self::name), "a file")?;
        Ok(Self::from_name(end).unwrap_or(Self::Csv))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kind_of_a_file_is_detected() {
        assert_eq!(Format::of(Path::new("a/run.MCAP")).unwrap(), Format::Mcap);
        for wrong in ["run", "run.xlsx", ".csv"] {
            assert!(Format::of(Path::new(wrong)).is_err(), "{wrong}");
        }
    }
}
