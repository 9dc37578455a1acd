//! Decodes defmt frames to lines of text, using the strings in the program's ELF file.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use defmt_decoder::{DecodeError, Encoding, Locations, Table};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::input;

use super::log_line::{DefmtTotals, Line};

/// Longest incomplete frame that is kept; anything longer is noise.
const LONGEST_FRAME: usize = 1 << 16;

/// Decodes the log of one program. A malformed frame is counted and affects no other.
pub struct Defmt {
    table: Table,
    locations: Option<Locations>,
    /// Bytes of an incomplete frame.
    pending: Vec<u8>,
    totals: DefmtTotals,
}

impl Defmt {
    /// Reads the strings from the ELF file of the program that runs on the unit.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, is not an ELF file, has no defmt strings, or uses another version
    /// of defmt.
    pub fn open(path: &Path) -> Result<Self> {
        let elf = input::bytes(path)?;
        Self::new(&elf).map_err(|problem| problem.in_file(path))
    }

    /// Same as [`Defmt::open`], from the bytes of the file.
    ///
    /// # Errors
    /// Same as [`Defmt::open`].
    pub fn new(elf: &[u8]) -> Result<Self> {
        const HELP: &str =
            "give the ELF file that was flashed, as built by cargo, not a .bin or .hex file";
        let table = Table::parse(elf)
            .map_err(|error| {
                Problem::bad_input(format!("not an ELF file with defmt strings: {error:#}"))
                    .help(HELP)
            })?
            .ok_or_else(|| {
                Problem::bad_input("the program does not use defmt: no section .defmt").help(HELP)
            })?;
        // Without debug information there are no source locations, but the log is still complete.
        let locations = table.get_locations(elf).ok();
        Ok(Self {
            locations,
            ..Self::with_table(table)
        })
    }

    fn with_table(table: Table) -> Self {
        Self {
            table,
            locations: None,
            pending: Vec::new(),
            totals: DefmtTotals::default(),
        }
    }

    /// Whether lines have source locations.
    pub fn has_locations(&self) -> bool {
        self.locations
            .as_ref()
            .is_some_and(|locations| !locations.is_empty())
    }

    /// Totals of what was decoded so far.
    pub fn totals(&self) -> &DefmtTotals {
        &self.totals
    }

    /// Accepts bytes in pieces of any size; returns the lines they complete.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Line> {
        self.totals.bytes += bytes.len() as u64;
        self.pending.extend_from_slice(bytes);
        match self.table.encoding() {
            Encoding::Rzcobs => self.delimited_frames(),
            _ => self.bare_frames(),
        }
    }

    /// Frames end with a zero byte, so decoding resynchronises after any error.
    fn delimited_frames(&mut self) -> Vec<Line> {
        let mut lines = Vec::new();
        let pending = core::mem::take(&mut self.pending);
        let mut rest = pending.as_slice();
        while let Some(end) = rest.iter().position(|byte| *byte == 0) {
            let (frame, after) = rest.split_at(end + 1);
            rest = after;
            if end > 0 {
                let line = guarded(|| {
                    let mut decoder = self.table.new_stream_decoder();
                    decoder.received(frame);
                    decoder.decode().map(|frame| self.line(&frame))
                });
                match line {
                    Ok(line) => lines.push(line),
                    Err(_) => self.totals.malformed_frames += 1,
                }
            }
        }
        if rest.len() > LONGEST_FRAME {
            self.totals.malformed_frames += 1;
        } else {
            self.pending = rest.to_vec();
        }
        self.totals.lines += lines.len() as u64;
        lines
    }

    /// Frames without a delimiter: after a malformed frame the start of the next one is unknown, so all buffered bytes
    /// are dropped.
    fn bare_frames(&mut self) -> Vec<Line> {
        let mut lines = Vec::new();
        let pending = core::mem::take(&mut self.pending);
        let mut rest = pending.as_slice();
        while !rest.is_empty() {
            let decoded = guarded(|| {
                let (frame, length) = self.table.decode(rest)?;
                Ok((self.line(&frame), length))
            });
            match decoded {
                Ok((line, length)) => {
                    lines.push(line);
                    rest = rest.get(length.max(1)..).unwrap_or_default();
                }
                Err(DecodeError::UnexpectedEof) if rest.len() <= LONGEST_FRAME => break,
                Err(_) => {
                    self.totals.malformed_frames += 1;
                    rest = &[];
                }
            }
        }
        self.pending = rest.to_vec();
        self.totals.lines += lines.len() as u64;
        lines
    }

    fn line(&self, frame: &defmt_decoder::Frame<'_>) -> Line {
        let location = self
            .locations
            .as_ref()
            .and_then(|locations| locations.get(&frame.index()))
            .map(|place| format!("{}:{}", place.file.display(), place.line));
        Line {
            time: frame.display_timestamp().map(|time| time.to_string()),
            level: frame.level().map(|level| level.as_str()),
            text: frame.display_message().to_string(),
            location,
        }
    }
}

