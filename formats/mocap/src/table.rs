//! Tables of numbers with named columns: CSV, OpenSim's storage files (`.mot`, `.sto`), TRC and C3D.

use bodyflight_core::Segment;

use crate::header::Header;
use crate::mapping::{AngleUnit, Kind, Mapping};
use crate::{c3d, storage};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::text::decimal;

/// Most column names listed in the message about a missing one.
const NAMES_SHOWN: usize = 40;

/// Name of the column of times (s) of files that have points.
const TIME: &str = "Time";

/// Largest angle of a joint in radians, and the smallest of a moving body in degrees.
const MOST_RADIANS: f64 = 7.0;
pub(crate) const LEAST_DEGREES: f64 = 3.2;

/// A whole table.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Names of the columns.
    pub columns: Vec<String>,
    /// The unit of angles, if the file or its format determines it.
    pub angles: Option<AngleUnit>,
    /// Length of one unit (m), if the file states it.
    pub unit_m: Option<f64>,
    /// Name of that unit as the file states it, "none" if its format should but it does not.
    pub unit_name: Option<String>,
    /// What the header says of the rows.
    pub(crate) header: Header,
    values: Vec<f64>,
    lines: Vec<u64>,
}

impl Table {
    /// Reads a table from a text. Empty cells become NaN.
    ///
    /// # Errors
    /// Returns an error if it has no column names, or has a cell that is not a number.
    pub(crate) fn parse(text: &str) -> Result<Self> {
        let text = text.trim_start_matches('\u{feff}');
        let lines = || (1..).zip(text.lines());
        if text.trim_start().starts_with("PathFileType") {
            return trc(lines());
        }
        let storage = lines().find(|(_, line)| line.trim().eq_ignore_ascii_case("endheader"));
        let header = storage.map_or(0, |(number, _)| number);
        let head: Vec<&str> = lines()
            .take_while(|(number, _)| *number < header)
            .map(|(_, line)| line.trim())
            .collect();
        let angles = storage.and_then(|_| storage::angle_unit(&head));
        let parts = storage::parts(&head);
        let mut rest = lines()
            .skip_while(|(number, _)| *number <= header)
            .filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
        let (number, names) = rest
            .next()
            .ok_or_else(|| Problem::bad_input("expected a line of names, found an empty table"))?;
        let separator = separator(names);
        let columns: Vec<String> = cells(names, separator)
            .enumerate()
            .flat_map(|(k, name)| storage::columns(name, if k == 0 { "" } else { parts }))
            .collect();
        if columns.iter().all(|name| name.parse::<f64>().is_ok()) {
            return Err(
                Problem::bad_input("expected names of columns, found numbers")
                    .at_line(number)
                    .help("the first line of a table must name its columns"),
            );
        }
        let mut table = Self {
            columns,
            angles,
            unit_m: None,
            unit_name: None,
            header: storage::header(&head),
            values: Vec::new(),
            lines: Vec::new(),
        };
        table.check_names(number)?;
        for (number, line) in rest {
            if parts.is_empty() {
                table.add_row(number, cells(line, separator))?;
            } else {
                let each = cells(line, separator).flat_map(|cell| cell.split(',').map(str::trim));
                table.add_row(number, each)?;
            }
        }
        table.checked()
    }

    /// Converts the points of a C3D file to columns `Time` (s), `point.x`, `point.y`, `point.z`.
    ///
    /// # Errors
    /// Returns an error if two points have the same name, or there are fewer than two frames.
    pub(crate) fn of_points(points: &c3d::Points) -> Result<Self> {
        let names = points.names.iter();
        let coordinates =
            names.flat_map(|point| ["x", "y", "z"].map(|axis| format!("{point}.{axis}")));
        let mut table = Self {
            // Without a rate there is no time: the mapping gives the rate.
            columns: (points.rate.map(|_| TIME.to_owned()).into_iter())
                .chain(coordinates)
                .collect(),
            angles: None,
            unit_m: None,
            unit_name: Some(points.unit.clone().unwrap_or_else(|| "none".to_owned())),
            header: points.header.clone(),
            values: Vec::new(),
            lines: Vec::new(),
        };
        table.check_names(0)?;
        table.unit_m = table.unit_name.as_deref().and_then(unit_of_length);
        for (row, places) in (0u32..).zip(points.places.chunks(points.names.len().max(1))) {
            table
                .values
                .extend(points.rate.map(|rate| f64::from(row) / rate));
            table.values.extend(places.iter().flatten());
            table.lines.push(u64::from(row) + 1);
        }
        table.checked()
    }

