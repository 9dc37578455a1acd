//! `bodyflight unit`.

pub(super) mod calibrate;
pub(super) mod sensor;
pub(super) mod setup;

use std::path::PathBuf;
use std::time::Duration;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use bodyflight_replay::subject::Subject;
use bodyflight_unit::image::{Board, Image};
use bodyflight_unit::log;
use bodyflight_unit::sensor_line;
use bodyflight_unit::stream::connection::DEFAULT_BAUD;
use bodyflight_unit::virtual_unit::VirtualUnit;
use serde::Serialize;

use super::outputs::Outputs;
use super::terminal;
use setup::{ConfigureArgs, Place, ShowArgs};

/// Run a unit on this machine behind a pseudo-terminal until Ctrl-C, read a unit's log, or check its image.
#[derive(clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "Without a subcommand, prints the pseudo-terminal to stream to.\n\n\
                  Examples:\n  bodyflight unit   (and in another terminal: stream flight.toml --port and what it printed)\n  \
                  bodyflight unit --flash unit.bin --sensor /dev/ttyUSB0 --baud 115200\n  \
                  bodyflight unit --qemu unit --flash unit.bin --sensor imu.bin\n  \
                  bodyflight unit log --port /dev/ttyACM0 --out jump\n  \
                  bodyflight unit flash unit.uf2 --key maker.pub --drive /media/me/RP2350"
)]
pub(super) struct Args {
    #[command(subcommand)]
    verb: Option<Verb>,
    /// Keep the unit's log in this file, 3 MiB that act as flash memory; created if absent.
    #[arg(long, value_name = "FILE")]
    flash: Option<PathBuf>,
    /// Connect a sensor to the unit's own port: its serial port here, or its recorded bytes, which arrive in real time.
    /// With a configuration stored in --flash the unit then needs no host.
    #[arg(long, value_name = "BYTES", requires = "flash")]
    sensor: Option<String>,
    /// Rate of the sensor's port (baud).
    #[arg(long, default_value_t = DEFAULT_BAUD, requires = "sensor")]
    baud: u32,
    /// Run this image for QEMU's mps2-an505 instead, target/boards/qemu-an505/unit of `cargo xtask unit`. No host can reach
    /// it: it flies with what is stored in --flash until the recorded bytes end.
    #[arg(long, value_name = "IMAGE", requires_all = ["flash", "sensor"])]
    qemu: Option<PathBuf>,
}

#[derive(clap::Subcommand)]
enum Verb {
    Configure(ConfigureArgs),
    Calibrate(calibrate::Args),
    Show(ShowArgs),
    Log(LogArgs),
    Flash(FlashArgs),
}

/// Check an image for a board, and copy it onto the drive of a Pico 2.
#[derive(clap::Args)]
#[command(
    after_help = "Without --drive nothing is written. A flat image for the STM32F405 is checked here and written by dfu-util.\n\
                  Exit code 4: the image does not match its signature.\n\n\
                  Example: bodyflight unit flash unit.uf2 --key maker.pub --drive /media/me/RP2350"
)]
struct FlashArgs {
    /// The image: unit.uf2 or unit.bin of `cargo xtask unit`.
    image: PathBuf,
    /// A minisign public key, with which the signature IMAGE.minisig is checked.
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,
    /// Folder at which the boot loader's drive is mounted.
    #[arg(long, value_name = "FOLDER")]
    drive: Option<PathBuf>,
}

/// The result of a check.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Flashed {
    board: Board,
    bytes: usize,
    /// The signer's comment on the image, if a key was given.
    signed: Option<String>,
    copied: bool,
}

/// Read a unit's on-board log: a recording and the estimates of each flight.
#[derive(clap::Args)]
#[command(
    after_help = "Writes OUT/1, OUT/2 and so on, the oldest first, each with flight.toml, flight.mvnx, estimates.csv and \
                  unit.csv with the unit's own status. A flight of which no sample has an attitude is named and left out. Exit code 4: \
                  blocks of the log are damaged; the intact ones are written.\n\n\
                  Example: bodyflight unit log --port /dev/ttyACM0 --out jump --subject me.toml"
)]
struct LogArgs {
    #[command(flatten)]
    place: Place,
    /// Rate of the port (baud).
    #[arg(long, default_value_t = DEFAULT_BAUD)]
    baud: u32,
    /// Folder for the flights; created if absent.
    #[arg(long, required_unless_present = "erase")]
    out: Option<PathBuf>,
    /// The person who flew, a subject.toml; by default the recording has the body that the unit used.
    #[arg(long)]
    subject: Option<PathBuf>,
    /// Erase the log; with --out, after writing it, and only if no block is damaged and every flight was written.
    #[arg(long)]
    erase: bool,
    #[command(flatten)]
    outputs: Outputs,
}

