//! `bodyflight slimevr`.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use bodyflight_mocap::slimevr::Tracker;
use bodyflight_mocap::slimevr::record::{Assignment, Record, check};
use bodyflight_mocap::slimevr::source::{DEFAULT_PORT, Source};
use bodyflight_verbs::slimevr::{Line, Report, Request, read, restarted};
use clap::Subcommand;

use super::arguments::within;
use super::terminal;

/// Time between two lines of rates.
const REPORT_PERIOD: Duration = Duration::from_secs(1);

/// SlimeVR's trackers: record what they send, live or from recorded traffic, for `import`.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  bodyflight slimevr listen --out jump\n  \
                  bodyflight slimevr read traffic.pcap --out jump")]
pub(super) struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    Listen(Listen),
    Read(Read),
}

/// Take the place of SlimeVR's server: answer trackers, keep them sending, and record their orientations and accelerations.
#[derive(clap::Args)]
#[command(
    after_help = "Trackers find this machine by themselves if they are on its network and SlimeVR's own server is not running.\n\
                  The folder has a table for each tracker and mapping.toml; Ctrl-C completes it.\n\
                  Exit code 5: the trackers make orientations in different ways.\n\
                  Examples:\n  bodyflight slimevr listen\n  \
                  bodyflight slimevr listen --out jump --tracker A1:B2:C3:D4:E5:F6=pelvis"
)]
struct Listen {
    /// Address to listen at: HOST:PORT, or :PORT for all networks, as trackers need it.
    #[arg(long, default_value_t = format!(":{DEFAULT_PORT}"), value_name = "[HOST]:PORT")]
    bind: String,
    /// Stop after this time (s).
    #[arg(long)]
    seconds: Option<f64>,
    /// Folder for the tables and mapping.toml; it must not exist.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Where a tracker is worn, by its network address; after /1 for its second sensor. May be given several times.
    #[arg(long = "tracker", value_name = "ADDRESS[/N]=SEGMENT")]
    worn: Vec<Assignment>,
}

/// Record the same from traffic that tcpdump or Wireshark saved, also while SlimeVR's own server was running.
#[derive(clap::Args)]
#[command(
    after_help = "To record traffic: tcpdump -i any -w traffic.pcap udp port 6969\n\
                  Example: bodyflight slimevr read traffic.pcap --out jump --tracker A1:B2:C3:D4:E5:F6=pelvis"
)]
struct Read {
    /// The file, possibly compressed (.gz, .xz).
    capture: PathBuf,
    /// The server's port.
    #[arg(long, default_value_t = DEFAULT_PORT)]
    port: u16,
    /// Folder for the tables and mapping.toml; it must not exist.
    #[arg(long)]
    out: PathBuf,
    /// Where a tracker is worn, by its network address; after /1 for its second sensor. May be given several times.
    #[arg(long = "tracker", value_name = "ADDRESS[/N]=SEGMENT")]
    worn: Vec<Assignment>,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    match &args.verb {
        Verb::Listen(args) => listen(args, json),
        Verb::Read(args) => of_capture(args, json),
    }
}

fn of_capture(args: &Read, json: bool) -> Result<()> {
    check(&args.worn)?;
    let spinner = terminal::spinner("reading");
    let report = read(&Request {
        capture: &args.capture,
        port: args.port,
        folder: &args.out,
        worn: &args.worn,
    });
    spinner.finish_and_clear();
    let report = report?;
    if json {
        terminal::print_json(&report)?;
    } else {
        tell(&report);
    }
    verdict(&report)
}

