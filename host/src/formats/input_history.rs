//! Conscious inputs over time, as a CSV file that `flight.toml` names: what is known of the muscle input and
//! damping of a synthetic or an estimated flight.

use std::path::Path;

use bodyflight_core::dynamics::Inputs;
use bodyflight_core::dynamics::muscle_input::{MODELS, MuscleForces, MuscleModel};
use bodyflight_core::dynamics::residual::ResidualLoad;
use bodyflight_core::frame::Vector;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

use crate::diagnostic::choices::choices;
use crate::diagnostic::{Problem, Result};
use crate::formats::input;

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
    /// Residual force over the dynamic pressure along the left axis (m2); zero where the file has no such column.
    #[serde(default)]
    pub residual_left_m2: f64,
    /// Along the dorsal axis.
    #[serde(default)]
    pub residual_dorsal_m2: f64,
    /// Along the cranial axis.
    #[serde(default)]
    pub residual_cranial_m2: f64,
    /// Residual moment over the dynamic pressure in pitch (m3).
    #[serde(default)]
    pub residual_pitch_m3: f64,
    /// In yaw.
    #[serde(default)]
    pub residual_yaw_m3: f64,
    /// In roll.
    #[serde(default)]
    pub residual_roll_m3: f64,
    /// Limbs that act on the muscle input from here on; those of the flight where the file does not say.
    #[serde(default, deserialize_with = "muscles")]
    pub muscles: Option<MuscleModel>,
    /// What muscle input does besides its moments.
    #[serde(default, deserialize_with = "muscle_forces")]
    pub muscle_forces: Option<MuscleForces>,
}

/// Number of numbers of a row besides its time.
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

impl Row {
    /// Names of the columns that every file has.
    pub const COLUMNS: [&'static str; 7] = [
        "time_s",
        "pitch",
        "yaw",
        "roll",
        "damp_pitch",
        "damp_yaw",
        "damp_roll",
    ];

    /// Names of the columns that an estimate has besides, in the order of [`Row::more_fields`].
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

    /// Values in the order of [`Row::COLUMNS`].
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

    /// Fields in the order of [`Row::MORE_COLUMNS`].
    pub fn more_fields(&self) -> impl Iterator<Item = String> {
        let [_, _, _, _, _, _, residual @ ..] = self.values();
        let muscles = self.muscles.as_ref().map_or("", MuscleModel::name);
        let forces = self.muscle_forces.map_or("", MuscleForces::name);
        // Millionths are too coarse for loads over the dynamic pressure.
        residual
            .map(|value| format!("{value:.9}"))
            .into_iter()
            .chain([muscles.to_owned(), forces.to_owned()])
    }

    /// Inputs of the core at `time_s`.
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

    /// The same with the limbs that the inputs belong to.
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
    /// Returns an error if the file is missing, has no rows, a field is not a finite number, or time does not rise.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(&input::bytes(path)?, path)
    }

    /// As [`InputHistory::read`], of bytes that were read from `path`.
    ///
    /// # Errors
    /// As of [`InputHistory::read`].
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .from_reader(bytes);
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

    /// Limbs that act on the muscle input at `time` (s): those of the last row before, `flight`'s where it does
    /// not say.
    pub fn muscles_at(&self, time: f64, flight: &MuscleModel) -> MuscleModel {
        let next = self.rows.partition_point(|row| row.time_s <= time);
        let Some(row) = self.rows.get(next.saturating_sub(1)) else {
            return *flight;
        };
        let muscles = row.muscles.unwrap_or(*flight);
        muscles.with_forces(row.muscle_forces.unwrap_or(flight.forces))
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
            residual: ResidualLoad::none(),
        };
        assert_eq!(history.at(1.0), expected);
        let written = Row::of(1.0, &expected).columns();
        for (found, expected) in written.iter().zip([1.0, 0.1, 0.2, 0.3, 3.0, 0.5, 6.0]) {
            assert!((found - expected).abs() < 1e-12, "{written:?}");
        }
    }

    #[test]
    fn rows_say_which_limbs_they_belong_to() {
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
