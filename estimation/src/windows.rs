//! Estimation with a filter over windows of samples, as in the paper.

use std::collections::VecDeque;
use std::time::Instant;

use bodyflight_core::Real;
use bodyflight_core::dynamics::Dynamics;
use bodyflight_core::dynamics::muscle_input::MuscleModel;
use bodyflight_core::estimator::full::Full;
use bodyflight_core::estimator::measurement::Measurement;
use bodyflight_core::estimator::motion::settings::MOTION;
use bodyflight_core::estimator::motion::watch::Consistency;
use bodyflight_core::estimator::preset::Preset;
use bodyflight_core::estimator::propagation::Propagation;
use bodyflight_core::estimator::reduced::Reduced;
use bodyflight_core::estimator::status::{Estimate, Health};
use bodyflight_core::estimator::{Estimator, inputs_of};
use bodyflight_core::observation::Observation;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision;
use bodyflight_replay::comparison::{Channel, Comparison, Pair};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::input_history::InputRow;
use bodyflight_replay::steps::{Divergence, Replay, Step};

use crate::report::{Flags, Point, Report, Watched};
use crate::verdict::{self, Collector, LONGEST_LOSS};
use crate::{Estimation, Filter};

/// Runs a filter over a recording and, for comparison, the model with constant coefficients.
///
/// # Errors
/// Returns an error if a file is unusable, the recording is not at 240 Hz, or the preset is refused.
pub fn estimate(
    flight: &Flight,
    preset: &Preset,
    filter: Filter,
    options: Options,
    precision: Precision,
    progress: &mut dyn FnMut(f64),
) -> Result<Estimation> {
    use Precision::{Double, Single};
    match (filter, precision) {
        (Filter::Paper, Single) => run::<f32, Full, 60>(flight, preset, options, progress),
        (Filter::Paper, Double) => run::<f64, Full, 60>(flight, preset, options, progress),
        (Filter::Reduced, Single) => run::<f32, Reduced, 30>(flight, preset, options, progress),
        (Filter::Reduced, Double) => run::<f64, Reduced, 30>(flight, preset, options, progress),
    }
}

fn run<T: Real, P: Propagation<T>, const INTERVALS: usize>(
    flight: &Flight,
    preset: &Preset,
    options: Options,
    progress: &mut dyn FnMut(f64),
) -> Result<Estimation> {
    let recording = flight.open(options)?;
    let rate = recording.header().frame_rate;
    if (rate * preset.time_step::<f64>() - 1.0).abs() > 1e-3 {
        return Err(
            Problem::bad_input(format!("expected 240 frames a second, found {rate}"))
                .in_file(&flight.recording)
                .help("the filter's windows count samples: export the recording at 240 Hz"),
        );
    }
    // The run with constant coefficients has no inputs.
    let constant = Flight {
        inputs: None,
        muscles: preset.muscles,
        ..flight.clone()
    };
    // A free run that diverges is a result here, not a fault of the flight.
    let mut replay = Replay::new(&constant, recording)?.on_divergence(Divergence::Held);
    let start = *replay.start();
    let height = start.measured.position.up();
    let dynamics = flight
        .effects
        .for_filter(constant.dynamics(height), height)?
        .cast::<T>();
    let mut filter = on_heap::<T, P, INTERVALS>(preset, &dynamics, &start)?;
    let mut collected = Collected::new(start.time, rate, preset.muscles);
    let mut end = start.time;
    for step in replay.by_ref() {
        let step = step?;
        end = step.time;
        collected.waiting.push_back(step.pair);
        let measurement = Measurement::of(&step.measured).cast();
        let begin = Instant::now();
        let posture = step.posture.cast();
        let estimate = filter.push(&posture, &measurement);
        collected.seconds += begin.elapsed().as_secs_f64();
        if let Some(estimate) = estimate {
            if collected.take(&estimate) {
                // Restarts from the measured motion, as a unit does.
                let _ = filter.restart(&step.measured.cast(), &posture);
            }
            progress(step.time);
            interrupt::check()?;
        }
    }
    let mut estimation = collected.finish(end - start.time, filter.delay().to_f64());
    estimation.report.warn(replay.frames().warnings());
    estimation.report.doubt_sensors(&flight.doubted);
    Ok(estimation)
}