fn listen(args: &Listen, json: bool) -> Result<()> {
    check(&args.worn)?;
    if let Some(seconds) = args.seconds {
        within("seconds", seconds, [0.1, 1e6], "s")?;
    }
    let mut record = args.out.as_deref().map(Record::create).transpose()?;
    let mut source = Source::bind(&args.bind)?;
    let address = source.local_address()?.to_string();
    let mut goes_on = if json {
        terminal::json_line(&Line::Listening { listening: address })?
    } else {
        terminal::line(&format!("listening at {address}"))
    };
    let mut samples = Vec::new();
    let mut reported = (Instant::now(), 0_u64);
    let mut received = 0;
    let mut told = Told::default();
    while goes_on
        && !interrupt::requested()
        && args.seconds.is_none_or(|most| source.time_s() < most)
    {
        source.take(&mut samples)?;
        received += samples.len() as u64;
        for sample in samples.drain(..) {
            if let Some(record) = &mut record {
                record.push(&sample, source.server())?;
            }
        }
        goes_on = told.restarts(&source, json)?;
        if goes_on && reported.0.elapsed() >= REPORT_PERIOD {
            #[expect(clippy::cast_precision_loss, reason = "few samples in a second")]
            let rate = (received - reported.1) as f64 / reported.0.elapsed().as_secs_f64();
            reported = (Instant::now(), received);
            goes_on = print_state(rate, &source, json)?;
        }
    }
    let time = source.time_s();
    for sample in source.ended() {
        if let Some(record) = &mut record {
            record.push(&sample, source.server())?;
        }
    }
    let refused = record.as_ref().map_or(0, Record::refused);
    let written = record.map(|record| record.finish(source.server(), &args.worn));
    let folder = written.transpose()?.flatten();
    let report = Report::of(source.server(), time, &args.worn).written(folder, refused);
    if json {
        let totals = Box::new(report.clone());
        terminal::json_line(&Line::Totals { totals })?;
    } else {
        tell(&report);
        if args.out.is_some() && report.folder.is_none() {
            terminal::note("nothing was received, so nothing was written");
        }
    }
    verdict(&report)
}

/// How many restarts of each tracker were told.
#[derive(Default)]
struct Told(Vec<usize>);

impl Told {
    /// Tells of trackers that restarted since the last time; returns whether anybody still reads it.
    fn restarts(&mut self, source: &Source, json: bool) -> Result<bool> {
        let trackers = source.server().trackers();
        self.0.resize(trackers.len(), 0);
        for (tracker, told) in trackers.iter().zip(&mut self.0) {
            let Tracker {
                name, restarted_s, ..
            } = tracker;
            for time_s in restarted_s.iter().skip(*told) {
                if !json {
                    terminal::note(&format!("warning: {name}: {}", restarted(*time_s)));
                } else if !terminal::json_line(&Line::Restarted {
                    restarted: name.clone(),
                    time_s: *time_s,
                })? {
                    return Ok(false);
                }
            }
            *told = restarted_s.len();
        }
        Ok(true)
    }
}

/// Prints how many samples come a second (Hz), and who is silent; returns whether anybody still reads it.
fn print_state(rate: f64, source: &Source, json: bool) -> Result<bool> {
    let server = source.server();
    let time = source.time_s();
    let silent: Vec<(&str, f64)> = server
        .silent(time)
        .map(|(tracker, since)| (tracker.name.as_str(), since))
        .collect();
    let trackers = server.trackers();
    if json {
        return terminal::json_line(&Line::State {
            received_rate_hz: rate,
            trackers: trackers.len(),
            silent: silent.iter().map(|(name, _)| (*name).to_owned()).collect(),
            datagrams: server.counters().clone(),
        });
    }
    let [lost, came] = trackers.iter().fold([0, 0], |[lost, came], tracker| {
        [lost + tracker.lost(), came + tracker.received()]
    });
    #[expect(clippy::cast_precision_loss, reason = "counts of packets")]
    let share = 100.0 * lost as f64 / (lost + came).max(1) as f64;
    let who: Vec<String> = silent
        .iter()
        .map(|(name, since)| format!("{name} for {since:.0} s"))
        .collect();
    let who = if who.is_empty() {
        String::new()
    } else {
        format!("; silent: {}", who.join(", "))
    };
    Ok(terminal::line(&format!(
        "{} trackers, {rate:.0} samples a second, {share:.2} % of the packets lost{who}",
        trackers.len()
    )))
}

/// Prints what was received, and remarks.
fn tell(report: &Report) {
    for warning in &report.warnings {
        terminal::note(&format!("warning: {warning}"));
    }
    terminal::print(&report.to_string());
}

fn verdict(report: &Report) -> Result<()> {
    report
        .doubt()
        .map_or(Ok(()), |doubt| Err(Problem::doubt(doubt)))
}
