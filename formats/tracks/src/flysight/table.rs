//! The tables in FlySight files.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use bodyflight_io::diagnostic::Result;
use bodyflight_io::input;
use bodyflight_io::text::with_commas;

use crate::text;

/// Most fields read per row; receivers write at most fifteen.
const MOST_FIELDS: usize = 64;

/// Rows that could not be used.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Skipped {
    /// How many.
    pub count: usize,
    /// Line number of the first one, and what is wrong with it.
    pub first: Option<(u64, String)>,
}

impl Skipped {
    pub(super) fn add(&mut self, line: u64, why: &str) {
        self.count += 1;
        self.first.get_or_insert((line, why.to_owned()));
    }
}

/// The rows of all sensors in a file.
#[derive(Debug)]
pub(super) struct Tables {
    /// Column names of each sensor.
    columns: BTreeMap<String, Vec<String>>,
    /// Names of the sensors that have rows.
    sensors: Vec<String>,
    rows: Vec<Stored>,
    /// The text of all fields, and where each begins. Hours of rows would take ten times the memory and time as a text
    /// for each field.
    text: String,
    begins: Vec<usize>,
    /// Whether a FlySight 2 wrote the file.
    pub(super) is_second_generation: bool,
    pub(super) skipped: Skipped,
}

/// A row as it is kept.
#[derive(Debug)]
struct Stored {
    line: u64,
    /// Place of its sensor.
    sensor: usize,
    /// Places of its fields.
    fields: Range<usize>,
}

/// A row with the names of its fields.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row<'a> {
    pub(super) line: u64,
    columns: &'a [String],
    tables: &'a Tables,
    first: usize,
    count: usize,
}

impl Tables {
    pub(super) fn read(path: &Path) -> Result<Self> {
        let bytes = input::bytes(path)?;
        Ok(Self::parse(&with_commas(&text::plain(&bytes))))
    }

    /// Invalid UTF-8 in one place must not cost the rest of the track.
    pub(super) fn parse(bytes: &[u8]) -> Self {
        let mut tables = Self {
            columns: BTreeMap::new(),
            sensors: Vec::new(),
            rows: Vec::new(),
            text: String::with_capacity(bytes.len()),
            begins: Vec::new(),
            is_second_generation: bytes.starts_with(b"$FLYS"),
            skipped: Skipped::default(),
        };
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .quoting(false)
            .from_reader(bytes);
        let mut record = csv::ByteRecord::new();
        loop {
            match reader.read_byte_record(&mut record) {
                Ok(true) => tables.add(&record),
                Ok(false) => break,
                Err(error) => {
                    let line = error.position().map_or(0, csv::Position::line);
                    tables.skipped.add(line, &error.to_string());
                }
            }
        }
        tables
    }

    fn add(&mut self, record: &csv::ByteRecord) {
        let line = record.position().map_or(0, csv::Position::line);
        let Some(first) = record.get(0).map(trimmed) else {
            return;
        };
        // Most rows begin with a digit or a sensor's name.
        let is_row = first.starts_with(|letter: char| letter.is_ascii_digit());
        let has = |wanted: &[u8]| record.iter().any(|field| field.trim_ascii() == wanted);
        let names = |skipped: usize| record.iter().take(MOST_FIELDS).skip(skipped).map(trimmed);
        // FlySight 1: a line of names in any order, a line of units, then the rows.
        if !is_row && !first.starts_with("$COL") && has(b"velD") && has(b"lat") {
            let names = names(0).map(|name| name.trim_start_matches('$').to_owned());
            self.columns.insert("GNSS".to_owned(), names.collect());
            return;
        }
        match &*first {
            "$FLYS" | "$VAR" | "$UNIT" | "$DATA" => {}
            "$COL" => {
                let mut names = names(1).map(Cow::into_owned);
                if let Some(sensor) = names.next() {
                    self.columns.insert(sensor, names.collect());
                }
            }
            sensor if sensor.starts_with('$') => self.keep(line, &sensor[1..], names(1)),
            _ if self.rows.is_empty() && has(b"(m/s)") => {}
            "" if self.rows.is_empty() => {}
            _ => self.keep(line, "GNSS", names(0)),
        }
    }

    fn keep<'a>(&mut self, line: u64, sensor: &str, fields: impl Iterator<Item = Cow<'a, str>>) {
        let known = self.sensors.iter().position(|known| known == sensor);
        let sensor = known.unwrap_or_else(|| {
            self.sensors.push(sensor.to_owned());
            self.sensors.len() - 1
        });
        let first = self.begins.len();
        for field in fields {
            self.begins.push(self.text.len());
            self.text.push_str(&field);
        }
        self.rows.push(Stored {
            line,
            sensor,
            fields: first..self.begins.len(),
        });
    }

    /// The text of a field.
    fn field(&self, place: usize) -> Option<&str> {
        let begin = *self.begins.get(place)?;
        let end = self.begins.get(place + 1).copied();
        self.text.get(begin..end.unwrap_or(self.text.len()))
    }

    /// The rows of one sensor.
    pub(super) fn rows<'a>(&'a self, sensor: &str) -> impl Iterator<Item = Row<'a>> {
        let columns = self.columns.get(sensor).map_or(&[][..], Vec::as_slice);
        let place = self.sensors.iter().position(|known| known == sensor);
        let own = self
            .rows
            .iter()
            .filter(move |row| Some(row.sensor) == place);
        own.map(move |row| Row {
            line: row.line,
            columns,
            tables: self,
            first: row.fields.start,
            count: row.fields.len(),
        })
    }
}

/// The text of a field without blanks around it.
fn trimmed(field: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(field.trim_ascii())
}

impl<'a> Row<'a> {
    /// The field in the named column.
    pub(super) fn text(&self, name: &str) -> core::result::Result<&'a str, String> {
        let place = self.columns.iter().position(|column| column == name);
        let place = place.ok_or_else(|| format!("no column \"{name}\""))?;
        let field = (place < self.count).then(|| self.tables.field(self.first + place));
        field
            .flatten()
            .ok_or_else(|| format!("the row ends before \"{name}\""))
    }

    /// The number in the named column.
    pub(super) fn number(&self, name: &str) -> core::result::Result<f64, String> {
        let text = self.text(name)?;
        let number: Option<f64> = text.parse().ok();
        number
            .filter(|number| number.is_finite())
            .ok_or_else(|| format!("{name}: expected a number, found \"{text}\""))
    }

    /// The number in the named column, with an absolute value of at most `most`.
    pub(super) fn within(&self, name: &str, most: f64) -> core::result::Result<f64, String> {
        let number = self.number(name)?;
        if number.abs() <= most {
            Ok(number)
        } else {
            Err(format!("{name}: expected at most {most}, found {number}"))
        }
    }
}
