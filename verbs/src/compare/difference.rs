//! A difference of a joint with its effect, and how far that can be believed.

use serde::Serialize;

use super::effect::Means;

/// Effects that count the same when differences are ranked: turn rate (rad/s), fall rate, horizontal speed (m/s), pitch (rad).
const ALIKE: [f64; 4] = [0.5, 2.0, 3.0, 0.2];

/// How far an effect can be believed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Trust {
    /// It exceeds two standard deviations, and the gaps between model and recordings are smaller.
    Sound,
    /// Errors of the joints or of the person's body explain it.
    Uncertain,
    /// The model misses one of the recordings by more than the effect.
    ModelGap,
    /// It could not be simulated.
    NotFlown,
}

/// A difference of a joint, and what it does.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Difference {
    /// Name of joint and angle, as for `simulate --joint`.
    pub joint: String,
    /// When it begins and ends (s, relative to the event).
    pub time_s: [f64; 2],
    /// Mean of how much further the joint is turned in B, over at most 2 s from its beginning (rad).
    pub difference_rad: f64,
    /// Standard deviation of it (rad).
    pub deviation_rad: f64,
    /// The effect by the model: a run of A with this angle as in B minus A's own run, means over the time below.
    pub effect: Option<Means>,
    /// Standard deviations of the effect.
    pub effect_deviation: Option<Means>,
    /// Time over which effects are averaged (s).
    pub over_s: f64,
    /// B minus A as recorded, over the same time.
    pub measured: Option<Means>,
    /// What the model misses A and B by over this time: simulated minus recorded.
    pub model_gap: Option<[Means; 2]>,
    /// How far the effect can be believed.
    pub trust: Trust,
    /// The difference and its effect in words.
    pub words: String,
}

/// The part of an effect that says most, and its size.
pub(super) fn lead(effect: &Means) -> (usize, f64) {
    let sizes = effect
        .numbers()
        .into_iter()
        .zip(ALIKE)
        .map(|(number, alike)| (number / alike).abs());
    sizes
        .enumerate()
        .max_by(|x, y| x.1.total_cmp(&y.1))
        .unwrap_or((0, 0.0))
}

/// Whether an effect stands out from its error and from the gaps of the model.
pub(super) fn trust(effect: &Means, deviation: &Means, gaps: &[Means; 2]) -> Trust {
    let (k, _) = lead(effect);
    let size = effect.numbers()[k].abs();
    if size <= 2.0 * deviation.numbers()[k] {
        Trust::Uncertain
    } else if gaps.iter().any(|gap| gap.numbers()[k].abs() > size) {
        Trust::ModelGap
    } else {
        Trust::Sound
    }
}
