//! A technique against the best of others: what it costs, and which joint changes it.

use bodyflight_core::Segment;
use bodyflight_core::dynamics::Dynamics;
use nalgebra::DVector;
use serde::Serialize;

use super::agreement::input;
use super::linear::Linear;
use super::response::{Response, response};
use bodyflight_core::body::joint_angle::JointAngle;
use bodyflight_core::dynamics::step::TIME_STEP;

/// Place of the turn rate among the outputs.
pub const TURN: usize = 0;
/// A change that loses more than this share of the gain is no advice.
const KEPT: f64 = 0.5;
/// Bandwidth for the own one from which a change is worth naming.
const WIDER: f64 = 1.02;
/// Changes listed.
const MOST: usize = 6;
/// Length of the simulated turn (s).
const SECONDS: f64 = 2.0;

/// A turning technique in numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Merit {
    /// Turn rate for a slow movement (rad/s per rad), size.
    pub gain: f64,
    /// Bandwidth (Hz); null if above 10.
    pub bandwidth_hz: Option<f64>,
}

impl Merit {
    /// Those of a response.
    pub fn of(response: &Response) -> Self {
        Self {
            gain: response.gain.abs(),
            bandwidth_hz: response.bandwidth_hz,
        }
    }
}

/// A change of one joint in the pattern.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointChange {
    /// The joint, named by its segment.
    pub joint: &'static str,
    /// "leave out", or "as the other": move it as the other flight's pattern does.
    pub change: &'static str,
    /// The technique with the change.
    pub merit: Merit,
}

/// A turn simulated by the full model from the trimmed fall: a smooth step of the pattern in 0.2 s, then held.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Turn {
    /// Angle turned in 2 s (rad), positive to the left.
    pub turned_rad: f64,
    /// Turn rate after 0.5 s (rad/s).
    pub rate_at_half_second_radps: f64,
    /// Turn rate after 2 s (rad/s).
    pub rate_at_end_radps: f64,
}

/// A technique against another.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Against {
    /// The other flight; null if none was given.
    pub best: Option<String>,
    /// Cosine between the two patterns, both signed to turn to the left.
    pub alike: Option<f64>,
    /// The own technique.
    pub own: Merit,
    /// The other technique on this body.
    pub other: Option<Merit>,
    /// Changes of single joints, the most bandwidth first; those that keep at least half of the gain.
    pub changes: Vec<JointChange>,
    /// Step of the patterns in the simulated turns (rad).
    pub step_rad: f64,
    /// The turn with the own pattern; null if it diverges.
    pub own_turn: Option<Turn>,
    /// The turn with the first change.
    pub changed_turn: Option<Turn>,
    /// The turn with the other pattern.
    pub other_turn: Option<Turn>,
}

/// A named pattern of another flight.
#[derive(Debug, Clone)]
pub struct Expert {
    /// The flight.
    pub name: String,
    /// Its turn pattern, in the order of the axes.
    pub weights: DVector<f64>,
}

/// Compares `own` weights with the best of `experts` on the body of `linear`; `step` is the amplitude of the proof (rad).
pub fn against(
    linear: &Linear,
    dynamics: &Dynamics<f64>,
    axes: &[JointAngle],
    own: &DVector<f64>,
    experts: &[Expert],
    step: f64,
) -> Against {
    let turn_of = |weights: &DVector<f64>| response(&linear.of_pattern(weights), TURN, &[]);
    // Patterns have no sign of their own: all turn to the left.
    let signed = |weights: &DVector<f64>| {
        let found = turn_of(weights);
        let sign = if found.gain < 0.0 { -1.0 } else { 1.0 };
        (weights * sign, found)
    };
    let (own, own_response) = signed(own);
    let best = experts
        .iter()
        .map(|expert| (expert, signed(&expert.weights)))
        .max_by(|(_, (_, a)), (_, (_, b))| a.merit().total_cmp(&b.merit()));
    let other = best.as_ref().map(|(_, (weights, _))| weights);
    let changes = single_changes(axes, &own, other);
    let mut ranked: Vec<(JointChange, DVector<f64>, Response)> = changes
        .into_iter()
        // A joint that hardly moves has nothing to leave out.
        .filter(|(_, _, weights)| (weights - &own).norm() > 0.02)
        .map(|(segment, change, weights)| {
            let found = turn_of(&weights);
            let merit = Merit::of(&found);
            let joint = segment.name();
            (
                JointChange {
                    joint,
                    change,
                    merit,
                },
                weights,
                found,
            )
        })
        .filter(|(_, _, found)| found.gain > KEPT * own_response.gain.abs())
        .filter(|(_, _, found)| wide(found) > WIDER * wide(&own_response))
        .collect();
    ranked.sort_by(|(_, _, a), (_, _, b)| {
        wide(b).total_cmp(&wide(a)).then(b.gain.total_cmp(&a.gain))
    });
    let proof = |weights: &DVector<f64>| {
        let amplitude = input(None, step, SECONDS);
        let flown = linear.flown(dynamics, axes, weights, &amplitude)?;
        let rates: Vec<f64> = flown.iter().map(|seen| seen[TURN]).collect();
        Some(Turn {
            turned_rad: rates.iter().sum::<f64>() * TIME_STEP,
            rate_at_half_second_radps: *rates.get(rates.len() / 4)?,
            rate_at_end_radps: *rates.last()?,
        })
    };
    Against {
        best: best.as_ref().map(|(expert, _)| expert.name.clone()),
        alike: other.map(|other| other.dot(&own) / (other.norm() * own.norm())),
        own: Merit::of(&own_response),
        other: best.as_ref().map(|(_, (_, found))| Merit::of(found)),
        step_rad: step,
        own_turn: proof(&own),
        changed_turn: ranked.first().and_then(|(_, weights, _)| proof(weights)),
        other_turn: other.and_then(proof),
        changes: ranked
            .into_iter()
            .take(MOST)
            .map(|(change, _, _)| change)
            .collect(),
    }
}

/// The pattern `own` with each joint left out, and as in `other`.
fn single_changes(
    axes: &[JointAngle],
    own: &DVector<f64>,
    other: Option<&DVector<f64>>,
) -> Vec<(Segment, &'static str, DVector<f64>)> {
    let mut changes = Vec::new();
    for segment in Segment::ALL {
        let with = |value: &dyn Fn(usize) -> f64| {
            DVector::from_iterator(
                axes.len(),
                axes.iter().enumerate().map(|(k, axis)| {
                    if axis.segment == segment {
                        value(k)
                    } else {
                        own[k]
                    }
                }),
            )
        };
        changes.push((segment, "leave out", with(&|_| 0.0)));
        if let Some(other) = other {
            changes.push((segment, "as the other", with(&|k| other[k])));
        }
    }
    changes
}

fn wide(found: &Response) -> f64 {
    found.bandwidth_hz.unwrap_or(super::response::HIGHEST_HZ)
}
