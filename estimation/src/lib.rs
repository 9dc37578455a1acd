//! Muscle inputs over time from a recording, and how much better they reconstruct the flight than constant coefficients
//! do. The paper makes the same comparison.
//!
//! [`request`] chooses the filter: that of the paper over windows ([`windows`]), or the motion filter ([`motion`]), from
//! whose result a solution for the whole flight ([`whole`], [`forward`], [`smoother`]) can start. [`verdict`] judges the result.
#![forbid(unsafe_code)]

pub mod assumed;
pub mod constants;
pub mod forward;
mod joint_errors;
pub mod joints;
pub mod measured;
pub mod motion;
mod replayed;
pub mod report;
pub mod request;
mod run;
pub mod size;
pub mod smoother;
pub mod velocities;
pub mod verdict;
pub mod whole;
pub mod windows;

use std::path::Path;

use bodyflight_core::estimator::motion::watch::Consistency;
use bodyflight_io::diagnostic::Result;
use bodyflight_io::files::{CsvFile, number};
use bodyflight_replay::comparison::Comparison;
use bodyflight_replay::input_history::InputRow;

use report::{Point, Report};

/// The filter to run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filter {
    /// The paper's filter: thirteen runs of the full model over 60 samples.
    Paper,
    /// The reduced filter, as on the unit.
    Reduced,
}

/// An estimation, with the data for plots and files.
#[derive(Debug, Clone)]
pub struct Estimation {
    /// The numbers.
    pub report: Report,
    /// Coefficients over time.
    pub points: Vec<Point>,
    /// Reconstruction with estimated inputs.
    pub estimated: Comparison,
    /// Free run with constant coefficients.
    pub constant: Comparison,
}

impl Estimation {
    /// For each axis, the share of estimates whose muscle input exceeds two standard deviations.
    #[expect(clippy::cast_precision_loss, reason = "counts of estimates")]
    pub fn active_shares(&self) -> [(&'static str, f64); 3] {
        ["pitch", "yaw", "roll"].map(|axis| {
            let place = InputRow::COLUMNS.iter().position(|name| *name == axis);
            let beyond = self.points.iter().filter(|point| {
                let of = |row: &InputRow| place.map_or(0.0, |place| row.columns()[place]);
                of(&point.inputs).abs() > 2.0 * of(&point.deviation)
            });
            (
                axis,
                beyond.count() as f64 / self.points.len().max(1) as f64,
            )
        })
    }

    /// Writes coefficients over time as CSV.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn write_csv(&self, path: &Path) -> Result<()> {
        let mut file = CsvFile::create(path, &Self::columns())?;
        for row in self.rows() {
            file.write_fields(row)?;
        }
        file.finish()
    }

    /// Columns of the table of coefficients over time. The first are those that `inputs` in `flight.toml` expects.
    pub fn columns() -> Vec<&'static str> {
        InputRow::COLUMNS
            .into_iter()
            .chain(InputRow::MORE_COLUMNS)
            .chain(DEVIATIONS)
            .chain(["nis", "consistency"])
            .chain(VELOCITY)
            .collect()
    }

    /// Rows of the table of coefficients over time.
    pub fn rows(&self) -> impl Iterator<Item = Vec<String>> {
        self.points.iter().map(|point| {
            let numbers = point.inputs.columns().map(number);
            let deviation = point.deviation.columns();
            let rest = deviation.iter().skip(1).copied();
            let rest = rest.chain([point.normalised_innovation]).map(number);
            let consistency = point.consistency.map_or("", Consistency::name);
            let more = point.inputs.more_fields();
            let fields = numbers.into_iter().chain(more).chain(rest);
            let velocity = point
                .motion
                .map(|motion| motion.velocity_inertial().components);
            let velocity = velocity.map_or([f64::NAN; 3], Into::into);
            let velocity = velocity.into_iter().chain(point.velocity_deviation);
            let fields = fields.chain([consistency.to_owned()]);
            fields.chain(velocity.map(number)).collect()
        })
    }
}

/// Columns of the standard deviations.
const DEVIATIONS: [&str; 6] = [
    "sd_pitch",
    "sd_yaw",
    "sd_roll",
    "sd_damp_pitch",
    "sd_damp_yaw",
    "sd_damp_roll",
];

/// Columns of the velocity of the pelvis and of its standard deviations, which only the motion filter has.
const VELOCITY: [&str; 6] = [
    "velocity_north_mps",
    "velocity_west_mps",
    "velocity_up_mps",
    "sd_velocity_north_mps",
    "sd_velocity_west_mps",
    "sd_velocity_up_mps",
];

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
