//! Conscious inputs over time, as a CSV file that `flight.toml` names: what is known of the muscle input and
//! damping of a synthetic or an estimated flight.

use std::path::Path;

use bodyflight_core::dynamics::Inputs;
use serde::Deserialize;

use crate::diagnostic::{Problem, Result};

/// Inputs at one time; the columns of the file, which a reader takes by their names.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct Row {
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
}

impl Row {
    /// Names of the columns.
    pub const COLUMNS: [&'static str; 7] = [
        "time_s",
        "pitch",
        "yaw",
        "roll",
        "damp_pitch",
        "damp_yaw",
        "damp_roll",
    ];

    /// Values in the order of [`Row::COLUMNS`].
    pub fn columns(&self) -> [f64; 7] {
        let [pitch, yaw, roll, damp_pitch, damp_yaw, damp_roll] = self.values();
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

    /// Inputs of the core at `time_s`.
    pub fn of(time_s: f64, inputs: &Inputs<f64>) -> Self {
        let (muscle, damping) = (inputs.muscle, inputs.damping);
        Self {
            time_s,
            pitch: muscle.pitch,
            yaw: muscle.yaw,
            roll: muscle.roll,
            damp_pitch: damping.pitch,
            damp_yaw: damping.yaw,
            damp_roll: damping.roll,
        }
    }

    fn values(&self) -> [f64; 6] {
        [
            self.pitch,
            self.yaw,
            self.roll,
            self.damp_pitch,
            self.damp_yaw,
            self.damp_roll,
        ]
    }
}

/// Inputs over time, linear between rows, constant beyond the ends.
#[derive(Debug, Clone, PartialEq)]
pub struct InputHistory {
    rows: Vec<Row>,
}

impl InputHistory {
    /// Of rows whose time rises; those that do not are left out.
    pub fn new(rows: Vec<Row>) -> Self {
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

    /// Reads a CSV file with the columns of [`Row`].
    ///
    /// # Errors
    /// Where the file is missing, has no rows, a field is not a finite number, or time does not rise.
    pub fn read(path: &Path) -> Result<Self> {
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .from_path(path)
            .map_err(|error| csv_problem(error, path))?;
        let mut rows: Vec<Row> = Vec::new();
        for row in reader.deserialize() {
            let row: Row = row.map_err(|error| csv_problem(error, path))?;
            let problem = |message: String| {
                Problem::bad_input(message)
                    .in_file(path)
                    .at_line(rows.len() as u64 + 2)
            };
            if !row.time_s.is_finite() || !row.values().iter().all(|v| v.abs() <= 1e3) {
                return Err(problem("expected finite numbers within 1000".into()));
            }
            if let Some(last) = rows.last()
                && row.time_s <= last.time_s
            {
                return Err(problem(format!(
                    "time_s must rise: {} after {}",
                    row.time_s, last.time_s
                )));
            }
            rows.push(row);
        }
        if rows.is_empty() {
            return Err(Problem::bad_input("no rows").in_file(path).help(
                "the columns are time_s, pitch, yaw, roll, damp_pitch, damp_yaw, damp_roll",
            ));
        }
        Ok(Self { rows })
    }

    /// Inputs at `time` (s).
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
            (None, None) => [0.0; 6],
        };
        let [pitch, yaw, roll, damp_pitch, damp_yaw, damp_roll] = values;
        Inputs {
            muscle: [pitch, yaw, roll].into(),
            damping: [damp_pitch, damp_yaw, damp_roll].into(),
        }
    }
}

/// A CSV error with its line.
fn csv_problem(error: csv::Error, path: &Path) -> Problem {
    let problem = Problem::bad_input(error.to_string()).in_file(path);
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
    fn columns_go_by_their_names_in_any_order() {
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
        };
        assert_eq!(history.at(1.0), expected);
        let written = Row::of(1.0, &expected).columns();
        for (found, expected) in written.iter().zip([1.0, 0.1, 0.2, 0.3, 3.0, 0.5, 6.0]) {
            assert!((found - expected).abs() < 1e-12, "{written:?}");
        }
    }

    #[test]
    fn bad_rows_are_named() {
        for (text, part) in [
            ("", "no rows"),
            (HEAD, "no rows"),
            (
                &format!("{HEAD}1,0,0,0,0,0,0\n1,0,0,0,0,0,0\n"),
                "inputs.csv:3: time_s must rise",
            ),
            (
                &format!("{HEAD}1,0,NaN,0,0,0,0\n"),
                "inputs.csv:2: expected finite",
            ),
            (&format!("{HEAD}1,0,x,0,0,0,0\n"), "inputs.csv:2"),
            ("time_s,yaw\n1,2\n", "missing field"),
        ] {
            let problem = read(text).unwrap_err().to_string();
            assert!(problem.contains(part), "{text}: {problem}");
        }
    }
}
