//! `bodyflight simulate`: a free run of the model from the first frame, fed by the recorded postures, against
//! what the recording says of the pelvis.

use std::path::Path;
use std::time::Instant;

use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::free_run::FreeRun;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion};
use bodyflight_core::effect::Model;
use bodyflight_core::effect::sensors::Moving;
use bodyflight_core::observation::Observation;
use bodyflight_core::{Posture, Real};
use bodyflight_discovery::motion_history::MotionHistory;
use serde::Serialize;

use crate::diagnostic::{Problem, Result};
use crate::formats::flight::Flight;
use crate::formats::recording::{FlightFrame, Options, Quality, Recording};
use crate::interrupt;
use crate::output::files::CsvFile;
use crate::replay::comparison::{Channel, Comparison, Pair, PerChannel};

/// The result of a simulation.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Frames compared.
    pub frames: u64,
    /// Length of the flight (s).
    pub duration_s: f64,
    /// Root mean square of measured minus simulated.
    pub rms: PerChannel,
    /// Largest size of the measured channel.
    pub amplitude: PerChannel,
    /// Frames simulated in a second of computing, reading included.
    pub steps_per_second: f64,
    /// Bad frames of the recording that were bridged.
    pub bridged_frames: u64,
}

/// A simulation with what plots need.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// Numbers.
    pub report: Report,
    /// Channels over time.
    pub comparison: Comparison,
    /// What reading met.
    pub quality: Quality,
}

/// Reads the recording of a flight, runs the model beside it and compares.
///
/// `each` is called with every pair; `progress` with the time reached (s).
///
/// # Errors
/// Where a file is not usable, fewer than two frames are there, or the model runs out of numbers.
pub fn simulate<T: Real>(
    flight: &Flight,
    options: Options,
    mut each: impl FnMut(&Pair) -> Result<()>,
    mut progress: impl FnMut(f64),
) -> Result<Simulation> {
    let begin = Instant::now();
    let mut recording = Recording::open(&flight.recording, options)?;
    let too_short = || {
        Problem::bad_input("expected at least two frames of type \"normal\"")
            .in_file(&flight.recording)
    };
    let first = recording.next().ok_or_else(too_short)??;
    let mut ahead = recording.next().ok_or_else(too_short)??;
    let dynamics = flight.dynamics(first.pelvis.position.up());
    let mut follower = Follower::<T>::new(flight, &dynamics, &first, &ahead)?;
    let mut comparison = Comparison::default();
    loop {
        let following = recording.next().transpose()?;
        let pair = follower.follow(&ahead, following.as_ref())?;
        comparison.push(pair);
        each(&pair)?;
        if comparison.count().is_multiple_of(1024) {
            progress(pair.time);
            interrupt::check()?;
        }
        match following {
            Some(next) => ahead = next,
            None => break,
        }
    }
    let frames = comparison.count();
    #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
    let steps_per_second = frames as f64 / begin.elapsed().as_secs_f64();
    let quality = recording.quality().clone();
    Ok(Simulation {
        report: Report {
            frames,
            duration_s: ahead.time - first.time,
            rms: comparison.rms(),
            amplitude: comparison.amplitude(),
            steps_per_second,
            bridged_frames: quality.bridged_frames,
        },
        comparison,
        quality,
    })
}

/// Longest delay of a sensor that is kept (s).
const LONGEST_DELAY: f64 = 1.0;

/// The model beside a recording, frame by frame.
pub struct Follower<'a, T: Real> {
    flight: &'a Flight,
    model: Model<f64>,
    start: f64,
    history: MotionHistory,
    motion: Motion<f64>,
    inputs: Inputs<f64>,
    dynamics: Dynamics<T>,
    run: FreeRun<T>,
    time: f64,
    posture: Posture<f64>,
}

