//! Conscious inputs over time, in a CSV file that `flight.toml` refers to: the known muscle input and damping of a
//! synthetic or estimated flight.

use std::path::Path;

use bodyflight_core::dynamics::Inputs;
use bodyflight_core::dynamics::muscle_input::{MODELS, MuscleForces, MuscleModel};
use bodyflight_core::dynamics::residual::ResidualLoad;
use bodyflight_core::frame::Vector;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

use bodyflight_io::diagnostic::choices::choices;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::file_kind::FileKind;
use bodyflight_io::input;
use bodyflight_io::text::with_commas;

/// Inputs at one time: one row of the file. Columns are identified by name, in any order.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct InputRow {
    /// Time since frame 0 (s).
    pub time_s: f64,
    /// Muscle input coefficient in pitch.
    pub pitch: f64,
    /// In yaw.
    pub yaw: f64,
    /// In roll.
    pub roll: f64,
    /// Damping coefficient in pitch.
    pub damp_pitch: f64,
    /// In yaw.
    pub damp_yaw: f64,
    /// In roll.
    pub damp_roll: f64,
    /// Residual force divided by the dynamic pressure, along the left axis (m2); zero if the file has no such column.
    #[serde(default)]
    pub residual_left_m2: f64,
    /// Along the dorsal axis.
    #[serde(default)]
    pub residual_dorsal_m2: f64,
    /// Along the cranial axis.
    #[serde(default)]
    pub residual_cranial_m2: f64,
    /// Residual moment divided by the dynamic pressure, in pitch (m3).
    #[serde(default)]
    pub residual_pitch_m3: f64,
    /// In yaw.
    #[serde(default)]
    pub residual_yaw_m3: f64,
    /// In roll.
    #[serde(default)]
    pub residual_roll_m3: f64,
    /// Limb groups that muscle input acts on from this row on; if not given, those of the flight.
    #[serde(default, deserialize_with = "muscles")]
    pub muscles: Option<MuscleModel>,
    /// The effect of muscle input besides its moments; if not given, that of the flight.
    #[serde(default, deserialize_with = "muscle_forces")]
    pub muscle_forces: Option<MuscleForces>,
}

/// Help for a file without the right columns.
const COLUMNS_HELP: &str =
    "the columns are time_s, pitch, yaw, roll, damp_pitch, damp_yaw, damp_roll";

/// Number of numeric values in a row, not counting the time.
const VALUES: usize = 12;

fn muscles<'de, D: Deserializer<'de>>(
    source: D,
) -> std::result::Result<Option<MuscleModel>, D::Error> {
    let Some(name) = Option::<String>::deserialize(source)? else {
        return Ok(None);
    };
    MuscleModel::from_name(&name).map(Some).ok_or_else(|| {
        let known = choices(&name, MODELS.map(|(name, _)| name));
        D::Error::custom(format!("unknown limb groups \"{name}\"; {known}"))
    })
}

fn muscle_forces<'de, D: Deserializer<'de>>(
    source: D,
) -> std::result::Result<Option<MuscleForces>, D::Error> {
    let Some(name) = Option::<String>::deserialize(source)? else {
        return Ok(None);
    };
    MuscleForces::from_name(&name).map(Some).ok_or_else(|| {
        D::Error::custom(format!(
            "muscle_forces: expected moment or paper, found \"{name}\""
        ))
    })
}

impl InputRow {
    /// Names of the columns that every file must have.
    pub const COLUMNS: [&'static str; 7] = [
        "time_s",
        "pitch",
        "yaw",
        "roll",
        "damp_pitch",
        "damp_yaw",
        "damp_roll",
    ];

    /// Names of the additional columns of an estimate, in the order of [`InputRow::more_fields`].
    pub const MORE_COLUMNS: [&'static str; 8] = [
        "residual_left_m2",
        "residual_dorsal_m2",
        "residual_cranial_m2",
        "residual_pitch_m3",
        "residual_yaw_m3",
        "residual_roll_m3",
        "muscles",
        "muscle_forces",
    ];

    /// Values in the order of [`InputRow::COLUMNS`].
    pub fn columns(&self) -> [f64; 7] {
        let [pitch, yaw, roll, damp_pitch, damp_yaw, damp_roll, ..] = self.values();
        [
            self.time_s,
            pitch,
            yaw,
            roll,
            damp_pitch,
            damp_yaw,
            damp_roll,
        ]
    }

