//! Raw readings of inertial sensors on the limbs: their calibration on the ground, then a simulated flight.
//!
//! Every sensor has its own errors: bias, scale, noise, clock, lost samples, mounting, misplacement and soft tissue. The
//! person does not hold the poses exactly. None of these numbers is known to the program that reads the files.

mod errors;
mod fault;
mod ground;
mod instant;
pub mod line;
mod track;

use std::fmt::Write as _;
use std::path::Path;

use bodyflight_core::air::STANDARD_GRAVITY;
use bodyflight_core::{Body, Segment};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::{CsvFile, write_file};
use bodyflight_mvnx::recording::FlightFrame;
use nalgebra::{UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

use errors::SensorErrors;
pub use errors::{Row, Sizes};
pub use fault::Fault;
use ground::Ground;
use instant::Instant;
pub use track::Fix;

/// Folder of the files, below that of the flight.
pub const FOLDER: &str = "sensors";
/// Name of the mapping.
pub const MAPPING_FILE: &str = "mapping.toml";
/// Name of the receiver's track.
pub const TRACK_FILE: &str = "TRACK.CSV";
/// Frames of the flight for one sample.
const STRIDE: usize = 2;

/// Names of the columns of each file.
const COLUMNS: [&str; 7] = [
    "time_s",
    "gyroscope_x_radps",
    "gyroscope_y_radps",
    "gyroscope_z_radps",
    "accelerometer_x_mps2",
    "accelerometer_y_mps2",
    "accelerometer_z_mps2",
];

/// The sensors of a person.
#[derive(Debug, Clone, PartialEq)]
pub struct LimbSensors {
    /// Seed of all errors.
    pub seed: u64,
    /// Segments with a sensor.
    pub segments: &'static [Segment],
    /// Sizes of the errors.
    pub sizes: Sizes,
    /// A sensor's fault.
    pub fault: Option<(Segment, Fault)>,
}

/// Which segments have a sensor, and a fault of one of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limbs {
    /// Segments with a sensor.
    pub segments: &'static [Segment],
    /// A sensor's fault.
    pub fault: Option<(Segment, Fault)>,
}

impl Limbs {
    /// Checks that the fault is of sensors that are worn.
    ///
    /// # Errors
    /// Returns an error if it is not.
    pub fn check(&self) -> Result<()> {
        let Some((segment, fault)) = self.fault else {
            return Ok(());
        };
        let other = match fault {
            Fault::Exchanged(other) => Some(other),
            _ => None,
        };
        for segment in [Some(segment), other].into_iter().flatten() {
            if !self.segments.contains(&segment) {
                let names = self.segments.iter().map(|worn| worn.name());
                return Err(Problem::unknown("sensor", segment.name(), names));
            }
        }
        Ok(())
    }
}

/// The readings of all sensors, and when the flight begins by the first clock (s).
#[derive(Debug, Clone, PartialEq)]
pub struct Streams {
    /// The samples of each segment's sensor.
    pub sensors: Vec<(Segment, Vec<Row>)>,
    /// Begin of the flight (s).
    pub flight_s: f64,
    /// A receiver's track of the flight.
    pub track: Vec<Fix>,
    /// Name of the limb groups that act in the flight; empty if it is not known.
    pub muscles: &'static str,
}

impl LimbSensors {
    /// The readings in a flight without noise, whose frames follow each other at one rate, after the calibration.
    pub fn of(&self, body: &Body<f64>, frames: &[FlightFrame]) -> Streams {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed ^ 0x7375_6974);
        let interval = match frames {
            [first, second, ..] => second.time - first.time,
            _ => return self.nothing(),
        };
        let Some(first) = frames.first().map(Instant::of) else {
            return self.nothing();
        };
        let ground = Ground::new(&mut random, &self.sizes, first);
        let mut sensors: Vec<(Segment, Vec<Row>)> = (self.segments.iter())
            .map(|segment| {
                let errors = SensorErrors::new(&mut random, &self.sizes);
                let fault = self.fault.filter(|(of, _)| of == segment);
                let fault = fault.map(|(_, fault)| fault);
                let rows = self.rows(
                    (*segment, fault),
                    errors,
                    &Flown {
                        body,
                        ground: &ground,
                        frames,
                        interval,
                    },
                );
                (*segment, rows)
            })
            .collect();
        if let Some((one, Fault::Exchanged(other))) = self.fault {
            exchange(&mut sensors, one, other);
        }
        Streams {
            sensors,
            flight_s: ground::DURATION,
            track: track::of(&mut random, frames),
            muscles: "",
        }
    }

    fn nothing(&self) -> Streams {
        Streams {
            sensors: self.segments.iter().map(|s| (*s, Vec::new())).collect(),
            flight_s: ground::DURATION,
            track: Vec::new(),
            muscles: "",
        }
    }

    fn rows(
        &self,
        (segment, fault): (Segment, Option<Fault>),
        mut errors: SensorErrors,
        flown: &Flown<'_>,
    ) -> Vec<Row> {
        let place = flown.body.segments[segment].cg + errors.misplaced;
        let count = flown.count();
        let mut rows = Vec::new();
        let moving = |index: usize, errors: &SensorErrors| {
            let time = flown.time(index);
            let (attitude, at) = flown.instant(index)?.point(flown.body, segment, &place);
            let tissue = errors.tissue_at(time, ground::liveliness(segment, time));
            let turn = fault.map_or_else(UnitQuaternion::identity, |fault| {
                fault.turn(time - ground::DURATION)
            });
            Some((attitude * tissue * turn * errors.segment_from_sensor, at))
        };
        for index in (0..count).step_by(STRIDE) {
            let time = flown.time(index);
            let fall = time - ground::DURATION;
            if fault.is_some_and(|fault| fault.is_silent(fall)) || errors.is_lost() {
                continue;
            }
            let (rate, force) = match ground::tray(time) {
                Some((rate, inertial_from_tray)) => (
                    rate,
                    inertial_from_tray.inverse() * Vector3::z() * STANDARD_GRAVITY,
                ),
                None => {
                    let around = flown.around(index);
                    let [Some(before), Some(now), Some(after)] =
                        around.map(|at| moving(at, &errors))
                    else {
                        continue;
                    };
                    motion([before, now, after], flown.interval)
                }
            };
            let (rate, force) = errors.read(&rate, &force, time);
            let row = (errors.stamp(time), rate, force);
            rows.push(fault.map_or(row, |fault| fault.of_row(row, fall)));
        }
        rows
    }
}

