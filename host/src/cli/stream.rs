//! `bodyflight stream`.

mod sensor;

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::time::Duration;

use bodyflight_core::link::fault::Faults;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvn_network::Source;
use bodyflight_mvnx::live::LiveRecording;
use bodyflight_mvnx::recording::{FlightFrame, Warning};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::live::LiveChecks;
use bodyflight_replay::model_file::Effects;
use bodyflight_unit::monitor::Defmt;
use bodyflight_unit::stream::connection::{DEFAULT_BAUD, Target};
use bodyflight_unit::stream::report::Report;
use bodyflight_unit::stream::{Pace, Settings, stream};

use super::arguments::{Names, within};
use super::outputs::{Outputs, print_kept};
use super::simulate::Reading;
use super::unit::sensor::SensorArgs;
use super::watch::Watch;
use super::{estimate, several, terminal};
use sensor::Alone;

/// Stream a flight to a unit, and compare its estimates bit for bit with those of the same filter on this machine.
#[derive(clap::Args)]
#[command(
    group = clap::ArgGroup::new("target").required(true),
    after_help = "Exit code 4: an estimate differs, or a sample was lost other than by --drop, --corrupt or --reorder; with \
                  --sensor, the estimates are not to be trusted.\n\n\
                  Examples:\n  bodyflight stream flight.toml --virtual\n  \
                  bodyflight stream flight.toml --port /dev/ttyACM0 --speed max\n  \
                  bodyflight stream flight.toml --qemu --drop 0.05 --corrupt 0.05 --reorder 0.02\n  \
                  bodyflight stream flight.toml --virtual --view --open\n  \
                  bodyflight stream --mvn :9763 --port /dev/ttyACM0 --out jump.mvnx\n  \
                  bodyflight stream subject.toml --sensor /dev/ttyUSB0 --baud 115200 --rate 100 --log jump"
)]
pub(super) struct Args {
    /// A flight.toml, or an MVNX file on its own; with --mvn or --sensor, a flight.toml for the subject and the air, or
    /// with --sensor a subject.toml.
    #[arg(required_unless_present = "mvn")]
    flight: Option<PathBuf>,
    /// Take samples from MVN's network stream instead of a recording.
    #[arg(long, value_name = "HOST:PORT", conflicts_with_all = ["speed", "seconds"])]
    mvn: Option<String>,
    /// Sample rate of that stream, 240 by default, or of the sensor, 100 by default (Hz).
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// The unit's serial port; `bodyflight ports` lists them.
    #[arg(long, group = "target", value_name = "DEVICE")]
    port: Option<PathBuf>,
    /// Use a unit in QEMU, with this image or the one that `cargo xtask unit` builds.
    #[arg(long, group = "target", value_name = "IMAGE", num_args = 0..=1, default_missing_value = DEFAULT_IMAGE)]
    qemu: Option<PathBuf>,
    /// Use a unit in this process, behind a pseudo-terminal.
    #[arg(long, group = "target")]
    r#virtual: bool,
    /// Run the unit here as it flies alone, with nothing but the bytes of its sensor: a recorded file, the sensor's
    /// serial port, or - for standard input.
    #[arg(long, group = "target", value_name = "BYTES", requires = "flight",
          conflicts_with_all = ["mvn", "speed", "seconds", "drop", "corrupt", "reorder", "seed", "model", "out", "view"])]
    sensor: Option<String>,
    #[command(flatten)]
    unit_sensor: SensorArgs,
    /// With --sensor: write the flight and the estimates into this folder, as `unit log` does.
    #[arg(long, value_name = "FOLDER", requires = "sensor")]
    log: Option<PathBuf>,
    /// Rate of the port (baud).
    #[arg(long, default_value_t = DEFAULT_BAUD)]
    baud: u32,
    /// Speed relative to the recording, or `max` for as fast as the unit can process.
    #[arg(long, default_value = "1")]
    speed: String,
    /// Filter preset of the unit, a built-in one as in `estimate`.
    #[arg(long, default_value = "auto", value_parser = Names(estimate::presets), hide_possible_values = true)]
    preset: String,
    /// Stream only this many seconds of the flight.
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Share of samples to drop.
    #[arg(long, default_value_t = 0.0, value_name = "P")]
    drop: f32,
    /// Share of samples in which to flip a bit.
    #[arg(long, default_value_t = 0.0, value_name = "P")]
    corrupt: f32,
    /// Share of samples to send after their successor.
    #[arg(long, default_value_t = 0.0, value_name = "P")]
    reorder: f32,
    /// Seed of the faults; another seed affects other samples.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Effects to add to the model: a model.toml. Only effects that change the body are supported.
    #[arg(long, value_name = "TOML")]
    model: Option<PathBuf>,
    /// Keep the streamed frames as a recording; Ctrl-C completes the file.
    #[arg(long, value_name = "MVNX")]
    out: Option<PathBuf>,
    #[command(flatten)]
    outputs: Outputs,
    #[command(flatten)]
    watch: Watch,
    #[command(flatten)]
    reading: Reading,
}

