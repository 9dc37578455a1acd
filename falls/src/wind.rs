//! The wind over height, from the drift of a fall.
//!
//! Horizontally, drag pulls the velocity towards that of the air, while steering, intended or not, pulls it away for
//! some seconds. For each axis a Kalman filter has the states velocity, wind that changes with height, and a decaying
//! drive. The strengths of drive and wind changes are chosen by maximum likelihood, so a steered fall gives a wind with
//! wide error bars. A smoother then runs back over the fall.

use nalgebra::{Matrix3, RowVector3, Vector2, Vector3};

use crate::Sample;

/// Time constant of the decay of a drive (s).
const FADES: f64 = 8.0;

/// Candidate strengths of the drive (m/s2), from a still belly flyer to a wingsuit.
const DRIVES: [f64; 7] = [0.15, 0.3, 0.6, 1.2, 2.4, 4.8, 9.6];

/// Candidate changes of the wind over [`LAYER`] of height (m/s).
const CHANGES: [f64; 3] = [1.0, 2.0, 4.0];
const LAYER: f64 = 500.0;

/// Most layers of a profile: more than the atmosphere has.
const MOST_LAYERS: usize = 1000;

/// Prior standard deviation of the wind, per axis (m/s).
const PRIOR: f64 = 10.0;

/// Longest step of the filter (s).
const STEP: f64 = 0.25;

/// Wind at a height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wind {
    /// Height above mean sea level (m).
    pub height: f64,
    /// Velocity of the air, north and west (m/s).
    pub velocity: Vector2<f64>,
    /// Standard deviation of each (m/s).
    pub deviation: Vector2<f64>,
}

/// Wind over height, from the top down: one value for each sample of the fall.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// In the order of the fall.
    pub values: Vec<Wind>,
    /// Chosen strength of the drive (m/s2); 0 if the wind was not estimated.
    pub drive: f64,
}

impl Profile {
    /// A profile of unknown wind.
    pub fn still(samples: &[Sample]) -> Self {
        let unknown = |sample: &Sample| Wind {
            height: sample.height(),
            velocity: Vector2::zeros(),
            deviation: Vector2::repeat(PRIOR),
        };
        Self {
            values: samples.iter().map(unknown).collect(),
            drive: 0.0,
        }
    }

    /// Extends the profile upwards with its topmost wind, whose uncertainty grows with height.
    #[must_use]
    pub fn from_above(mut self, above: &[Sample]) -> Self {
        if let Some(top) = self.values.first().copied() {
            let higher = above.iter().map(|sample| {
                let layers = (sample.height() - top.height).abs() / LAYER;
                let change = CHANGES[1] * CHANGES[1] * layers;
                Wind {
                    height: sample.height(),
                    deviation: top
                        .deviation
                        .map(|deviation| (deviation.powi(2) + change).sqrt()),
                    ..top
                }
            });
            self.values = higher.chain(self.values.iter().copied()).collect();
        }
        self
    }

    /// The wind at the sample nearest to a height (m); `None` if the profile is empty.
    pub fn at(&self, height: f64) -> Option<&Wind> {
        let off = |wind: &&Wind| (wind.height - height).abs();
        self.values.iter().min_by(|a, b| off(a).total_cmp(&off(b)))
    }

    /// Whether the wind was estimated from the fall, rather than being only the prior.
    pub fn is_told(&self) -> bool {
        self.drive > 0.0
    }

    /// Root mean square difference between the winds of two falls, in combined deviations, over the full layers of
    /// height (m) that both crossed; and the number of these layers. `None` if there are none.
    pub fn apart(&self, other: &Self, thickness: f64) -> Option<(f64, usize)> {
        if !(self.is_told() && other.is_told()) {
            return None;
        }
        let (mut squares, mut layers) = (0.0, 0);
        for own in self.layers(thickness) {
            let (Some(top), Some(low)) = (other.values.first(), other.values.last()) else {
                continue;
            };
            if !(low.height..=top.height).contains(&own.height) {
                continue;
            }
            let Some(beside) = other.at(own.height) else {
                continue;
            };
            for axis in 0..2 {
                let variance = own.deviation[axis].powi(2) + beside.deviation[axis].powi(2);
                squares += (own.velocity[axis] - beside.velocity[axis]).powi(2) / variance;
            }
            layers += 1;
        }
        (layers > 0).then(|| ((0.5 * squares / layers as f64).sqrt(), layers))
    }

    /// The wind at each full layer of height (m) that the fall crossed, from the top.
    pub fn layers(&self, thickness: f64) -> Vec<Wind> {
        let (Some(first), Some(last)) = (self.values.first(), self.values.last()) else {
            return Vec::new();
        };
        let mut layers = Vec::new();
        let mut height = (first.height / thickness).floor() * thickness;
        while height >= last.height && layers.len() < MOST_LAYERS {
            layers.extend(self.at(height).map(|wind| Wind { height, ..*wind }));
            height -= thickness;
        }
        layers
    }
}

