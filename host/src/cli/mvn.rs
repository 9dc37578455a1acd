//! `bodyflight mvn`.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use bodyflight::diagnostic::{Problem, Result};
use bodyflight::flight::Flight;
use bodyflight::interrupt;
use bodyflight::mvn_network::{Sink, Source};
use bodyflight::recording::Recording;

use super::simulate::Reading;
use super::terminal;

/// The network stream of Xsens MVN: send a recording as MVN would, or listen to one.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  bodyflight mvn listen\n  \
                        bodyflight mvn send flight.toml --to 127.0.0.1:9763")]
pub(super) struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(clap::Subcommand)]
enum Verb {
    /// Send a recording at its own rate: pose and kinematics (MXTP02, 21, 22).
    Send {
        /// A flight.toml, or an MVNX file alone.
        flight: PathBuf,
        /// Where to.
        #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:9763")]
        to: String,
        /// How many times faster than recorded.
        #[arg(long, default_value_t = 1.0)]
        speed: f64,
        #[command(flatten)]
        reading: Reading,
    },
    /// Listen until the sender falls silent or Ctrl-C, and say what came.
    Listen {
        /// Where.
        #[arg(long, value_name = "HOST:PORT", default_value = ":9763")]
        bind: String,
    },
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    match &args.verb {
        Verb::Send {
            flight,
            to,
            speed,
            reading,
        } => {
            if !(0.01..=1000.0).contains(speed) {
                return Err(Problem::bad_input(format!(
                    "expected --speed of 0.01 to 1000, found {speed}"
                )));
            }
            let flight = Flight::read(flight)?;
            let mut sink = Sink::connect(to)?;
            let begin = Instant::now();
            let mut first = None;
            let mut count = 0u64;
            for frame in Recording::open(&flight.recording, reading.options())? {
                let frame = frame?;
                let start = *first.get_or_insert(frame.time);
                let due = begin + Duration::from_secs_f64(((frame.time - start) / speed).max(0.0));
                std::thread::sleep(due.saturating_duration_since(Instant::now()));
                sink.send(&frame);
                count += 1;
                interrupt::check()?;
            }
            terminal::print(&format!("{count} samples sent to {to}"));
            Ok(())
        }
        Verb::Listen { bind } => {
            let mut source = Source::bind(bind)?;
            terminal::print_note(&format!("listening at {}", source.address()));
            while let Some(Ok(_)) = source.next() {}
            let counters = *source.counters();
            if json {
                return terminal::print_json(&counters);
            }
            terminal::print(&format!(
                "{} samples from {} datagrams; {} missing, {} late, {} incomplete; \
                 {} malformed, {} of other kinds, {} not of MVN",
                counters.samples,
                counters.datagrams,
                counters.missing,
                counters.late,
                counters.incomplete,
                counters.malformed,
                counters.unused,
                counters.foreign
            ));
            Ok(())
        }
    }
}
