//! Compares an estimation with the recording, and with free runs with estimated and with constant inputs.

use bodyflight_core::estimator::motion::settings::MotionPreset;
use bodyflight_core::observation::Observation;

use crate::Estimation;
use crate::measured::MeasuredFlight;
use crate::report::{Flags, JointErrorSource, Point, Report};
use crate::verdict::{self, Collector};
use bodyflight_io::diagnostic::Result;
use bodyflight_replay::comparison::{Channel, Comparison, Pair};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::input_history::InputHistory;
use bodyflight_replay::steps::{Divergence, Replay};

/// A flight to compare an estimation with.
pub(crate) struct Replayed<'a> {
    pub(crate) flight: &'a Flight,
    pub(crate) measured: &'a MeasuredFlight,
}

impl Replayed<'_> {
    /// Compares with the measurements and with a run with constant coefficients.
    pub(crate) fn report(
        &self,
        points: Vec<Point>,
        collector: &Collector,
        flags: Flags,
        preset: &MotionPreset,
        seconds: f64,
    ) -> Result<Estimation> {
        let constant = self.free_run(None)?;
        let history = InputHistory::new(points.iter().map(|point| point.inputs).collect());
        let replayed = self.free_run(Some(history))?;
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
                measured: Observation::of(&instant.motion),
                simulated,
            };
            estimated.push(pair(Observation::of(motion)));
            without.push(pair(*constant));
        }
        let mut free = Comparison::default();
        for (instant, simulated) in self.measured.samples.iter().zip(replayed).skip(1) {
            free.push(Pair {
                time: instant.time,
                measured: Observation::of(&instant.motion),
                simulated,
            });
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
        Ok(Estimation {
            report: Report {
                rms,
                rms_constant,
                rms_free_run: Some(free.rms()),
                amplitude: estimated.amplitude(),
                updates: points.len() as u64,
                nis_mean,
                flags,
                filter_s: seconds,
                duration_s,
                delay_s: 0.0,
                joint_error_deg: Some(f64::from(preset.joint_error.to_degrees())),
                joint_error_sd_deg: None,
                joint_error_source: Some(JointErrorSource::Given),
                doubt: verdict::sentence(&worse, &consistency),
                is_recording_doubtful: false,
                warnings: Vec::new(),
                consistency: Some(consistency),
            },
            points,
            estimated,
            constant: without,
        })
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
