//! Vicon Nexus' export as CSV: blocks with a title, a rate, and rows of names, axes and units before the numbers.
//!
//! Points are in the block "Trajectories", and with lengths as their unit in "Model Outputs"; other blocks and columns,
//! such as angles and forces, are left out. A cell is empty where a point was not seen.

use std::collections::BTreeMap;

use crate::table::{Table, unit_of_length};
use bodyflight_io::diagnostic::{Problem, Result};

/// Titles of the blocks that hold points.
const BLOCKS: [&str; 2] = ["trajectories", "model outputs"];
/// Titles of all blocks, by which a file is recognised.
const TITLES: [&str; 6] = [
    "trajectories",
    "model outputs",
    "devices",
    "joints",
    "segments",
    "events",
];

/// A block of the file.
#[derive(Debug, Default)]
struct Block {
    rate: f64,
    names: Vec<String>,
    /// Column of X, Y and Z of each point.
    places: Vec<[usize; 3]>,
    unit: Option<String>,
    /// A unit of what is left out.
    other_unit: Option<String>,
    /// Line and cells of each frame.
    rows: BTreeMap<u64, (u64, Vec<f64>)>,
}

fn cells(line: &str) -> Vec<&str> {
    // Nexus separates by commas; other locales by semicolons or tabs.
    let separator = [',', ';', '\t'].into_iter().find(|c| line.contains(*c));
    line.split(separator.unwrap_or(','))
        .map(|cell| cell.trim().trim_matches('"'))
        .collect()
}

fn title(line: &str) -> Option<&'static str> {
    let words =
        line.trim_matches(|c: char| c == '\u{feff}' || c.is_whitespace() || ",;\"".contains(c));
    let small = words.to_ascii_lowercase();
    TITLES.into_iter().find(|title| *title == small)
}

/// Whether a text is such an export: a title, then a rate alone on its line.
pub(crate) fn is_export(text: &str) -> bool {
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let titled = lines.next().is_some_and(|line| title(line).is_some());
    let next = lines.next().map(cells).unwrap_or_default();
    titled && alone(&next).is_some()
}

/// A number alone on its line.
fn alone(cells: &[&str]) -> Option<f64> {
    let (first, rest) = cells.split_first()?;
    let is_alone = rest.iter().all(|cell| cell.is_empty());
    first.parse().ok().filter(|_| is_alone)
}

/// The same, if it is a rate.
fn rate(cells: &[&str]) -> Option<f64> {
    alone(cells).filter(|rate| rate.is_finite() && *rate > 0.0)
}

/// Reads the points of an export. Columns are called `Time` (s), `point.x` and so on; the subject before a name is left
/// out if there is only one.
///
/// # Errors
/// Returns an error with the line if a block does not follow the format, or if there are no points.
pub(crate) fn read(text: &str) -> Result<(Table, Vec<String>)> {
    let mut lines = (1..).zip(text.lines());
    let mut blocks = Vec::new();
    let mut left_out = Vec::new();
    while let Some((number, line)) = lines.next() {
        match title(line) {
            Some(title) if BLOCKS.contains(&title) => blocks.push(block(&mut lines)?),
            Some(title) => {
                left_out.push(title);
                lines.by_ref().find(|(_, line)| line.trim().is_empty());
            }
            None if line.trim().is_empty() => {}
            None => {
                let message = format!(
                    "expected the title of a block of Nexus, found \"{}\"",
                    line.chars().take(40).collect::<String>()
                );
                return Err(Problem::bad_input(message).at_line(number));
            }
        }
    }
    let other = (blocks.iter()).find_map(|block: &Block| block.other_unit.clone());
    let mut blocks = blocks.into_iter().filter(|block| !block.names.is_empty());
    let Some(mut first) = blocks.next() else {
        let found = other.map_or_else(
            || "none".to_owned(),
            |unit| {
                format!("only such with the unit \"{unit}\", which is none of mm, cm, m, in, ft")
            },
        );
        return Err(Problem::bad_input(format!(
            "expected points in a block Trajectories or Model Outputs, found {found}"
        ))
        .help("export the trajectories from Nexus, File > Export > ASCII"));
    };
    for block in blocks {
        first.join(block)?;
    }
    let mut warnings = Vec::new();
    if !left_out.is_empty() {
        warnings.push(format!("left out: the blocks {}", left_out.join(", ")));
    }
    Ok((first.table()?, warnings))
}

