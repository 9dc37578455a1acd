//! `bodyflight simulate`: compares a free run of the model, from the first frame and with the recorded postures, with
//! the recorded motion of the pelvis.

pub mod pair_file;
pub mod what_if;

use std::path::Path;
use std::time::Instant;

use serde::Serialize;

use bodyflight_io::diagnostic::Result;
use bodyflight_io::files::CsvFile;
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::{Options, Quality, Warning, faults};
use bodyflight_replay::Precision;
use bodyflight_replay::comparison::{Channel, Comparison, PerChannel};
use bodyflight_replay::flight::{Flight, Start};
use bodyflight_replay::gnss::Alignment;
use bodyflight_replay::steps::{Divergence, Replay, Step};

/// The result of a simulation.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// Number of frames compared.
    pub frames: u64,
    /// Length of the flight (s).
    pub duration_s: f64,
    /// Root mean square of measured minus simulated.
    pub rms: PerChannel,
    /// Largest absolute value of the measured channel.
    pub amplitude: PerChannel,
    /// Frames processed per second of computing time, including reading.
    pub steps_per_second: f64,
    /// Bad frames of the recording that were bridged.
    pub bridged_frames: u64,
    /// Source of the initial motion.
    pub start: Start,
    /// Alignment of a receiver's track with the recording's clock, if the flight has such a track.
    pub gnss: Option<Alignment>,
    /// Values that are implausible for a flight.
    pub warnings: Vec<Warning>,
    /// Why the simulation means nothing, if it diverges.
    pub diverged: Option<String>,
}

impl Report {
    /// Why the result cannot be trusted.
    pub fn doubt(&self) -> Option<String> {
        faults(&self.warnings).or_else(|| self.diverged.clone())
    }
}

/// A simulation, with the data for plots.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// The numbers.
    pub report: Report,
    /// Channels over time.
    pub comparison: Comparison,
    /// Faults found while reading.
    pub quality: Quality,
}

/// Reads the recording of a flight, runs the model beside it and compares both.
///
/// `each` is called with every step; `progress` with the time reached (s).
///
/// # Errors
/// Returns an error if a file is unusable, or if there are fewer than two frames.
pub fn simulate(
    flight: &Flight,
    options: Options,
    precision: Precision,
    each: &mut dyn FnMut(&Step) -> Result<()>,
    progress: &mut dyn FnMut(f64),
) -> Result<Simulation> {
    let begin = Instant::now();
    // A simulation that diverges is a result here, with a doubt.
    let replay = Replay::open(flight, options, precision)?;
    let mut replay = replay.on_divergence(Divergence::Held);
    let mut comparison = Comparison::default();
    let mut end = replay.start().time;
    for step in replay.by_ref() {
        let step = step?;
        comparison.push(step.pair);
        each(&step)?;
        if comparison.count().is_multiple_of(1024) {
            progress(step.time);
            interrupt::check()?;
        }
        end = step.time;
    }
    let frames = comparison.count();
    #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
    let steps_per_second = frames as f64 / begin.elapsed().as_secs_f64();
    let quality = replay.frames().quality().clone();
    Ok(Simulation {
        report: Report {
            frames,
            duration_s: end - replay.start().time,
            rms: comparison.rms(),
            amplitude: comparison.amplitude(),
            steps_per_second,
            bridged_frames: quality.bridged_frames,
            start: flight.start,
            gnss: replay.frames().alignment(),
            warnings: replay.frames().warnings(),
            diverged: replay.diverged(),
        },
        comparison,
        quality,
    })
}

/// The run as CSV: time, then the measured and simulated value of each channel.
pub struct RunFile(CsvFile);

impl RunFile {
    /// Creates the file.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be written to.
    pub fn create(path: &Path) -> Result<Self> {
        let names = Channel::ALL.into_iter().flat_map(|channel| {
            ["measured", "simulated"].map(|side| format!("{side}_{}", channel.key()))
        });
        let columns: Vec<String> = std::iter::once("time_s".to_owned()).chain(names).collect();
        CsvFile::create(path, &columns).map(Self)
    }

    /// Adds a row.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn write(&mut self, step: &Step) -> Result<()> {
        let values = Channel::ALL.into_iter().flat_map(|channel| {
            [
                channel.value(&step.pair.measured),
                channel.value(&step.pair.simulated),
            ]
        });
        self.0.write(std::iter::once(step.time).chain(values))
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written; no partial file is left.
    pub fn finish(self) -> Result<()> {
        self.0.finish()
    }
}