impl<'a, T: Real> Follower<'a, T> {
    /// Starts at `first`, whose joints move towards `second`; `dynamics` is the model before the effects of
    /// the flight.
    ///
    /// # Errors
    /// Where `first` has no velocity or angular velocity.
    pub fn new(
        flight: &'a Flight,
        dynamics: &Dynamics<f64>,
        first: &FlightFrame,
        second: &FlightFrame,
    ) -> Result<Self> {
        let model = flight
            .effects
            .applied(*dynamics, first.pelvis.position.up())?;
        let dynamics = model.dynamics.cast::<T>();
        let rate = rate(&first.posture, &second.posture, second.time - first.time);
        let motion = first.motion()?;
        let mut history = MotionHistory::default();
        history.push(first.time, Moving::of(&motion));
        let posture = first.posture.cast();
        let run = FreeRun::new(&dynamics, flight.equations, &motion.cast(), &posture, &rate);
        Ok(Self {
            flight,
            start: first.time,
            history,
            motion,
            inputs: model.inputs(&inputs_at(flight, first.time)),
            model,
            dynamics,
            run,
            time: first.time,
            posture: first.posture,
        })
    }

    /// Goes on to `frame`; `following` is the one after, for the joint rates at `frame`.
    ///
    /// # Errors
    /// Where `frame` has no velocity or angular velocity, or the model runs out of numbers.
    pub fn follow(&mut self, frame: &FlightFrame, following: Option<&FlightFrame>) -> Result<Pair> {
        let duration = frame.time - self.time;
        self.inputs = self
            .model
            .inputs(&inputs_at(self.flight, self.time + 0.5 * duration));
        self.run.advance(
            &self.dynamics,
            &self.inputs.cast(),
            &frame.posture.cast(),
            T::of(duration),
        );
        // Central where there is a frame on both sides.
        let last = following.unwrap_or(frame);
        let rate = rate(&self.posture, &last.posture, last.time - self.time);
        self.time = frame.time;
        self.posture = frame.posture;
        let motion = self.run.motion(&self.dynamics, &rate).cast::<f64>();
        let sensors = &self.model.sensors;
        self.history.push_within(frame.time, &motion, LONGEST_DELAY);
        let past = |delay: f64| {
            let moving = self.history.at(frame.time - delay);
            moving.unwrap_or_else(|| Moving::of(&motion))
        };
        let seen = sensors.observe(&motion, past, frame.time - self.start);
        self.motion = motion;
        if !motion.velocity.to_array().iter().all(|v| v.abs() < 1e4) {
            return Err(Problem::bad_input(format!(
                "the simulated motion left every plausible range at {:.3} s",
                frame.time
            ))
            .help("check the damping coefficients and the segment table of the subject"));
        }
        Ok(Pair {
            time: frame.time,
            measured: Observation::of(&frame.motion()?),
            simulated: Observation::of(&seen),
        })
    }
}

impl<T: Real> Follower<'_, T> {
    /// The motion of the model at the last frame; what sensors make of it is in the pair.
    pub const fn motion(&self) -> &Motion<f64> {
        &self.motion
    }

    /// The conscious inputs up to the last frame.
    pub const fn inputs(&self) -> &Inputs<f64> {
        &self.inputs
    }

    /// The model with its effects.
    pub const fn model(&self) -> &Model<f64> {
        &self.model
    }
}

/// The conscious inputs of a flight: known ones, or the subject's damping.
fn inputs_at(flight: &Flight, time: f64) -> Inputs<f64> {
    match &flight.inputs {
        Some(history) => history.at(time),
        None => Inputs {
            damping: flight.subject.damping(),
            ..Inputs::belly_turn()
        },
    }
}

/// Joint rates from one posture to another, `duration` (s) later.
fn rate<T: Real>(from: &Posture<f64>, to: &Posture<f64>, duration: f64) -> PostureRate<T> {
    PostureRate::between(&from.cast(), &to.cast(), T::of(duration))
}

/// The run as CSV: time, then measured and simulated value of each channel.
pub struct RunFile(CsvFile);

impl RunFile {
    /// Begins the file.
    ///
    /// # Errors
    /// Where the folder cannot be written to.
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
    /// Where the disk refuses.
    pub fn write(&mut self, pair: &Pair) -> Result<()> {
        let values = Channel::ALL.into_iter().flat_map(|channel| {
            [
                channel.value(&pair.measured),
                channel.value(&pair.simulated),
            ]
        });
        self.0.write(std::iter::once(pair.time).chain(values))
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// Where the disk refuses; then no file is left.
    pub fn finish(self) -> Result<()> {
        self.0.finish()
    }
}