/// Reads a block after its title, up to an empty line.
fn block<'a>(lines: &mut impl Iterator<Item = (u64, &'a str)>) -> Result<Block> {
    let mut next = |what: &str| {
        let line = lines.next();
        line.ok_or_else(|| Problem::bad_input(format!("the file ends early: expected {what}")))
    };
    let (number, line) = next("the rate of a block")?;
    let rate = rate(&cells(line)).ok_or_else(|| {
        let message = format!(
            "expected a rate above 0 Hz alone on its line, found \"{}\"",
            line.trim()
        );
        Problem::bad_input(message).at_line(number)
    })?;
    let (_, names) = next("the names of the points")?;
    let (number, axes) = next("the names of the axes")?;
    let (_, units) = next("the units")?;
    let (names, axes, units) = (cells(names), cells(axes), cells(units));
    if !axes
        .first()
        .is_some_and(|first| first.eq_ignore_ascii_case("frame"))
    {
        let message = format!(
            "expected Frame, Sub Frame and axes, found \"{}\"",
            axes.join(",")
        );
        return Err(Problem::bad_input(message).at_line(number));
    }
    let mut block = Block {
        rate,
        ..Block::default()
    };
    for (k, three) in axes.windows(3).enumerate() {
        let name = names.get(k).copied().unwrap_or_default();
        let unit = units.get(k).copied().unwrap_or_default();
        let is_point = three
            .iter()
            .zip(["X", "Y", "Z"])
            .all(|(axis, letter)| *axis == letter);
        if !is_point || name.is_empty() {
            continue;
        }
        if unit_of_length(unit).is_none() {
            block.other_unit = Some(unit.to_owned());
            continue;
        }
        if block.unit.as_ref().is_some_and(|known| known != unit) {
            let message = format!("expected one unit of length, found {unit} at {name}");
            return Err(Problem::bad_input(message).at_line(number + 1));
        }
        block.unit = Some(unit.to_owned());
        block.names.push(name.to_owned());
        block.places.push([k, k + 1, k + 2]);
    }
    for (number, line) in
        lines.take_while(|(_, line)| !line.trim_matches([',', ' ', '\r']).is_empty())
    {
        block
            .row(number, &cells(line))
            .map_err(|problem| problem.at_line(number))?;
    }
    Ok(block)
}

impl Block {
    fn row(&mut self, line: u64, cells: &[&str]) -> Result<()> {
        let frame: u64 = cells
            .first()
            .and_then(|cell| cell.parse().ok())
            .ok_or_else(|| {
                Problem::bad_input(format!(
                    "expected the number of a frame, found \"{}\"",
                    cells.join(",")
                ))
            })?;
        let mut values = Vec::with_capacity(3 * self.places.len());
        for (name, places) in self.names.iter().zip(&self.places) {
            for place in places {
                let cell = cells.get(*place).copied().unwrap_or_default();
                let value: Option<f64> = cell.parse().ok();
                match value {
                    Some(value) => values.push(value),
                    None if cell.is_empty() || cell.eq_ignore_ascii_case("nan") => {
                        values.push(f64::NAN)
                    }
                    None => {
                        let message = format!("expected a number, found \"{cell}\"");
                        return Err(
                            Problem::bad_input(message).at(format!("column {}, {name}", place + 1))
                        );
                    }
                }
            }
        }
        match self.rows.insert(frame, (line, values)) {
            Some(_) => Err(Problem::bad_input(format!(
                "expected the frames of a block to be counted up, found frame {frame} twice"
            ))),
            None => Ok(()),
        }
    }

    /// Adds the points of another block with the same frames.
    fn join(&mut self, other: Self) -> Result<()> {
        if (self.rate - other.rate).abs() > 1e-9 || self.unit != other.unit {
            return Err(Problem::bad_input(format!(
                "expected points of one rate and unit, found {} Hz in {} and {} Hz in {}",
                self.rate,
                self.unit.as_deref().unwrap_or("no unit"),
                other.rate,
                other.unit.as_deref().unwrap_or("no unit")
            )));
        }
        let (own, added) = (3 * self.names.len(), 3 * other.names.len());
        for (frame, (line, values)) in other.rows {
            let row = self.rows.entry(frame).or_insert_with(|| (line, Vec::new()));
            row.1.resize(own, f64::NAN);
            row.1.extend(values);
        }
        for (_, values) in self.rows.values_mut() {
            values.resize(own + added, f64::NAN);
        }
        self.names.extend(other.names);
        Ok(())
    }

