//! `bodyflight estimate`: conscious inputs over time from a recording, and how much better the flight is
//! reconstructed with them than with constant coefficients, the paper's own comparison.

use std::collections::VecDeque;
use std::path::Path;
use std::time::Instant;

use bodyflight_core::Real;
use bodyflight_core::estimator::full::Full;
use bodyflight_core::estimator::measurement::Measurement;
use bodyflight_core::estimator::preset::Preset;
use bodyflight_core::estimator::propagation::Propagation;
use bodyflight_core::estimator::reduced::Reduced;
use bodyflight_core::estimator::status::{Estimate, Faults, Health};
use bodyflight_core::estimator::{Estimator, StateVector};
use bodyflight_core::observation::Observation;
use serde::Serialize;

use crate::diagnostic::{Problem, Result};
use crate::formats::flight::Flight;
use crate::formats::input_history::Row;
use crate::formats::recording::{Options, Recording};
use crate::interrupt;
use crate::output::files::CsvFile;
use crate::output::plot::{
    AXES, CONSTANT, Curve, ESTIMATED, Panel, figure_svg, measured_curve, simulated_curve,
};
use crate::replay::comparison::{Channel, Comparison, Pair, PerChannel};
use crate::replay::steps::{Divergence, Replay};

/// Which of the two filters runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filter {
    /// The paper's: thirteen whole runs over 60 samples.
    Paper,
    /// The unit's.
    Reduced,
}

/// How often each fault was met, in updates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Flags {
    /// A posture was not usable.
    pub posture: u64,
    /// A measured channel was not usable.
    pub measurement: u64,
    /// An update was not taken in.
    pub update: u64,
    /// The covariance was kept from degenerating.
    pub covariance: u64,
    /// The reconstructed motion was limited.
    pub motion: u64,
    /// Updates in which predictions missed measurements by far.
    pub inconsistent: u64,
}

impl Flags {
    fn count(&mut self, faults: Faults, health: Health) {
        for (count, set) in [
            (&mut self.posture, faults.posture),
            (&mut self.measurement, faults.measurement),
            (&mut self.update, faults.update),
            (&mut self.covariance, faults.covariance),
            (&mut self.motion, faults.motion),
            (&mut self.inconsistent, health == Health::Inconsistent),
        ] {
            *count += u64::from(set);
        }
    }
}

/// The result of an estimation.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Gap of the reconstruction with estimated inputs.
    pub rms: PerChannel,
    /// Gap of a free run with constant coefficients.
    pub rms_constant: PerChannel,
    /// Largest size of the measured channel.
    pub amplitude: PerChannel,
    /// Updates made.
    pub updates: u64,
    /// Mean normalised innovation squared of an update, all channels.
    pub nis_mean: f64,
    /// Faults by kind.
    pub flags: Flags,
    /// Time that the filter itself took (s).
    pub seconds: f64,
    /// Length of the flight (s).
    pub duration_s: f64,
    /// Time from a sample to the estimate for it (s): the prediction window.
    pub delay_s: f64,
}

/// Coefficients at one time.
#[derive(Debug, Clone, Copy)]
pub struct Point {
    /// Time from which on they act (s).
    pub time: f64,
    /// Coefficients.
    pub inputs: Row,
    /// Standard deviations, in the order of [`StateVector`].
    pub deviation: StateVector<f64>,
    /// Normalised innovation squared of the update.
    pub normalised_innovation: f64,
}

/// An estimation with what plots and files need.
#[derive(Debug, Clone)]
pub struct Estimation {
    /// Numbers.
    pub report: Report,
    /// Coefficients over time.
    pub points: Vec<Point>,
    /// Reconstruction with estimated inputs.
    pub estimated: Comparison,
    /// Free run with constant coefficients.
    pub constant: Comparison,
}

