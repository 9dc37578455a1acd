//! Movella's export of MVN recordings to Excel: a sheet for each kind of data, a row for each frame.

use bodyflight_core::Segment;
use bodyflight_mvnx::xsens::MvnSegment;

use crate::archive::Archive;
use crate::mapping::{Kind, Mapping, Position, Rest, Row};
use crate::table::Table;
use crate::workbook::{SheetRow, Workbook};
use bodyflight_io::diagnostic::{Problem, Result};

const TURNS: &str = "Segment Orientation - Quat";
const PLACES: &str = "Segment Position";
const GENERAL: &str = "General Information";
/// The row of the general sheet with the frame rate (Hz).
const RATE: &str = "frame rate";

/// Columns of the position of the pelvis.
const PELVIS: [&str; 3] = ["Pelvis x", "Pelvis y", "Pelvis z"];

/// The numbers of a row, after its number in the sheet.
type Numbers = (u64, Vec<f64>);

/// Reads the orientations of all segments and the positions of the pelvis, with the mapping of MVN. Columns are called
/// `Time` (s), `Right Upper Leg.w` and so on, `Pelvis x`.
///
/// # Errors
/// Returns an error if a sheet is absent or damaged, or a cell is not a number.
pub(crate) fn read(archive: &Archive<'_>) -> Result<(Table, Mapping)> {
    let book = Workbook::read(archive)?;
    let sheet = |name: &str| {
        book.sheet(name)?.ok_or_else(|| {
            Problem::bad_input(format!("expected a sheet \"{name}\", found {}", book.names()))
                .help("export from MVN to Excel with segment orientations as quaternions, segment positions and general information")
        })
    };
    let rate = rate(&sheet(GENERAL)?)?;
    let (names, frames) = numbers(TURNS, &sheet(TURNS)?)?;
    let (place_names, places) = numbers(PLACES, &sheet(PLACES)?)?;
    let columns = PELVIS.map(|name| place_names.iter().position(|own| own == name));
    let [Some(x), Some(y), Some(z)] = columns else {
        let message = format!("expected columns {}", PELVIS.join(", "));
        return Err(Problem::bad_input(message).at(PLACES));
    };
    let mut rows = Vec::with_capacity(frames.len());
    for (k, (line, turns)) in frames.into_iter().enumerate() {
        let place = places.get(k).map(|(_, values)| values);
        let frame = turns.first().copied();
        if place.and_then(|place| place.first()).copied() != frame {
            let message = format!("expected the frames of the sheet \"{PLACES}\", found others");
            return Err(Problem::bad_input(message).at(format!("{TURNS}, row {line}")));
        }
        let mut values = vec![frame.unwrap_or(0.0) / rate];
        values.extend(turns.iter().skip(1));
        values.extend([x, y, z].map(|at| {
            place
                .and_then(|place| place.get(at))
                .copied()
                .unwrap_or(f64::NAN)
        }));
        rows.push((line, values));
    }
    let columns = core::iter::once("Time".to_owned())
        .chain(names.iter().skip(1).map(|name| part(name)))
        .chain(PELVIS.map(str::to_owned));
    let mut table = Table::of_rows(columns.collect(), rows)?;
    table.unit_m = Some(1.0);
    let mapping = mapping(&table)?;
    Ok((table, mapping))
}

/// The name of a column of quaternions: `Pelvis q0` becomes `Pelvis.w`.
fn part(name: &str) -> String {
    let ends = [(" q0", ".w"), (" q1", ".x"), (" q2", ".y"), (" q3", ".z")];
    let renamed = ends
        .iter()
        .find_map(|(end, part)| Some(format!("{}{part}", name.strip_suffix(end)?)));
    renamed.unwrap_or_else(|| name.to_owned())
}

fn rate(rows: &[SheetRow]) -> Result<f64> {
    let named = |cells: &&Vec<String>| {
        let first = cells.first().map(|cell| cell.trim().to_ascii_lowercase());
        first.as_deref() == Some(RATE)
    };
    let row = rows.iter().map(|(_, cells)| cells).find(named);
    let rate: Option<f64> = row.and_then(|cells| cells.get(1)?.trim().parse().ok());
    rate.filter(|rate| rate.is_finite() && *rate > 0.0)
        .ok_or_else(|| {
            Problem::bad_input("expected a row \"Frame Rate\" with a number above 0, found none")
                .at(GENERAL)
        })
}

/// The names of the columns, and the numbers of each row with its number in the sheet.
fn numbers(sheet: &str, rows: &[SheetRow]) -> Result<(Vec<String>, Vec<Numbers>)> {
    let Some(((_, names), rows)) = rows.split_first() else {
        return Err(Problem::bad_input("expected rows, found an empty sheet").at(sheet.to_owned()));
    };
    let mut found = Vec::with_capacity(rows.len());
    for (line, cells) in rows {
        let mut values = Vec::with_capacity(names.len());
        for (k, name) in names.iter().enumerate() {
            let cell = cells.get(k).map_or("", String::as_str);
            let value: Option<f64> = cell.parse().ok();
            values.push(match value {
                Some(value) => value,
                None if cell.is_empty() => f64::NAN,
                None => {
                    let message = format!("expected a number, found \"{cell}\"");
                    return Err(
                        Problem::bad_input(message).at(format!("{sheet}, row {line}, {name}"))
                    );
                }
            });
        }
        found.push((*line, values));
    }
    Ok((names.clone(), found))
}

