//! Recordings of FlySight receivers: `TRACK.CSV` of FlySight 2, with `SENSOR.CSV` beside it, and the CSV files of
//! FlySight 1.
//!
//! FlySight 2 names its columns in `$COL` lines and marks each row with its sensor; FlySight 1 has one line of names
//! and often one of units. Rows that cannot be used are skipped and counted, with the line of the first of them.
//! Known receiver faults: negative milliseconds (`:28.-001` is a millisecond before the full second), truncated rows,
//! and time that runs backwards.

mod table;

use std::path::Path;

use bodyflight_core::frame::{Inertial, Vector};
use chrono::NaiveDateTime;
use nalgebra::Vector3;

use crate::diagnostic::{Problem, Result};
use crate::formats::input;
pub use table::Skipped;
use table::{Row, Tables};

/// Metres of a degree of latitude: the mean radius of the Earth.
const METRES_PER_DEGREE: f64 = 6_371_008.8 * core::f64::consts::PI / 180.0;

/// Standard gravity, the unit of the accelerometer (m/s2).
const STANDARD_GRAVITY: f64 = 9.806_65;

/// Seconds of a week of GPS time.
const WEEK: f64 = 604_800.0;

/// Sunday 1980-01-06, when the weeks of GPS begin (s since 1970).
const GPS_EPOCH: f64 = 315_964_800.0;

/// One GNSS fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fix {
    /// Time since 1970 (s, UTC).
    pub time: f64,
    /// Position north and west of the first fix, height above mean sea level (m).
    pub position: Vector<f64, Inertial>,
    /// Velocity over ground (m/s).
    pub velocity: Vector<f64, Inertial>,
    /// The receiver's own estimate of its speed accuracy (m/s), if available.
    pub speed_accuracy: Option<f64>,
}

/// One sample of the inertial sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InertialSample {
    /// Time in the week (s).
    pub time_of_week: f64,
    /// Specific force, axes of the device (m/s2).
    pub specific_force: Vector3<f64>,
    /// Angular velocity, axes of the device (rad/s).
    pub angular_velocity: Vector3<f64>,
}

/// One sample of the barometer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PressureSample {
    /// Time in the week (s).
    pub time_of_week: f64,
    /// Pressure (Pa).
    pub pressure: f64,
}

/// A recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// In order of time.
    pub fixes: Vec<Fix>,
    /// Samples of the inertial sensor, in order of time; empty if there is no `SENSOR.CSV`.
    pub inertial: Vec<InertialSample>,
    /// Samples of the barometer, in order of time; empty if there is no `SENSOR.CSV`.
    pub pressure: Vec<PressureSample>,
    /// Rows skipped in both files.
    pub skipped: Skipped,
}

/// Whether the name of a file is that of a FlySight recording.
pub fn is_flysight(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("csv"))
}

impl Track {
    /// Reads a track, and `SENSOR.CSV` in the same folder if the track is from a FlySight 2.
    ///
    /// # Errors
    /// Returns an error if the file is not from a FlySight, has no usable row, or has more unusable rows than usable
    /// ones.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = input::bytes(path)?;
        Self::parse(&bytes, path)
    }

    /// Like [`Track::read`], for bytes already read from `path`.
    ///
    /// # Errors
    /// Same as [`Track::read`].
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
        let tables = Tables::parse(bytes);
        let mut skipped = tables.skipped.clone();
        let mut fixes: Vec<Fix> = Vec::new();
        let mut origin = None;
        for row in tables.rows("GNSS") {
            match fix(&row, &mut origin) {
                Err(why) => skipped.add(row.line, &why),
                Ok(fix) if fixes.last().is_some_and(|last| fix.time <= last.time) => {
                    skipped.add(row.line, "not later than the previous row");
                }
                Ok(fix) => fixes.push(fix),
            }
        }
        if fixes.is_empty() || skipped.count > fixes.len() {
            let problem = Problem::bad_input(format!(
                "expected FlySight rows (time, lat, lon, hMSL, velN, velE, velD), found {} usable and {} unusable",
                fixes.len(),
                skipped.count
            ))
            .in_file(path);
            return Err(match skipped.first {
                Some((line, why)) => problem
                    .at_line(line)
                    .help(format!("the first unusable row: {why}")),
                None => problem.help("give a TRACK.CSV of FlySight 2 or a CSV file of FlySight 1"),
            });
        }
        let beside = path.with_file_name("SENSOR.CSV");
        let (mut inertial, mut pressure) = (Vec::new(), Vec::new());
        if tables.is_second_generation && beside.is_file() {
            let sensors = Tables::read(&beside)?;
            inertial = inertial_samples(&sensors, &mut skipped);
            pressure = pressure_samples(&sensors, &mut skipped);
        }
        Ok(Self {
            fixes,
            inertial,
            pressure,
            skipped,
        })
    }
}