/// An MVN stream that is silent for this long has ended.
const SILENCE: Duration = Duration::from_secs(5);

/// Path of the image that `cargo xtask unit` builds.
const DEFAULT_IMAGE: &str = "target/thumbv7em-none-eabihf/firmware/unit";

impl Args {
    fn target(&self) -> Target {
        match (&self.port, &self.qemu) {
            (Some(path), _) => Target::Port {
                path: path.clone(),
                baud: self.baud,
            },
            (None, Some(image)) => Target::Qemu(image.clone()),
            (None, None) => Target::Virtual,
        }
    }

    fn pace(&self) -> Result<Pace> {
        if self.mvn.is_some() {
            return Ok(Pace::Source);
        }
        let wrong = || {
            Problem::bad_input(format!(
                "expected --speed of 0.01 to 100, or max, found {}",
                self.speed
            ))
        };
        if self.speed == "max" {
            return Ok(Pace::Max);
        }
        let speed = self.speed.parse().map_err(|_| wrong())?;
        if (0.01..=100.0).contains(&speed) {
            Ok(Pace::Times(speed))
        } else {
            Err(wrong())
        }
    }

    fn faults(&self) -> Result<Faults> {
        for (name, share) in [
            ("drop", self.drop),
            ("corrupt", self.corrupt),
            ("reorder", self.reorder),
        ] {
            if !(0.0..=1.0).contains(&share) {
                return Err(Problem::bad_input(format!(
                    "expected --{name} of 0 to 1, found {share}"
                )));
            }
        }
        Ok(Faults {
            drop: self.drop,
            corrupt: self.corrupt,
            reorder: self.reorder,
            ..Faults::default()
        })
    }
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    if let Some(rate) = args.rate {
        within("rate", rate, [1.0, 10_000.0], "Hz")?;
    }
    if let Some(seconds) = args.seconds {
        within("seconds", seconds, [0.01, 1e5], "s")?;
    }
    if let Some(source) = &args.sensor {
        let alone = Alone {
            flight: args.flight.as_deref().unwrap_or(Path::new("")),
            preset: &args.preset,
            sensor: &args.unit_sensor,
            rate: args.rate.unwrap_or(100.0),
            source,
            baud: args.baud,
            log: args.log.as_deref(),
            outputs: args.outputs,
        };
        return sensor::run(&alone, json);
    }
    if args.unit_sensor.is_given() {
        return Err(Problem::bad_input(
            "--protocol, --mounting and --latency describe a sensor, but there is none",
        )
        .help("name its bytes with --sensor, or store the configuration with `unit configure`"));
    }
    let settings = Settings {
        target: args.target(),
        preset: estimate::unit_preset(&args.preset)?,
        pace: args.pace()?,
        faults: args.faults()?,
        seed: args.seed,
    };
    let mut flight = match &args.flight {
        Some(path) => Flight::read(path)?,
        None => Flight::bare(Path::new("MVN")),
    };
    if let Some(model) = &args.model {
        flight.effects = Effects::read(model)?;
        terminal::note_random(&flight.effects);
    }
    if let Some(address) = &args.mvn {
        let mut source = Source::bind(address)?;
        terminal::note(&format!("listening to MVN at {}", source.local_address()?));
        let mut patience = Duration::MAX;
        let rate = args.rate.unwrap_or(240.0);
        let checks = RefCell::new(LiveChecks::new(&flight, rate));
        let frames = std::iter::from_fn(|| {
            let frame = source.next_within(patience).transpose();
            patience = SILENCE;
            if let Some(Ok(frame)) = &frame {
                checks.borrow_mut().see(frame);
            }
            frame
        });
        return run_frames(args, json, &flight, rate, frames, &settings, &|| {
            checks.borrow().warnings()
        });
    }
    let recording = RefCell::new(flight.open(args.reading.options())?);
    let frame_rate = recording.borrow().header().frame_rate;
    let seconds = args.seconds.unwrap_or(f64::INFINITY);
    let mut start = None;
    let frames = std::iter::from_fn(|| recording.borrow_mut().next()).take_while(|frame| {
        frame.as_ref().map_or(true, |frame| {
            frame.time - *start.get_or_insert(frame.time) <= seconds
        })
    });
    run_frames(args, json, &flight, frame_rate, frames, &settings, &|| {
        recording.borrow().warnings()
    })
}

