//! The sensor on the unit's own port, as options.

use std::path::Path;

use bodyflight_core::link::{LimbTable, PackedQuaternion, SensorKind, Setup};
use bodyflight_core::nalgebra::{Quaternion, UnitQuaternion};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_replay::flight::Flight;
use bodyflight_unit::stream::configuration_at;

use super::super::estimate;

/// Protocols of the sensor on the unit's own port.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Protocol {
    /// An Xsens MTi.
    Xbus,
    /// A BNO08x in its UART-RVC mode.
    Bno08xRvc,
    /// Sensors on the limbs on one line.
    Chain,
}

/// The sensor on the unit's own port.
#[derive(clap::Args)]
pub(in super::super) struct SensorArgs {
    /// Protocol of the sensor; xbus by default.
    #[arg(long, value_enum)]
    protocol: Option<Protocol>,
    /// Mounting: the rotation from the sensor's axes to the body's (X left, Y back, Z head), as a quaternion.
    #[arg(long, num_args = 4, value_names = ["W", "X", "Y", "Z"])]
    mounting: Option<Vec<f32>>,
    /// Time from the instant of a receiver's solution to its arrival; 0.1 by default (s).
    #[arg(long, value_name = "S")]
    latency: Option<f32>,
}

impl SensorArgs {
    /// Whether any of them is given.
    pub(in super::super) fn is_given(&self) -> bool {
        self.protocol.is_some() || self.mounting.is_some() || self.latency.is_some()
    }

    /// The configuration of a unit for a subject.toml or flight.toml, with a sensor that sends at `rate` (Hz), and why
    /// nobody is this person or flies in this air.
    pub(in super::super) fn setup(
        &self,
        path: &Path,
        preset: &str,
        rate: f64,
    ) -> Result<(Setup, Option<String>)> {
        let flight = Flight::read_person(path)?;
        let preset = estimate::unit_preset(preset)?;
        let (mut configure, table) = configuration_at(&flight, 0.0, &preset, rate)?;
        if self.mounting.is_some() && matches!(self.protocol, Some(Protocol::Chain)) {
            return Err(Problem::bad_input(
                "--mounting is not for sensors on the limbs: their calibration finds how each of them lies",
            ));
        }
        if let Some([w, x, y, z]) = self.mounting.as_deref().and_then(<[f32]>::first_chunk) {
            let sent = Quaternion::new(*w, *x, *y, *z);
            let is_rotation = (sent.norm() - 1.0).abs() <= 0.01;
            if !is_rotation {
                return Err(Problem::bad_input(format!(
                    "expected --mounting with a norm of 1, found {:.3}",
                    sent.norm()
                )));
            }
            configure.body_from_sensor =
                PackedQuaternion::pack(&UnitQuaternion::new_normalize(sent));
        }
        if let Some(latency) = self.latency {
            if !(0.0..=2.0).contains(&latency) {
                return Err(Problem::bad_input(format!(
                    "expected --latency of 0 to 2 s, found {latency}"
                )));
            }
            configure.receiver_latency = latency;
        }
        configure.sensor = match self.protocol.unwrap_or(Protocol::Xbus) {
            Protocol::Xbus => SensorKind::Xbus,
            Protocol::Bno08xRvc => SensorKind::Bno08xRvc,
            Protocol::Chain => SensorKind::Chain,
        };
        let setup = Setup {
            configure,
            table,
            limbs: LimbTable::new(),
        };
        Ok((setup, flight.doubt()))
    }
}