    /// A table from rows with their line numbers; a row holds a number for each column.
    ///
    /// # Errors
    /// Returns an error if two columns have the same name, or there are fewer than two rows.
    pub(crate) fn of_rows(columns: Vec<String>, rows: Vec<(u64, Vec<f64>)>) -> Result<Self> {
        let (lines, values): (Vec<u64>, Vec<Vec<f64>>) = rows.into_iter().unzip();
        let table = Self {
            columns,
            angles: None,
            unit_m: None,
            unit_name: None,
            header: Header::default(),
            values: values.concat(),
            lines,
        };
        table.check_names(0)?;
        table.checked()
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.lines.len()
    }

    /// Line number of a row in the file, from 1; for C3D, the frame.
    pub fn line(&self, row: usize) -> u64 {
        self.lines.get(row).copied().unwrap_or(0)
    }

    /// The number in a cell; NaN if it is empty.
    pub fn value(&self, row: usize, column: usize) -> f64 {
        let at = row * self.columns.len() + column;
        self.values.get(at).copied().unwrap_or(f64::NAN)
    }

    /// Replaces the number in a cell.
    pub fn set(&mut self, row: usize, column: usize, value: f64) {
        let at = row * self.columns.len() + column;
        if let Some(cell) = self.values.get_mut(at) {
            *cell = value;
        }
    }

    /// Whether a mapping takes the time from the file, whose points have none because it states no rate.
    pub(crate) fn lacks_rate(&self, mapping: &Mapping) -> bool {
        let has_points = self.unit_name.is_some();
        let column = mapping.time.column.as_deref();
        has_points && column == Some(TIME) && !self.columns.iter().any(|name| name == TIME)
    }

    /// Doubts about the unit of the mapped angles, if neither mapping nor file states it.
    pub fn angle_warnings(&self, mapping: &Mapping) -> Vec<String> {
        if mapping.kind != Kind::Angles {
            return Vec::new();
        }
        let joints = mapping
            .segments
            .iter()
            .filter(|(name, _)| *name != Segment::Pelvis.name());
        let columns = joints.flat_map(|(_, row)| row.columns.iter().flatten());
        let columns = columns.filter_map(|name| self.column(name.trim_start_matches('-')).ok());
        let values =
            columns.flat_map(|column| (0..self.rows()).map(move |row| self.value(row, column)));
        let largest = values
            .map(f64::abs)
            .filter(|value| value.is_finite())
            .fold(0.0, f64::max);
        let in_radians = mapping.angles.unit.or(self.angles) == Some(AngleUnit::Rad);
        let doubt = if in_radians && largest > MOST_RADIANS {
            "more than a joint turns: are they degrees?"
        } else if !in_radians && (0.0..LEAST_DEGREES).contains(&largest) && largest > 0.0 {
            "so small that they may be radians"
        } else {
            return Vec::new();
        };
        let unit = if in_radians { "radians" } else { "degrees" };
        vec![format!(
            "the angles of the joints, taken as {unit}, reach {largest:.2}, {doubt} [angles] unit says it"
        )]
    }

    /// Index of a column.
    ///
    /// # Errors
    /// Returns an error that lists the columns if none has this name.
    pub fn column(&self, name: &str) -> Result<usize> {
        let found = self.columns.iter().position(|column| column == name);
        found.ok_or_else(|| {
            let mut names = self
                .columns
                .iter()
                .take(NAMES_SHOWN)
                .cloned()
                .collect::<Vec<_>>();
            if self.columns.len() > NAMES_SHOWN {
                names.push("...".to_owned());
            }
            Problem::bad_input(format!("the table has no column \"{name}\""))
                .help(format!("its columns: {}", names.join(", ")))
        })
    }

    fn check_names(&self, line: u64) -> Result<()> {
        for (k, name) in self.columns.iter().enumerate() {
            if self.columns[..k].contains(name) && !name.is_empty() {
                let problem = Problem::bad_input(format!("two columns are called \"{name}\""));
                return Err(if line > 0 {
                    problem.at_line(line)
                } else {
                    problem
                });
            }
        }
        Ok(())
    }

