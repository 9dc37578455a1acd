//! Compares an estimation with the recording, and with free runs with estimated and with constant inputs.

use bodyflight_core::dynamics::Motion;
use bodyflight_core::estimator::motion::settings::MotionPreset;
use bodyflight_core::observation::Observation;

use crate::Estimation;
use crate::measured::MeasuredFlight;
use crate::report::{JointErrorSource, Point, Report};
use crate::run::Points;
use crate::verdict;
use bodyflight_io::diagnostic::Result;
use bodyflight_replay::comparison::{Channel, Comparison, Pair, PerChannel};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::input_history::InputHistory;
use bodyflight_replay::steps::{Divergence, Replay};

/// Time after which an assumed velocity is as the air makes it (s).
const SETTLED: f64 = 5.0;

/// A flight to compare an estimation with.
pub(crate) struct Replayed<'a> {
    pub(crate) flight: &'a Flight,
    pub(crate) measured: &'a MeasuredFlight,
}

impl Replayed<'_> {
    /// Compares with the measurements and with a run with constant coefficients.
    pub(crate) fn report(
        &self,
        estimates: Points,
        preset: &MotionPreset,
        seconds: f64,
    ) -> Result<Estimation> {
        let Points {
            points,
            collector,
            flags,
            is_smoothed,
        } = estimates;
        let constant = self.free_run(None)?;
        let history = InputHistory::new(points.iter().map(|point| point.inputs).collect());
        let rms_free_run = Some(self.gaps(self.free_run(Some(history))?));
        let (mut estimated, mut without) = (Comparison::default(), Comparison::default());
        let mut instants = self.measured.samples.iter().zip(&constant).skip(1);
        for point in &points {
            let Some(motion) = &point.motion else {
                continue;
            };
            let here = instants.find(|(instant, _)| instant.time >= point.time - 1e-6);
            let Some((instant, constant)) = here else {
                break;
            };
            let pair = |simulated| Pair {
                time: instant.time,
                measured: self.seen(&instant.motion),
                simulated,
            };
            estimated.push(pair(Observation::of(motion)));
            without.push(pair(*constant));
        }
        let consistency = collector.finish();
        let (rms, rms_constant) = (estimated.rms(), without.rms());
        let worse: Vec<(Channel, f64, f64)> =
            verdict::worse_channels(&rms, &rms_constant, &preset.noise)
                .into_iter()
                .map(|channel| (channel, rms.get(channel), rms_constant.get(channel)))
                .collect();
        #[expect(clippy::cast_precision_loss, reason = "counts of updates")]
        let number = points.len().max(1) as f64;
        let nis_mean = points.iter().map(|p| p.normalised_innovation).sum::<f64>() / number;
        let ends = (self.measured.samples.first(), self.measured.samples.last());
        let duration_s = match ends {
            (Some(first), Some(last)) => last.time - first.time,
            _ => 0.0,
        };
        let assumed = self.measured.velocities.are_assumed();
        let assumed_velocity_sd_mps = assumed.then(|| settled_deviation(&points));
        Ok(Estimation {
            report: Report {
                rms,
                rms_constant,
                rms_free_run,
                amplitude: estimated.amplitude(),
                updates: points.len() as u64,
                is_smoothed,
                nis_mean,
                flags,
                filter_s: seconds,
                duration_s,
                assumed_velocity_sd_mps,
                delay_s: 0.0,
                joint_error_deg: Some(f64::from(preset.joint_error.to_degrees())),
                joint_error_sd_deg: None,
                joint_error_source: Some(JointErrorSource::Given),
                doubt: verdict::sentence(&worse, &consistency, assumed_velocity_sd_mps),
                is_recording_doubtful: false,
                warnings: Vec::new(),
                consistency: Some(consistency),
            },
            points,
            estimated,
            constant: without,
        })
    }

    /// Gaps between the recording and a free run.
    fn gaps(&self, simulated: Vec<Observation<f64>>) -> PerChannel {
        let mut gaps = Comparison::default();
        for (instant, simulated) in self.measured.samples.iter().zip(simulated).skip(1) {
            gaps.push(Pair {
                time: instant.time,
                measured: self.seen(&instant.motion),
                simulated,
            });
        }
        gaps.rms()
    }

    /// What the recording shows of a motion: channels of the velocity are not a number if it is assumed.
    fn seen(&self, motion: &Motion<f64>) -> Observation<f64> {
        let seen = Observation::of(motion);
        if self.measured.velocities.are_assumed() {
            return Observation {
                horizontal_speed: f64::NAN,
                vertical_velocity: f64::NAN,
                ..seen
            };
        }
        seen
    }

    /// Observations of a free run with these inputs, or with constant coefficients, at every instant.
    fn free_run(&self, inputs: Option<InputHistory>) -> Result<Vec<Observation<f64>>> {
        let flight = Flight {
            inputs,
            ..self.flight.clone()
        };
        let frames = self.measured.frames.iter().copied().map(Ok);
        // A free run that diverges is a result here, not a fault of the flight.
        let replay = Replay::new(&flight, frames)?.on_divergence(Divergence::Held);
        let first = replay.start().pair.simulated;
        std::iter::once(Ok(first))
            .chain(replay.map(|step| step.map(|step| step.pair.simulated)))
            .collect()
    }
}

/// Standard deviation of a component of the velocity after the first seconds, root of its mean square (m/s).
fn settled_deviation(points: &[Point]) -> f64 {
    let begin = points.first().map_or(0.0, |point| point.time);
    let is_settled = |point: &&Point| point.time - begin > SETTLED;
    let settled = points.iter().filter(is_settled);
    let last = points.last().filter(|last| !is_settled(last));
    let squares: Vec<f64> = (settled.chain(last))
        .flat_map(|point| {
            point
                .velocity_deviation
                .map(|deviation| deviation * deviation)
        })
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}