    /// Fields in the order of [`InputRow::MORE_COLUMNS`].
    pub fn more_fields(&self) -> impl Iterator<Item = String> {
        let [_, _, _, _, _, _, residual @ ..] = self.values();
        let muscles = self.muscles.as_ref().map_or("", MuscleModel::name);
        let forces = self.muscle_forces.map_or("", MuscleForces::name);
        // Six decimals are too few for loads divided by the dynamic pressure.
        residual
            .map(|value| format!("{value:.9}"))
            .into_iter()
            .chain([muscles.to_owned(), forces.to_owned()])
    }

    /// Creates a row from the core's inputs at `time_s`.
    pub fn of(time_s: f64, inputs: &Inputs<f64>) -> Self {
        let (muscle, damping) = (inputs.muscle, inputs.damping);
        let force = inputs.residual.force.components;
        let moment = inputs.residual.moment.components;
        Self {
            time_s,
            pitch: muscle.pitch,
            yaw: muscle.yaw,
            roll: muscle.roll,
            damp_pitch: damping.pitch,
            damp_yaw: damping.yaw,
            damp_roll: damping.roll,
            residual_left_m2: force.x,
            residual_dorsal_m2: force.y,
            residual_cranial_m2: force.z,
            residual_pitch_m3: moment.x,
            residual_yaw_m3: moment.y,
            residual_roll_m3: moment.z,
            muscles: None,
            muscle_forces: None,
        }
    }

    /// Returns the row with the limb groups that its inputs belong to.
    #[must_use]
    pub fn with_muscles(mut self, muscles: &MuscleModel) -> Self {
        self.muscle_forces = Some(muscles.forces);
        self.muscles = Some(*muscles);
        self
    }

    fn values(&self) -> [f64; VALUES] {
        [
            self.pitch,
            self.yaw,
            self.roll,
            self.damp_pitch,
            self.damp_yaw,
            self.damp_roll,
            self.residual_left_m2,
            self.residual_dorsal_m2,
            self.residual_cranial_m2,
            self.residual_pitch_m3,
            self.residual_yaw_m3,
            self.residual_roll_m3,
        ]
    }
}

/// Inputs over time, linear between rows, constant beyond the ends.
#[derive(Debug, Clone, PartialEq)]
pub struct InputHistory {
    rows: Vec<InputRow>,
}

impl InputHistory {
    /// Creates a history from rows; a row whose time is not later than that of all before it is left out.
    pub fn new(rows: Vec<InputRow>) -> Self {
        let mut last = f64::NEG_INFINITY;
        let rows = rows.into_iter().filter(|row| {
            let later = row.time_s > last;
            last = last.max(row.time_s);
            later
        });
        Self {
            rows: rows.collect(),
        }
    }

