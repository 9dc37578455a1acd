//! Simulates a fall with the drag, lift and wind determined from it or from its first part.

use bodyflight_core::air::{Air, GRAVITY};
use bodyflight_core::dynamics::point_mass::PointMass;
use bodyflight_core::frame::Vector;
use nalgebra::Vector3;
use serde::Serialize;

use crate::Sample;
use crate::atmosphere::Atmosphere;
use crate::drag::{Piece, upwards};
use crate::wind::Profile;

/// Longest integration step (s).
const STEP: f64 = 0.05;

/// Largest error with which a prediction counts as held, as a fraction of the fall rate.
const HOLDS: f64 = 0.05;

/// Smallest change of drag, or of lift as a fraction of the drag, that counts as another posture: a tenth, which
/// changes the fall rate by a twentieth.
const CHANGE: f64 = 0.1;

/// Number of combined standard deviations of both pieces that such a change must exceed as well.
const CERTAIN: f64 = 3.0;

/// Variation of the fall rate from one minute to the next within one posture, as a fraction.
const BREATH: f64 = 0.02;

/// Assumed change of the fall rate by a change of posture if none has been seen yet, as a fraction. Falls in public
/// tracks reach about 53 m/s belly to earth and at least 71 m/s upright; this is half of the difference. The sink speed of
/// a flyer who glides is mostly between 10 and 22 m/s; with a deviation for 8 to 25 m/s (0.3), all of 12 public flights from
/// aircraft lay within one.
const UNSEEN: f64 = 0.17;
const UNSEEN_GLIDING: f64 = 0.22;

/// Drag factor of a belly flyer (m2/kg). Falls that are faster or slower are most likely to change towards it: a speed
/// skydiver must brake before the opening.
const USUAL: f64 = 1.0 / 153.0;

/// Share of a part of a fall that a change at an unknown time affects, in the mean square.
const AFFECTED: f64 = 1.0 / 3.0;

/// Outcome of a prediction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The prediction agrees with the last third of the fall.
    Held,
    /// The posture changed in the last third; the first two thirds determine only how often that happens.
    PostureChanged,
    /// The posture was kept, but the fall rate differs from the prediction.
    Missed,
}

/// A fall rate predicted from the preceding part of the fall alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Forecast {
    /// Start of the predicted part (s).
    pub from: f64,
    /// Predicted mean downward speed over that part (m/s).
    pub rate: f64,
    /// Standard deviation of the prediction (m/s), from earlier posture changes.
    pub deviation: f64,
    /// Measured mean downward speed (m/s).
    pub measured: f64,
    /// The piece that the prediction continues.
    pub made_with: Piece,
    /// Number of earlier posture changes, after the fall had gathered speed.
    pub changes: usize,
    /// Probability that the posture stays over the predicted part, if changes continue at the same rate.
    pub kept_chance: f64,
}

impl Forecast {
    /// Predicts the fall rate of `after`, of which only times and the first `velocity` (m/s) are used, from the last of
    /// the `pieces` before it. Pieces before `steady` (s) do not count as postures. `None` without pieces or samples, or if
    /// the motion by these pieces grows without limit, as that of an engine's thrust taken for drag.
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
        // Posture changes are assumed to continue as before.
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
        // Half a change is added to those seen, since seeing none in a short time is weak evidence.
        let often = (changes as f64 + 0.5) / f64::max(time, 1.0);
        let kept_chance = (-often * (until - from)).exp();
        let unseen = (1.0 - kept_chance) * unseen(&made_with);
        let deviation = rate.abs() * (postures + unseen + own + BREATH * BREATH).sqrt();
        (rate.is_finite() && deviation.is_finite()).then(|| Self {
            from,
            rate,
            deviation,
            measured: mean(after.iter().map(|sample| -sample.velocity.z).sum()),
            made_with,
            changes,
            kept_chance,
        })
    }

    /// Difference between measured and predicted rate, as a fraction and in deviations.
    fn off(&self) -> [f64; 2] {
        let off = self.measured - self.rate;
        [off / self.measured, off / self.deviation]
    }
}

/// Mean square of the change of the fall rate, as a fraction, when this posture is given up.
fn unseen(piece: &Piece) -> f64 {
    if piece.lift.abs() > 0.0 {
        return UNSEEN_GLIDING * UNSEEN_GLIDING;
    }
    let usual = sinks(&Piece {
        drag: USUAL,
        ..*piece
    });
    let change = usual / sinks(piece) - 1.0;
    UNSEEN * UNSEEN + AFFECTED * (change * change).min(1.0)
}

/// Steady sink speed of a piece, up to a factor of mass and density, from drag and lift together.
fn sinks(piece: &Piece) -> f64 {
    let drag = piece.drag.max(1e-4);
    drag / drag.hypot(piece.lift).powf(1.5)
}

/// Trial predictions at many times of one fall, which test whether their error bars are accurate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Trials {
    /// Number of predictions made.
    pub made: usize,
    /// Number of those within 5 % of the fall rate.
    pub held: usize,
    /// Number within one deviation.
    pub within_one: usize,
    /// Number within two deviations.
    pub within_two: usize,
}

impl Trials {
    /// Counts a prediction if one was made.
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

/// The last third of the fall, predicted from the first two.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Prediction {
    /// Outcome of the prediction.
    pub outcome: Outcome,
    /// The outcome in a sentence.
    pub sentence: String,
    /// Predicted mean downward speed in the last third if the posture stays (m/s).
    pub predicted_mps: f64,
    /// Standard deviation of the prediction, from earlier posture changes (m/s).
    pub deviation_mps: f64,
    /// Measured mean downward speed (m/s).
    pub measured_mps: f64,
    /// Number of posture changes in the first two thirds.
    pub changes_before: usize,
    /// Probability that the posture stays over the last third, if changes continue at the same rate.
    pub kept_chance: f64,
    /// Predictions for the fall ended earlier, at many times.
    pub trials: Trials,
}

impl Prediction {
    /// Judges a prediction by the pieces of the last third; `begin` is the start of the fall (s).
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

/// Whether two pieces have different postures.
fn is_other(one: &Piece, other: &Piece) -> bool {
    let least = (CHANGE * one.drag).max(CERTAIN * one.deviation.hypot(other.deviation));
    (other.drag - one.drag).abs() > least || (other.lift - one.lift).abs() > least
}

/// Parameters of the simulation of a fall.
pub struct Flown<'a> {
    /// Drag and lift over time; the last piece continues.
    pub pieces: &'a [Piece],
    /// Wind over height; the lowest value continues to the ground.
    pub wind: &'a Profile,
    /// Air density over height.
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

    /// Simulated velocities at the times of `samples`, starting at the first with `velocity` (m/s).
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
    fn a_miss_is_attributed_to_the_posture_only_if_it_changed() {
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
