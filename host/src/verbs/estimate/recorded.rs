//! A whole flight in memory as input for the motion filter: postures, and measurements corrected for known sensor
//! errors.

use bodyflight_core::Posture;
use bodyflight_core::dynamics::Motion;
use bodyflight_core::effect::sensors::{Moving, Sensors};
use bodyflight_core::estimator::motion::measurement::Noise;
use bodyflight_discovery::statistics::quantile;
use nalgebra::Vector3;

use crate::diagnostic::{Problem, Result};
use crate::formats::flight::Flight;
use crate::formats::recording::{FlightFrame, Options};

/// One instant of a flight.
#[derive(Debug, Clone)]
pub struct Instant {
    /// Time since frame 0 (s).
    pub time: f64,
    /// Posture.
    pub posture: Posture<f64>,
    /// Motion of the pelvis as measured.
    pub motion: Motion<f64>,
}

/// A flight, sample by sample.
#[derive(Debug, Clone)]
pub struct Recorded {
    /// The instants, in order of time.
    pub instants: Vec<Instant>,
    /// The frames that the instants come from.
    pub frames: Vec<FlightFrame>,
    /// Sample rate (Hz).
    pub rate: f64,
}

/// Share of the preset's noise above which a recording's noise is believed. Below it, the recording has been smoothed,
/// so that its errors change more slowly than from sample to sample.
const VISIBLE: f64 = 0.25;

impl Recorded {
    /// Reads a flight.
    ///
    /// # Errors
    /// Returns an error if a file is unusable, or fewer than two frames have velocity and angular velocity.
    pub fn read(flight: &Flight, options: Options) -> Result<Self> {
        let recording = flight.open(options)?;
        let rate = recording.header().frame_rate;
        let frames = recording.collect::<Result<Vec<FlightFrame>>>()?;
        if frames.len() < 2 {
            return Err(
                Problem::bad_input("expected at least two frames of type \"normal\"")
                    .in_file(&flight.recording),
            );
        }
        let instants = frames.iter().map(|frame| {
            Ok(Instant {
                time: frame.time,
                posture: frame.posture,
                motion: frame.motion()?,
            })
        });
        Ok(Self {
            instants: instants.collect::<Result<_>>()?,
            frames,
            rate,
        })
    }

    /// Corrects for known sensor errors.
    pub fn correct(&mut self, sensors: &Sensors<f64>) {
        if *sensors == Sensors::perfect() {
            return;
        }
        let seen = self.instants.clone();
        let start = seen.first().map_or(0.0, |first| first.time);
        for (index, instant) in self.instants.iter_mut().enumerate() {
            let later = |delay: f64| neighbours(&seen, index, delay * self.rate);
            let moving = |delay: f64| {
                later(delay).map_or_else(
                    || Moving::of(&instant.motion),
                    |(a, b, share)| Moving::of(&a.motion).towards(&Moving::of(&b.motion), share),
                )
            };
            let attitude = instant.motion.inertial_from_body;
            let measured = Motion {
                velocity: attitude.inverse() * moving(sensors.velocity_latency).velocity,
                angular_velocity: moving(sensors.rate_lag).angular_velocity,
                ..instant.motion
            };
            if let Some((a, b, share)) = later(sensors.posture_delay) {
                instant.posture = a.posture.interpolated(&b.posture, share);
            }
            instant.motion = sensors.corrected(&measured, instant.time - start);
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
        let axes = |part: &dyn Fn(&Instant) -> Vector3<f64>| {
            let series: Vec<Vector3<f64>> = self.instants.iter().map(part).collect();
            (0..3)
                .map(|axis| third_difference(series.iter().map(|v| v[axis])))
                .collect::<Vec<f64>>()
        };
        let velocity = axes(&|instant| instant.motion.velocity_inertial().components);
        let spin = axes(&|instant| instant.motion.angular_velocity.components);
        let turns: Vec<Vector3<f64>> = self
            .instants
            .windows(2)
            .filter_map(|pair| {
                let [a, b] = pair else { return None };
                let turn = a.motion.inertial_from_body.inverse() * b.motion.inertial_from_body;
                Some(turn.quaternion().scaled_axis())
            })
            .collect();
        // A rotation from one sample to the next is already a first difference.
        let attitude = (0..3)
            .map(|axis| second_difference(turns.iter().map(|v| v[axis])))
            .collect();
        let horizontal = velocity.iter().take(2).copied().collect();
        let vertical = velocity.iter().skip(2).copied().collect();
        Noise {
            attitude: seen(attitude, preset.attitude),
            angular_velocity: seen(spin, preset.angular_velocity),
            horizontal_velocity: seen(horizontal, preset.horizontal_velocity),
            vertical_velocity: seen(vertical, preset.vertical_velocity),
            horizontal_speed: preset.horizontal_speed,
        }
    }
}

/// The instants on both sides of the time `samples` after `index`, and the fraction of the way between them.
fn neighbours(seen: &[Instant], index: usize, samples: f64) -> Option<(&Instant, &Instant, f64)> {
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

/// Standard deviation of the white noise in these values, from their third differences.
fn third_difference(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    let differences = values.windows(4).filter_map(|four| {
        let [a, b, c, d] = four else { return None };
        Some(d - 3.0 * c + 3.0 * b - a)
    });
    median_size(differences) / 20.0f64.sqrt()
}

/// The same for values that are first differences already.
fn second_difference(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    let differences = values.windows(3).filter_map(|three| {
        let [a, b, c] = three else { return None };
        Some(c - 2.0 * b + a)
    });
    median_size(differences) / 20.0f64.sqrt()
}

/// Standard deviation from the median absolute value, which is robust against a few jumps.
fn median_size(values: impl Iterator<Item = f64>) -> f64 {
    1.4826 * quantile(values.map(f64::abs).collect(), 0.5)
}
