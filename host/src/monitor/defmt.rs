//! The unit's logs: defmt frames, made readable by the image that sent them.

use std::path::Path;

use defmt_decoder::{DecodeError, StreamDecoder, Table};
use serde::Serialize;

use crate::diagnostic::{Problem, Result};

/// The table of an image: what its log frames mean.
///
/// # Errors
/// Where the file is no image, or one without logs.
pub fn table(image: &Path) -> Result<Table> {
    let bytes = std::fs::read(image).map_err(|error| Problem::system("read", image, &error))?;
    let wrong = |what: String| {
        Problem::bad_input(what)
            .in_file(image)
            .help("give the ELF image that runs on the unit; cargo xtask unit builds it")
    };
    Table::parse(&bytes)
        .map_err(|error| wrong(format!("expected an image with defmt logs: {error}")))?
        .ok_or_else(|| wrong("this image has no defmt logs".to_owned()))
}

/// A line of the log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Line {
    /// Time of the unit, as it prints it.
    pub time: Option<String>,
    /// Level: trace to error.
    pub level: Option<String>,
    /// What it says.
    pub text: String,
}

/// Turns bytes into lines.
pub struct Decoder<'t> {
    frames: Box<dyn StreamDecoder + Send + Sync + 't>,
    /// Lines so far.
    pub lines: u64,
    /// Frames that were none.
    pub malformed: u64,
}

impl<'t> Decoder<'t> {
    /// For the image of `table`.
    pub fn new(table: &'t Table) -> Self {
        Self {
            frames: table.new_stream_decoder(),
            lines: 0,
            malformed: 0,
        }
    }

    /// The lines that `bytes` complete.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Line> {
        self.frames.received(bytes);
        let mut lines = Vec::new();
        loop {
            match self.frames.decode() {
                Ok(frame) => lines.push(Line {
                    time: frame.display_timestamp().map(|time| time.to_string()),
                    level: frame.level().map(|level| level.as_str().to_owned()),
                    text: frame.display_message().to_string(),
                }),
                Err(DecodeError::UnexpectedEof) => break,
                Err(DecodeError::Malformed) => self.malformed += 1,
            }
        }
        self.lines += lines.len() as u64;
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_image_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("unit");
        assert!(
            table(&path)
                .unwrap_err()
                .to_string()
                .contains("cannot read")
        );
        std::fs::write(&path, "not an image").unwrap();
        let problem = table(&path).err().unwrap();
        assert!(
            problem.to_string().contains("expected an image"),
            "{problem}"
        );
        assert!(problem.help.unwrap().contains("cargo xtask unit"));
    }
}