/// Runs a filter over a recording and, beside it, the model with constant coefficients.
///
/// # Errors
/// Where a file is not usable, the recording is not at 240 Hz, or the preset is refused.
pub fn estimate<T: Real>(
    flight: &Flight,
    preset: &Preset,
    filter: Filter,
    options: Options,
    progress: impl FnMut(f64),
) -> Result<Estimation> {
    match filter {
        Filter::Paper => run::<T, Full, 60>(flight, preset, options, progress),
        Filter::Reduced => run::<T, Reduced, 30>(flight, preset, options, progress),
    }
}

fn run<T: Real, P: Propagation<T>, const INTERVALS: usize>(
    flight: &Flight,
    preset: &Preset,
    options: Options,
    mut progress: impl FnMut(f64),
) -> Result<Estimation> {
    let recording = Recording::open(&flight.recording, options)?;
    let rate = recording.header().frame_rate;
    if (rate * preset.time_step::<f64>() - 1.0).abs() > 1e-3 {
        return Err(
            Problem::bad_input(format!("expected 240 frames a second, found {rate}"))
                .in_file(&flight.recording)
                .help("the filter's windows count samples: export the recording at 240 Hz"),
        );
    }
    // The run with constant coefficients knows of no inputs.
    let constant = Flight {
        inputs: None,
        muscles: preset.muscles,
        ..flight.clone()
    };
    // A free run that leaves every range is a result here, not a fault of the flight.
    let replay = Replay::<f64, _>::new(&constant, recording)?.on_divergence(Divergence::Held);
    let start = *replay.start();
    let height = start.measured.position.up();
    let dynamics = flight
        .effects
        .for_filter(constant.dynamics(height), height)?
        .cast::<T>();
    let mut filter = Estimator::<T, P, INTERVALS>::new(
        preset,
        &dynamics,
        &start.measured.cast(),
        &start.posture.cast(),
    )
    .map_err(|error| Problem::bad_input(format!("preset {}: {error}", preset.name)))?;
    let mut collected = Collected::new(start.time, rate);
    let mut end = start.time;
    for step in replay {
        let step = step?;
        end = step.time;
        collected.waiting.push_back(step.pair);
        let measurement = Measurement::of(&step.measured).cast();
        let begin = Instant::now();
        let estimate = filter.push(&dynamics, &step.posture.cast(), &measurement);
        collected.seconds += begin.elapsed().as_secs_f64();
        if let Some(estimate) = estimate {
            collected.take(&estimate);
            progress(step.time);
            interrupt::check()?;
        }
    }
    Ok(collected.finish(end - start.time, filter.delay().to_f64()))
}

struct Collected {
    start: f64,
    rate: f64,
    /// Index of the first entry of `waiting`; the first frame is 0.
    first_waiting: u32,
    /// What was measured, beside the run with constant coefficients, until its estimate comes.
    waiting: VecDeque<Pair>,
    estimated: Comparison,
    constant: Comparison,
    points: Vec<Point>,
    flags: Flags,
    innovations: f64,
    updates: u64,
    seconds: f64,
}

impl Collected {
    fn new(start: f64, rate: f64) -> Self {
        Self {
            start,
            rate,
            first_waiting: 1,
            waiting: VecDeque::new(),
            estimated: Comparison::default(),
            constant: Comparison::default(),
            points: Vec::new(),
            flags: Flags::default(),
            innovations: 0.0,
            updates: 0,
            seconds: 0.0,
        }
    }

    fn take<T: Real>(&mut self, estimate: &Estimate<T>) {
        self.updates += 1;
        self.innovations += estimate.normalised_innovation.to_f64();
        self.flags.count(estimate.faults, estimate.health);
        let time = self.start + f64::from(estimate.sample) / self.rate;
        self.points.push(Point {
            time,
            inputs: Row::of(time, &estimate.inputs.cast()),
            deviation: estimate.deviation.map(Real::to_f64),
            normalised_innovation: estimate.normalised_innovation.to_f64(),
        });
        while self.first_waiting < estimate.solved_sample && self.waiting.len() > 1 {
            self.waiting.pop_front();
            self.first_waiting += 1;
        }
        if let Some(constant) = self.waiting.front() {
            self.estimated.push(Pair {
                simulated: Observation::of(&estimate.motion.cast()),
                ..*constant
            });
            self.constant.push(*constant);
        }
    }