    /// Reads a CSV file with the columns of [`InputRow`].
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or has no rows, if a value is not finite or its magnitude exceeds
    /// 1000, or if time does not increase.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(&input::bytes(path)?, path)
    }

    /// Like [`InputHistory::read`], for bytes already read from `path`.
    ///
    /// # Errors
    /// Same as [`InputHistory::read`].
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
        let bytes = with_commas(bytes);
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .from_reader(&*bytes);
        let head = reader.headers().cloned();
        let head = head.map_err(|error| csv_problem(error, path))?;
        let has = |name: &str| head.iter().any(|own| own == name);
        if let Some(missing) = InputRow::COLUMNS.iter().find(|name| !has(name)) {
            let other = FileKind::Inputs.mistaken(FileKind::of_head(&bytes));
            return Err(other
                .unwrap_or_else(|| {
                    Problem::bad_input(format!("expected a column {missing}"))
                        .at_line(1)
                        .help(COLUMNS_HELP)
                })
                .in_file(path));
        }
        let mut rows: Vec<InputRow> = Vec::new();
        for record in reader.records() {
            let record = record.map_err(|error| csv_problem(error, path))?;
            let line = record.position().map_or(0, csv::Position::line);
            let problem = |message: String| Problem::bad_input(message).in_file(path).at_line(line);
            let row: InputRow = record.deserialize(Some(&head)).map_err(|error| {
                let (column, message) = row_problem(&error, &head, &record);
                problem(message).at(format!("column {column}"))
            })?;
            if !row.time_s.is_finite() || !row.values().iter().all(|v| v.abs() <= 1e3) {
                return Err(problem("expected finite numbers from -1000 to 1000".into()));
            }
            if let Some(last) = rows.last()
                && row.time_s <= last.time_s
            {
                return Err(problem(format!(
                    "time_s must increase: {} after {}",
                    row.time_s, last.time_s
                )));
            }
            rows.push(row);
        }
        if rows.is_empty() {
            return Err(Problem::bad_input("no rows below the column names")
                .in_file(path)
                .help(COLUMNS_HELP));
        }
        Ok(Self { rows })
    }

    /// Times of the first and the last row (s).
    pub fn ends(&self) -> Option<[f64; 2]> {
        let (first, last) = (self.rows.first()?, self.rows.last()?);
        Some([first.time_s, last.time_s])
    }

    /// Returns the inputs at `time` (s).
    pub fn at(&self, time: f64) -> Inputs<f64> {
        let next = self.rows.partition_point(|row| row.time_s <= time);
        let values = match (
            next.checked_sub(1).and_then(|k| self.rows.get(k)),
            self.rows.get(next),
        ) {
            (Some(before), Some(after)) => {
                let share = (time - before.time_s) / (after.time_s - before.time_s);
                let mut values = before.values();
                for (value, to) in values.iter_mut().zip(after.values()) {
                    *value += (to - *value) * share;
                }
                values
            }
            (Some(only), None) | (None, Some(only)) => only.values(),
            (None, None) => [0.0; VALUES],
        };
        let [
            pitch,
            yaw,
            roll,
            damp_pitch,
            damp_yaw,
            damp_roll,
            residual @ ..,
        ] = values;
        let [
            left,
            dorsal,
            cranial,
            residual_pitch,
            residual_yaw,
            residual_roll,
        ] = residual;
        Inputs {
            muscle: [pitch, yaw, roll].into(),
            damping: [damp_pitch, damp_yaw, damp_roll].into(),
            residual: ResidualLoad {
                force: Vector::new(left, dorsal, cranial),
                moment: Vector::new(residual_pitch, residual_yaw, residual_roll),
            },
        }
    }

    /// Whether another history names the same limbs and forces at the same times.
    pub(crate) fn has_muscles_of(&self, other: &Self) -> bool {
        let row = |row: &InputRow| (row.time_s.to_bits(), row.muscles, row.muscle_forces);
        let (own, others) = (self.rows.iter().map(row), other.rows.iter().map(row));
        own.eq(others)
    }

    /// Returns the limb groups that muscle input acts on at `time` (s): those of the latest row, or `flight`'s if that
    /// row gives none. Before the first row, the first row applies.
    pub fn muscles_at(&self, time: f64, flight: &MuscleModel) -> MuscleModel {
        let next = self.rows.partition_point(|row| row.time_s <= time);
        let Some(row) = self.rows.get(next.saturating_sub(1)) else {
            return *flight;
        };
        let muscles = row.muscles.unwrap_or(*flight);
        muscles
            .with_forces(row.muscle_forces.unwrap_or(flight.forces))
            .with_lever_arms(flight.lever_arms)
    }
}

/// The column that a row cannot be read because of, and why.
fn row_problem<'a>(
    error: &csv::Error,
    head: &'a csv::StringRecord,
    record: &csv::StringRecord,
) -> (&'a str, String) {
    let csv::ErrorKind::Deserialize { err, .. } = error.kind() else {
        return ("?", error.to_string());
    };
    let at = err.field().and_then(|field| usize::try_from(field).ok());
    // A message of the program's own has no place, but names its value.
    let Some(at) = at else {
        return ("muscles", err.kind().to_string());
    };
    let found = record.get(at).unwrap_or_default();
    let column = head.get(at).unwrap_or_default();
    let message = match err.kind() {
        csv::DeserializeErrorKind::Message(message) => message.clone(),
        _ => format!("expected a number, found \"{found}\""),
    };
    (column, message)
}

