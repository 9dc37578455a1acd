//! A fall flown again, with the drag, lift and wind that were told from it or from its first part.

use bodyflight_core::air::{Air, GRAVITY};
use bodyflight_core::dynamics::point_mass::PointMass;
use bodyflight_core::frame::Vector;
use nalgebra::Vector3;
use schemars::JsonSchema;
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

/// What the drag of one posture does to the fall rate from one minute to the next: share of it.
const BREATH: f64 = 0.02;

/// What a change of posture does to the fall rate where none was seen yet: share of it. Public falls are at about 53 m/s
/// belly to earth and from 71 m/s on upright; half of that.
const UNSEEN: f64 = 0.17;

/// What became of a prediction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, JsonSchema, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The last third was flown as predicted.
    Held,
    /// It was flown in another posture, of which the first two thirds say nothing but how often that happens.
    PostureChanged,
    /// It was flown in the same posture, and otherwise than predicted.
    Missed,
}

/// A fall rate that was predicted from what was flown before, and nothing else.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Forecast {
    /// When the part that is predicted begins (s).
    pub from: f64,
    /// Mean speed downwards over that part, predicted (m/s).
    pub rate: f64,
    /// Standard deviation of it (m/s): as far as postures changed before.
    pub deviation: f64,
    /// As it was (m/s).
    pub measured: f64,
    /// The piece that goes on in the prediction.
    pub made_with: Piece,
    /// How often the posture changed before, once the fall had gathered speed.
    pub changes: usize,
    /// Chance that it stays over the part that is predicted, if it goes on changing as often.
    pub kept_chance: f64,
}

impl Forecast {
    /// Predicts the fall rate of `after`, of which only times and the first `velocity` (m/s) are used, with the last of the
    /// `pieces` flown before; what came before `steady` (s) is no posture yet. `None` without pieces or samples.
    pub fn made(
        pieces: &[Piece],
        wind: &Profile,
        atmosphere: &Atmosphere,
        after: &[Sample],
        velocity: Vector3<f64>,
        steady: f64,
    ) -> Option<Self> {
        let (made_with, from) = (*pieces.last()?, after.first()?.time);
        let until = after.last()?.time;
        let flown = Flown {
            pieces,
            wind,
            atmosphere,
        };
        let velocities = flown.velocities(after, velocity);
        let mean = |sum: f64| sum / after.len() as f64;
        let rate = mean(velocities.iter().map(|velocity| -velocity.z).sum());
        // What postures did before, they may do again.
        let (mut squares, mut time, mut changes) = (0.0, 0.0, 0);
        let before: Vec<&Piece> = pieces
            .iter()
            .filter(|piece| piece.time[1] > steady)
            .collect();
        for piece in &before {
            let duration = piece.time[1] - piece.time[0].max(steady);
            squares += duration * (sinks(piece) / sinks(&made_with) - 1.0).powi(2);
            time += duration;
        }
        for pair in before.windows(2) {
            changes += usize::from(is_other(pair[0], pair[1]));
        }
        let postures = (squares / f64::max(time, 1.0)).min(1.0);
        let own = (0.5 * made_with.deviation / made_with.drag).powi(2);
        // Half a change more than was seen: none in a short time says little.
        let often = (changes as f64 + 0.5) / f64::max(time, 1.0);
        let kept_chance = (-often * (until - from)).exp();
        let unseen = (1.0 - kept_chance) * UNSEEN * UNSEEN;
        Some(Self {
            from,
            rate,
            deviation: rate.abs() * (postures + unseen + own + BREATH * BREATH).sqrt(),
            measured: mean(after.iter().map(|sample| -sample.velocity.z).sum()),
            made_with,
            changes,
            kept_chance,
        })
    }

    /// How far the measured rate is from the predicted one: share of it, and in deviations.
    fn off(&self) -> [f64; 2] {
        let off = self.measured - self.rate;
        [off / self.measured, off / self.deviation]
    }
}

/// Speed at which a piece sinks when it is steady, but for mass and density: by drag and lift together.
fn sinks(piece: &Piece) -> f64 {
    let drag = piece.drag.max(1e-4);
    drag / drag.hypot(piece.lift).powf(1.5)
}

