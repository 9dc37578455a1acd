//! Windows of a flight, predicted from their first frame or their first tenth of a second, and whole flights.

use std::sync::atomic::{AtomicUsize, Ordering};

use bodyflight_core::dynamics::Motion;
use bodyflight_core::dynamics::free_run::Equations;
use bodyflight_falls::statistics::interpolated_quantile;
use rayon::prelude::*;
use serde::Serialize;

use bodyflight_io::diagnostic::Result;
use bodyflight_io::progress;
use bodyflight_replay::recorded::{Recorded, Variant};
use bodyflight_replay::start::{Noise, SMOOTHED_OVER, fitted};

/// Time from the start of one window to that of the next (s), and the largest number of windows per flight; in longer
/// flights they are further apart.
const STRIDE: f64 = 0.06;
const MOST_WINDOWS: f64 = 100.0;
/// Time by which a window may be shorter (s).
const ENDS_EARLY: f64 = 1e-3;

/// A model, or a part of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Model {
    /// Name in files.
    pub key: &'static str,
    /// Readable name.
    pub name: &'static str,
    /// The variant to simulate.
    pub variant: Variant,
}

/// The full model, the published equations, and the model without one of its parts.
pub const MODELS: [Model; 4] = [
    Model {
        key: "exact",
        name: "exact equations",
        variant: Variant::Whole(Equations::Exact),
    },
    Model {
        key: "as-published",
        name: "as published",
        variant: Variant::Whole(Equations::AsPublished),
    },
    Model {
        key: "without-limb-momentum",
        name: "exact, limbs without momentum",
        variant: Variant::WithoutLimbMomentum,
    },
    Model {
        key: "frozen-posture",
        name: "exact, posture frozen",
        variant: Variant::FrozenPosture,
    },
];

/// Median and 90th percentile of errors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Spread {
    /// Median (rad).
    pub median_rad: f64,
    /// 90th percentile (rad).
    pub nine_tenths_rad: f64,
}

impl Spread {
    fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        Some(Self {
            median_rad: interpolated_quantile(&values, 0.5)?,
            nine_tenths_rad: interpolated_quantile(&values, 0.9)?,
        })
    }
}

/// Windows of one length in one model: the angle between measured and predicted attitude at the end.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Row {
    /// The model's name in files.
    pub model: &'static str,
    /// Length of a window (s).
    pub length_s: f64,
    /// Number of windows.
    pub windows: usize,
    /// Mean angle of rotation in a window (rad).
    pub turned_rad: f64,
    /// Started from the window's first frame, nothing fitted.
    pub first_frame: Spread,
    /// Started from a fit to the window's first tenth of a second.
    pub smoothed: Spread,
    /// Started from a fit to the whole window; no other start can reduce this error.
    pub fitted: Spread,
}

/// Whole flights in one model, with fitted start: root mean square angle between measured and simulated attitude.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Whole {
    /// The model's name in files.
    pub model: &'static str,
    /// One value per flight (rad).
    pub rms_rad: Vec<f64>,
}

/// Angle between two attitudes (rad).
pub fn angle(a: &Motion<f64>, b: &Motion<f64>) -> f64 {
    let (a, b) = (&a.inertial_from_body, &b.inertial_from_body);
    a.quaternion().angle_to(b.quaternion())
}

/// First and last frame of each window of `length` (s).
fn windows(flight: &Recorded, length: f64) -> Vec<[usize; 2]> {
    let mut windows = Vec::new();
    let (Some(begin), Some(end)) = (flight.samples.first(), flight.samples.last()) else {
        return windows;
    };
    let stride = STRIDE.max((end.time - begin.time - length) / MOST_WINDOWS);
    // A window ends at a frame: at the rate of video, up to half a frame earlier.
    let intervals = flight.samples.len().saturating_sub(1).max(1) as f64;
    let slack = ENDS_EARLY.max(0.51 * (end.time - begin.time) / intervals);
    let mut start = 0.0;
    loop {
        let first = flight.frame_at(0, start);
        let last = flight.frame_at(first, length);
        if flight.samples[last].time - flight.samples[first].time < length - slack {
            return windows;
        }
        windows.push([first, last]);
        start += stride;
    }
}

/// Result for one window: errors at its end from the three starts, and the angle of rotation (rad).
struct Found {
    errors: [f64; 3],
    turned: f64,
}

fn found(flight: &Recorded, [first, last]: [usize; 2], model: Model) -> Found {
    let smoothed_until = flight.frame_at(first, SMOOTHED_OVER);
    let fit = |until: usize| fitted(flight, [first, until], model.variant, Noise::default());
    let starts = [flight.samples[first].motion, fit(smoothed_until), fit(last)];
    let errors = starts.map(|start| {
        let run = flight.run(first, last, &start, model.variant);
        // A run contains at least its start.
        angle(run.last().unwrap_or(&start), &flight.samples[last].motion)
    });
    let part = &flight.samples[first..=last];
    let turns = part
        .windows(2)
        .map(|pair| angle(&pair[0].motion, &pair[1].motion));
    Found {
        errors,
        turned: turns.sum(),
    }
}

/// Predicts all windows of one length; `None` if the flights are shorter.
///
/// # Errors
/// Returns an error if Ctrl-C was pressed.
pub fn predicted(flights: &[&Recorded], length: f64, model: Model) -> Result<Option<Row>> {
    let all: Vec<(&Recorded, [usize; 2])> = flights
        .iter()
        .flat_map(|flight| {
            windows(flight, length)
                .into_iter()
                .map(|window| (*flight, window))
        })
        .collect();
    let done = AtomicUsize::new(0);
    let found = all
        .par_iter()
        .map(|(flight, window)| {
            progress::reached(done.fetch_add(1, Ordering::Relaxed), all.len())?;
            Ok(found(flight, *window, model))
        })
        .collect::<Result<Vec<Found>>>()?;
    let errors = [0, 1, 2].map(|start| found.iter().map(|found| found.errors[start]).collect());
    let [first_frame, smoothed, fitted] = errors.map(Spread::of);
    let (Some(first_frame), Some(smoothed), Some(fitted)) = (first_frame, smoothed, fitted) else {
        return Ok(None);
    };
    let turned: f64 = found.iter().map(|found| found.turned).sum();
    Ok(Some(Row {
        model: model.key,
        length_s: length,
        windows: found.len(),
        turned_rad: turned / found.len() as f64,
        first_frame,
        smoothed,
        fitted,
    }))
}

/// The run of a whole flight from a start fitted to its attitudes only.
pub fn whole_run(flight: &Recorded, model: Model) -> Vec<Motion<f64>> {
    let last = flight.samples.len() - 1;
    let attitudes = Noise {
        angular_velocity: 1e3,
        ..Noise::default()
    };
    let start = fitted(flight, [0, last], model.variant, attitudes);
    flight.run(0, last, &start, model.variant)
}

/// Attitude errors of whole flights.
pub fn whole(flights: &[&Recorded], model: Model) -> Whole {
    let rms = |flight: &&Recorded| {
        let run = whole_run(flight, model);
        let errors = run
            .iter()
            .zip(&flight.samples)
            .map(|(run, sample)| angle(run, &sample.motion).powi(2));
        (errors.sum::<f64>() / run.len() as f64).sqrt()
    };
    Whole {
        model: model.key,
        rms_rad: flights.par_iter().map(rms).collect(),
    }
}
