//! The tables in FlySight files.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

use bodyflight_io::text;

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
pub(super) struct Tables<'a> {
    text: &'a [u8],
    /// Column names of each sensor.
    columns: BTreeMap<String, Vec<String>>,
    /// Names of the sensors that have rows.
    sensors: Vec<&'a [u8]>,
    /// The sensors among them whose columns were known, and their places.
    marked: Vec<(&'a [u8], usize)>,
    rows: Vec<Stored>,
    /// Whether a FlySight 2 wrote the file.
    pub(super) is_second_generation: bool,
}

/// Where a row is. Hours of rows would take ten times the memory and time with a text for each field.
#[derive(Debug)]
struct Stored {
    line: u64,
    /// Place of its sensor.
    sensor: usize,
    /// Its bytes, from its first field on.
    bytes: Range<usize>,
    most_fields: usize,
}

/// A column of a sensor by its name, which it may lack.
#[derive(Debug, Clone, Copy)]
pub(super) struct Column {
    name: &'static str,
    place: Option<usize>,
}

/// A row, with the places at which its fields begin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row<'a> {
    pub(super) line: u64,
    bytes: &'a [u8],
    begins: [usize; MOST_FIELDS + 1],
    count: usize,
}

impl<'a> Tables<'a> {
    /// Invalid UTF-8 in one place must not cost the rest of the track.
    pub(super) fn parse(text: &'a [u8]) -> Self {
        let mut tables = Self {
            text,
            columns: BTreeMap::new(),
            sensors: Vec::new(),
            marked: Vec::new(),
            rows: Vec::new(),
            is_second_generation: text.starts_with(b"$FLYS"),
        };
        let (mut at, mut line) = (0, 1);
        while at < text.len() {
            // A row ends at a line feed, a carriage return, or both.
            let end = memchr::memchr2(b'\n', b'\r', &text[at..]).map_or(text.len(), |end| at + end);
            if end > at {
                tables.add(line, at..end);
            }
            line += u64::from(text.get(end) == Some(&b'\n'));
            at = end + 1;
        }
        tables
    }

    fn add(&mut self, line: u64, row: Range<usize>) {
        let bytes = &self.text[row.clone()];
        // Most rows are of a sensor that had rows before.
        let own = self.marked.iter().find_map(|&(name, sensor)| {
            let rest = bytes.strip_prefix(b"$")?.strip_prefix(name)?;
            Some((rest.strip_prefix(b",")?, sensor))
        });
        if let Some((rest, sensor)) = own {
            self.rows.push(Stored {
                line,
                sensor,
                bytes: row.end - rest.len()..row.end,
                most_fields: MOST_FIELDS - 1,
            });
            return;
        }
        let first_end = memchr::memchr(b',', bytes).unwrap_or(bytes.len());
        let first = bytes[..first_end].trim_ascii();
        let after_first = (row.start + first_end + 1).min(row.end)..row.end;
        let marked = first.strip_prefix(b"$").filter(|sensor| {
            let name = core::str::from_utf8(sensor);
            name.is_ok_and(|name| self.columns.contains_key(name))
        });
        // Others begin with a digit, or with the name of a sensor whose columns are known.
        if let Some(name) = marked {
            let sensor = self.keep(line, name, after_first, MOST_FIELDS - 1);
            if !self.marked.iter().any(|(known, _)| *known == name) {
                self.marked.push((name, sensor));
            }
            return;
        }
        let is_row = first.first().is_some_and(u8::is_ascii_digit);
        let has = |wanted: &[u8]| fields(bytes).any(|field| field == wanted);
        let names = |skipped: usize| fields(bytes).take(MOST_FIELDS).skip(skipped).map(lossy);
        // FlySight 1: a line of names in any order, a line of units, then the rows.
        if !is_row && !first.starts_with(b"$COL") && has(b"velD") && has(b"lat") {
            let names = names(0).map(|name| name.trim_start_matches('$').to_owned());
            self.columns.insert("GNSS".to_owned(), names.collect());
            return;
        }
        match first {
            b"$FLYS" | b"$VAR" | b"$UNIT" | b"$DATA" => {}
            b"$COL" => {
                let mut names = names(1).map(Cow::into_owned);
                if let Some(sensor) = names.next() {
                    self.columns.insert(sensor, names.collect());
                }
            }
            [b'$', sensor @ ..] => {
                self.keep(line, sensor, after_first, MOST_FIELDS - 1);
            }
            _ if self.rows.is_empty() && has(b"(m/s)") => {}
            b"" if self.rows.is_empty() => {}
            _ => {
                self.keep(line, b"GNSS", row, MOST_FIELDS);
            }
        }
    }

