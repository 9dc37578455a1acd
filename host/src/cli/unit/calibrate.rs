//! `bodyflight unit calibrate`.

use std::path::PathBuf;
use std::time::Duration;

use bodyflight_core::Segment;
use bodyflight_core::link::{Calibration, CalibrationStage};
use bodyflight_io::diagnostic::Result;
use bodyflight_unit::calibration;
use bodyflight_unit::stream::connection::{DEFAULT_BAUD, Target};
use serde::Serialize;

use super::super::terminal;

/// Calibrate the sensors on the limbs of a unit, which then stores them with its configuration.
///
/// The unit sees by itself what is done: sensors in their tray at rest, and turned, if biases and scales are wanted; then
/// worn: upright, bent, a march, upright again. Whoever does not hold still is not calibrated.
#[derive(clap::Args)]
#[command(after_help = "Exit code 2: it was refused, or not seen in time.\n\n\
                        Example: bodyflight unit calibrate --port /dev/ttyACM0")]
pub(super) struct Args {
    /// The unit's serial port; `bodyflight ports` lists them.
    #[arg(long, value_name = "DEVICE")]
    port: PathBuf,
    /// Time for all poses (s).
    #[arg(long, value_name = "S", default_value_t = 180)]
    patience: u64,
}

/// A calibration that ended well.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(crate) struct Calibrated {
    /// The sensors.
    sensors: Vec<CalibratedSensor>,
}

/// A calibrated sensor.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(crate) struct CalibratedSensor {
    /// The segment that carries it.
    segment: &'static str,
    /// Bias of its gyroscope (deg/s, sensor axes), and the standard deviation of each.
    bias_dps: [f32; 3],
    /// See `bias_dps`.
    bias_deviation_dps: f32,
    /// Factors on its axes.
    gain: [f32; 3],
    /// Standard deviation of the segment's tilt in the upright pose, and of the heading (deg).
    tilt_deviation_deg: f32,
    /// See `tilt_deviation_deg`.
    heading_deviation_deg: f32,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let target = Target::Port {
        path: args.port.clone(),
        baud: DEFAULT_BAUD,
    };
    let patience = Duration::from_secs(args.patience);
    let setup = calibration::calibrate(&target, patience, |state| {
        terminal::note(&said(state));
    })?;
    let sensors = setup.limbs.rows().map(|row| CalibratedSensor {
        segment: row.segment.name(),
        bias_dps: row.bias.map(f32::to_degrees),
        bias_deviation_dps: row.bias_deviation.to_degrees(),
        gain: row.gain,
        tilt_deviation_deg: row.tilt_deviation.to_degrees(),
        heading_deviation_deg: row.heading_deviation.to_degrees(),
    });
    let found = Calibrated {
        sensors: sensors.collect(),
    };
    if json {
        return terminal::print_json(&found);
    }
    for sensor in &found.sensors {
        terminal::print(&format!(
            "{}: tilt within {:.1} degrees, heading within {:.1}, bias within {:.3} deg/s",
            sensor.segment,
            sensor.tilt_deviation_deg,
            sensor.heading_deviation_deg,
            sensor.bias_deviation_dps
        ));
    }
    terminal::print(&format!(
        "{} sensors are calibrated and stored",
        found.sensors.len()
    ));
    Ok(())
}

/// The state in words.
fn said(state: &Calibration) -> String {
    let turned = Segment::ALL
        .into_iter()
        .filter(|s| state.turned & 1 << *s as u8 != 0);
    match state.stage {
        CalibrationStage::Absent => "no sensors on the limbs".to_owned(),
        CalibrationStage::Poses => format!(
            "{} sensors heard, {} rests seen, {} scales calibrated",
            state.heard.count_ones(),
            state.rests,
            turned.count()
        ),
        CalibrationStage::Waiting => "calibrated: stand upright and still".to_owned(),
        CalibrationStage::Worn => "calibrated, and postures follow".to_owned(),
    }
}
