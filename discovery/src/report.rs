//! The report of a search, for people and machines.

use std::collections::BTreeMap;

use bodyflight_core::effect::{Effect, PARAMETER_COUNT};
use schemars::JsonSchema;
use serde::{Serialize, Serializer};

use super::adjustment::{Adjustment, JointCalibration};
use super::candidate::Candidate;
use super::description::told::Described;
use super::effect_set::{EffectSet, estimated};
use super::error_model::PUSH;
use super::fitted::Fitted;
use super::gap::{Gap, Spot};
use super::problem::Problem;
use super::remainder::Remainder;
use super::stretch::CHANNELS;

/// Names of the channels, with units.
pub const CHANNEL_NAMES: [&str; CHANNELS] = [
    "attitude_x_rad",
    "attitude_y_rad",
    "attitude_z_rad",
    "angular_velocity_x_radps",
    "angular_velocity_y_radps",
    "angular_velocity_z_radps",
    "velocity_north_mps",
    "velocity_west_mps",
    "velocity_up_mps",
];

/// The outcome of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, JsonSchema, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The effects found explain the disagreement.
    Named,
    /// Model and data agree to within the noise, with the files as they are.
    None,
    /// Model and data agree once joints, subject and coefficients are adjusted within their tolerances.
    Calibrated,
    /// A load that is not in the library explains the disagreement.
    Described,
    /// There is a disagreement that nothing in the library explains.
    Unexplained,
    /// Not enough excitation to tell effects apart.
    Thin,
}

impl Outcome {
    /// `agrees` says whether the plain model agrees, `explained` whether the named effects explain enough.
    pub(super) const fn of(thin: bool, agrees: bool, named: &[Named], explained: bool) -> Self {
        match (thin, named.is_empty()) {
            (true, _) => Self::Thin,
            (false, true) if agrees => Self::None,
            (false, false) if explained => Self::Named,
            (false, _) => Self::Unexplained,
        }
    }

    /// Splits into effects that are named and those that only came nearest.
    pub(super) fn split(self, named: Vec<Named>) -> (Vec<Named>, Vec<Named>) {
        match self {
            Self::Named => (named, Vec::new()),
            _ => (Vec::new(), named),
        }
    }
}

/// Share of the excess misfit, that of the plain model above the expected one, that a fit explains.
pub(super) fn share_explained(plain: f64, left: f64, expected: f64) -> f64 {
    let to_explain = plain - expected;
    if to_explain > 0.0 {
        (plain - left) / to_explain
    } else {
        0.0
    }
}

/// Another effect that explains about as much.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Rival {
    /// Its name.
    pub name: &'static str,
    /// Its gain relative to that of the named effect.
    pub share: f64,
}

impl Rival {
    pub(super) fn new(candidate: &Candidate, best: &Candidate) -> Self {
        Self {
            name: candidate.effect.description().name,
            share: candidate.total() / best.total(),
        }
    }
}