/// Predictions on trial, at many moments of one fall: whether their error bars are true.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, JsonSchema, Serialize)]
pub struct Trials {
    /// How many were made.
    pub made: usize,
    /// Of them, within 5 % of the fall rate.
    pub held: usize,
    /// Within one deviation.
    pub within_one: usize,
    /// Within two deviations.
    pub within_two: usize,
}

impl Trials {
    /// Counts a prediction in, where one was made.
    pub fn add(&mut self, forecast: Option<&Forecast>) {
        let Some(forecast) = forecast else {
            return;
        };
        let [share, deviations] = forecast.off();
        self.made += 1;
        self.held += usize::from(share.abs() <= HOLDS);
        self.within_one += usize::from(deviations.abs() <= 1.0);
        self.within_two += usize::from(deviations.abs() <= 2.0);
    }
}

/// The last third of the fall, predicted from what the first two tell.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Prediction {
    /// What became of it.
    pub outcome: Outcome,
    /// That in a sentence.
    pub sentence: String,
    /// Mean speed downwards of the last third, predicted for the posture going on (m/s).
    pub predicted_mps: f64,
    /// Standard deviation of it, as far as postures changed before (m/s).
    pub deviation_mps: f64,
    /// As it was (m/s).
    pub measured_mps: f64,
    /// How often the posture changed in the first two thirds.
    pub changes_before: usize,
    /// Chance that it stays over the last third, if it goes on changing as often.
    pub kept_chance: f64,
    /// The same with the fall ended earlier, again and again.
    pub trials: Trials,
}

impl Prediction {
    /// A prediction, judged by the pieces of the last third; `begin` is the start of the fall (s).
    pub fn judged(forecast: &Forecast, late: &[Piece], begin: f64, trials: Trials) -> Self {
        let made_with = &forecast.made_with;
        let [share, deviations] = forecast.off();
        let off = format!(
            "{:+.1} % off, {:.1} deviations",
            -100.0 * share,
            deviations.abs()
        );
        let changed = late.iter().find(|piece| is_other(made_with, piece));
        let (outcome, sentence) = match changed {
            _ if share.abs() <= HOLDS => (Outcome::Held, off),
            Some(piece) => (
                Outcome::PostureChanged,
                format!(
                    "{off}: posture changed {:.0} s after the start of the fall, drag by {:+.0} % and lift by {:+.0} % of \
                     the drag, and what was flown before says nothing of it",
                    (piece.time[0] - begin).max(0.0),
                    100.0 * (piece.drag / made_with.drag - 1.0),
                    100.0 * (piece.lift - made_with.lift) / made_with.drag
                ),
            ),
            None => (
                Outcome::Missed,
                format!("{off}, though no change of posture is seen"),
            ),
        };
        Self {
            outcome,
            sentence,
            predicted_mps: forecast.rate,
            deviation_mps: forecast.deviation,
            measured_mps: forecast.measured,
            changes_before: forecast.changes,
            kept_chance: forecast.kept_chance,
            trials,
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
                velocity: Vector::from_components(air),
                ..Air::still(density)
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
        let judged = |rate, measured, late: Piece| {
            let forecast = Forecast {
                from: 40.0,
                rate,
                deviation: 1.0,
                measured,
                made_with: piece(10.0, 0.0065),
                changes: 0,
                kept_chance: 0.8,
            };
            let mut trials = Trials::default();
            trials.add(Some(&forecast));
            Prediction::judged(&forecast, &[late], 10.0, trials)
        };
        let held = judged(54.0, 53.0, piece(40.0, 0.0066));
        assert_eq!(held.outcome, Outcome::Held);
        let trials = Trials {
            made: 1,
            held: 1,
            within_one: 1,
            within_two: 1,
        };
        assert_eq!(held.trials, trials);
        let braked = judged(54.0, 44.0, piece(40.0, 0.0098));
        assert_eq!(braked.outcome, Outcome::PostureChanged);
        assert!(
            braked.sentence.contains("posture changed 30 s"),
            "{}",
            braked.sentence
        );
        let missed = judged(54.0, 50.0, piece(40.0, 0.0066));
        assert_eq!(missed.outcome, Outcome::Missed);
        assert_eq!((missed.trials.made, missed.trials.within_two), (1, 0));
    }
}