/// Strengths of the drive and of the wind's changes for one axis, and the noise of a measured velocity.
#[derive(Clone, Copy)]
struct Strengths {
    drive: f64,
    change: f64,
    noise: f64,
}

/// Estimates the wind of a fall. `pull` is the rate (1/s) at which drag pulls each sample's velocity towards that of
/// the air, `noise` the standard deviation of a velocity (m/s).
pub fn wind(samples: &[Sample], pull: &[f64], noise: f64) -> Profile {
    let mut best: Option<(f64, Strengths)> = None;
    for drive in DRIVES {
        for change in CHANGES {
            let strengths = Strengths {
                drive,
                change,
                noise,
            };
            let likelihood: f64 = [0, 1]
                .map(|axis| filtered(samples, pull, axis, strengths).1)
                .iter()
                .sum();
            if best.is_none_or(|(most, _)| likelihood > most) {
                best = Some((likelihood, strengths));
            }
        }
    }
    let Some((_, strengths)) = best else {
        return Profile::still(samples);
    };
    let axes = [0, 1].map(|axis| smoothed(filtered(samples, pull, axis, strengths).0));
    let values = samples.iter().enumerate().map(|(index, sample)| Wind {
        height: sample.height(),
        velocity: Vector2::new(axes[0][index].0, axes[1][index].0),
        deviation: Vector2::new(axes[0][index].1, axes[1][index].1),
    });
    Profile {
        values: values.collect(),
        drive: strengths.drive,
    }
}

/// A step of the filter: transition, prediction and update.
struct Filtered {
    transition: Matrix3<f64>,
    expected: (Vector3<f64>, Matrix3<f64>),
    corrected: (Vector3<f64>, Matrix3<f64>),
}

/// Filters one axis with the states velocity, wind, drive; also returns the log-likelihood.
fn filtered(
    samples: &[Sample],
    pull: &[f64],
    axis: usize,
    strengths: Strengths,
) -> (Vec<Filtered>, f64) {
    let measured = RowVector3::new(1.0, 0.0, 0.0);
    let variance = strengths.noise * strengths.noise;
    let mut state = Vector3::zeros();
    let mut covariance = Matrix3::from_diagonal(&Vector3::new(
        1e4,
        PRIOR * PRIOR,
        strengths.drive * strengths.drive,
    ));
    let mut steps = Vec::with_capacity(samples.len());
    let mut likelihood = 0.0;
    for (index, sample) in samples.iter().enumerate() {
        let mut transition = Matrix3::identity();
        if let Some(before) = index.checked_sub(1) {
            let duration = (sample.time - samples[before].time).max(0.0);
            let descent = (sample.height() - samples[before].height()).abs();
            let parts = (duration / STEP).ceil().max(1.0);
            let time = duration / parts;
            let faded = (-time / FADES).exp();
            let pulled = 1.0 - (-pull[before] * time).exp();
            let part = Matrix3::new(1.0 - pulled, pulled, time, 0.0, 1.0, 0.0, 0.0, 0.0, faded);
            let spread = Vector3::new(
                0.0,
                strengths.change * strengths.change * descent / LAYER / parts,
                strengths.drive * strengths.drive * (1.0 - faded * faded),
            );
            let mut left = parts;
            while left > 0.5 {
                state = part * state;
                covariance = part * covariance * part.transpose() + Matrix3::from_diagonal(&spread);
                transition = part * transition;
                left -= 1.0;
            }
        }
        let expected = (state, covariance);
        let innovation = sample.velocity[axis] - state[0];
        let expected_variance = covariance[(0, 0)] + variance;
        let gain = covariance * measured.transpose() / expected_variance;
        state += gain * innovation;
        covariance -= gain * measured * covariance;
        if index > 0 {
            likelihood -=
                0.5 * (innovation * innovation / expected_variance + expected_variance.ln());
        }
        steps.push(Filtered {
            transition,
            expected,
            corrected: (state, covariance),
        });
    }
    (steps, likelihood)
}

/// Wind and its standard deviation at each step, smoothed from the end of the fall.
fn smoothed(steps: Vec<Filtered>) -> Vec<(f64, f64)> {
    let mut winds = Vec::with_capacity(steps.len());
    let mut after: Option<(Vector3<f64>, Matrix3<f64>, Filtered)> = None;
    for step in steps.into_iter().rev() {
        let (mut state, mut covariance) = step.corrected;
        if let Some((next_state, next_covariance, next)) = &after
            && let Some(inverse) = next.expected.1.try_inverse()
        {
            let gain = covariance * next.transition.transpose() * inverse;
            state += gain * (next_state - next.expected.0);
            covariance += gain * (next_covariance - next.expected.1) * gain.transpose();
        }
        winds.push((state[1], covariance[(1, 1)].max(0.0).sqrt()));
        after = Some((state, covariance, step));
    }
    winds.reverse();
    winds
}