fn run_frames(
    args: &Args,
    json: bool,
    flight: &Flight,
    frame_rate: f64,
    frames: impl Iterator<Item = Result<FlightFrame>>,
    settings: &Settings,
    warnings: &dyn Fn() -> Vec<Warning>,
) -> Result<()> {
    // The image contains the strings of the unit's log.
    let mut logs = match args.qemu.as_deref() {
        Some(image) if cfg!(feature = "full") => Some(Defmt::open(image)?),
        Some(_) => {
            terminal::note("this program was built without the decoder of the unit's logs");
            None
        }
        None => None,
    };
    let mut kept = args.outputs.live(&args.out, || flight.subject.body())?;
    // Every frame advances the simulated body, but the page is updated less often.
    let view = RefCell::new(args.watch.begin(flight, args.flight.as_ref())?);
    let spinner = terminal::spinner("streaming");
    let frames = frames.map(|frame| {
        let frame = frame?;
        if let Some(view) = &mut *view.borrow_mut() {
            view.follow(&frame)?;
        }
        if let Some(kept) = &mut kept {
            kept.push(&frame)?;
        }
        Ok(frame)
    });
    let report = stream(
        flight,
        frame_rate,
        frames,
        settings,
        |live, frame| {
            if let Some(view) = &*view.borrow() {
                view.show(frame, Some(*live), None)?;
            }
            spinner.set_message(format!(
                "{:.0} s, {} sent, {} estimates, {:.1} ms, missing {}, dropped {}, late {}",
                live.time_s,
                live.sent,
                live.estimates,
                live.latency_ms.unwrap_or(0.0),
                live.missing,
                live.dropped,
                live.deadline_missed
            ));
            Ok(())
        },
        |bytes| {
            for line in logs.iter_mut().flat_map(|logs| logs.push(bytes)) {
                spinner.suspend(|| terminal::note(&line.to_string()));
            }
        },
    );
    spinner.finish_and_clear();
    // Keep what was received even if the stream failed.
    let kept = kept.map(LiveRecording::finish).transpose();
    if let (Ok(Some(Some(kept))), false) = (&kept, json) {
        print_kept(kept);
    }
    let mut report = report?;
    report.kept = kept?.flatten();
    report.log_lines = logs.as_ref().map(|logs| logs.totals().lines);
    report.warnings = warnings();
    report.log_malformed = logs.as_ref().map(|logs| logs.totals().malformed_frames);
    if json {
        terminal::print_json(&report)?;
    } else {
        print_report(&report);
    }
    report.verdict()?;
    several::verdict(report.doubt(), &flight.recording)
}

fn print_report(report: &Report) {
    terminal::note_warnings(&report.warnings);
    let estimates = &report.estimates;
    let unit = &report.unit;
    if let Some(place) = &report.unit_panic {
        terminal::print(&format!(
            "the unit has panicked since its power-on, at {place}"
        ));
    }
    let latency = &report.latency;
    terminal::print(&format!(
        "{} samples in {:.1} s ({:.1} s of flight, {:.1} kB/s) to unit {}",
        report.sent,
        report.wall_s,
        report.flight_s,
        report.bytes_per_second * 1e-3,
        report.unit_build
    ));
    terminal::print(&format!(
        "estimates: {} of {} received, {} equal to the desktop's bit for bit",
        estimates.received, estimates.expected, estimates.equal
    ));
    terminal::print(&format!(
        "latency: median {:.2} ms, 99 % {:.2} ms, longest {:.2} ms; round trip {:.2} ms",
        latency.median_ms, latency.p99_ms, latency.max_ms, latency.round_trip_ms
    ));
    terminal::print(&format!(
        "samples: {} used, {} rejected, {} late, {} missing ({} lost on the line), {} dropped by the unit",
        unit.used, unit.rejected, unit.late, unit.missing, report.lost, unit.dropped_oldest
    ));
    let harmed = &report.harmed;
    terminal::print(&format!(
        "frames: {} good, {} damaged; injected faults: {} dropped, {} corrupted, {} reordered",
        unit.received_frames,
        unit.crc_bad + unit.cobs_bad + unit.too_long,
        harmed.dropped,
        harmed.corrupted,
        harmed.reordered
    ));
    terminal::print(&format!(
        "unit: {} deadline misses, longest update {} cycles, {} innovations rejected, stack free {} B",
        unit.deadline_missed, unit.cycles_max, unit.innovation_rejected, unit.stack_free
    ));
    if unit.battery_mv > 0 {
        let volts = f64::from(unit.battery_mv) * 1e-3;
        terminal::print(&format!("battery: {volts:.2} V"));
    }
}
