//! Recordings of FlySight receivers: `TRACK.CSV` of FlySight 2, with `SENSOR.CSV` beside it, and the CSV files of
//! FlySight 1.
//!
//! FlySight 2 names its columns in `$COL` lines and marks each row with its sensor; FlySight 1 has one line of names
//! and often one of units. Rows that cannot be used are skipped and counted, with the line of the first of them.
//! Known receiver faults: negative milliseconds (`:28.-001` is a millisecond before the full second), truncated rows,
//! and time that runs backwards.

mod calendar;
mod clock;
mod table;

use std::path::Path;

use bodyflight_core::frame::{Inertial, Vector};
use nalgebra::Vector3;

use bodyflight_falls::Sample;
use bodyflight_falls::channels::Given;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::input;
use bodyflight_io::text::with_commas;

use crate::points::{Flat, in_order};
use crate::text;
use crate::track;
pub use crate::track::InertialSample;
use calendar::Calendar;
use clock::SensorClock;
pub use table::Skipped;
use table::{Column, Row, Tables};

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
    /// The same of its place or its height, whichever is worse (m).
    pub position_accuracy: Option<f64>,
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
    /// What was done about the clock, in sentences.
    pub notes: Vec<String>,
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
        let text = text::plain(bytes);
        let text = with_commas(&text);
        let tables = Tables::parse(&text);
        let mut skipped = Skipped::default();
        let (mut rows, mut without_fix) = (Vec::new(), 0);
        let mut fixes = Fixes::of(&tables);
        for row in tables.rows("GNSS") {
            if row.optional(fixes.kind).is_some_and(|kind| kind < 3.0) {
                without_fix += 1;
                continue;
            }
            match fixes.fix(&row) {
                Err(why) => skipped.add(row.line, &why),
                Ok(fix) => rows.push((row.line, fix)),
            }
        }
        let lines: Vec<u64> = rows.iter().map(|(line, _)| *line).collect();
        let (rows, out_of_order, mut notes) = in_order(rows, |(_, fix)| &mut fix.time);
        // Names the first row that is not in order.
        if out_of_order > 0 {
            let kept = rows.iter().map(|(line, _)| line);
            let first = lines.iter().zip(kept).find(|(line, kept)| line != kept);
            let line = first.map_or(0, |(line, _)| *line);
            skipped.add(line, "not later than the previous row");
            skipped.count += out_of_order - 1;
        }
        let fixes: Vec<Fix> = rows.into_iter().map(|(_, fix)| fix).collect();
        if fixes.is_empty() || skipped.count > fixes.len() + out_of_order {
            let problem = Problem::bad_input(format!(
                "expected FlySight rows (time, lat, lon, hMSL, velN, velE, velD), found {} usable, {} unusable and \
                 {without_fix} without a three-dimensional fix",
                fixes.len(),
                skipped.count
            ))
            .in_file(path);
            return Err(match skipped.first {
                Some((line, why)) => problem
                    .at_line(line)
                    .help(format!("the first unusable row: {why}")),
                None if without_fix > 0 => problem.help(
                    "switch the logger on with a view of the sky, some minutes before the exit",
                ),
                None => problem.help("give a TRACK.CSV of FlySight 2 or a CSV file of FlySight 1"),
            });
        }
        skipped.count += without_fix;
        let beside = path.with_file_name("SENSOR.CSV");
        let (mut inertial, mut pressure) = (Vec::new(), Vec::new());
        if tables.is_second_generation && beside.is_file() {
            let bytes = input::bytes(&beside)?;
            let text = text::plain(&bytes);
            let text = with_commas(&text);
            let sensors = Tables::parse(&text);
            let clock = SensorClock::of(&sensors);
            notes.extend(clock.drift());
            inertial = inertial_samples(&sensors, &clock, &mut skipped);
            pressure = pressure_samples(&sensors, &clock, &mut skipped);
        }
        Ok(Self {
            fixes,
            inertial,
            pressure,
            skipped,
            notes,
        })
    }
}

/// Whether the head of a text has the columns of a FlySight.
pub(crate) fn is_flysight_text(text: &[u8]) -> bool {
    let mut lines = text.split(|byte| *byte == b'\n').take(40);
    text.starts_with(b"$FLYS")
        || lines.any(|line| {
            let mut fields = line.split(|byte| *byte == b',').map(<[u8]>::trim_ascii);
            fields.any(|field| field == b"velD")
        })
}