/// The decoder panics on some impossible values, such as times after the year 9999; such frames count as malformed.
fn guarded<T>(
    decode: impl FnOnce() -> core::result::Result<T, DecodeError>,
) -> core::result::Result<T, DecodeError> {
    catch_unwind(AssertUnwindSafe(decode)).unwrap_or(Err(DecodeError::Malformed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    /// The table of a program with three messages, as its ELF file would provide it.
    fn decoder(encoding: &str) -> Defmt {
        let entry = |tag: &str, text: &str| json!({"string": {"tag": tag, "string": text}, "raw_symbol": ""});
        let table = json!({
            "timestamp": entry("Timestamp", "{=u8:us}"),
            "entries": {
                "1": entry("Info", "rate {=u8} Hz"),
                "2": entry("Error", "dropped {=u16}"),
                "3": entry("Println", "ready"),
            },
            "bitflags": {},
            "encoding": encoding,
        });
        Defmt::with_table(serde_json::from_value(table).unwrap())
    }

    /// Encoded messages (index, time, argument) and the lines they decode to.
    fn messages() -> [(Vec<u8>, &'static str); 3] {
        [
            (vec![1, 0, 7, 240], "0.000007 info  rate 240 Hz"),
            (vec![2, 0, 8, 0x2C, 0x01], "0.000008 error dropped 300"),
            (vec![3, 0, 9], "0.000009 ready"),
        ]
    }

    /// Reverse zero-compressing COBS for at most six bytes: the non-zero bytes, then a map of the zeros.
    fn rzcobs(frame: &[u8]) -> Vec<u8> {
        assert!((1..=6).contains(&frame.len()));
        let mut zeros = 0xFFu8 << frame.len();
        for (place, byte) in frame.iter().enumerate() {
            zeros |= u8::from(*byte == 0) << place;
        }
        let mut encoded: Vec<u8> = frame.iter().copied().filter(|byte| *byte != 0).collect();
        encoded.extend([zeros & 0x7F, 0]);
        encoded
    }

    fn stream(encoding: &str) -> (Vec<u8>, Vec<&'static str>) {
        let mut bytes = Vec::new();
        let mut texts = Vec::new();
        for (frame, text) in messages() {
            bytes.extend(if encoding == "Raw" {
                frame
            } else {
                rzcobs(&frame)
            });
            texts.push(text);
        }
        (bytes, texts)
    }

    #[test]
    fn lines_are_the_same_in_pieces_of_any_size() {
        for encoding in ["Raw", "Rzcobs"] {
            let (bytes, texts) = stream(encoding);
            for size in 1..=bytes.len() {
                let mut decoder = decoder(encoding);
                let lines: Vec<String> = bytes
                    .chunks(size)
                    .flat_map(|piece| decoder.push(piece))
                    .map(|line| line.to_string())
                    .collect();
                assert_eq!(lines, texts, "{encoding} by {size}");
                assert_eq!(decoder.totals().lines, 3);
                assert_eq!(decoder.totals().malformed_frames, 0);
            }
        }
    }

    #[test]
    fn a_malformed_frame_costs_no_other() {
        let (good, texts) = stream("Rzcobs");
        let mut decoder = decoder("Rzcobs");
        let unknown = rzcobs(&[99, 0, 1, 1]);
        let cut = [1, 0];
        let bytes = [&unknown, good.as_slice(), &cut, &good].concat();
        let lines = decoder.push(&bytes);
        assert_eq!(lines.len(), 2 * texts.len());
        assert_eq!(decoder.totals().malformed_frames, 2);
        // Noise without a delimiter is not kept.
        decoder.push(&vec![0x55; LONGEST_FRAME + 1]);
        assert!(decoder.pending.is_empty());
        assert_eq!(decoder.totals().malformed_frames, 3);
    }

    #[test]
    fn a_file_that_cannot_be_used_is_reported() {
        let problem = |bytes: &[u8]| Defmt::new(bytes).err().unwrap();
        let text = problem(b"#!/bin/sh");
        assert!(text.message.contains("not an ELF file"), "{text}");
        assert!(text.help.unwrap().contains("flashed"));
        assert!(Defmt::open(Path::new("/nowhere/unit")).is_err());
        let own = std::env::current_exe().unwrap();
        if cfg!(target_os = "linux") {
            let problem = Defmt::open(&own).err().unwrap();
            assert!(problem.message.contains("does not use defmt"), "{problem}");
        }
    }

    proptest! {
        #[test]
        fn noise_never_stops_it(noise in prop::collection::vec(any::<u8>(), 0..400), raw: bool) {
            let encoding = if raw { "Raw" } else { "Rzcobs" };
            let mut decoder = decoder(encoding);
            decoder.push(&noise);
            if !raw {
                decoder.push(&[0]);
                let (good, texts) = stream(encoding);
                prop_assert_eq!(decoder.push(&good).len(), texts.len());
            }
        }
    }
}
