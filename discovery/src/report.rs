//! What discovery found, in numbers for people and machines.

use std::collections::BTreeMap;

use bodyflight_core::effect::{Effect, PARAMETER_COUNT};
use schemars::JsonSchema;
use serde::{Serialize, Serializer};

use super::adjustment::{Adjustment, JointCalibration};
use super::description::told::Described;
use super::effect_set::EffectSet;
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

/// How a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, JsonSchema, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// Effects were found that explain the disagreement.
    Named,
    /// Model and data agree to the noise, as the files are.
    None,
    /// Model and data agree once joints, subject and coefficients are adjusted within their tolerances.
    Calibrated,
    /// A load that is not in the library explains the disagreement.
    Described,
    /// There is a disagreement, and nothing in the library explains it.
    Unexplained,
    /// Not enough excitation to tell effects apart.
    Thin,
}

impl Outcome {
    /// `agrees` says whether the plain model does, `explained` whether what was named explains enough.
    pub(super) const fn of(thin: bool, agrees: bool, named: &[Named], explained: bool) -> Self {
        match (thin, named.is_empty()) {
            (true, _) => Self::Thin,
            (false, true) if agrees => Self::None,
            (false, false) if explained => Self::Named,
            (false, _) => Self::Unexplained,
        }
    }

    /// Effects that were named, or what only came nearest.
    pub(super) fn split(self, named: Vec<Named>) -> (Vec<Named>, Vec<Named>) {
        match self {
            Self::Named => (named, Vec::new()),
            _ => (Vec::new(), named),
        }
    }
}

/// Share of what there is to explain, the misfit of the plain model beyond the one expected, that a fit explains.
pub(super) fn share_explained(plain: f64, left: f64, expected: f64) -> f64 {
    let to_explain = plain - expected;
    if to_explain > 0.0 {
        (plain - left) / to_explain
    } else {
        0.0
    }
}

/// Another effect that explains as much.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Rival {
    /// Its name.
    pub name: &'static str,
    /// What it explains, over what the named one does.
    pub share: f64,
}

/// Numbers by name as a map, in their order.
fn as_map<S: Serializer>(
    numbers: &[(&'static str, f64)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(numbers.iter().copied())
}

/// Why an effect got its name.
#[derive(Debug, Clone, Copy, PartialEq, JsonSchema, Serialize)]
pub struct Evidence {
    /// Deviations by which its gain is beyond chance.
    #[serde(rename = "confidence")]
    pub deviations: f64,
    /// Probability that some effect of the library gains as much in a flight in which nothing is missing, where such
    /// flights were drawn.
    pub chance: Option<f64>,
    /// Share of flights put together from blocks of this one in which it, or a rival, comes out first, where they were.
    pub stability: Option<f64>,
    /// Share of what was left to explain.
    pub explains: f64,
}

/// An effect that was named.
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
    /// Why.
    #[serde(flatten)]
    pub evidence: Evidence,
    /// Effects that cannot be told from it on this flight.
    pub rivals: Vec<Rival>,
    /// The maneuver that would tell them apart.
    pub separated_by: &'static str,
    /// Whether a parameter stands at an end of its plausible range: then the effect is not all that is missing.
    pub at_limit: bool,
    /// Whether conscious muscle input or damping could imitate it, so that an estimator would take it for that.
    pub imitated_by_inputs: bool,
    #[serde(skip)]
    effect: Effect,
}

impl Named {
    pub(super) fn new(effect: Effect, evidence: Evidence, rivals: Vec<Rival>) -> Self {
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

    /// With its parameters and their standard errors.
    pub(super) fn with_parameters(
        self,
        values: &[f64; PARAMETER_COUNT],
        errors: &[f64; PARAMETER_COUNT],
    ) -> Self {
        let parameters = self.effect.description().parameters;
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

/// How large the errors of a flight were found to be.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct ErrorSizes {
    /// Noise of single frames: attitude (rad), angular velocity (rad/s), horizontal and vertical velocity (m/s).
    pub sensors: [f64; 4],
    /// The same as neighbouring frames of the recording show it.
    pub sensors_recorded: [f64; 4],
    /// Calibration of a joint about an axis (degrees).
    pub joint_calibration_deg: f64,
    /// Wander of a joint about an axis, root mean square (degrees).
    pub joint_wander_deg: f64,
    /// Error of a joint with its bend (share).
    pub joint_bend: f64,
    /// Moment and force that push, each tenth of a second for itself (N m, N).
    pub pushes: [f64; 2],
    /// Misfit with these errors, by the number of what is compared: one where they are right.
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

/// A flight that effects were not fitted to.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct HeldOut {
    /// By how much the effects named raise the logarithm of its likelihood.
    pub gain: f64,
    /// By channel.
    pub gap: Gap,
    /// What is left in it.
    pub remainder: Remainder,
}

/// What discovery found.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Report {
    /// How it ended.
    pub verdict: Outcome,
    /// Effects that were named, in the order in which they were found.
    pub effects: Vec<Named>,
    /// What came nearest where the verdict is not `named`; not in the model.
    pub nearest: Vec<Named>,
    /// Share of what can be explained at all that the effects explain.
    pub explained: f64,
    /// Misfit of the model as in the files with the noise of the sensors alone, by the number of what is compared.
    pub misfit_unadjusted: f64,
    /// Errors of the flights, each.
    pub errors: Vec<ErrorSizes>,
    /// What subject, coefficients and sensors have wrong, what is worth most first.
    pub adjustments: Vec<Adjustment>,
    /// Joints whose calibration is off, the surest first.
    pub joints: Vec<JointCalibration>,
    /// Gap of the (first) flight.
    pub gap: Gap,
    /// Flights held out.
    pub held_out: Vec<HeldOut>,
    /// Where the model disagrees.
    pub residual_map: Vec<Spot>,
    /// What is left of the flights, each.
    pub remainders: Vec<Remainder>,
    /// Loads that describe what nothing in the library explains.
    pub description: Option<Described>,
    /// Loads that come nearest to it and do not do enough, or not in the flights held out; not in the model.
    pub nearest_description: Option<Described>,
    /// What to fly next, in words.
    pub fly_next: String,
    /// The effects as in `model.toml`.
    pub model: Vec<ByName>,
    /// What tolerance and flights together say of mass and coefficients, as effects of a `model.toml`.
    pub corrections: Vec<ByName>,
}

/// An effect with its parameters, by their names in files.
pub type ByName = (&'static str, Vec<(&'static str, f64)>);

/// The effect by name.
pub fn by_name(effect: Effect, values: &[f64; PARAMETER_COUNT]) -> ByName {
    let description = effect.description();
    let parameters = description.parameters.iter().zip(values);
    let parameters = parameters.map(|(parameter, value)| (parameter.name, *value));
    (description.name, parameters.collect())
}

/// Effects by the names of files.
pub(super) fn model_of(effects: &EffectSet) -> Vec<ByName> {
    let by_name = |(effect, values): &(Effect, _)| by_name(*effect, values);
    effects.iter().map(by_name).collect()
}
