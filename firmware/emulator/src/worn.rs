//! Ten sensors on the limbs of somebody who is calibrated, stands upright, and jumps.

use std::path::Path;

use bodyflight_core::link::{SensorKind, Setup};
use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::sensor_noise::SensorNoise;
use bodyflight_core::suit::placement::of_size;
use bodyflight_firmware::computer::Configuration;
use bodyflight_firmware::limbs::Limbs;
use bodyflight_laboratory::limb_sensors::line::STANDING;
use bodyflight_laboratory::limb_sensors::{LimbSensors, Sizes};
use bodyflight_laboratory::sensor_bytes::SensorBytes;
use bodyflight_laboratory::synthesize::{Request, flown};
use bodyflight_replay::flight as file;

use crate::Result;
use crate::sensed::Sensed;

/// The line of the sensors, and a unit that knows them.
pub struct Worn {
    /// The bytes of the sensors and of a receiver, each with the time since the flight began (s).
    pub line: Vec<(f64, Vec<u8>)>,
    /// A configuration with the calibration that the line begins with.
    pub setup: Setup,
}

impl Worn {
    /// An exit, up to `seconds` after it.
    ///
    /// # Errors
    /// Returns an error if nothing can be flown, or if the sensors are not calibrated by their line.
    pub fn in_exit(seconds: f64) -> Result<Self> {
        let line = line(seconds)?;
        let mut setup = Sensed::of_maneuver("tracking", 0.1, &SensorBytes::TYPICAL)?.setup;
        setup.configure.sensor = SensorKind::Chain;
        (setup.configure.sample_rate, setup.configure.update_rate) = (100.0, 25.0);
        let configuration = Configuration::new(&setup.configure, &setup.table);
        let configuration = configuration.map_err(|error| format!("{error:?}"))?;
        let mut limbs = Limbs::new();
        for (_, bytes) in &line {
            let mut input = &bytes[..];
            while limbs.next(&mut input, Some(configuration.body())).is_some() {}
            if limbs.is_to_store() {
                setup.limbs = *limbs.table();
                return Ok(Self { line, setup });
            }
        }
        Err(format!("not calibrated: {:?}", limbs.calibration()))
    }
}

fn line(seconds: f64) -> Result<Vec<(f64, Vec<u8>)>> {
    let flight = file::Flight::bare(Path::new(""));
    let maneuver = Maneuver::from_name("exit-and-tracking").ok_or("no such maneuver")?;
    let request = Request {
        noise: SensorNoise::NONE,
        ..Request::new(maneuver, &flight.subject, 2)
    };
    let frames = flown(&request, &flight.dynamics(4000.0));
    let mut frames = frames.map_err(|error| error.to_string())?;
    frames.retain(|frame| frame.time <= seconds);
    let sensors = LimbSensors {
        seed: 2,
        segments: of_size(10).ok_or("no such set")?,
        sizes: Sizes::TYPICAL,
        fault: None,
    };
    let streams = sensors.of(&flight.subject.body(), &frames);
    let begin = streams.flight_s + STANDING;
    let sent = streams.line().into_iter();
    Ok(sent.map(|(time, bytes)| (time - begin, bytes)).collect())
}