    fn add_row<'a>(&mut self, line: u64, cells: impl Iterator<Item = &'a str>) -> Result<()> {
        let before = self.values.len();
        for (cell, column) in cells.zip(0..) {
            let empty = cell.is_empty() || cell.eq_ignore_ascii_case("nan");
            // Where commas do not separate cells, they may be those of decimals.
            let value = match decimal(cell) {
                Some(value) => value,
                None if empty => f64::NAN,
                None => {
                    let name = self.columns.get(column).map_or("", String::as_str);
                    return Err(
                        Problem::bad_input(format!("expected a number, found \"{cell}\""))
                            .at_line(line)
                            .at(format!("column {}, {name}", column + 1)),
                    );
                }
            };
            self.values.push(value);
        }
        let found = self.values.len() - before;
        if found != self.columns.len() {
            return Err(Problem::bad_input(format!(
                "expected {} numbers, one per column, found {found}",
                self.columns.len()
            ))
            .at_line(line));
        }
        self.lines.push(line);
        Ok(())
    }

    fn checked(self) -> Result<Self> {
        if self.rows() < 2 {
            let message = format!("expected at least 2 rows of numbers, found {}", self.rows());
            return Err(Problem::bad_input(message));
        }
        Ok(self)
    }
}

/// The separator between the cells of a line.
fn separator(line: &str) -> char {
    let count = |c: char| line.matches(c).count();
    let most = ['\t', ';', ','].into_iter().max_by_key(|c| count(*c));
    most.filter(|c| count(*c) > 0).unwrap_or(' ')
}

fn cells(line: &str, separator: char) -> Box<dyn Iterator<Item = &str> + '_> {
    if separator == ' ' {
        Box::new(line.split_whitespace())
    } else {
        Box::new(
            line.trim_end_matches(['\r', '\n'])
                .split(separator)
                .map(|cell| cell.trim().trim_matches('"')),
        )
    }
}

/// TRC (Track Row Column): three header lines, point names, axis names, then rows of frame, time and coordinates.
/// Columns are called `point.x`, `point.y`, `point.z`; points without a name are called by their number.
fn trc<'a>(mut lines: impl Iterator<Item = (u64, &'a str)>) -> Result<Table> {
    let mut next = |what: &str| {
        let line = lines.next();
        line.ok_or_else(|| Problem::bad_input(format!("the file ends early: expected {what}")))
    };
    let (_, _) = next("the file type")?;
    let (_, keys) = next("the names of the header fields")?;
    let (_, values) = next("the values of the header fields")?;
    let header: Vec<(&str, &str)> = keys
        .split_whitespace()
        .zip(values.split_whitespace())
        .collect();
    let of = |key: &str| {
        let found = header
            .iter()
            .find(|(name, _)| name.eq_ignore_ascii_case(key));
        found.map(|(_, value)| *value)
    };
    let unit_name = of("Units").unwrap_or("none").to_owned();
    let (number, names) = next("the names of the points")?;
    next("the names of the axes")?;
    let rows: Vec<(u64, &str)> = lines.filter(|(_, line)| !line.trim().is_empty()).collect();
    let wide = rows.iter().map(|(_, row)| filled(row)).max().unwrap_or(0);
    let marked = of("NumMarkers").and_then(|count| count.parse().ok());
    let points = points(names, marked, wide.saturating_sub(2) / 3)
        .map_err(|problem| problem.at_line(number))?;
    let coordinates = points
        .iter()
        .flat_map(|point| ["x", "y", "z"].map(|axis| format!("{point}.{axis}")));
    let mut table = Table {
        columns: ["Frame#".to_owned(), TIME.to_owned()]
            .into_iter()
            .chain(coordinates)
            .collect(),
        angles: None,
        unit_m: unit_of_length(&unit_name),
        unit_name: Some(unit_name),
        header: Header {
            contradictions: Vec::new(),
            rate: of("DataRate").and_then(|rate| Some(("DataRate", rate.parse().ok()?))),
            frames: of("NumFrames").and_then(|count| count.parse().ok()),
            found: None,
        },
        values: Vec::new(),
        lines: Vec::new(),
    };
    table.check_names(number)?;
    let width = table.columns.len();
    for (number, line) in rows {
        // Some programs end each line with a tab; the cells of a point that was not visible are empty.
        if filled(line) > width {
            let message = format!("expected {width} cells, found more");
            return Err(Problem::bad_input(message).at_line(number));
        }
        let line = line.trim_end_matches(['\r', '\n']);
        let cells = cells(line, '\t').chain(core::iter::repeat("")).take(width);
        table.add_row(number, cells)?;
    }
    table.checked()
}

