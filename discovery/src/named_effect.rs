//! How a search for missing effects reports: its outcome, and the effects that it names with the evidence for each.

use bodyflight_core::effect::{Effect, PARAMETER_COUNT, Parameter};
use serde::{Serialize, Serializer};

/// Effects with their parameters.
pub type EffectSet = Vec<(Effect, [f64; PARAMETER_COUNT])>;

/// The outcome of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
    /// Splits into effects that are named and those that only came nearest.
    pub fn split(self, named: Vec<Named>) -> (Vec<Named>, Vec<Named>) {
        match self {
            Self::Named => (named, Vec::new()),
            _ => (Vec::new(), named),
        }
    }
}

/// Serializes pairs as a map, keeping their order.
pub(crate) fn as_map<T: Serialize + Copy, S: Serializer>(
    numbers: &[(&'static str, T)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(numbers.iter().copied())
}

/// Evidence for a named effect.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct EffectEvidence {
    /// Natural logarithm of the odds that it acts, given all flights, which decides whether it is named.
    pub log_odds: f64,
    /// The same as the probability that it does not act: the local false discovery rate.
    pub false_discovery_rate: f64,
    /// Share of the remaining disagreement that it explains.
    pub explains: f64,
}

/// Another effect that explains about as much.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Rival {
    /// Its name.
    pub name: &'static str,
    /// Probability that it acts instead, given that the named effect or a rival acts.
    pub share: f64,
}

/// A named effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Named {
    /// Its name.
    pub name: &'static str,
    /// Parameters by name.
    #[serde(serialize_with = "as_map")]
    #[cfg_attr(
        feature = "schema",
        schemars(with = "std::collections::BTreeMap<String, f64>")
    )]
    pub parameters: Vec<(&'static str, f64)>,
    /// Their standard errors.
    #[serde(serialize_with = "as_map")]
    #[cfg_attr(
        feature = "schema",
        schemars(with = "std::collections::BTreeMap<String, f64>")
    )]
    pub standard_errors: Vec<(&'static str, f64)>,
    /// The evidence.
    #[serde(flatten)]
    pub evidence: EffectEvidence,
    /// Effects that this flight cannot distinguish from it.
    pub rivals: Vec<Rival>,
    /// The maneuver that would tell them apart.
    pub separated_by: &'static str,
    /// Whether a parameter is at a limit of its plausible range, so that the effect cannot be all that is missing.
    pub at_limit: bool,
    /// Whether muscle input or damping could imitate it, so that an estimator would mistake it for those.
    pub imitated_by_inputs: bool,
}

impl Named {
    /// Creates an effect without its parameters.
    pub fn new(effect: Effect, evidence: EffectEvidence, rivals: Vec<Rival>) -> Self {
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
        }
    }

    /// The effect with those of its parameters that were estimated, and their standard errors.
    #[must_use]
    pub fn with_parameters(
        self,
        parameters: &[Parameter],
        values: &[f64; PARAMETER_COUNT],
        errors: &[f64; PARAMETER_COUNT],
    ) -> Self {
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
pub fn model_of(effects: &EffectSet) -> Vec<ByName> {
    let by_name = |(effect, values): &(Effect, _)| by_name(*effect, values);
    effects.iter().map(by_name).collect()
}