    /// Keeps a row; returns the place of its sensor.
    fn keep(
        &mut self,
        line: u64,
        sensor: &'a [u8],
        bytes: Range<usize>,
        most_fields: usize,
    ) -> usize {
        let known = self.sensors.iter().position(|known| *known == sensor);
        let sensor = known.unwrap_or_else(|| {
            self.sensors.push(sensor);
            self.sensors.len() - 1
        });
        self.rows.push(Stored {
            line,
            sensor,
            bytes,
            most_fields,
        });
        sensor
    }

    /// Columns of a sensor by their names.
    pub(super) fn columns<const N: usize>(
        &self,
        sensor: &str,
        names: [&'static str; N],
    ) -> [Column; N] {
        let known = self.columns.get(sensor).map_or(&[][..], Vec::as_slice);
        names.map(|name| Column {
            name,
            place: known.iter().position(|column| column == name),
        })
    }

    /// The rows of one sensor.
    pub(super) fn rows(&self, sensor: &str) -> impl Iterator<Item = Row<'a>> {
        let sensor = sensor.as_bytes();
        let place = self.sensors.iter().position(|known| *known == sensor);
        let own = self
            .rows
            .iter()
            .filter(move |row| Some(row.sensor) == place);
        own.map(|row| Row::new(row.line, &self.text[row.bytes.clone()], row.most_fields))
    }
}

/// The fields of a row without blanks around them.
fn fields(row: &[u8]) -> impl Iterator<Item = &[u8]> {
    row.split(|byte| *byte == b',').map(<[u8]>::trim_ascii)
}

fn lossy(field: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(field)
}

impl<'a> Row<'a> {
    fn new(line: u64, bytes: &'a [u8], most_fields: usize) -> Self {
        let mut begins = [0; MOST_FIELDS + 1];
        let mut count = usize::from(!bytes.is_empty());
        for (at, byte) in bytes.iter().enumerate() {
            if *byte == b',' {
                begins[count] = at + 1;
                if count == most_fields {
                    break;
                }
                count += 1;
            }
        }
        // Where the field after the last would begin.
        if begins[count] == 0 {
            begins[count] = bytes.len() + 1;
        }
        Self {
            line,
            bytes,
            begins,
            count,
        }
    }

    /// The field in a column, if there is one.
    #[inline]
    fn found(&self, column: Column) -> Option<&'a [u8]> {
        let place = column.place.filter(|place| *place < self.count)?;
        let bytes = self.bytes;
        Some(bytes[self.begins[place]..self.begins[place + 1] - 1].trim_ascii())
    }

    /// The field in a column.
    pub(super) fn field(&self, column: Column) -> Result<&'a [u8], String> {
        self.found(column).ok_or_else(|| {
            let name = column.name;
            match column.place {
                None => format!("no column \"{name}\""),
                Some(_) => format!("the row ends before \"{name}\""),
            }
        })
    }

    /// The number in a column, if there is one.
    pub(super) fn optional(&self, column: Column) -> Option<f64> {
        self.found(column)?;
        self.number(column).ok()
    }

    /// The number in a column.
    #[inline]
    pub(super) fn number(&self, column: Column) -> Result<f64, String> {
        if let Some(field) = self.found(column)
            && let Some((number, length)) = text::leading_number(field)
            && length == field.len()
        {
            return Ok(number);
        }
        self.unusual_number(column)
    }

    /// The same for numbers in other forms, and for what is none.
    #[cold]
    fn unusual_number(&self, column: Column) -> Result<f64, String> {
        let field = lossy(self.field(column)?);
        let number: Option<f64> = field.parse().ok();
        number
            .filter(|number| number.is_finite())
            .ok_or_else(|| format!("{}: expected a number, found \"{field}\"", column.name))
    }

    /// The number in a column, with an absolute value of at most `most`.
    pub(super) fn within(&self, column: Column, most: f64) -> Result<f64, String> {
        let number = self.number(column)?;
        if number.abs() <= most {
            Ok(number)
        } else {
            let name = column.name;
            Err(format!("{name}: expected at most {most}, found {number}"))
        }
    }
}