/// Lets two sensors be worn in each other's place, if both are.
fn exchange(sensors: &mut [(Segment, Vec<Row>)], one: Segment, other: Segment) {
    let place = |of: Segment| sensors.iter().position(|(segment, _)| *segment == of);
    let (Some(one), Some(other)) = (place(one), place(other)) else {
        return;
    };
    sensors.swap(one, other);
    let name = sensors[one].0;
    sensors[one].0 = sensors[other].0;
    sensors[other].0 = name;
}

/// Angular velocity and specific force at the middle one of three attitudes and places, in its axes.
fn motion(
    [before, now, after]: [(UnitQuaternion<f64>, Vector3<f64>); 3],
    interval: f64,
) -> (Vector3<f64>, Vector3<f64>) {
    let turn = (before.0.inverse() * after.0).scaled_axis() / (2.0 * interval);
    let acceleration = (after.1 - now.1 * 2.0 + before.1) / (interval * interval);
    let force = acceleration + Vector3::z() * STANDARD_GRAVITY;
    (turn, now.0.inverse() * force)
}

/// The ground and the flight after it as one sequence of instants.
struct Flown<'a> {
    body: &'a Body<f64>,
    ground: &'a Ground,
    frames: &'a [FlightFrame],
    interval: f64,
}

impl Flown<'_> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a minute of frames"
    )]
    fn on_ground(&self) -> usize {
        (ground::DURATION / self.interval).round() as usize
    }

    fn count(&self) -> usize {
        self.on_ground() + self.frames.len()
    }

    fn time(&self, index: usize) -> f64 {
        index as f64 * self.interval
    }

    fn instant(&self, index: usize) -> Option<Instant> {
        match index.checked_sub(self.on_ground()) {
            None => Some(self.ground.at(self.time(index))),
            Some(index) => self.frames.get(index).map(Instant::of),
        }
    }

    /// An instant with its neighbours, not across the begin of the flight, where velocity jumps.
    fn around(&self, index: usize) -> [usize; 3] {
        let begin = self.on_ground();
        let (least, most) = if index < begin {
            (1, begin.saturating_sub(2))
        } else {
            (begin + 1, self.count().saturating_sub(2))
        };
        let middle = index.clamp(least, most);
        [middle - 1, middle, middle + 1]
    }
}

impl Streams {
    /// Writes a file for each sensor and a mapping into the folder.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be written to.
    pub fn write_in(&self, folder: &Path) -> Result<()> {
        std::fs::create_dir_all(folder)
            .map_err(|error| Problem::system("create", folder, error))?;
        for (segment, rows) in &self.sensors {
            let mut file =
                CsvFile::create(&folder.join(format!("{}.csv", segment.name())), &COLUMNS)?;
            for (time, rate, force) in rows {
                let numbers = [*time].into_iter().chain(rate.iter().copied());
                file.write(numbers.chain(force.iter().copied()))?;
            }
            file.finish()?;
        }
        track::write(&self.track, &folder.join(TRACK_FILE))?;
        write_file(&folder.join(MAPPING_FILE), self.mapping().as_bytes())
    }

    /// The mapping: columns, windows of the calibration, and the sensors.
    pub fn mapping(&self) -> String {
        let mut text = String::from("kind = \"imu\"\n\n[columns]\ntime = \"time_s\"\n");
        // Writing to a String cannot fail.
        let _ = writeln!(text, "angular_velocity = {:?}", &COLUMNS[1..4]);
        let _ = writeln!(text, "specific_force = {:?}", &COLUMNS[4..7]);
        let _ = writeln!(text, "\n[calibration]");
        for (name, window) in ground::WINDOWS {
            let _ = writeln!(text, "{name} = {window:?}");
        }
        let _ = writeln!(text, "turns_s = {:?}", ground::TURNS);
        let _ = writeln!(text, "\n[flight]\nbegin_s = {:?}", self.flight_s);
        let _ = writeln!(text, "gnss = \"{TRACK_FILE}\"");
        if !self.muscles.is_empty() {
            let _ = writeln!(text, "muscles = {:?}", self.muscles);
        }
        for (segment, _) in &self.sensors {
            let name = segment.name();
            let _ = writeln!(text, "\n[sensors.{name}]\nfile = \"{name}.csv\"");
        }
        text
    }
}
