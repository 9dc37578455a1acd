//! Windows of a flight, predicted from their first frame or their first tenth of a second, and whole flights.

use bodyflight_core::dynamics::Motion;
use bodyflight_core::dynamics::free_run::Equations;
use bodyflight_discovery::statistics::interpolated_quantile;
use schemars::JsonSchema;
use serde::Serialize;

use crate::replay::recorded::{Recorded, Variant};
use crate::replay::start::{Noise, SMOOTHED_OVER, fitted};

/// Time from the start of one window to that of the next (s).
const STRIDE: f64 = 0.06;

/// A model, or a part of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Model {
    /// Name in files.
    pub key: &'static str,
    /// Name for people.
    pub name: &'static str,
    /// What is flown.
    pub variant: Variant,
}

/// The whole model, the published equations, and the model without one of its parts.
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
#[derive(Debug, Clone, Copy, PartialEq, JsonSchema, Serialize)]
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

/// Windows of one length, predicted by one model: angle between the measured and the predicted attitude at the end.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Row {
    /// The model's name in files.
    pub model: &'static str,
    /// Length of a window (s).
    pub length_s: f64,
    /// Number of windows.
    pub windows: usize,
    /// Angle turned in a window, mean (rad).
    pub turned_rad: f64,
    /// Started from the window's first frame; nothing is fitted.
    pub first_frame: Spread,
    /// Started from a fit to the window's first tenth of a second.
    pub smoothed: Spread,
    /// Started from a fit to the whole window: what no start can take away.
    pub fitted: Spread,
}

/// Whole flights under one model, their start fitted: root mean square of the angle between measured and simulated.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Whole {
    /// The model's name in files.
    pub model: &'static str,
    /// Of each flight (rad).
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
    let mut start = 0.0;
    loop {
        let first = flight.frame_at(0, start);
        let last = flight.frame_at(first, length);
        if flight.times[last] - flight.times[first] < length - 1e-3 {
            return windows;
        }
        windows.push([first, last]);
        start += STRIDE;
    }
}

/// Predicts all windows of one length; `None` where the flights are shorter.
pub fn predicted(flights: &[&Recorded], length: f64, model: Model) -> Option<Row> {
    let mut errors: [Vec<f64>; 3] = Default::default();
    let mut turned = 0.0;
    for flight in flights {
        for [first, last] in windows(flight, length) {
            let smoothed_until = flight.frame_at(first, SMOOTHED_OVER);
            let fit =
                |until: usize| fitted(flight, [first, until], model.variant, Noise::default());
            let starts = [flight.measured[first], fit(smoothed_until), fit(last)];
            for (errors, start) in errors.iter_mut().zip(starts) {
                let run = flight.run(first, last, &start, model.variant);
                errors.extend(run.last().map(|end| angle(end, &flight.measured[last])));
            }
            let part = &flight.measured[first..=last];
            turned += part
                .windows(2)
                .map(|pair| angle(&pair[0], &pair[1]))
                .sum::<f64>();
        }
    }
    let count = errors[0].len();
    let [first_frame, smoothed, fitted] = errors.map(Spread::of);
    Some(Row {
        model: model.key,
        length_s: length,
        windows: count,
        turned_rad: turned / count.max(1) as f64,
        first_frame: first_frame?,
        smoothed: smoothed?,
        fitted: fitted?,
    })
}

/// The run of a whole flight from a start that is fitted to its attitudes alone.
pub fn whole_run(flight: &Recorded, model: Model) -> Vec<Motion<f64>> {
    let last = flight.times.len() - 1;
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
            .zip(&flight.measured)
            .map(|(a, b)| angle(a, b).powi(2));
        (errors.sum::<f64>() / run.len() as f64).sqrt()
    };
    Whole {
        model: model.key,
        rms_rad: flights.iter().map(rms).collect(),
    }
}
