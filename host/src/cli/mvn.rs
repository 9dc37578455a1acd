//! `bodyflight mvn`.

use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use bodyflight_mvn_network::{AngularUnit, Options, Receiver, Sink, Source, Speed, replay};
use bodyflight_mvnx::live::LiveRecording;
use bodyflight_mvnx::recording::{self, Checks, FlightFrame, Warning, faults};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::subject::Subject;
use bodyflight_verbs::view::live::{LiveView, Received};
use clap::Subcommand;
use serde_json::json;

use super::arguments::{at_least_one, within};
use super::outputs::{Outputs, print_kept};
use super::terminal;
use super::watch::Watch;

/// Time between two lines of rates.
const REPORT_PERIOD: Duration = Duration::from_secs(1);
/// Time between two updates of the page.
const LOOK_PERIOD: Duration = Duration::from_millis(33);
/// Longest wait between checks of the clock.
const PATIENCE: Duration = Duration::from_millis(100);

/// The network stream of Xsens MVN: send a recording as MVN does, or listen to a live stream.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  bodyflight mvn listen\n  \
                  bodyflight mvn send flight.mvnx --to 127.0.0.1:9763")]
pub(super) struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    Send(Send),
    Listen(Listen),
}

/// Send a recording to other tools as MVN would: pose, kinematics, centre of mass, skeleton.
#[derive(clap::Args)]
#[command(after_help = "Example: bodyflight mvn send flight.mvnx --to 127.0.0.1:9763 --speed 0.5")]
struct Send {
    /// A flight.toml or an MVNX file.
    flight: PathBuf,
    /// Destination, HOST:PORT. MVN's port is 9763.
    #[arg(long, value_name = "HOST:PORT")]
    to: String,
    /// Speed relative to the recording, or max: 2 sends twice as fast.
    #[arg(long, default_value = "1")]
    speed: Speed,
}

/// Listen to MVN: print rate, loss and frames once a second, and totals on Ctrl-C.
#[derive(clap::Args)]
#[command(
    after_help = "In MVN: Options, Network Streamer, this machine's address, port 9763, quaternions (02);\n\
                  add linear and angular segment kinematics for exact velocities.\n\
                  Examples:\n  bodyflight mvn listen --bind :9763 --json\n  \
                  bodyflight mvn listen --view --flight flight.toml   (a simulated body beside the measured one)\n  \
                  bodyflight mvn listen --bind :9763 --out jump.mvnx --subject subject.toml"
)]
struct Listen {
    /// Address to listen at: HOST:PORT, or :PORT for all networks. Needed if MVN runs on another machine.
    #[arg(long, default_value = "127.0.0.1:9763", value_name = "[HOST]:PORT")]
    bind: String,
    /// The machine to listen to; by default the first that sends.
    #[arg(long, value_name = "ADDRESS")]
    from: Option<IpAddr>,
    /// The person to follow, counted from 0; by default the first that is received.
    #[arg(long)]
    character: Option<u8>,
    /// Rate of the sample counter (Hz), to use if the time codes are unusable.
    #[arg(long)]
    rate: Option<f64>,
    /// Stop after this many frames.
    #[arg(long)]
    frames: Option<u64>,
    /// The person and the air for --view: a flight.toml; by default a default person.
    #[arg(long, requires = "view", value_name = "TOML")]
    flight: Option<PathBuf>,
    #[command(flatten)]
    watch: Watch,
    /// Keep the frames as a recording; Ctrl-C completes the file.
    #[arg(long, value_name = "MVNX")]
    out: Option<PathBuf>,
    /// The person in that recording: a subject.toml.
    #[arg(long, value_name = "TOML", requires = "out")]
    subject: Option<PathBuf>,
    #[command(flatten)]
    outputs: Outputs,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    match &args.verb {
        Verb::Send(args) => send(args, json),
        Verb::Listen(args) => listen(args, json),
    }
}

fn send(args: &Send, json: bool) -> Result<()> {
    let flight = Flight::read(&args.flight)?;
    let recording = flight.open(recording::Options::default())?;
    let label = recording.header().subject_label.clone();
    let sink = Sink::connect(
        &args.to,
        &flight.subject.body(),
        label.as_deref().unwrap_or("bodyflight"),
    )?;
    let spinner = terminal::spinner("sending");
    let sent = replay(recording, sink, args.speed, |sent| {
        spinner.set_position(sent.frames);
    });
    spinner.finish_and_clear();
    let sent = sent?;
    if json {
        return terminal::print_json(&sent);
    }
    terminal::print(&format!(
        "{} frames in {} datagrams, {:.1} kB, to {}",
        sent.frames,
        sent.datagrams,
        sent.bytes as f64 / 1000.0,
        args.to
    ));
    if sent.refused_datagrams > 0 {
        terminal::note(&format!(
            "{} datagrams were refused: nothing is listening at {}",
            sent.refused_datagrams, args.to
        ));
    }
    Ok(())
}

impl Listen {
    /// Checks the numbers.
    fn check(&self) -> Result<()> {
        if let Some(rate) = self.rate {
            within("rate", rate, [1.0, 10_000.0], "Hz")?;
        }
        (self.frames).map_or(Ok(()), |frames| at_least_one("frames", frames))
    }
}