    fn table(self) -> Result<Table> {
        let subject = |name: &str| name.split_once(':').map(|(subject, _)| subject.to_owned());
        let first = self.names.first().and_then(|name| subject(name));
        let alone = first.is_some() && self.names.iter().all(|name| subject(name) == first);
        let shown = |name: &String| match name.split_once(':') {
            Some((_, bare)) if alone => bare.to_owned(),
            _ => name.clone(),
        };
        let points = self.names.iter().map(shown);
        let columns = points.flat_map(|name| ["x", "y", "z"].map(|axis| format!("{name}.{axis}")));
        let rate = self.rate;
        let rows = self
            .rows
            .into_iter()
            .map(|(frame, (line, values))| (line, [&[frame as f64 / rate][..], &values].concat()));
        let names = core::iter::once("Time".to_owned()).chain(columns).collect();
        let mut table = Table::of_rows(names, rows.collect())?;
        table.unit_m = self.unit.as_deref().and_then(unit_of_length);
        table.unit_name = self.unit;
        Ok(table)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "Devices\n1000\n,,Force\nFrame,Sub Frame,Fx\n,,N\n1,0,5\n1,1,5\n\nTrajectories\n100\n\
        ,,Bob:LASI,,,Bob:RASI,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm\n\
        11,0,1,2,3,4,5,6\n12,0,1.5,2,3,,,\n13,0,2,2,3,4,5,6\n\n\
        Model Outputs\n100\n,,Bob:LHipAngles,,,Bob:LHJC,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,deg,deg,deg,mm,mm,mm\n\
        11,0,10,20,30,7,8,9\n12,0,10,20,30,7,8,9\n";

    #[test]
    fn points_of_all_blocks_are_joined_by_frame() {
        assert!(is_export(FILE) && is_export("\u{feff}Trajectories,,\r\n100,,\r\n"));
        assert!(!is_export("time,x\n0,1\n"));
        // A rate that is none is an error of this format, not of another one.
        assert!(is_export("Trajectories\n0\n"));
        let (table, warnings) = read(FILE).unwrap();
        assert!(warnings[0].contains("devices"), "{warnings:?}");
        assert_eq!((table.rows(), table.unit_m), (3, Some(1e-3)));
        let value = |row: usize, name: &str| table.value(row, table.column(name).unwrap());
        assert!((value(0, "Time") - 0.11).abs() < 1e-12);
        assert!((value(1, "LASI.x") - 1.5).abs() < 1e-12 && value(1, "RASI.z").is_nan());
        assert!((value(1, "LHJC.y") - 8.0).abs() < 1e-12 && value(2, "LHJC.y").is_nan());
        assert!(table.column("LHipAngles.x").is_err());
        assert_eq!(table.line(1), 15);
        let two = read(&FILE.replace("Bob:RASI", "Eve:RASI")).unwrap().0;
        assert!(two.column("Eve:RASI.x").is_ok() && two.column("Bob:LASI.x").is_ok());
    }

    #[test]
    fn broken_files_are_refused_with_the_line() {
        for (text, parts) in [
            (
                FILE.replace("1.5,2,3", "1.5,two,3"),
                [
                    "line 15",
                    "column 4, Bob:LASI: expected a number, found \"two\"",
                ],
            ),
            (
                FILE.replace("\n12,0,1.5", "\n11,0,1.5"),
                ["line 15", "frame 11 twice"],
            ),
            (
                FILE.replace("12,0,1.5", "twelve,0,1.5"),
                ["line 15", "number of a frame"],
            ),
            (
                FILE.replace("Trajectories\n100", "Trajectories\nfast"),
                ["line 10", "a rate"],
            ),
            (
                FILE.replace("Outputs\n100", "Outputs\n50"),
                ["line 0", "one rate"],
            ),
            (
                FILE.replace("mm,mm,mm,mm,mm,mm", "mm,mm,mm,cm,cm,cm"),
                ["line 13", "one unit"],
            ),
            (
                FILE.replace("mm", "furlong"),
                ["unit \"furlong\"", "none of mm, cm"],
            ),
            (
                FILE.replacen("Trajectories\n100", "Trajectories\n0", 1),
                [
                    "line 10",
                    "a rate above 0 Hz alone on its line, found \"0\"",
                ],
            ),
            (FILE[..57].to_owned(), ["line 0", "found none"]),
        ] {
            let problem = read(&text).unwrap_err();
            let said = format!("line {}: {problem}", problem.line.unwrap_or(0));
            for part in parts {
                assert!(said.contains(part), "{said}\nlacks {part}");
            }
        }
    }
}