    fn finish(self, duration_s: f64, delay_s: f64) -> Estimation {
        #[expect(clippy::cast_precision_loss, reason = "counts of updates")]
        let nis_mean = self.innovations / self.updates.max(1) as f64;
        Estimation {
            report: Report {
                rms: self.estimated.rms(),
                rms_constant: self.constant.rms(),
                amplitude: self.estimated.amplitude(),
                updates: self.updates,
                nis_mean,
                flags: self.flags,
                seconds: self.seconds,
                duration_s,
                delay_s,
            },
            points: self.points,
            estimated: self.estimated,
            constant: self.constant,
        }
    }
}

impl Estimation {
    /// Coefficients over time as CSV. The first columns are those that `inputs` of a `flight.toml` takes.
    ///
    /// # Errors
    /// Where the disk refuses.
    pub fn write_csv(&self, path: &Path) -> Result<()> {
        let columns: Vec<&str> = Row::COLUMNS
            .into_iter()
            .chain(DEVIATIONS)
            .chain(["nis"])
            .collect();
        let mut file = CsvFile::create(path, &columns)?;
        for point in &self.points {
            let deviation = point.deviation.iter().copied();
            let rest = deviation.chain([point.normalised_innovation]);
            file.write(point.inputs.columns().into_iter().chain(rest))?;
        }
        file.finish()
    }

    /// Muscle input and damping over time.
    pub fn input_panels(&self) -> [Panel; 2] {
        let axes = |caption: &str, value: fn(&Row) -> [f64; 3]| Panel {
            caption: caption.to_owned(),
            curves: AXES
                .iter()
                .enumerate()
                .map(|(axis, line)| Curve {
                    line: *line,
                    points: self
                        .points
                        .iter()
                        .map(|p| (p.time, value(&p.inputs)[axis]))
                        .collect(),
                })
                .collect(),
            wraps: false,
        };
        [
            axes("muscle input coefficients", |row| {
                [row.pitch, row.yaw, row.roll]
            }),
            axes("damping coefficients", |row| {
                [row.damp_pitch, row.damp_yaw, row.damp_roll]
            }),
        ]
    }

    /// Coefficients over time above, reconstructed and measured channels below, as SVG.
    ///
    /// # Errors
    /// Where the figure cannot be drawn.
    pub fn svg(&self, title: &str) -> Result<String> {
        let channels = [
            Channel::Roll,
            Channel::Pitch,
            Channel::HorizontalVelocity,
            Channel::YawRate,
        ];
        let reconstructed = channels.map(|channel| {
            let (label, unit) = channel.label();
            let (rms, constant) = (&self.report.rms, &self.report.rms_constant);
            Panel {
                caption: format!(
                    "{label} ({unit}): RMS gap {:.3} with estimation, {:.3} without",
                    rms.get(channel),
                    constant.get(channel)
                ),
                curves: vec![
                    measured_curve(channel, self.estimated.series()),
                    simulated_curve(channel, self.constant.series(), CONSTANT),
                    simulated_curve(channel, self.estimated.series(), ESTIMATED),
                ],
                wraps: channel.is_angle(),
            }
        });
        let mut panels = self.input_panels().to_vec();
        panels.extend(reconstructed);
        figure_svg(title, &panels)
    }
}

/// Columns of the standard deviations, in the order of [`StateVector`].
const DEVIATIONS: [&str; 6] = [
    "sd_pitch",
    "sd_yaw",
    "sd_roll",
    "sd_damp_pitch",
    "sd_damp_yaw",
    "sd_damp_roll",
];