fn listen(args: &Listen, json: bool) -> Result<()> {
    args.check()?;
    let options = Options {
        character: args.character,
        rate: args.rate,
        angular_unit: None,
        sender: args.from,
    };
    let subject = args.subject.as_deref().map(Subject::read).transpose()?;
    let mut kept = args
        .outputs
        .live(&args.out, || subject.unwrap_or_default().body())?;
    let mut source = Source::with_options(&args.bind, options)?;
    let address = source.local_address()?.to_string();
    let mut goes_on = if json {
        terminal::json_line(&json!({ "listening": address }))?
    } else {
        terminal::line(&format!("listening at {address}"))
    };
    let flight = match &args.flight {
        Some(path) => Flight::read(path)?,
        None => Flight::bare(Path::new("MVN")),
    };
    let mut page = Page {
        view: args.watch.begin(&flight, args.flight.as_ref())?,
        shown: Instant::now(),
    };
    let mut checks = Checks::new(args.rate.unwrap_or(240.0));
    let mut reported = (Instant::now(), 0);
    let mut frames = 0;
    while goes_on && !interrupt::requested() && args.frames.is_none_or(|limit| frames < limit) {
        match source.next_within(PATIENCE) {
            Ok(None) => {}
            Ok(Some(frame)) => {
                frames += 1;
                checks.see(&frame);
                page.take(&frame, frames, source.receiver())?;
                if let Some(kept) = &mut kept {
                    keep(kept, &frame, source.receiver())?;
                }
            }
            // Here Ctrl-C is the normal end.
            Err(_) if interrupt::requested() => break,
            Err(problem) => return Err(problem),
        }
        if reported.0.elapsed() >= REPORT_PERIOD {
            #[expect(clippy::cast_precision_loss, reason = "few frames in a second")]
            let rate = (frames - reported.1) as f64 / reported.0.elapsed().as_secs_f64();
            reported = (Instant::now(), frames);
            goes_on = print_rate(rate, frames, source.receiver(), json)?;
        }
    }
    // Who only listens need not fall.
    let mut wrong = checks.warnings();
    wrong.retain(|warning| warning.is_fault);
    print_totals(frames, source.receiver(), &wrong, json)?;
    let kept = kept.map(LiveRecording::finish).transpose()?.flatten();
    match &kept {
        Some(kept) if json => {
            terminal::json_line(&json!({ "kept": kept }))?;
        }
        Some(kept) => print_kept(kept),
        None => {}
    }
    match faults(&wrong) {
        Some(doubt) => Err(Problem::doubt(doubt)),
        None => Ok(()),
    }
}

/// Prints the rate of the last second (Hz); returns whether anybody still reads it.
fn print_rate(rate: f64, frames: u64, receiver: &Receiver, json: bool) -> Result<bool> {
    if json {
        let counters = receiver.counters();
        return terminal::json_line(&json!({ "received_rate_hz": rate, "counters": counters }));
    }
    Ok(terminal::line(&format!(
        "{rate:.1} Hz, {}",
        summary(frames, receiver)
    )))
}

/// Adds a frame to a recording, with the person's name if it is known.
fn keep(kept: &mut LiveRecording, frame: &FlightFrame, receiver: &Receiver) -> Result<()> {
    if let Some(name) = receiver.information().name() {
        kept.name(name);
    }
    kept.push(frame)
}

/// Number of samples that never arrived, or not completely.
fn lost(receiver: &Receiver) -> u64 {
    let counters = receiver.counters();
    (counters.samples + counters.missing_samples).saturating_sub(counters.frames)
}

/// The page, if there is one, and when it was last updated.
struct Page {
    view: Option<LiveView>,
    shown: Instant,
}

impl Page {
    /// Advances the page to a frame; `frames` is the number received so far.
    fn take(&mut self, frame: &FlightFrame, frames: u64, receiver: &Receiver) -> Result<()> {
        let Some(view) = &mut self.view else {
            return Ok(());
        };
        view.follow(frame)?;
        if self.shown.elapsed() < LOOK_PERIOD {
            return Ok(());
        }
        self.shown = Instant::now();
        let lost = lost(receiver);
        view.show(frame, None, Some(Received { frames, lost }))
    }
}

/// Prints the totals received, and what is wrong in the frames.
fn print_totals(frames: u64, receiver: &Receiver, wrong: &[Warning], json: bool) -> Result<()> {
    if json {
        terminal::json_line(&json!({ "totals": {
            "frames": frames,
            "sender_rate_hz": receiver.rate(),
            "subject": receiver.information().name(),
            "angular_unit": receiver.angular_unit().map(unit),
            "counters": receiver.counters(),
            "warnings": wrong,
        }}))?;
        return Ok(());
    }
    terminal::note_warnings(wrong);
    terminal::print(&format!("total: {}", summary(frames, receiver)));
    let counters = receiver.counters();
    for (count, what) in [
        (counters.differenced_velocities, "velocity"),
        (counters.differenced_angular_velocities, "angular velocity"),
    ] {
        if count > 0 {
            terminal::note(&format!(
                "{what} of {count} frames was not sent by MVN, but differentiated from the pose"
            ));
        }
    }
    Ok(())
}

fn unit(unit: AngularUnit) -> &'static str {
    match unit {
        AngularUnit::Radians => "radps",
        AngularUnit::Degrees => "degps",
    }
}

fn summary(frames: u64, receiver: &Receiver) -> String {
    let counters = receiver.counters();
    let expected = counters.samples + counters.missing_samples;
    let lost = lost(receiver);
    #[expect(clippy::cast_precision_loss, reason = "counts of samples")]
    let share = if expected > 0 {
        100.0 * lost as f64 / expected as f64
    } else {
        0.0
    };
    let name = receiver.information().name().unwrap_or("nobody named");
    format!(
        "{frames} frames of {name}, {lost} lost ({share:.2} %): {} missing, {} incomplete, {} bad; \
         datagrams: {} repeated, {} late, {} bad, {} from elsewhere",
        counters.missing_samples,
        counters.incomplete_samples,
        counters.bad_samples,
        counters.repeated_datagrams,
        counters.late_datagrams,
        counters.bad_datagrams,
        counters.foreign_datagrams
    )
}
