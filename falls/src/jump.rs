//! A jump in numbers, and what follows from them.

use bodyflight_core::air::GRAVITY;
use nalgebra::Vector3;
use serde::Serialize;

use crate::Sample;
use crate::canopy::Circle;
use crate::cleaning::TakenOut;
use crate::drag::{Block, Piece};
use crate::force::specific_force;
use crate::jumps::Times;
use crate::prediction::Prediction;
use crate::verdict::Verdict;
use crate::wind::{Profile, Wind};

/// Results of the analysis.
#[derive(Debug, Clone, PartialEq)]
pub struct Jump {
    /// Verdict on the fall.
    pub verdict: Verdict,
    /// Reason for the verdict, in a sentence.
    pub reason: String,
    /// Times of the fall (s, as in the samples).
    pub times: Times,
    /// Rows that were removed.
    pub taken_out: TakenOut,
    /// The samples used.
    pub samples: Vec<Sample>,
    /// Acceleration at each sample (m/s2).
    pub accelerations: Vec<Vector3<f64>>,
    /// Indices of the first sample of the fall, and of the one after its last.
    pub fall: [usize; 2],
    /// Standard deviation of one component of a velocity (m/s).
    pub noise: f64,
    /// Drag and lift for each second of the fall.
    pub blocks: Vec<Block>,
    /// Pieces of constant posture.
    pub pieces: Vec<Piece>,
    /// Wind during the fall.
    pub wind: Profile,
    /// Wind under canopy.
    pub circles: Vec<Circle>,
    /// Velocity of the simulated fall at each sample of the fall (m/s).
    pub flown: Vec<Vector3<f64>>,
    /// Root mean square difference of the vertical velocity between simulated and measured fall (m/s).
    pub gap: f64,
    /// Median drag factor of the steady part, and its standard deviation from second to second (m2/kg); `None` if the
    /// fall has no usable second.
    pub drag: Option<[f64; 2]>,
    /// Fall rate normalised to the reference height (m/s).
    pub normalised_rate: f64,
    /// Largest downward speed (m/s).
    pub fastest: f64,
    /// Glide ratios of the fall (through the air) and under canopy (over ground); `None` if unknown.
    pub glide: [Option<f64>; 2],
    /// Prediction of the last third; `None` if the fall is thin.
    pub prediction: Option<Prediction>,
}

/// The opening of the canopy.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Opening {
    /// Height at its start (m above mean sea level).
    pub height_m: f64,
    /// Time until the canopy is open (s).
    pub duration_s: f64,
    /// Height lost (m).
    pub lost_m: f64,
    /// Largest specific force along the flight path (multiples of gravity), as far as the receiver resolves it.
    pub largest_g: f64,
}

impl Jump {
    /// Duration from the exit to the opening (s).
    pub fn duration(&self) -> f64 {
        self.times.fall[1] - self.times.fall[0]
    }

    /// Returns the sample at a time (s).
    pub fn sample_at(&self, time: f64) -> Option<&Sample> {
        let place = self
            .samples
            .partition_point(|sample| sample.time < time - 1e-6);
        self.samples.get(place).or(self.samples.last())
    }

    /// Height at a time (m above mean sea level), between the samples around it.
    pub fn height_at(&self, time: f64) -> f64 {
        let after = self.samples.partition_point(|sample| sample.time < time);
        let before = after
            .checked_sub(1)
            .and_then(|before| self.samples.get(before));
        match (before, self.samples.get(after)) {
            (Some(before), Some(after)) => {
                let share = (time - before.time) / (after.time - before.time);
                before.height() + share * (after.height() - before.height())
            }
            (Some(only), None) | (None, Some(only)) => only.height(),
            (None, None) => f64::NAN,
        }
    }

    /// Distance over ground between the places at two times (m).
    pub fn way_over_ground(&self, [from, to]: [f64; 2]) -> f64 {
        let place = |time: f64| self.sample_at(time).map(|sample| sample.position.xy());
        let ends = place(from).zip(place(to));
        ends.map_or(0.0, |(from, to)| (to - from).norm())
    }

    /// The opening, if it is on the track.
    pub fn opening(&self) -> Option<Opening> {
        let (begin, end) = (self.times.opening?.time, self.times.canopy?.time);
        let [from, to] = [begin, end].map(|time| self.sample_at(time).map(Sample::height));
        let during = self
            .samples
            .iter()
            .zip(&self.accelerations)
            .filter(|(sample, _)| (begin..=end).contains(&sample.time));
        Some(Opening {
            height_m: from?,
            duration_s: end - begin,
            lost_m: from? - to?,
            largest_g: during
                .map(|(_, a)| specific_force(a).norm())
                .fold(0.0, f64::max)
                / GRAVITY,
        })
    }

    /// Difference between the wind of the highest circle and that at the end of the fall, in deviations; they include
    /// both estimates and the possible change of wind over the height between.
    pub fn winds_apart(&self) -> Option<f64> {
        let circle: &Wind = &self.circles.first()?.wind;
        let fall = self.wind.values.last()?;
        let layers = (fall.height - circle.height).abs() / 500.0;
        let squares: f64 = (0..2)
            .map(|axis| {
                let variance =
                    fall.deviation[axis].powi(2) + circle.deviation[axis].powi(2) + 4.0 * layers;
                (fall.velocity[axis] - circle.velocity[axis]).powi(2) / variance
            })
            .sum();
        Some((0.5 * squares).sqrt())
    }
}