/// The mapping of MVN: its segments are spelt with or without spaces.
fn mapping(table: &Table) -> Result<Mapping> {
    let bare = |name: &str| name.replace(' ', "").to_ascii_lowercase();
    let mut segments = std::collections::BTreeMap::new();
    for segment in Segment::ALL {
        let label = bare(MvnSegment::leading(segment).label());
        let names = table
            .columns
            .iter()
            .filter_map(|name| name.strip_suffix(".w"));
        let name = names
            .into_iter()
            .find(|name| bare(name) == label)
            .ok_or_else(|| {
                let message = format!(
                    "expected columns of the segment {}",
                    MvnSegment::leading(segment).label()
                );
                Problem::bad_input(message).at(TURNS)
            })?;
        let row = Row {
            columns: Some(vec![name.to_owned()]),
            ..Row::default()
        };
        segments.insert(segment.name().to_owned(), row);
    }
    let (world, body) = (["north", "west", "up"], ["forward", "left", "up"]);
    let mut mapping = Mapping::of_system(Kind::Quaternions, world, (body, Rest::TPose), segments)?;
    mapping.world.unit_m = Some(1.0);
    mapping.time.column = Some("Time".to_owned());
    mapping.position = Some(Position {
        columns: PELVIS.map(str::to_owned),
        offset_m: [0.0; 3],
    });
    Ok(mapping)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workbook::tests::written;

    fn sheets() -> Vec<(&'static str, Vec<Vec<String>>)> {
        let spaced = |label: &str| {
            let mut name = String::new();
            for (k, c) in label.chars().enumerate() {
                let after_letter = label
                    .chars()
                    .nth(k.saturating_sub(1))
                    .is_some_and(char::is_lowercase);
                if c.is_uppercase() && k > 0 && after_letter {
                    name.push(' ');
                }
                name.push(c);
            }
            name
        };
        let names: Vec<String> = MvnSegment::ALL
            .iter()
            .map(|mvn| spaced(mvn.label()))
            .collect();
        let turns = names
            .iter()
            .flat_map(|name| (0..4).map(move |k| format!("{name} q{k}")));
        let places = names
            .iter()
            .flat_map(|name| ["x", "y", "z"].map(|axis| format!("{name} {axis}")));
        let head = |names: Vec<String>| [vec!["Frame".to_owned()], names].concat();
        let row = |frame: usize, parts: &[&str]| {
            let cells = (0..names.len()).flat_map(|_| parts.iter().map(|&part| part.to_owned()));
            core::iter::once(frame.to_string())
                .chain(cells)
                .collect::<Vec<_>>()
        };
        let all = |first: Vec<String>, parts: &[&str]| {
            let rows = (0..3).map(|frame| row(frame, parts));
            core::iter::once(first).chain(rows).collect::<Vec<_>>()
        };
        vec![
            (
                GENERAL,
                vec![
                    vec!["MVN version".into(), "2023.2".into()],
                    vec!["Frame Rate".into(), "240".into()],
                ],
            ),
            (TURNS, all(head(turns.collect()), &["1", "0", "0", "0"])),
            (PLACES, all(head(places.collect()), &["0.1", "0.2", "1"])),
        ]
    }

    fn read(sheets: &[(&str, Vec<Vec<String>>)]) -> Result<(Table, Mapping)> {
        super::read(&Archive::read(&written(sheets))?)
    }

    #[test]
    fn sheets_are_joined_by_frame_and_need_no_mapping() {
        let (table, mapping) = read(&sheets()).unwrap();
        assert_eq!(table.rows(), 3);
        let value = |name: &str| table.value(2, table.column(name).unwrap());
        assert!((value("Time") - 2.0 / 240.0).abs() < 1e-12);
        assert!((value("Left Upper Leg.w") - 1.0).abs() < 1e-12);
        assert!((value("Pelvis y") - 0.2).abs() < 1e-12);
        assert_eq!(
            mapping.segments["r_thigh"].columns,
            Some(vec!["Right Upper Leg".to_owned()])
        );
        assert_eq!(
            mapping.segments["abdomen"].columns,
            Some(vec!["L3".to_owned()])
        );
    }

    #[test]
    fn missing_sheets_and_cells_are_refused_by_name() {
        for k in 0..3 {
            let mut fewer = sheets();
            let (name, _) = fewer.remove(k);
            let said = read(&fewer).unwrap_err().to_string();
            assert!(
                said.contains(&format!("expected a sheet \"{name}\"")),
                "{said}"
            );
        }
        let mut odd = sheets();
        odd[1].1[2][5] = "n/a".to_owned();
        let said = read(&odd).unwrap_err().to_string();
        assert!(
            said.contains("Segment Orientation - Quat, row 3, L5 q0") && said.contains("n/a"),
            "{said}"
        );
        let mut shifted = sheets();
        shifted[2].1[2][0] = "7".to_owned();
        assert!(
            read(&shifted)
                .unwrap_err()
                .to_string()
                .contains("the frames of the sheet")
        );
        let mut slow = sheets();
        slow[0].1[1][1] = "0".to_owned();
        assert!(read(&slow).unwrap_err().to_string().contains("Frame Rate"));
    }
}