/// Number of cells up to the last one that is not empty.
fn filled(line: &str) -> usize {
    let cells = line.trim_end_matches(['\r', '\n']).split('\t');
    let last = cells
        .enumerate()
        .filter(|(_, cell)| !cell.trim().is_empty())
        .last();
    last.map_or(0, |(at, _)| at + 1)
}

/// The names of the points in the third line of a TRC file, one for every three columns of the rows. Software adds
/// points that nobody named; they are called by their number.
fn points(line: &str, marked: Option<usize>, in_rows: usize) -> Result<Vec<String>> {
    let cells: Vec<&str> = line.split('\t').skip(2).map(str::trim).collect();
    let named = |cells: &[&str]| cells.iter().filter(|name| !name.is_empty()).count();
    // Names stand above the first of three columns, or one after another.
    let (spread, count) = (cells.iter().copied().step_by(3), named(&cells));
    let spread: Vec<&str> = spread.collect();
    let names: Vec<&str> = if named(&spread) == count && count > 0 {
        spread
    } else {
        cells
            .iter()
            .copied()
            .filter(|name| !name.is_empty())
            .collect()
    };
    if count == 0 || marked.is_some_and(|marked| marked > in_rows.max(names.len())) {
        let message = format!(
            "expected the names of {} points between tabs, found {count}",
            marked.map_or_else(|| "some".to_owned(), |count| count.to_string()),
        );
        return Err(Problem::bad_input(message));
    }
    let last_named = names.iter().rposition(|name| !name.is_empty());
    let count = in_rows.max(last_named.map_or(0, |last| last + 1));
    let name = |k: usize| match names.get(k) {
        Some(name) if !name.is_empty() => (*name).to_owned(),
        _ => format!("point {}", k + 1),
    };
    Ok((0..count).map(name).collect())
}