/// Seconds since 1970 of `2023-10-08T21:36:27.798Z`; milliseconds may be negative.
fn seconds(text: &str) -> Option<f64> {
    let (whole, part) = text.trim_end_matches('Z').split_once('.')?;
    let whole = NaiveDateTime::parse_from_str(whole, "%Y-%m-%dT%H:%M:%S").ok()?;
    let (sign, digits) = match part.strip_prefix('-') {
        Some(digits) => (-1.0, digits),
        None => (1.0, part),
    };
    if digits.is_empty() || digits.len() > 9 || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let share: f64 = format!("0.{digits}").parse().ok()?;
    #[expect(
        clippy::cast_precision_loss,
        reason = "exact for any date of the calendar"
    )]
    Some(whole.and_utc().timestamp() as f64 + sign * share)
}

fn fix(row: &Row<'_>, origin: &mut Option<[f64; 2]>) -> core::result::Result<Fix, String> {
    let time = row.text("time")?;
    let time = seconds(time).ok_or_else(|| {
        format!("expected a time like 2023-10-08T21:36:27.798Z, found \"{time}\"")
    })?;
    if row.number("gpsFix").is_ok_and(|kind| kind < 3.0) {
        return Err("no three-dimensional fix".to_owned());
    }
    let [latitude, longitude] = [row.within("lat", 90.0)?, row.within("lon", 180.0)?];
    let height = row.within("hMSL", 50_000.0)?;
    let velocity = ["velN", "velE", "velD"].map(|name| row.within(name, 1000.0));
    let [north, east, down] = velocity;
    let [first_latitude, first_longitude] = *origin.get_or_insert([latitude, longitude]);
    let narrower = first_latitude.to_radians().cos();
    // Also correct across the date line.
    let east_of_first = (longitude - first_longitude + 540.0).rem_euclid(360.0) - 180.0;
    Ok(Fix {
        time,
        position: Vector::new(
            (latitude - first_latitude) * METRES_PER_DEGREE,
            -east_of_first * METRES_PER_DEGREE * narrower,
            height,
        ),
        velocity: Vector::new(north?, -east?, -down?),
        speed_accuracy: row.number("sAcc").ok().filter(|accuracy| *accuracy > 0.0),
    })
}

/// Offset (s) from the sensors' clock to the time of week: the clock starts at an arbitrary value, and `$TIME` rows
/// relate it to GPS time.
fn clock_offset(tables: &Tables) -> f64 {
    tables
        .rows("TIME")
        .find_map(|row| Some(row.number("tow").ok()? - row.number("time").ok()?))
        .unwrap_or(0.0)
}

/// Barometer rows on the GNSS clock.
fn pressure_samples(tables: &Tables, skipped: &mut Skipped) -> Vec<PressureSample> {
    let offset = clock_offset(tables);
    let mut samples = Vec::new();
    for row in tables.rows("BARO") {
        let sample = || {
            Ok::<_, String>(PressureSample {
                time_of_week: row.number("time")? + offset,
                pressure: row.within("pressure", 120_000.0)?,
            })
        };
        match sample() {
            Ok(sample) => samples.push(sample),
            Err(why) => skipped.add(row.line, &why),
        }
    }
    samples
}

/// Rows of the inertial sensor on the GNSS clock.
fn inertial_samples(tables: &Tables, skipped: &mut Skipped) -> Vec<InertialSample> {
    let offset = clock_offset(tables);
    let vector = |row: &Row<'_>, names: [&str; 3], unit: f64| {
        let [x, y, z] = names.map(|name| row.within(name, 10_000.0));
        Ok::<_, String>(Vector3::new(x?, y?, z?) * unit)
    };
    let mut samples: Vec<InertialSample> = Vec::new();
    for row in tables.rows("IMU") {
        let sample = || {
            Ok::<_, String>(InertialSample {
                time_of_week: row.number("time")? + offset,
                specific_force: vector(&row, ["ax", "ay", "az"], STANDARD_GRAVITY)?,
                angular_velocity: vector(&row, ["wx", "wy", "wz"], 1.0_f64.to_radians())?,
            })
        };
        match sample() {
            Ok(sample) => samples.push(sample),
            Err(why) => skipped.add(row.line, &why),
        }
    }
    samples
}

impl Fix {
    /// Time in the week (s), the clock of [`InertialSample`]. Public recordings of both files begin and end together
    /// without leap seconds: `$TIME` rows count as the fixes do.
    pub fn time_of_week(&self) -> f64 {
        (self.time - GPS_EPOCH).rem_euclid(WEEK)
    }
}

#[cfg(test)]
mod tests;