/// A filter at the start of a replay, on the heap: its windows take more than a hundred kilobytes, and the frames of
/// nested parallel work would hold copies of them.
#[inline(never)]
fn on_heap<T: Real, P: Propagation<T>, const INTERVALS: usize>(
    preset: &Preset,
    dynamics: &Dynamics<T>,
    start: &Step,
) -> Result<Box<Estimator<T, P, INTERVALS>>> {
    let (motion, posture) = (start.measured.cast(), start.posture.cast());
    Estimator::new(preset, dynamics, &motion, &posture)
        .map(Box::new)
        .map_err(|error| {
            let message = format!("the preset {} cannot be run: {error}", preset.name);
            Problem::bad_input(message).help(
                "change its numbers in the preset.toml or the flags; docs/estimator.md, Presets, says what each is",
            )
        })
}

struct Collected {
    muscles: MuscleModel,
    start: f64,
    rate: f64,
    /// Index of the first entry of `waiting`; the first frame is 0.
    first_waiting: u32,
    /// Measurements and the run with constant coefficients, until the estimate for them is available.
    waiting: VecDeque<Pair>,
    estimated: Comparison,
    constant: Comparison,
    points: Vec<Point>,
    flags: Flags,
    collector: Collector,
    /// Time at which the reconstructed motion was lost (s).
    lost_since: Option<f64>,
    innovations: f64,
    updates: u64,
    seconds: f64,
}

impl Collected {
    fn new(start: f64, rate: f64, muscles: MuscleModel) -> Self {
        Self {
            muscles,
            start,
            rate,
            first_waiting: 1,
            waiting: VecDeque::new(),
            estimated: Comparison::default(),
            constant: Comparison::default(),
            points: Vec::new(),
            flags: Flags::default(),
            collector: Collector::default(),
            lost_since: None,
            innovations: 0.0,
            updates: 0,
            seconds: 0.0,
        }
    }

    /// Adds an update, and returns whether the filter has been lost for so long that it must restart.
    fn take<T: Real>(&mut self, estimate: &Estimate<T>) -> bool {
        self.updates += 1;
        self.innovations += estimate.normalised_innovation.to_f64();
        self.flags.count(estimate.faults, estimate.health);
        let time = self.start + f64::from(estimate.sample) / self.rate;
        let mean_square = estimate.mean_normalised_innovation.to_f64();
        let consistency = match estimate.health {
            Health::Settling => Consistency::Consistent,
            Health::Failing => Consistency::Lost,
            Health::Good | Health::Inconsistent => Consistency::of_mean_square(mean_square),
        };
        let last = self.points.last().map_or(self.start, |point| point.time);
        self.collector.take_state(consistency, time, time - last);
        self.points.push(Point {
            time,
            inputs: InputRow::of(time, &estimate.inputs.cast()).with_muscles(&self.muscles),
            deviation: InputRow::of(time, &inputs_of(&estimate.deviation.map(Real::to_f64))),
            normalised_innovation: estimate.normalised_innovation.to_f64(),
            consistency: Some(consistency),
            watched: Watched::of_all(mean_square),
            motion: None,
            velocity_deviation: [f64::NAN; 3],
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
        if estimate.health != Health::Inconsistent {
            self.lost_since = None;
            return false;
        }
        let due = time - *self.lost_since.get_or_insert(time) >= LONGEST_LOSS;
        if due {
            self.flags.restarted += 1;
            self.lost_since = None;
        }
        due
    }

    fn finish(self, duration_s: f64, delay_s: f64) -> Estimation {
        #[expect(clippy::cast_precision_loss, reason = "counts of updates")]
        let nis_mean = self.innovations / self.updates.max(1) as f64;
        let (rms, rms_constant) = (self.estimated.rms(), self.constant.rms());
        let worse: Vec<(Channel, f64, f64)> =
            verdict::worse_channels(&rms, &rms_constant, &MOTION.noise)
                .into_iter()
                .map(|channel| (channel, rms.get(channel), rms_constant.get(channel)))
                .collect();
        let consistency = self.collector.finish();
        Estimation {
            report: Report {
                doubt: verdict::sentence(&worse, &consistency, None),
                is_recording_doubtful: false,
                warnings: Vec::new(),
                rms,
                rms_constant,
                rms_free_run: None,
                joint_error_deg: None,
                joint_error_sd_deg: None,
                joint_error_source: None,
                consistency: Some(consistency),
                amplitude: self.estimated.amplitude(),
                updates: self.updates,
                is_smoothed: false,
                nis_mean,
                flags: self.flags,
                filter_s: self.seconds,
                duration_s,
                assumed_velocity_sd_mps: None,
                delay_s,
            },
            points: self.points,
            estimated: self.estimated,
            constant: self.constant,
        }
    }
}
