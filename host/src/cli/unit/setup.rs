//! `bodyflight unit configure` and `bodyflight unit show`.

use std::path::PathBuf;

use bodyflight_core::link::{SensorKind, Setup};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_unit::setup;
use bodyflight_unit::stream::connection::{DEFAULT_BAUD, Target};
use bodyflight_unit::virtual_unit::VirtualUnit;
use serde::Serialize;

use super::super::arguments::Names;
use super::super::{estimate, terminal};
use super::sensor::SensorArgs;

/// Where the unit is.
#[derive(clap::Args)]
#[group(required = true, multiple = false)]
pub(super) struct Place {
    /// The unit's serial port; `bodyflight ports` lists them.
    #[arg(long, value_name = "DEVICE")]
    port: Option<PathBuf>,
    /// The memory of a virtual unit, as in `bodyflight unit --flash`.
    #[arg(long, value_name = "FILE")]
    flash: Option<PathBuf>,
}

/// Store a configuration on a unit, with which it then starts on its own.
///
/// From then on power is all that the unit needs: it starts with its own sensor, without a greeting, also after a reset
/// in flight.
#[derive(clap::Args)]
#[command(
    after_help = "Exit code 5: the configuration is stored, but nobody is this person or flies in this air.\n\n\
                  Example: bodyflight unit configure me.toml --port /dev/ttyACM0 --rate 100"
)]
pub(super) struct ConfigureArgs {
    /// A subject.toml, or a flight.toml for the subject, the air and the limbs.
    #[arg(required_unless_present = "erase")]
    flight: Option<PathBuf>,
    #[command(flatten)]
    place: Place,
    /// Sample rate of the sensor (Hz).
    #[arg(long, value_name = "HZ", default_value_t = 100.0)]
    rate: f64,
    /// Filter preset, a built-in one as in `estimate`.
    #[arg(long, default_value = "auto", value_parser = Names(estimate::presets), hide_possible_values = true)]
    preset: String,
    #[command(flatten)]
    sensor: SensorArgs,
    /// Erase the stored configuration instead.
    #[arg(long, conflicts_with = "flight")]
    erase: bool,
}

/// Show the configuration stored on a unit.
#[derive(clap::Args)]
#[command(after_help = "Example: bodyflight unit show --port /dev/ttyACM0")]
pub(super) struct ShowArgs {
    #[command(flatten)]
    place: Place,
}

/// The configuration stored on a unit.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(crate) struct Stored {
    /// Whether there is one.
    present: bool,
    /// Filter preset, by its number in docs/link.md.
    preset: Option<u16>,
    /// Sample rate of the sensor (Hz).
    sample_rate_hz: Option<f32>,
    /// Rate of estimates (Hz).
    update_rate_hz: Option<f32>,
    /// Stature (m) and mass (kg) of the subject.
    height_m: Option<f32>,
    /// See `height_m`.
    mass_kg: Option<f32>,
    /// Air density (kg/m3).
    air_density_kgpm3: Option<f32>,
    /// Protocol of the sensor.
    sensor: Option<&'static str>,
    /// Age of a receiver's solution on arrival (s).
    receiver_latency_s: Option<f32>,
    /// Mounting, a quaternion w, x, y, z.
    body_from_sensor_wxyz: Option<[f32; 4]>,
    /// Segments with a calibrated sensor of a chain.
    limbs: Option<Vec<&'static str>>,
    /// Checksum of the segment table, eight hexadecimal digits.
    table: Option<String>,
}

/// A unit that runs as long as this exists, and its address.
pub(super) fn reach(place: &Place, baud: u32) -> Result<(Option<VirtualUnit>, Target)> {
    let at = |path: PathBuf| Target::Port { path, baud };
    match (&place.port, &place.flash) {
        (_, Some(flash)) => {
            let unit = VirtualUnit::start_with_log(flash)?;
            let target = at(unit.path().to_path_buf());
            Ok((Some(unit), target))
        }
        (port, None) => Ok((None, at(port.clone().unwrap_or_default()))),
    }
}

