//! Tables of numbers with named columns: CSV, OpenSim's storage files (`.mot`, `.sto`), TRC and C3D.

use std::path::Path;

use super::c3d;
use crate::diagnostic::{Problem, Result};
use crate::formats::input;

/// Most column names listed in the message about a missing one.
const NAMES_SHOWN: usize = 40;

/// A whole table.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Whether angles are in degrees, if the file states it.
    pub in_degrees: Option<bool>,
    /// Length of one unit (m), if the file states it.
    pub unit_m: Option<f64>,
    values: Vec<f64>,
    lines: Vec<u64>,
}

impl Table {
    /// Reads a table, which may be compressed. Empty cells become NaN.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, has no column names, or has a cell that is not a number.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = input::movement(path)?;
        if c3d::is_c3d(&bytes) {
            let points = c3d::Points::read(&bytes);
            return points
                .and_then(|points| Self::of_points(&points))
                .map_err(|problem| problem.in_file(path));
        }
        Self::parse(&input::utf_8(bytes, path)?).map_err(|problem| problem.in_file(path))
    }

    fn parse(text: &str) -> Result<Self> {
        let text = text.trim_start_matches('\u{feff}');
        let lines = || (1..).zip(text.lines());
        if text.trim_start().starts_with("PathFileType") {
            return trc(lines());
        }
        let storage = lines().find(|(_, line)| line.trim().eq_ignore_ascii_case("endheader"));
        let header = storage.map_or(0, |(number, _)| number);
        let in_degrees = lines()
            .take_while(|(number, _)| *number < header)
            .find_map(|(_, line)| line.trim().strip_prefix("inDegrees="))
            .map(|answer| answer.trim().eq_ignore_ascii_case("yes"));
        let mut rest = lines()
            .skip_while(|(number, _)| *number <= header)
            .filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
        let (number, names) = rest
            .next()
            .ok_or_else(|| Problem::bad_input("expected a line of names, found an empty table"))?;
        let separator = separator(names);
        let columns: Vec<String> = cells(names, separator).map(str::to_owned).collect();
        if columns.iter().all(|name| name.parse::<f64>().is_ok()) {
            return Err(
                Problem::bad_input("expected names of columns, found numbers")
                    .at_line(number)
                    .help("the first line of a table must name its columns"),
            );
        }
        let mut table = Self {
            columns,
            in_degrees,
            unit_m: None,
            values: Vec::new(),
            lines: Vec::new(),
        };
        table.check_names(number)?;
        for (number, line) in rest {
            table.add_row(number, cells(line, separator))?;
        }
        table.checked()
    }

    /// Converts the points of a C3D file to columns `Time` (s), `point.x`, `point.y`, `point.z`.
    fn of_points(points: &c3d::Points) -> Result<Self> {
        let names = points.names.iter();
        let coordinates =
            names.flat_map(|point| ["x", "y", "z"].map(|axis| format!("{point}.{axis}")));
        let mut table = Self {
            columns: core::iter::once("Time".to_owned())
                .chain(coordinates)
                .collect(),
            in_degrees: None,
            unit_m: Some(unit_of_length(points.unit.as_deref())?),
            values: Vec::new(),
            lines: Vec::new(),
        };
        table.check_names(0)?;
        for (row, places) in (0u32..).zip(points.places.chunks(points.names.len().max(1))) {
            table.values.push(f64::from(row) / points.rate);
            table.values.extend(places.iter().flatten());
            table.lines.push(u64::from(row) + 1);
        }
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
                let message = format!("two columns are called \"{name}\"");
                return Err(Problem::bad_input(message).at_line(line));
            }
        }
        Ok(())
    }

    fn add_row<'a>(&mut self, line: u64, cells: impl Iterator<Item = &'a str>) -> Result<()> {
        let before = self.values.len();
        for (cell, column) in cells.zip(0..) {
            let empty = cell.is_empty() || cell.eq_ignore_ascii_case("nan");
            let value: f64 = match cell.parse() {
                Ok(value) => value,
                Err(_) if empty => f64::NAN,
                Err(_) => {
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
/// Columns are called `point.x`, `point.y`, `point.z`.
fn trc<'a>(mut lines: impl Iterator<Item = (u64, &'a str)>) -> Result<Table> {
    let mut next = |what: &str| {
        let line = lines.next();
        line.ok_or_else(|| Problem::bad_input(format!("the file ends early: expected {what}")))
    };
    let (_, _) = next("the file type")?;
    let (_, keys) = next("the names of the header fields")?;
    let (number, values) = next("the values of the header fields")?;
    let header: Vec<(&str, &str)> = keys
        .split_whitespace()
        .zip(values.split_whitespace())
        .collect();
    let of = |key: &str| {
        header
            .iter()
            .find(|(name, _)| *name == key)
            .map(|(_, value)| *value)
    };
    let unit_m = unit_of_length(of("Units")).map_err(|problem| problem.at_line(number))?;
    let (number, names) = next("the names of the points")?;
    let points: Vec<&str> = names
        .split('\t')
        .skip(2)
        .map(str::trim)
        .filter(|n| !n.is_empty())
        .collect();
    let marked: Option<usize> = of("NumMarkers").and_then(|count| count.parse().ok());
    if points.is_empty() || marked.is_some_and(|count| count != points.len()) {
        let message = format!(
            "expected the names of {} points between tabs, found {}",
            marked.map_or_else(|| "some".to_owned(), |count| count.to_string()),
            points.len()
        );
        return Err(Problem::bad_input(message).at_line(number));
    }
    next("the names of the axes")?;
    let coordinates = points
        .iter()
        .flat_map(|point| ["x", "y", "z"].map(|axis| format!("{point}.{axis}")));
    let mut table = Table {
        columns: ["Frame#".to_owned(), "Time".to_owned()]
            .into_iter()
            .chain(coordinates)
            .collect(),
        in_degrees: None,
        unit_m: Some(unit_m),
        values: Vec::new(),
        lines: Vec::new(),
    };
    table.check_names(number)?;
    let width = table.columns.len();
    for (number, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        // Some programs end each line with a tab; the cells of a point that was not visible are empty.
        let line = line.trim_end_matches(['\r', '\n']);
        let cells = cells(line, '\t').chain(core::iter::repeat("")).take(width);
        if line
            .split('\t')
            .skip(width)
            .any(|cell| !cell.trim().is_empty())
        {
            let message = format!("expected {width} cells, found more");
            return Err(Problem::bad_input(message).at_line(number));
        }
        table.add_row(number, cells)?;
    }
    table.checked()
}

/// Length of one unit (m).
fn unit_of_length(name: Option<&str>) -> Result<f64> {
    match name {
        Some("mm") => Ok(1e-3),
        Some("cm") => Ok(1e-2),
        Some("m") => Ok(1.0),
        other => {
            let found = other.unwrap_or("none");
            let message = format!("expected Units of mm, cm or m, found {found}");
            Err(Problem::bad_input(message))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRC: &str = "PathFileType\t4\t(X/Y/Z)\twalk.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n\
        100\t100\t2\t2\tmm\nFrame#\tTime\tLHJC\t\t\tRHJC\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n\
        1\t0.00\t1\t2\t3\t4\t5\t6\n2\t0.01\t1\t2\t3\t\t\t\n";

    #[test]
    fn tables_of_each_kind_are_read() {
        let csv = Table::parse("\u{feff}time_s;knee\n0;1.5\n# a remark\n0.1;\n").unwrap();
        assert_eq!((csv.rows(), csv.line(1)), (2, 4));
        assert!(csv.value(1, 1).is_nan());
        let mot = Table::parse(
            "Coordinates\nversion=1\nnRows=2\ninDegrees=yes\nendheader\ntime\tknee\n0 \t 1\n0.1\t2\n",
        );
        let mot = mot.unwrap();
        assert_eq!((mot.in_degrees, mot.value(1, 1)), (Some(true), 2.0));
        let trc = Table::parse(TRC).unwrap();
        assert_eq!(trc.unit_m, Some(1e-3));
        assert_eq!(trc.column("RHJC.y").unwrap(), 6);
        assert!((trc.value(0, 6) - 5.0).abs() < 1e-12);
        assert!(trc.value(1, 6).is_nan());
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
            (TRC.replace("mm", "feet"), ["line 3", "feet"]),
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