/// Contents of a log.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Report {
    blocks: usize,
    damaged: usize,
    flights: Vec<log::Written>,
    /// Flights that were not written.
    without_attitude: Vec<log::WithoutAttitude>,
    erased: bool,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    match &args.verb {
        Some(Verb::Configure(args)) => return setup::configure(args, json),
        Some(Verb::Calibrate(args)) => return calibrate::run(args, json),
        Some(Verb::Show(args)) => return setup::show(args, json),
        Some(Verb::Log(args)) => return read_log(args, json),
        Some(Verb::Flash(args)) => return flash(args, json),
        None => {}
    }
    if let (Some(image), Some(flash), Some(sensor)) = (&args.qemu, &args.flash, &args.sensor) {
        return sensor_line::fly_in_qemu(image, flash, sensor_line::open(sensor, args.baud)?);
    }
    let unit = match (&args.flash, &args.sensor) {
        (Some(path), Some(sensor)) => {
            let sensor = sensor_line::open(sensor, args.baud)?;
            VirtualUnit::start_with_sensor(path, sensor)?
        }
        (Some(path), None) => VirtualUnit::start_with_log(path)?,
        (None, _) => VirtualUnit::start()?,
    };
    terminal::print(&unit.path().display().to_string());
    if unit.resumed().is_some() {
        terminal::note("started on its own with the stored configuration");
    }
    // Ctrl-C is the normal way to end.
    while interrupt::check().is_ok() {
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(())
}

fn read_log(args: &LogArgs, json: bool) -> Result<()> {
    let subject = args.subject.as_deref().map(Subject::read).transpose()?;
    let (_unit, target) = setup::reach_existing(&args.place, args.baud)?;
    let mut report = Report {
        blocks: 0,
        damaged: 0,
        flights: Vec::new(),
        without_attitude: Vec::new(),
        erased: false,
    };
    let mut attitudes = Ok(());
    if let Some(folder) = &args.out {
        let bar = terminal::spinner("blocks");
        let blocks = log::read(&target, &mut |count| bar.set_position(count as u64))?;
        bar.finish_and_clear();
        let (flights, damaged) = log::flights(&blocks);
        (report.blocks, report.damaged) = (blocks.len(), damaged);
        for (_, _, own) in log::folders(&flights, folder) {
            if let Some(own) = own {
                args.outputs.check_in(&own, &log::FILES)?;
            }
        }
        let log = log::write_all(&flights, subject.as_ref(), folder)?;
        attitudes = log.check();
        (report.flights, report.without_attitude) = (log.written, log.without_attitude);
    }
    // A damaged block may read correctly at the next attempt.
    if args.erase && report.damaged == 0 && report.without_attitude.is_empty() {
        log::erase(&target)?;
        report.erased = true;
    }
    if json {
        terminal::print_json(&report)?;
    } else {
        print(&report, args.erase);
    }
    if report.damaged > 0 {
        return Err(Problem::disagreement(format!(
            "{} of {} blocks of the log are damaged; the intact ones were written",
            report.damaged, report.blocks
        )));
    }
    attitudes
}

fn flash(args: &FlashArgs, json: bool) -> Result<()> {
    let image = Image::read(&args.image)?;
    let key = args.key.as_deref();
    let signed = key.map(|key| image.signed_by(key)).transpose()?;
    if let Some(drive) = &args.drive {
        image.copy_to(drive)?;
    }
    let flashed = Flashed {
        board: image.board,
        bytes: image.length(),
        signed,
        copied: args.drive.is_some(),
    };
    if json {
        return terminal::print_json(&flashed);
    }
    let signed = match &flashed.signed {
        Some(comment) => format!("signed by this key: {comment}"),
        None => "its signature was not checked, since no --key was given".to_owned(),
    };
    terminal::print(&format!(
        "a complete image of {} bytes; {signed}",
        flashed.bytes
    ));
    let next = match (image.board, flashed.copied) {
        (Board::Pico2, true) => "copied: the unit starts now; `bodyflight ports` lists it",
        (Board::Pico2, false) => "--drive copies it onto the drive RP2350",
        (Board::Stm32f405, _) => "write it with dfu-util -a 0 -s 0x08000000:leave -D IMAGE",
    };
    terminal::print(next);
    Ok(())
}

fn print(report: &Report, erase: bool) {
    for written in &report.flights {
        let log::Written {
            flight,
            frames,
            estimates,
            duration_s,
            battery_v,
            ..
        } = written;
        let flight = flight.display();
        let battery = battery_v.map_or_else(String::new, |volts| {
            format!(", battery {volts:.2} V at least")
        });
        terminal::print(&format!(
            "{flight}: {duration_s:.1} s, {frames} frames, {estimates} estimates{battery}"
        ));
        if let Some(said) = written.without_posture() {
            terminal::note(&said);
        }
    }
    for flight in &report.without_attitude {
        terminal::note(&flight.sentence());
    }
    if erase && !report.erased {
        terminal::note(
            "the log was not erased, since not all of it was written; --erase without --out does so",
        );
    }
    if report.flights.is_empty() && report.without_attitude.is_empty() && !report.erased {
        terminal::print("the log contains no flight");
    }
    if report.erased {
        terminal::print("the log was erased");
    }
}