/// Converts a CSV error, with its line if known.
fn csv_problem(error: csv::Error, path: &Path) -> Problem {
    let problem = match error.kind() {
        csv::ErrorKind::UnequalLengths {
            expected_len, len, ..
        } => {
            let message =
                format!("expected {expected_len} fields as in the line of names, found {len}");
            Problem::bad_input(message).help(
                "separate columns by semicolons or tabs if numbers have decimal commas; tables with commas need decimal points",
            )
        }
        _ => Problem::bad_input(error.to_string()),
    };
    let problem = problem.in_file(path);
    match (error.position(), error.is_io_error()) {
        (Some(position), false) => problem.at_line(position.line()),
        (None, false) => problem,
        (_, true) => Problem::system("read", path, error.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::AxisCoefficients;

    fn read(text: &str) -> Result<InputHistory> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("inputs.csv");
        std::fs::write(&path, text).unwrap();
        InputHistory::read(&path)
    }

    const HEAD: &str = "time_s,pitch,yaw,roll,damp_pitch,damp_yaw,damp_roll\n";

    #[test]
    fn inputs_are_linear_between_rows() {
        let history = read(&format!("{HEAD}1,0,0,0,3,0.5,6\n3,2,0,0,3,0.5,6\n")).unwrap();
        for (time, pitch) in [(0.0, 0.0), (1.0, 0.0), (2.0, 1.0), (3.0, 2.0), (9.0, 2.0)] {
            let inputs = history.at(time);
            assert!((inputs.muscle.pitch - pitch).abs() < 1e-12, "{time}");
            assert_eq!(inputs.damping, AxisCoefficients::new(3.0, 0.5, 6.0));
        }
    }

    /// Files written by earlier versions have yaw first.
    #[test]
    fn columns_are_found_by_name_in_any_order() {
        let history = read(
            "time_s,yaw,pitch,roll,damp_yaw,damp_pitch,damp_roll,sd_yaw\n1,0.2,0.1,0.3,0.5,3,6,9\n",
        )
        .unwrap();
        let expected = Inputs {
            muscle: AxisCoefficients {
                pitch: 0.1,
                yaw: 0.2,
                roll: 0.3,
            },
            damping: AxisCoefficients {
                pitch: 3.0,
                yaw: 0.5,
                roll: 6.0,
            },
            residual: ResidualLoad::none(),
        };
        assert_eq!(history.at(1.0), expected);
        let written = InputRow::of(1.0, &expected).columns();
        for (found, expected) in written.iter().zip([1.0, 0.1, 0.2, 0.3, 3.0, 0.5, 6.0]) {
            assert!((found - expected).abs() < 1e-12, "{written:?}");
        }
    }

    #[test]
    fn semicolons_and_tabs_separate_columns_too() {
        let rows = format!("{HEAD}1,0,0,0,3,0.5,6\n");
        let plain = read(&rows).unwrap();
        for delimiter in [";", "\t"] {
            let other = rows.replace(',', delimiter).replace('.', ",");
            assert_eq!(read(&other).unwrap(), plain, "{other}");
        }
    }

    #[test]
    fn rows_state_which_limbs_act() {
        let history = read(
            "time_s,pitch,yaw,roll,damp_pitch,damp_yaw,damp_roll,residual_left_m2,muscles,muscle_forces\n\
             1,0,0,0,3,0.5,6,0.25,layouts,paper\n2,0,0,0,3,0.5,6,0.75,,\n",
        )
        .unwrap();
        let flight = bodyflight_core::dynamics::muscle_input::BELLY_TRACKING;
        let at = |time| history.muscles_at(time, &flight);
        assert_eq!(at(1.5).name(), "layouts");
        assert_eq!(at(1.5).forces, MuscleForces::Paper);
        assert_eq!(at(2.5), flight);
        assert!((history.at(1.5).residual.force.x() - 0.5).abs() < 1e-12);
        let head = "time_s,pitch,yaw,roll,damp_pitch,damp_yaw,damp_roll,muscles";
        let problem = read(&format!("{head}\n1,0,0,0,3,0.5,6,tail\n")).unwrap_err();
        assert!(problem.to_string().contains("tail"), "{problem}");
    }

    #[test]
    fn bad_rows_are_named() {
        for (text, part) in [
            ("", "this file is empty"),
            (HEAD, "no rows"),
            (
                &format!("{HEAD}1,0,0,0,0,0,0\n1,0,0,0,0,0,0\n"),
                "inputs.csv:3: time_s must increase",
            ),
            (
                &format!("{HEAD}1,0,NaN,0,0,0,0\n"),
                "inputs.csv:2: expected finite",
            ),
            (
                &format!("{HEAD}1,0,x,0,0,0,0\n"),
                "inputs.csv:2: column yaw: expected a number, found \"x\"",
            ),
            (
                &format!("{HEAD}1,0,0,5,0,0,0,0\n"),
                "inputs.csv:2: expected 7 fields as in the line of names, found 8",
            ),
            ("time_s,yaw\n1,2\n", "inputs.csv:1: expected a column pitch"),
            (&HEAD.replace(',', ";"), "no rows"),
            (
                "time_s,north_m,east_m,height_m\n",
                "this is the track of a logger, not a table of inputs",
            ),
        ] {
            let problem = read(text).unwrap_err().to_string();
            assert!(problem.contains(part), "{text}: {problem}");
        }
    }
}
