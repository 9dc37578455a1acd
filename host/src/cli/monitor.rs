//! `bodyflight monitor`.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bodyflight_io::diagnostic::Result;
use bodyflight_io::interrupt;
use bodyflight_unit::monitor::{Chunk, Defmt, Input, PacketReading, Xbus, XbusTotals};
use serde_json::json;

use super::terminal;

/// Longest wait between checks for Ctrl-C.
const PATIENCE: Duration = Duration::from_millis(100);
/// Time between two lines of rates.
const REPORT_PERIOD: Duration = Duration::from_secs(1);

/// Watch a serial line: the unit's defmt log, or the Xbus packets of an MTi sensor.
///
/// Ctrl-C ends it and prints the totals.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  bodyflight monitor --xbus /dev/ttyUSB0 --baud 230400\n  \
                  bodyflight monitor --xbus recording.bin --json\n  \
                  bodyflight monitor --defmt unit.elf /dev/ttyUSB0\n  \
                  qemu-system-arm ... | bodyflight monitor --defmt unit.elf -"
)]
pub(super) struct Args {
    /// Decode defmt with the strings in this ELF file, which must be the one that runs on the unit.
    #[arg(
        long,
        value_name = "ELF",
        conflicts_with = "xbus",
        required_unless_present = "xbus"
    )]
    defmt: Option<PathBuf>,
    /// Decode Xbus.
    #[arg(long)]
    xbus: bool,
    /// A serial port, a file, or - for standard input.
    #[arg(default_value = "-")]
    input: String,
    /// Speed of the serial port (bit/s).
    #[arg(long, default_value_t = 115_200, value_parser = clap::value_parser!(u32).range(1..))]
    baud: u32,
    /// Xbus: print every packet, not just rates.
    #[arg(long, requires = "xbus")]
    items: bool,
    /// defmt: print the source location of each line.
    #[arg(short, long, conflicts_with = "xbus")]
    verbose: bool,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    match &args.defmt {
        Some(elf) => defmt(args, elf, json),
        None => xbus(args, json),
    }
}

/// Passes chunks of input on until it ends, Ctrl-C is pressed, or the output is closed.
fn pieces(input: &Input, mut take: impl FnMut(&[u8]) -> Result<bool>) -> Result<()> {
    while !interrupt::requested() {
        let more = match input.next(PATIENCE)? {
            Chunk::Bytes(bytes) => take(&bytes)?,
            Chunk::Silence => take(&[])?,
            Chunk::End => return Ok(()),
        };
        if !more {
            return Ok(());
        }
    }
    Ok(())
}

fn defmt(args: &Args, elf: &Path, json: bool) -> Result<()> {
    let mut decoder = Defmt::open(elf)?;
    let input = Input::open(&args.input, args.baud)?;
    if args.verbose && !decoder.has_locations() {
        terminal::note(
            "the ELF file has no debug information: lines are printed without source locations",
        );
    }
    let ended = pieces(&input, |bytes| {
        for line in decoder.push(bytes) {
            let goes_on = if json {
                terminal::json_line(&line)?
            } else {
                let place = line.location.as_ref().filter(|_| args.verbose);
                let place = place
                    .map(|place| format!("  ({place})"))
                    .unwrap_or_default();
                terminal::line(&format!("{line}{place}"))
            };
            if !goes_on {
                return Ok(false);
            }
        }
        Ok(true)
    });
    // The totals are printed after a failure too, such as a pulled plug.
    let totals = decoder.totals();
    if json {
        terminal::json_line(&json!({ "totals": totals }))?;
    } else {
        terminal::note(&format!(
            "{} lines, {} malformed frames, {} bytes",
            totals.lines, totals.malformed_frames, totals.bytes
        ));
    }
    ended
}

fn xbus(args: &Args, json: bool) -> Result<()> {
    let input = Input::open(&args.input, args.baud)?;
    let mut decoder = Xbus::new();
    let mut reported = (Instant::now(), 0);
    let every = |packets: Vec<PacketReading>| -> Result<bool> {
        for packet in packets {
            let goes_on = if json {
                terminal::json_line(&packet)?
            } else {
                !args.items || terminal::line(&text(&packet))
            };
            if !goes_on {
                return Ok(false);
            }
        }
        Ok(true)
    };
    let ended = pieces(&input, |bytes| {
        let goes_on = every(decoder.push(bytes))?;
        if !json && !args.items && reported.0.elapsed() >= REPORT_PERIOD {
            let totals = decoder.totals();
            #[expect(clippy::cast_precision_loss, reason = "few packets in a second")]
            let rate = (totals.packets - reported.1) as f64 / reported.0.elapsed().as_secs_f64();
            reported = (Instant::now(), totals.packets);
            return Ok(terminal::line(&format!(
                "{rate:.1} packets/s, {} in all, {} missing, {} bad checksums, {} bytes skipped",
                totals.packets, totals.missing_packets, totals.bad_checksums, totals.skipped_bytes
            )));
        }
        Ok(goes_on)
    });
    every(decoder.finish())?;
    let totals = decoder.totals();
    if json {
        terminal::json_line(&json!({ "totals": totals }))?;
        return ended;
    }
    print_totals(&totals);
    ended
}

/// Prints the totals received.
fn print_totals(totals: &XbusTotals) {
    let mut table = terminal::table(&["item", "count", "rate (Hz)", "last"]);
    for item in &totals.items {
        let rate = item.rate_hz.map(|rate| format!("{rate:.2}"));
        table.add_row([
            item.name.to_owned(),
            item.count.to_string(),
            rate.unwrap_or_default(),
            item.last.to_string(),
        ]);
    }
    if !totals.items.is_empty() {
        terminal::print(&table.to_string());
    }
    terminal::print(&format!(
        "{} packets in {:.2} s of the sensor's time, {} missing, {} bad checksums, {} bad lengths, \
         {} bad items, {} of {} bytes skipped",
        totals.packets,
        totals.duration_s,
        totals.missing_packets,
        totals.bad_checksums,
        totals.bad_lengths,
        totals.bad_items,
        totals.skipped_bytes,
        totals.bytes
    ));
    for finding in &totals.findings {
        terminal::print(finding);
    }
}

fn text(packet: &PacketReading) -> String {
    let time = packet.time_s.map(|time| format!("{time:.4} s  "));
    let items: Vec<String> = packet
        .items
        .iter()
        .map(|(name, value)| format!("{name} {value}"))
        .collect();
    format!(
        "{}{:02x} {}  {}",
        time.unwrap_or_default(),
        packet.bus_id,
        packet.message_id,
        items.join("  ")
    )
}
