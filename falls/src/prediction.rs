//! A fall flown again, with the drag, lift and wind that were told from it or from its first part.

use bodyflight_core::air::{Air, Density, GRAVITY};
use bodyflight_core::dynamics::point_mass::PointMass;
use bodyflight_core::frame::Vector;
use nalgebra::Vector3;
use serde::Serialize;

use crate::Sample;
use crate::atmosphere::Atmosphere;
use crate::drag::{Piece, upwards};
use crate::wind::Profile;

/// Longest step (s).
const STEP: f64 = 0.05;

/// How near a prediction is that holds: share of the fall rate.
const HOLDS: f64 = 0.05;

/// Least change of the drag, or of the lift beside it, that is another posture: a tenth, for a twentieth of the fall rate.
const CHANGE: f64 = 0.1;

/// So many deviations of both pieces a change must be apart.
const CERTAIN: f64 = 3.0;

/// What became of a prediction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The last third was flown as predicted.
    Held,
    /// It was flown in another posture, of which the first two thirds say nothing: there is no prediction.
    PostureChanged,
    /// It was flown in the same posture, and otherwise than predicted.
    Missed,
}

/// The last third of the fall, predicted from what the first two tell.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Prediction {
    /// What became of it.
    pub outcome: Outcome,
    /// That in a sentence.
    pub sentence: String,
    /// Mean speed downwards of the last third, predicted (m/s); `None` where the posture changed.
    pub predicted_mps: Option<f64>,
    /// Standard deviation of it, as far as postures changed before (m/s).
    pub deviation_mps: Option<f64>,
    /// As it was (m/s).
    pub measured_mps: f64,
}

impl Prediction {
    /// A prediction, its deviation and what was measured (m/s), judged by the piece that it was made with and by those of the
    /// last third; `begin` is the start of the fall (s).
    pub fn judged(rates: [f64; 3], made_with: &Piece, late: &[Piece], begin: f64) -> Self {
        let [predicted, deviation, measured] = rates;
        let off = predicted / measured - 1.0;
        let changed = late.iter().find(|piece| is_other(made_with, piece));
        let (outcome, sentence) = match changed {
            _ if off.abs() <= HOLDS => {
                (Outcome::Held, format!("predicted to {:+.1} %", 100.0 * off))
            }
            Some(piece) => (
                Outcome::PostureChanged,
                format!(
                    "posture changed {:.0} s after the start of the fall, drag by {:+.0} % and lift by {:+.0} % of the drag: \
                     what was flown before says nothing of it",
                    (piece.time[0] - begin).max(0.0),
                    100.0 * (piece.drag / made_with.drag - 1.0),
                    100.0 * (piece.lift - made_with.lift) / made_with.drag
                ),
            ),
            None => (
                Outcome::Missed,
                format!(
                    "missed by {:+.1} %, though no change of posture is seen",
                    100.0 * off
                ),
            ),
        };
        let told = outcome != Outcome::PostureChanged;
        Self {
            outcome,
            sentence,
            predicted_mps: told.then_some(predicted),
            deviation_mps: told.then_some(deviation),
            measured_mps: measured,
        }
    }
}

/// Whether two pieces are of different postures.
fn is_other(one: &Piece, other: &Piece) -> bool {
    let least = (CHANGE * one.drag).max(CERTAIN * one.deviation.hypot(other.deviation));
    (other.drag - one.drag).abs() > least || (other.lift - one.lift).abs() > least
}

/// What a fall is flown with.
pub struct Flown<'a> {
    /// Drag and lift over time; the last goes on.
    pub pieces: &'a [Piece],
    /// Wind over the height; the lowest goes on.
    pub wind: &'a Profile,
    /// Density over the height.
    pub atmosphere: &'a Atmosphere,
}

impl Flown<'_> {
    fn acceleration(
        &self,
        time: f64,
        position: &Vector3<f64>,
        velocity: &Vector3<f64>,
    ) -> Vector3<f64> {
        let later = self.pieces.partition_point(|piece| piece.time[1] < time);
        let Some(piece) = self.pieces.get(later).or(self.pieces.last()) else {
            return Vector3::z() * -GRAVITY;
        };
        let air = self
            .wind
            .at(position.z)
            .map_or_else(Vector3::zeros, |wind| {
                Vector3::new(wind.velocity.x, wind.velocity.y, 0.0)
            });
        let density = self.atmosphere.density(position.z);
        let point = PointMass {
            air: Air {
                density: Density::Constant(density),
                velocity: Vector::from_components(air),
                profile: 0.0,
            },
            drag_area: piece.drag,
            mass: 1.0,
            gravity: GRAVITY,
        };
        let position = Vector::from_components(*position);
        let dragged = point.acceleration(&position, &Vector::from_components(*velocity));
        let stream = velocity - air;
        let lift = upwards(&stream).map_or_else(Vector3::zeros, |up| {
            up * (0.5 * density * stream.norm_squared() * piece.lift)
        });
        dragged.components + lift
    }

    /// Velocities at the times of `samples`, from the first of them on, started at `velocity` (m/s).
    pub fn velocities(&self, samples: &[Sample], velocity: Vector3<f64>) -> Vec<Vector3<f64>> {
        let mut velocities = Vec::with_capacity(samples.len());
        let Some(first) = samples.first() else {
            return velocities;
        };
        let (mut time, mut position, mut velocity) = (first.time, first.position, velocity);
        for sample in samples {
            let steps = ((sample.time - time) / STEP).ceil().max(1.0);
            let duration = (sample.time - time) / steps;
            let mut left = steps;
            while left > 0.5 {
                let half = 0.5 * duration;
                let start = self.acceleration(time, &position, &velocity);
                let middle = self.acceleration(
                    time + half,
                    &(position + velocity * half),
                    &(velocity + start * half),
                );
                position += (velocity + start * half) * duration;
                velocity += middle * duration;
                time += duration;
                left -= 1.0;
            }
            velocities.push(velocity);
        }
        velocities
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(from: f64, drag: f64) -> Piece {
        Piece {
            time: [from, from + 20.0],
            drag,
            deviation: 1e-5,
            lift: 0.0,
            glide: 0.1,
        }
    }

    #[test]
    fn a_miss_is_put_down_to_the_posture_only_where_it_changed() {
        let before = piece(10.0, 0.0065);
        let judged = |rates, late: Piece| Prediction::judged(rates, &before, &[late], 10.0);
        let held = judged([54.0, 1.0, 53.0], piece(40.0, 0.0066));
        assert_eq!(held.outcome, Outcome::Held);
        let braked = judged([54.0, 1.0, 44.0], piece(40.0, 0.0098));
        assert_eq!(braked.outcome, Outcome::PostureChanged);
        assert_eq!(braked.predicted_mps, None);
        assert!(
            braked.sentence.contains("posture changed 30 s"),
            "{}",
            braked.sentence
        );
        let missed = judged([54.0, 1.0, 50.0], piece(40.0, 0.0066));
        assert_eq!(missed.outcome, Outcome::Missed);
        assert_eq!(missed.predicted_mps, Some(54.0));
    }
}