/// Length of one unit (m), `None` if the name is not known.
pub(crate) fn unit_of_length(name: &str) -> Option<f64> {
    let name = name.trim().to_ascii_lowercase();
    Some(match name.trim_end_matches('.') {
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => 1e-3,
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => 1e-2,
        "dm" | "decimeter" | "decimeters" | "decimetre" | "decimetres" => 0.1,
        "m" | "meter" | "meters" | "metre" | "metres" => 1.0,
        "in" | "inch" | "inches" => 0.0254,
        "ft" | "foot" | "feet" => 0.3048,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRC: &str = "PathFileType\t4\t(X/Y/Z)\twalk.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n\
        100\t100\t2\t2\tmm\nFrame#\tTime\tLHJC\t\t\tRHJC\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n\
        1\t0.00\t1\t2\t3\t4\t5\t6\n2\t0.01\t1\t2\t3\t\t\t\n";

    #[test]
    fn headers_are_compared_with_the_rows_after_them() {
        let trc = Table::parse(TRC).unwrap();
        assert_eq!(trc.header.other_rate(100.0), None);
        assert_eq!(trc.header.other_rate(100.1), None);
        let said = trc.header.other_rate(50.0).unwrap();
        assert!(
            said.contains("DataRate is 100 Hz, and the frames are at 50.000 Hz"),
            "{said}"
        );
        assert_eq!(trc.header.other_frames(2), [None, None]);
        let [few, more] = trc.header.other_frames(1);
        assert!(more.is_none() && few.is_some_and(|said| said.contains("it was cut off")));
        let [few, more] = trc.header.other_frames(3);
        assert!(few.is_none() && more.is_some_and(|said| said.contains("another file")));
        let sto = "DataRate=60.000000\nDataType=Quaternion\nnRows=5\nendheader\ntime\ta\n0\t1,0,0,0\n0.1\t1,0,0,0\n";
        let sto = Table::parse(sto).unwrap();
        assert!(sto.header.other_rate(10.0).is_some() && sto.header.other_rate(60.0).is_none());
        assert!(sto.header.other_frames(2)[0].is_some());
        // Programs leave the rate at zero.
        let zero = Table::parse(
            &TRC.replacen("\n100\t", "\n0\t", 1)
                .replacen("100\t100", "0\t100", 1),
        )
        .unwrap();
        assert_eq!(zero.header.other_rate(100.0), None);
    }

    #[test]
    fn tables_of_each_kind_are_read() {
        let csv = Table::parse("\u{feff}time_s;knee\n0;1.5\n# a remark\n0.1;\n").unwrap();
        assert_eq!((csv.rows(), csv.line(1)), (2, 4));
        assert!(csv.value(1, 1).is_nan());
        let decimal_commas = Table::parse("time;knee\n0,00;1,5\n0,10;-2\n").unwrap();
        assert_eq!(decimal_commas.value(0, 1).to_bits(), 1.5_f64.to_bits());
        let mot = Table::parse(
            "Coordinates\nversion=1\nnRows=2\ninDegrees=yes\nendheader\ntime\tknee\n0 \t 1\n0.1\t2\n",
        );
        let mot = mot.unwrap();
        assert_eq!((mot.angles, mot.value(1, 1)), (Some(AngleUnit::Deg), 2.0));
        let trc = Table::parse(TRC).unwrap();
        assert_eq!(trc.unit_m, Some(1e-3));
        assert_eq!(trc.column("RHJC.y").unwrap(), 6);
        assert!((trc.value(0, 6) - 5.0).abs() < 1e-12);
        assert!(trc.value(1, 6).is_nan());
        for (unit, unit_m) in [
            ("MM", Some(1e-3)),
            ("in", Some(0.0254)),
            ("meters", Some(1.0)),
            ("furlong", None),
        ] {
            let table = Table::parse(&TRC.replace("mm", unit)).unwrap();
            assert_eq!(
                (table.unit_m, table.unit_name.as_deref()),
                (unit_m, Some(unit))
            );
        }
        let turned = "DataRate=100\nDataType=Quaternion\nversion=3\nendheader\ntime\tpelvis_imu\tchest\n\
            0\t1,0,0,0\t0,1,0,0\n0.01\t1,0,0,0\t0,0,1,0\n";
        let table = Table::parse(turned).unwrap();
        assert_eq!(table.column("chest.y").unwrap(), 7);
        assert!((table.value(1, 7) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn points_without_a_name_are_called_by_their_number() {
        let more = TRC
            .replace("4\t5\t6", "4\t5\t6\t7\t8\t9")
            .replace("\t2\tmm", "\t3\tmm");
        let blank = TRC.replace("LHJC", "");
        for (text, names) in [
            (&more, ["LHJC", "RHJC", "point 3"].as_slice()),
            (&blank, &["point 1", "RHJC"]),
        ] {
            let table = Table::parse(text).unwrap();
            for name in names {
                assert!(
                    table.column(&format!("{name}.z")).is_ok(),
                    "{name}: {:?}",
                    table.columns
                );
            }
            assert_eq!(table.columns.len(), 2 + 3 * names.len());
        }
    }

    #[test]
    fn broken_files_are_refused_with_the_line() {
        for (text, parts) in [
            (String::new(), ["line names", "empty"]),
            ("0,1\n2,3\n4,5".into(), ["line 1", "found numbers"]),
            (
                "a,b\n0,1\n2,x\n".into(),
                ["line 3", "column 2, b: expected a number, found \"x\""],
            ),
            ("a,b\n0,1\n2\n".into(), ["line 3", "expected 2 numbers"]),
            ("a,a\n0,1\n2,3\n".into(), ["line 1", "two columns"]),
            ("a,b\n0,1\n".into(), ["rows", "at least 2"]),
            (
                TRC.replace("\t2\tmm", "\t3\tmm"),
                ["line 4", "names of 3 points"],
            ),
            (TRC.replace("5\t6", "5\t6\t7\t8"), ["line 7", "found more"]),
            (TRC[..60].to_owned(), ["ends early", "header"]),
        ] {
            let problem = Table::parse(&text).unwrap_err();
            let said = format!(
                "line {}: {problem}",
                problem.line.map_or("names".into(), |line| line.to_string())
            );
            let found = parts
                .iter()
                .all(|part| said.contains(part) || *part == "line names");
            assert!(found, "{said}\nlacks one of {parts:?}");
        }
        let table = Table::parse("a,b\n0,1\n2,3\n").unwrap();
        let missing = table.column("knee").unwrap_err();
        assert!(missing.help.unwrap().contains("a, b"));
    }
}