/// Same as [`reach`], for a unit that is there: a virtual one without a memory has nothing to tell, and none is created.
pub(super) fn reach_existing(place: &Place, baud: u32) -> Result<(Option<VirtualUnit>, Target)> {
    if let Some(flash) = &place.flash {
        std::fs::metadata(flash).map_err(|error| {
            Problem::system("open", flash, error)
                .help("name the memory of a virtual unit, which `unit --flash` or `unit configure --flash` created")
        })?;
    }
    reach(place, baud)
}

pub(super) fn configure(args: &ConfigureArgs, json: bool) -> Result<()> {
    let Some(flight) = &args.flight else {
        let (_unit, target) = reach_existing(&args.place, DEFAULT_BAUD)?;
        setup::erase(&target)?;
        return print(None, json);
    };
    let (setup, doubt) = args.sensor.setup(flight, &args.preset, args.rate)?;
    let (_unit, target) = reach(&args.place, DEFAULT_BAUD)?;
    setup::store(&target, &setup)?;
    print(Some(&setup), json)?;
    match doubt {
        None => Ok(()),
        Some(doubt) => Err(Problem::doubt(doubt)
            .in_file(flight)
            .help("the configuration is stored; correct the file and store it again")),
    }
}

pub(super) fn show(args: &ShowArgs, json: bool) -> Result<()> {
    let (_unit, target) = reach_existing(&args.place, DEFAULT_BAUD)?;
    print(setup::read(&target)?.as_ref(), json)
}

fn print(setup: Option<&Setup>, json: bool) -> Result<()> {
    let configure = setup.map(|setup| setup.configure);
    let stored = Stored {
        present: setup.is_some(),
        preset: configure.map(|c| c.preset),
        sample_rate_hz: configure.map(|c| c.sample_rate),
        update_rate_hz: configure.map(|c| c.update_rate),
        height_m: configure.map(|c| c.height),
        mass_kg: setup.map(|setup| setup.table.rows().map(|row| row.mass).sum()),
        air_density_kgpm3: configure.map(|c| c.air_density),
        sensor: configure.map(|c| match c.sensor {
            SensorKind::Xbus => "xbus",
            SensorKind::Bno08xRvc => "bno08x-rvc",
            SensorKind::Chain => "chain",
        }),
        receiver_latency_s: configure.map(|c| c.receiver_latency),
        body_from_sensor_wxyz: configure.map(|c| {
            let q = c.body_from_sensor.unpack();
            [q.w, q.i, q.j, q.k]
        }),
        limbs: setup.map(|setup| setup.limbs.rows().map(|row| row.segment.name()).collect()),
        table: setup.map(|setup| format!("{:08x}", setup.table.digest())),
    };
    if json {
        return terminal::print_json(&stored);
    }
    let (Some(configure), Some(mass)) = (configure, stored.mass_kg) else {
        terminal::print("no configuration is stored: the unit waits for a host");
        return Ok(());
    };
    terminal::print(&format!(
        "{:.2} m, {mass:.1} kg; {} at {} Hz, estimates at {:.1} Hz, preset {}; air {:.3} kg/m3; table {}",
        configure.height,
        stored.sensor.unwrap_or_default(),
        configure.sample_rate,
        configure.update_rate,
        configure.preset,
        configure.air_density,
        stored.table.unwrap_or_default(),
    ));
    if configure.sensor == SensorKind::Chain {
        let limbs = stored.limbs.unwrap_or_default();
        terminal::print(&if limbs.is_empty() {
            "the sensors on the limbs are not calibrated: `bodyflight unit calibrate`".to_owned()
        } else {
            format!("{} calibrated sensors: {}", limbs.len(), limbs.join(", "))
        });
    }
    Ok(())
}