/// Serializes pairs as a map, keeping their order.
fn as_map<S: Serializer>(
    numbers: &[(&'static str, f64)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(numbers.iter().copied())
}

/// Evidence for a named effect.
#[derive(Debug, Clone, Copy, PartialEq, JsonSchema, Serialize)]
pub struct Evidence {
    /// Significance of its gain, in standard deviations.
    #[serde(rename = "confidence")]
    pub deviations: f64,
    /// Probability that some effect of the library gains as much in a flight that lacks nothing, if such flights were
    /// drawn.
    pub chance: Option<f64>,
    /// Share of bootstrap flights, assembled from blocks of this one, in which it or a rival ranks first, if they were
    /// drawn.
    pub stability: Option<f64>,
    /// Share of the remaining disagreement that it explains.
    pub explains: f64,
}

/// A named effect.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Named {
    /// Its name.
    pub name: &'static str,
    /// Parameters by name.
    #[serde(serialize_with = "as_map")]
    #[schemars(with = "BTreeMap<String, f64>")]
    pub parameters: Vec<(&'static str, f64)>,
    /// Their standard errors.
    #[serde(serialize_with = "as_map")]
    #[schemars(with = "BTreeMap<String, f64>")]
    pub standard_errors: Vec<(&'static str, f64)>,
    /// The evidence.
    #[serde(flatten)]
    pub evidence: Evidence,
    /// Effects that this flight cannot distinguish from it.
    pub rivals: Vec<Rival>,
    /// The maneuver that would tell them apart.
    pub separated_by: &'static str,
    /// Whether a parameter is at a limit of its plausible range, so that the effect cannot be all that is missing.
    pub at_limit: bool,
    /// Whether muscle input or damping could imitate it, so that an estimator would mistake it for those.
    pub imitated_by_inputs: bool,
    #[serde(skip)]
    effect: Effect,
}

impl Named {
    /// Creates an effect without its parameters.
    pub fn new(effect: Effect, evidence: Evidence, rivals: Vec<Rival>) -> Self {
        let description = effect.description();
        let inputs = [Effect::Muscle, Effect::Damping].map(|input| input.description().name);
        let imitated = |name: &str| inputs.contains(&name);
        Self {
            name: description.name,
            parameters: Vec::new(),
            standard_errors: Vec::new(),
            evidence,
            imitated_by_inputs: description.confused_with.iter().any(|name| imitated(name))
                || rivals.iter().any(|rival| imitated(rival.name)),
            rivals,
            separated_by: description.separated_by,
            at_limit: false,
            effect,
        }
    }

    /// The effect with its parameters and their standard errors.
    pub(super) fn with_parameters(
        self,
        values: &[f64; PARAMETER_COUNT],
        errors: &[f64; PARAMETER_COUNT],
    ) -> Self {
        let parameters = estimated(self.effect);
        let names = parameters.iter().map(|p| p.name);
        Self {
            at_limit: parameters
                .iter()
                .zip(values)
                .any(|(p, value)| *value >= p.high || (*value <= p.low && !p.is_one_sided())),
            parameters: names.clone().zip(*values).collect(),
            standard_errors: names.zip(*errors).collect(),
            ..self
        }
    }
}

/// Estimated sizes of the errors in a flight.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct ErrorSizes {
    /// Noise of single frames: attitude (rad), angular velocity (rad/s), horizontal and vertical velocity (m/s).
    pub sensors: [f64; 4],
    /// The same, estimated from differences of neighbouring frames.
    pub sensors_recorded: [f64; 4],
    /// Calibration of a joint about an axis (degrees).
    pub joint_calibration_deg: f64,
    /// Wander of a joint about an axis, root mean square (degrees).
    pub joint_wander_deg: f64,
    /// Joint error proportional to the bend (fraction).
    pub joint_bend: f64,
    /// Unknown moment and force in each tenth of a second (N m, N).
    pub pushes: [f64; 2],
    /// Misfit per observation with these errors; one if they are right.
    pub misfit: f64,
}

impl ErrorSizes {
    pub(super) fn new(problem: &Problem<'_>, fitted: &Fitted) -> Self {
        let errors = &fitted.errors;
        Self {
            sensors: core::array::from_fn(|k| errors.sizes[k].sqrt()),
            sensors_recorded: problem.noise,
            joint_calibration_deg: errors.spread.calibration.to_degrees(),
            joint_wander_deg: errors.wander().to_degrees(),
            joint_bend: errors.spread.bend,
            pushes: PUSH.map(|k| errors.sizes[k].sqrt()),
            misfit: errors.misfit(),
        }
    }
}

/// A held-out flight.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct HeldOut {
    /// Gain of log-likelihood with the named effects.
    pub gain: f64,
    /// The gap by channel.
    pub gap: Gap,
    /// Its residual.
    pub remainder: Remainder,
}

/// The report of a search.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Report {
    /// The outcome.
    pub verdict: Outcome,
    /// The named effects, in the order in which they were found.
    pub effects: Vec<Named>,
    /// The closest candidates if the verdict is not `named`. They are not part of the model. If the verdict is
    /// `calibrated`, the effect that may be the cause of the adjustments, if there is one.
    pub nearest: Vec<Named>,
    /// Share of the explainable disagreement that the effects explain.
    pub explained: f64,
    /// Misfit per observation of the model as given by the files, with sensor noise alone.
    pub misfit_unadjusted: f64,
    /// Error sizes of each flight.
    pub errors: Vec<ErrorSizes>,
    /// Errors found in subject, coefficients and sensors, most significant first.
    pub adjustments: Vec<Adjustment>,
    /// Joints with a significant calibration error, most significant first.
    pub joints: Vec<JointCalibration>,
    /// The gap of the first flight.
    pub gap: Gap,
    /// The held-out flights.
    pub held_out: Vec<HeldOut>,
    /// The disagreement in each stretch.
    pub residual_map: Vec<Spot>,
    /// The residual of each flight.
    pub remainders: Vec<Remainder>,
    /// Loads that describe what nothing in the library explains.
    pub description: Option<Described>,
    /// The best description found if it does not explain enough, here or in the held-out flights. It is not part of the
    /// model.
    pub nearest_description: Option<Described>,
    /// What to fly next.
    pub fly_next: String,
    /// The effects as written to `model.toml`.
    pub model: Vec<ByName>,
    /// Mass and coefficients, estimated from tolerances and flights combined, as effects of a `model.toml`.
    pub corrections: Vec<ByName>,
}

/// An effect with its parameters, by their names in files.
pub type ByName = (&'static str, Vec<(&'static str, f64)>);

/// An effect with its parameter names.
pub fn by_name(effect: Effect, values: &[f64; PARAMETER_COUNT]) -> ByName {
    let description = effect.description();
    let parameters = description.parameters.iter().zip(values);
    let parameters = parameters.map(|(parameter, value)| (parameter.name, *value));
    (description.name, parameters.collect())
}

/// Effects with their names as in files.
pub(super) fn model_of(effects: &EffectSet) -> Vec<ByName> {
    let by_name = |(effect, values): &(Effect, _)| by_name(*effect, values);
    effects.iter().map(by_name).collect()
}
