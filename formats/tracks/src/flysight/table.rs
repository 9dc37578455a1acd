//! The tables in FlySight files.

use std::collections::BTreeMap;
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
    /// Line number, sensor and fields.
    rows: Vec<(u64, String, Vec<String>)>,
    /// Whether a FlySight 2 wrote the file.
    pub(super) is_second_generation: bool,
    pub(super) skipped: Skipped,
}

/// A row with the names of its fields.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row<'a> {
    pub(super) line: u64,
    columns: &'a [String],
    fields: &'a [String],
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
            rows: Vec::new(),
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
        let fields: Vec<String> = record
            .iter()
            .take(MOST_FIELDS)
            .map(|field| String::from_utf8_lossy(field).trim().to_owned())
            .collect();
        let Some(first) = fields.first() else {
            return;
        };
        // FlySight 1: a line of names in any order, a line of units, then the rows.
        let has = |name: &str| fields.iter().any(|field| field == name);
        if !first.starts_with("$COL") && has("velD") && has("lat") {
            let names = fields
                .iter()
                .map(|name| name.trim_start_matches('$').to_owned());
            self.columns.insert("GNSS".to_owned(), names.collect());
            return;
        }
        match first.as_str() {
            "$FLYS" | "$VAR" | "$UNIT" | "$DATA" => {}
            "$COL" => {
                if let Some((sensor, names)) = fields[1..].split_first() {
                    self.columns.insert(sensor.clone(), names.to_vec());
                }
            }
            sensor if sensor.starts_with('$') => {
                let sensor = sensor[1..].to_owned();
                self.rows.push((line, sensor, fields[1..].to_vec()));
            }
            _ if self.rows.is_empty() && fields.iter().any(|field| field == "(m/s)") => {}
            "" if self.rows.is_empty() => {}
            _ => self.rows.push((line, "GNSS".to_owned(), fields)),
        }
    }

    /// The rows of one sensor.
    pub(super) fn rows<'a>(&'a self, sensor: &'a str) -> impl Iterator<Item = Row<'a>> {
        let columns = self.columns.get(sensor).map_or(&[][..], Vec::as_slice);
        let own = self.rows.iter().filter(move |(_, s, _)| s == sensor);
        own.map(move |(line, _, fields)| Row {
            line: *line,
            columns,
            fields,
        })
    }
}

impl<'a> Row<'a> {
    /// The field in the named column.
    pub(super) fn text(&self, name: &str) -> core::result::Result<&'a str, String> {
        let place = self.columns.iter().position(|column| column == name);
        let place = place.ok_or_else(|| format!("no column \"{name}\""))?;
        let field = self.fields.get(place).map(String::as_str);
        field.ok_or_else(|| format!("the row ends before \"{name}\""))
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
