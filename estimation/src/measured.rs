//! A whole flight in memory as input for the motion filter: postures, and measurements corrected for known sensor
//! errors.

use bodyflight_core::dynamics::Motion;
use bodyflight_core::effect::sensors::{Moving, Sensors};
use bodyflight_core::estimator::motion::measurement::Noise;
use bodyflight_core::estimator::motion::settings::ASSUMED_FALL;
use bodyflight_core::flight_sample::FlightSample;
use bodyflight_core::frame::Vector;
use bodyflight_falls::statistics::{
    THIRD_DIFFERENCE_VARIANCE, quantile, second_difference, third_difference,
};
use nalgebra::Vector3;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvnx::recording::{FlightFrame, Options, Warning};
use bodyflight_replay::flight::Flight;

use crate::velocities::Velocities;

/// The measurements of a flight.
#[derive(Debug, Clone)]
pub struct MeasuredFlight {
    /// Postures and motion of the pelvis, in order of time.
    pub samples: Vec<FlightSample>,
    /// The frames that the samples come from.
    pub frames: Vec<FlightFrame>,
    /// Where the velocities come from.
    pub velocities: Velocities,
    /// Sample rate (Hz).
    pub rate: f64,
    /// What is implausible in the recording.
    pub warnings: Vec<Warning>,
}

/// Share of the preset's noise above which a recording's noise is believed. Below it, the recording has been smoothed,
/// so that its errors change more slowly than from sample to sample.
const VISIBLE: f64 = 0.25;

impl MeasuredFlight {
    /// Reads a flight. If no frame has a velocity, those of a steady fall are assumed.
    ///
    /// # Errors
    /// Returns an error if a file is unusable, there are fewer than two frames, or some lack velocity or angular velocity.
    pub fn read(flight: &Flight, options: Options) -> Result<Self> {
        let mut recording = flight.open(options)?;
        let rate = recording.header().frame_rate;
        let mut frames = recording.by_ref().collect::<Result<Vec<FlightFrame>>>()?;
        if frames.len() < 2 {
            return Err(
                Problem::bad_input("expected at least two frames of type \"normal\"")
                    .in_file(&flight.recording),
            );
        }
        let is_assumed = frames.iter().all(|frame| frame.pelvis.velocity.is_none());
        if is_assumed {
            for frame in &mut frames {
                frame.pelvis.velocity = Some(Vector::from_components(ASSUMED_FALL.into()).cast());
            }
        }
        let samples = frames.iter().map(FlightFrame::sample);
        let samples = samples.collect::<Result<Vec<FlightSample>>>()?;
        Ok(Self {
            velocities: if is_assumed {
                Velocities::Assumed
            } else {
                Velocities::of(recording.solutions(), &samples)
            },
            samples,
            frames,
            rate,
            warnings: recording.warnings(),
        })
    }

    /// Corrects for known sensor errors.
    pub fn correct(&mut self, sensors: &Sensors<f64>) {
        if *sensors == Sensors::perfect() {
            return;
        }
        self.velocities.correct(sensors);
        let seen = self.samples.clone();
        let start = seen.first().map_or(0.0, |first| first.time);
        for (index, sample) in self.samples.iter_mut().enumerate() {
            let later = |delay: f64| neighbours(&seen, index, delay * self.rate);
            let moving = |delay: f64| {
                later(delay).map_or_else(
                    || Moving::of(&sample.motion),
                    |(a, b, share)| Moving::of(&a.motion).towards(&Moving::of(&b.motion), share),
                )
            };
            let attitude = sample.motion.inertial_from_body;
            let measured = Motion {
                velocity: attitude.inverse() * moving(sensors.velocity_latency).velocity,
                angular_velocity: moving(sensors.rate_lag).angular_velocity,
                ..sample.motion
            };
            if let Some((a, b, share)) = later(sensors.posture_delay) {
                sample.posture = a.posture.interpolated(&b.posture, share);
            }
            sample.motion = sensors.corrected(&measured, sample.time - start);
        }
    }

    /// Sensor noise, from changes between samples that are faster than any body's; the preset's if no noise is visible.
    pub fn noise(&self, preset: &Noise<f32>) -> Noise<f32> {
        let seen = |values: Vec<f64>, preset: f32| {
            let found = values.into_iter().fold(0.0, f64::max);
            #[expect(clippy::cast_possible_truncation, reason = "a deviation")]
            let found = found as f32;
            if f64::from(found) > VISIBLE * f64::from(preset) {
                found.min(10.0 * preset)
            } else {
                preset
            }
        };
        let axes = |part: &dyn Fn(&FlightSample) -> Vector3<f64>| {
            let series: Vec<Vector3<f64>> = self.samples.iter().map(part).collect();
            (0..3)
                .map(|axis| noise_of(series.iter().map(|v| v[axis])))
                .collect::<Vec<f64>>()
        };
        let velocity = axes(&|sample| sample.motion.velocity_inertial().components);
        let spin = axes(&|sample| sample.motion.angular_velocity.components);
        let turns: Vec<Vector3<f64>> = self
            .samples
            .windows(2)
            .filter_map(|pair| {
                let [a, b] = pair else { return None };
                let turn = a.motion.inertial_from_body.inverse() * b.motion.inertial_from_body;
                Some(turn.quaternion().scaled_axis())
            })
            .collect();
        // A rotation from one sample to the next is already a first difference.
        let attitude = (0..3)
            .map(|axis| noise_of_differences(turns.iter().map(|v| v[axis])))
            .collect();
        let [horizontal_velocity, vertical_velocity] = match self.velocities.deviations() {
            #[expect(clippy::cast_possible_truncation, reason = "deviations")]
            Some(stated) => stated.map(|deviation| deviation as f32),
            None => {
                let horizontal = velocity.iter().take(2).copied().collect();
                let vertical = velocity.iter().skip(2).copied().collect();
                [
                    seen(horizontal, preset.horizontal_velocity),
                    seen(vertical, preset.vertical_velocity),
                ]
            }
        };
        Noise {
            attitude: seen(attitude, preset.attitude),
            angular_velocity: seen(spin, preset.angular_velocity),
            horizontal_velocity,
            vertical_velocity,
            horizontal_speed: preset.horizontal_speed,
        }
    }
}

/// The samples on both sides of the time `samples` after `index`, and the fraction of the way between them.
fn neighbours(
    seen: &[FlightSample],
    index: usize,
    samples: f64,
) -> Option<(&FlightSample, &FlightSample, f64)> {
    if samples == 0.0 {
        return None;
    }
    #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
    let place = (index as f64 + samples).clamp(0.0, (seen.len() - 1) as f64);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the flight"
    )]
    let before = place.floor() as usize;
    let a = seen.get(before)?;
    let b = seen.get(before + 1).unwrap_or(a);
    Some((a, b, place.fract()))
}

/// Standard deviation of the white noise in these values.
fn noise_of(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    let thirds = values.array_windows();
    white_noise(thirds.map(|four| third_difference(*four)))
}

/// The same for values that are first differences already.
fn noise_of_differences(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    let thirds = values.array_windows();
    white_noise(thirds.map(|three| second_difference(*three)))
}

fn white_noise(third_differences: impl Iterator<Item = f64>) -> f64 {
    // The reciprocal of the median magnitude, in the rounding with which the published estimates were made.
    const DEVIATION: f64 = 1.4826;
    let sizes = third_differences.map(f64::abs).collect();
    DEVIATION * quantile(sizes, 0.5) / THIRD_DIFFERENCE_VARIANCE.sqrt()
}
