//! What a sensor at the pelvis and a receiver would have sent in flights of the independent simulator
//! (`shared/flights`), and how far estimates are from what was flown.

use std::path::Path;
use std::process::Command;

use bodyflight_core::frame::{Inertial, Rotation};
use bodyflight_core::link::{Estimate, EstimateFlags, LimbTable, Setup};
use bodyflight_laboratory::sensor_bytes::SensorBytes;
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_replay::flight as file;
use bodyflight_shared_data::{shared, skipped};
use bodyflight_unit::stream::configuration_at;
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::Value;

use crate::Result;
use crate::flight::{RATE, flown};

/// A flight, the configuration of the unit, and the bytes of its sensors.
pub struct Sensed {
    /// Configuration of a unit that flies alone.
    pub setup: Setup,
    /// What was flown; the positions are exact.
    pub frames: Vec<FlightFrame>,
    /// Time at which bytes are sent (s), and the bytes.
    pub bytes: Vec<(f64, Vec<u8>)>,
    /// The muscle input that acts: pitch, yaw, roll; NaN if it is not constant.
    pub muscle: [f64; 3],
}

impl Sensed {
    /// The first `seconds` of a flight, for example `none-slow-101/flight-0`; `None`, with a notice, if it or `xz` is
    /// absent.
    ///
    /// # Errors
    /// Returns an error if the flight cannot be read.
    pub fn of(name: &str, seconds: f64, sensor: &SensorBytes) -> Result<Option<Self>> {
        let Some(source) = shared(&format!("flights/{name}")) else {
            return Ok(None);
        };
        let failed = |error: &dyn std::fmt::Display| format!("{name}: {error}");
        let folder = tempfile::tempdir().map_err(|error| failed(&error))?;
        for part in ["flight.toml", "subject.toml", "segments.json"] {
            std::fs::copy(source.join(part), folder.path().join(part))
                .map_err(|error| failed(&error))?;
        }
        let packed = source.join("flight.mvnx.xz");
        let Ok(text) = Command::new("xz").arg("-dc").arg(packed).output() else {
            skipped("xz is not installed");
            return Ok(None);
        };
        std::fs::write(folder.path().join("flight.mvnx"), text.stdout)
            .map_err(|error| failed(&error))?;
        let truth = std::fs::read_to_string(source.join("truth.json"));
        let truth: Value = truth
            .map_err(|error| failed(&error))
            .and_then(|text| serde_json::from_str(&text).map_err(|error| failed(&error)))?;
        let pitch = truth["in_pitch"].as_f64().unwrap_or(0.0);
        let read = Self::read(folder.path(), seconds, sensor);
        let read = read.map_err(|problem| failed(&problem))?;
        Ok(Some(Self {
            muscle: [pitch, 0.0, 0.0],
            ..read
        }))
    }

    /// The first `seconds` of a bundled maneuver, flown by our own model.
    ///
    /// # Errors
    /// Returns an error if there is no such maneuver.
    pub fn of_maneuver(name: &str, seconds: f64, sensor: &SensorBytes) -> Result<Self> {
        let (flight, mut frames) = flown(name)?;
        frames.retain(|frame| frame.time <= seconds);
        let sensed = Self::by(&flight, frames, RATE, sensor);
        let sensed = sensed.map_err(|problem| problem.to_string())?;
        Ok(Self {
            muscle: [f64::NAN; 3],
            ..sensed
        })
    }

    fn read(
        folder: &Path,
        seconds: f64,
        sensor: &SensorBytes,
    ) -> bodyflight_io::diagnostic::Result<Self> {
        let flight = file::Flight::read(&folder.join("flight.toml"))?;
        let recording = flight.open(Default::default())?;
        let rate = recording.header().frame_rate;
        let mut frames = Vec::new();
        for frame in recording {
            let frame = frame?;
            if frame.time > seconds {
                break;
            }
            frames.push(frame);
        }
        Self::by(&flight, frames, rate, sensor)
    }

    /// What a sensor sends in a flight of that frame rate (Hz).
    fn by(
        flight: &file::Flight,
        frames: Vec<FlightFrame>,
        rate: f64,
        sensor: &SensorBytes,
    ) -> bodyflight_io::diagnostic::Result<Self> {
        let (configure, table) = configuration_at(flight, 0.0, "auto", rate)?;
        let bytes = sensor.of(&frames);
        Ok(Self {
            setup: Setup {
                configure,
                table,
                limbs: LimbTable::new(),
            },
            frames,
            bytes,
            muscle: [0.0; 3],
        })
    }