/// Reads a text with the columns of a FlySight; its sensors are in the folder of `path`.
pub(crate) fn track(text: &[u8], path: &Path) -> Result<track::Track> {
    let track = Track::parse(text, path)?;
    let first = track.fixes.first().copied();
    let samples = track.fixes.iter().map(|fix| Sample {
        time: fix.time - first.map_or(0.0, |first| first.time),
        position: fix.position.components,
        velocity: fix.velocity.components,
    });
    let week = first.map_or(0.0, |first| first.time_of_week());
    let inertial = track.inertial.iter();
    let pressure = track.pressure.iter();
    Ok(track::Track {
        format: "FlySight",
        samples: samples.collect(),
        speed_accuracy: track.fixes.iter().map(|fix| fix.speed_accuracy).collect(),
        position_accuracy: (track.fixes.iter().map(|fix| fix.position_accuracy)).collect(),
        start: first.map(|first| first.time),
        given: Given {
            places: true,
            velocities: true,
            speeds: false,
        },
        inertial: inertial
            .map(|sample| (sample.time_of_week - week, *sample))
            .collect(),
        pressure: pressure
            .map(|sample| (sample.time_of_week - week, sample.pressure))
            .collect(),
        skipped: track.skipped.count,
        notes: track.notes,
    })
}

/// Makes fixes of rows.
struct Fixes {
    time: Column,
    /// Latitude, longitude, height.
    place: [Column; 3],
    /// North, east, down.
    velocity: [Column; 3],
    /// Of the velocity, the place, the height.
    accuracy: [Column; 3],
    kind: Column,
    flat: Flat,
    calendar: Calendar,
}

impl Fixes {
    fn of(tables: &Tables<'_>) -> Self {
        let columns = |names| tables.columns("GNSS", names);
        let [time, speed, kind] = columns(["time", "sAcc", "gpsFix"]);
        let [across, height, _] = columns(["hAcc", "vAcc", "sAcc"]);
        Self {
            time,
            place: columns(["lat", "lon", "hMSL"]),
            velocity: columns(["velN", "velE", "velD"]),
            accuracy: [speed, across, height],
            kind,
            flat: Flat::default(),
            calendar: Calendar::default(),
        }
    }

    fn fix(&mut self, row: &Row<'_>) -> core::result::Result<Fix, String> {
        let time = row.field(self.time)?;
        let time = self.calendar.seconds(time).ok_or_else(|| {
            let time = String::from_utf8_lossy(time);
            format!("expected a time like 2023-10-08T21:36:27.798Z, found \"{time}\"")
        })?;
        let [latitude, longitude, height] = self.place;
        let place = [row.within(latitude, 90.0)?, row.within(longitude, 180.0)?];
        let height = row.within(height, 50_000.0)?;
        let stated = |column| row.optional(column).filter(|accuracy| *accuracy > 0.0);
        let [speed, across, above] = self.accuracy.map(stated);
        let [north, east, down] = self.velocity.map(|column| row.within(column, 1000.0));
        Ok(Fix {
            time,
            position: Vector::from_components(self.flat.position(place, height)),
            velocity: Vector::new(north?, -east?, -down?),
            speed_accuracy: speed,
            position_accuracy: across.into_iter().chain(above).reduce(f64::max),
        })
    }
}

/// Barometer rows on the GNSS clock.
fn pressure_samples(
    tables: &Tables<'_>,
    clock: &SensorClock,
    skipped: &mut Skipped,
) -> Vec<PressureSample> {
    let [time, pressure] = tables.columns("BARO", ["time", "pressure"]);
    let mut samples = Vec::new();
    for row in tables.rows("BARO") {
        let sample = || {
            Ok::<_, String>(PressureSample {
                time_of_week: clock.time_of_week(row.number(time)?),
                pressure: row.within(pressure, 120_000.0)?,
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
fn inertial_samples(
    tables: &Tables<'_>,
    clock: &SensorClock,
    skipped: &mut Skipped,
) -> Vec<InertialSample> {
    let [time] = tables.columns("IMU", ["time"]);
    let force = tables.columns("IMU", ["ax", "ay", "az"]);
    let turn = tables.columns("IMU", ["wx", "wy", "wz"]);
    let vector = |row: &Row<'_>, columns: [Column; 3], unit: f64| {
        let [x, y, z] = columns.map(|column| row.within(column, 10_000.0));
        Ok::<_, String>(Vector3::new(x?, y?, z?) * unit)
    };
    let mut samples: Vec<InertialSample> = Vec::new();
    for row in tables.rows("IMU") {
        let sample = || {
            Ok::<_, String>(InertialSample {
                time_of_week: clock.time_of_week(row.number(time)?),
                specific_force: vector(&row, force, STANDARD_GRAVITY)?,
                angular_velocity: vector(&row, turn, 1.0_f64.to_radians())?,
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
