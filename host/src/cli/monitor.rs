//! `bodyflight monitor`.

use std::path::PathBuf;

use bodyflight::diagnostic::Result;
use bodyflight::monitor::{defmt, follow, open, xbus};

use super::terminal;

/// Read what comes from a port, a file or `-`: the unit's logs, or a sensor's packets. Ctrl-C ends it.
#[derive(clap::Args)]
#[command(
    group = clap::ArgGroup::new("protocol").required(true),
    after_help = "Examples:\n  probe-rs run … | bodyflight monitor --defmt unit.elf -\n  \
                  bodyflight monitor --xbus /dev/ttyUSB0 --baud 115200"
)]
pub(super) struct Args {
    /// A serial port, a file, or - for standard input.
    input: PathBuf,
    /// The unit's logs, read by the image that runs on it.
    #[arg(long, group = "protocol", value_name = "IMAGE")]
    defmt: Option<PathBuf>,
    /// Packets of an Xsens MTi sensor.
    #[arg(long, group = "protocol")]
    xbus: bool,
    /// Rate of the port (baud).
    #[arg(long, default_value_t = 460_800)]
    baud: u32,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    match &args.defmt {
        Some(image) => {
            let table = defmt::table(image)?;
            let mut decoder = defmt::Decoder::new(&table);
            let input = open(&args.input, args.baud)?;
            follow(&args.input, input, |bytes| {
                for line in decoder.push(bytes) {
                    if json {
                        terminal::print_json_line(&line)?;
                    } else {
                        terminal::print(&text(&line));
                    }
                }
                Ok(())
            })?;
            let (lines, malformed) = (decoder.lines, decoder.malformed);
            terminal::print_note(&format!("{lines} lines, {malformed} frames malformed"));
        }
        None => {
            let mut reader = xbus::Reader::new();
            let input = open(&args.input, args.baud)?;
            follow(&args.input, input, |bytes| {
                for line in reader.push(bytes) {
                    if json {
                        terminal::print_json_line(&line)?;
                    } else {
                        let time = line.time_us.map_or(String::new(), |t| format!("{t} us  "));
                        let items = line.items.join("; ");
                        terminal::print(&format!("{time}message {:#04x}: {items}", line.message));
                    }
                }
                Ok(())
            })?;
            let counters = reader.counters();
            terminal::print_note(&format!(
                "{} packets; {} bytes skipped, {} bad checksums, {} bad lengths, {} with bad items",
                counters.packets,
                counters.skipped_bytes,
                counters.bad_checksum,
                counters.bad_length,
                counters.bad_items
            ));
        }
    }
    Ok(())
}

/// A line of the unit's log as text.
pub(super) fn text(line: &defmt::Line) -> String {
    let defmt::Line { time, level, text } = line;
    let time = time.as_deref().unwrap_or_default();
    let level = level.as_deref().unwrap_or_default();
    format!("{time:>10} {level:5} {text}")
}