    /// The same flight with another north: turned about the vertical by this angle (rad).
    #[must_use]
    pub fn turned(mut self, heading: f64, sensor: &SensorBytes) -> Self {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading);
        let turn = Rotation::<f64, Inertial, Inertial>::from_quaternion(turn);
        for frame in &mut self.frames {
            let pelvis = &mut frame.pelvis;
            pelvis.inertial_from_body = turn * pelvis.inertial_from_body;
            pelvis.position = turn * pelvis.position;
            pelvis.velocity = pelvis.velocity.map(|velocity| turn * velocity);
            pelvis.angular_velocity = pelvis.angular_velocity.map(|spin| turn * spin);
        }
        self.bytes = sensor.of(&self.frames);
        self
    }

    /// Velocity (m/s, inertial axes) and attitude at a time (s).
    pub fn truth(&self, time: f64) -> Option<(Vector3<f32>, UnitQuaternion<f32>)> {
        let at = self.frames.partition_point(|frame| frame.time < time);
        let at = at.clamp(1, self.frames.len().saturating_sub(2));
        let [before, now, after] = [at - 1, at, at + 1].map(|at| self.frames.get(at));
        let (before, now, after) = (before?, now?, after?);
        let change = after.pelvis.position - before.pelvis.position;
        let velocity = change * (1.0 / (after.time - before.time));
        let velocity = Vector3::from(velocity.cast::<f32>().to_array());
        let attitude = now.pelvis.inertial_from_body.cast::<f32>();
        Some((velocity, *attitude.quaternion()))
    }

    /// How far estimates, each with the time of its sample (s), are from what was flown.
    pub fn errors<'a>(&self, estimates: impl Iterator<Item = (f64, &'a Estimate)>) -> Errors {
        let mut found = Errors::default();
        for (time, estimate) in estimates {
            let Some((velocity, attitude)) = self.truth(time) else {
                continue;
            };
            let miss = Vector3::from(estimate.velocity) - velocity;
            let turn = estimate.inertial_from_body.unpack().angle_to(&attitude);
            found.horizontal += f64::from(miss.x.powi(2) + miss.y.powi(2)) / 2.0;
            found.vertical += f64::from(miss.z.powi(2));
            found.attitude += f64::from(turn.powi(2));
            found.consistent += f64::from(u8::from(is_consistent(estimate)));
            for ((found_axis, variance), muscle) in estimate
                .state
                .iter()
                .zip(&estimate.variance)
                .zip(self.muscle)
            {
                let miss = f64::from(*found_axis) - muscle;
                found.muscle += miss.powi(2) / 3.0;
                found.muscle_deviations += miss.powi(2) / f64::from(*variance) / 3.0;
            }
            found.count += 1.0;
        }
        let count = found.count;
        Errors {
            horizontal: (found.horizontal / count).sqrt(),
            vertical: (found.vertical / count).sqrt(),
            attitude: (found.attitude / count).sqrt(),
            consistent: found.consistent / count,
            muscle: (found.muscle / count).sqrt(),
            muscle_deviations: (found.muscle_deviations / count).sqrt(),
            count,
        }
    }
}

/// Root mean square errors of estimates.
#[derive(Debug, Clone, Copy, Default)]
pub struct Errors {
    /// Each horizontal axis (m/s).
    pub horizontal: f64,
    /// Vertical velocity (m/s).
    pub vertical: f64,
    /// Attitude (rad).
    pub attitude: f64,
    /// Share of estimates that agree with the measurements.
    pub consistent: f64,
    /// Muscle input, each axis, and the same in its stated deviations.
    pub muscle: f64,
    /// See `muscle`.
    pub muscle_deviations: f64,
    /// Number of estimates.
    pub count: f64,
}

/// Whether an estimate has a motion and agrees with the measurements.
pub fn is_consistent(estimate: &Estimate) -> bool {
    let bad = EstimateFlags::LOST | EstimateFlags::DOUBTFUL | EstimateFlags::INCONSISTENT;
    estimate.flags.contains(EstimateFlags::MOTION) && !estimate.flags.intersects(bad)
}
