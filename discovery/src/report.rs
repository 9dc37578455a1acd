//! What discovery found, in numbers for people and machines.

use bodyflight_core::effect::{Effect, PARAMETER_COUNT};
use serde::{Serialize, Serializer};

use super::check::{Check, Finding};
use super::effect_set::EffectSet;
use super::gap::{Gap, HeldOutGap, Spot};
use super::momentum::Missing;
use super::regime::{Companion, Regime};
use super::stability::Whiteness;
use super::stretch::CHANNELS;

/// Names of the channels, with units.
pub const CHANNEL_NAMES: [&str; CHANNELS] = [
    "attitude_x_rad",
    "attitude_y_rad",
    "attitude_z_rad",
    "angular_velocity_x_rad_s",
    "angular_velocity_y_rad_s",
    "angular_velocity_z_rad_s",
    "velocity_north_m_s",
    "velocity_west_m_s",
    "velocity_up_m_s",
];

/// How a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// Effects were found that explain the disagreement.
    Named,
    /// Model and data agree to the noise.
    None,
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
#[derive(Debug, Clone, PartialEq, Serialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Named {
    /// Its name.
    pub name: &'static str,
    /// Parameters by name.
    #[serde(serialize_with = "as_map")]
    pub parameters: Vec<(&'static str, f64)>,
    /// Their standard errors.
    #[serde(serialize_with = "as_map")]
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

    /// An error of a sensor that the data alone show.
    pub(super) fn by_check(check: &Check) -> Self {
        // Of sensors against one another, with no physics between them.
        let evidence = Evidence {
            deviations: check.deviations,
            chance: None,
            stability: None,
            explains: 0.0,
        };
        Self::new(check.effect, evidence, Vec::new()).with_parameters(&check.values, &check.errors)
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

    pub(super) const fn effect(&self) -> Effect {
        self.effect
    }
}

/// An error of a sensor that the data alone show, rule out, or do not decide.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Checked {
    /// Name of the effect.
    pub name: &'static str,
    /// What came of it.
    pub finding: Finding,
    /// Parameters by name.
    #[serde(serialize_with = "as_map")]
    pub parameters: Vec<(&'static str, f64)>,
    /// Their standard errors.
    #[serde(serialize_with = "as_map")]
    pub standard_errors: Vec<(&'static str, f64)>,
}

impl Checked {
    fn of(check: &Check) -> Self {
        let named = Named::by_check(check);
        Self {
            name: named.name,
            finding: check.finding,
            parameters: named.parameters,
            standard_errors: named.standard_errors,
        }
    }
}

/// What discovery found.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// How it ended.
    pub verdict: Outcome,
    /// Effects that were named, in the order in which they were found.
    pub effects: Vec<Named>,
    /// What came nearest where the verdict is not `named`; not in the model.
    pub nearest: Vec<Named>,
    /// Share of what there was to explain that effects or nearest explain.
    pub explained: f64,
    /// Deviations by which the misfit of the plain model is beyond that of flights in which nothing is missing.
    pub disagreement: f64,
    /// Gap of the flight.
    pub gap: Gap,
    /// Gaps of the flights held out.
    pub held_out: Vec<HeldOutGap>,
    /// Where the plain model disagrees.
    pub residual_map: Vec<Spot>,
    /// In which regime.
    pub regimes: Vec<Regime>,
    /// Force and moment that the plain model misses, by the balance of momentum.
    pub momentum: Vec<Missing>,
    /// The same with the effects.
    pub momentum_after: Vec<Missing>,
    /// What goes with what is still missing: the signature of something that the library does not have.
    pub signature: Vec<Companion>,
    /// Whether what is left is noise.
    pub whiteness: Whiteness,
    /// What sensors say of one another.
    pub checks: Vec<Checked>,
    /// The effects as in `model.toml`.
    pub model: Vec<ByName>,
}

pub(super) struct Parts {
    pub(super) outcome: Outcome,
    pub(super) named: Vec<Named>,
    pub(super) explained: f64,
    pub(super) disagreement: f64,
    pub(super) gap: Gap,
    pub(super) held_out: Vec<HeldOutGap>,
    pub(super) map: Vec<Spot>,
    pub(super) regimes: Vec<Regime>,
    pub(super) momentum: [Vec<Missing>; 2],
    pub(super) signature: Vec<Companion>,
    pub(super) whiteness: Whiteness,
    pub(super) effects: EffectSet,
    pub(super) checks: Vec<Check>,
}

impl Report {
    pub(super) fn new(parts: Parts) -> Self {
        let [momentum, momentum_after] = parts.momentum;
        let (effects, nearest) = parts.outcome.split(parts.named);
        Self {
            verdict: parts.outcome,
            effects,
            nearest,
            explained: parts.explained,
            disagreement: parts.disagreement,
            gap: parts.gap,
            held_out: parts.held_out,
            residual_map: parts.map,
            regimes: parts.regimes,
            momentum,
            momentum_after,
            signature: parts.signature,
            whiteness: parts.whiteness,
            checks: parts.checks.iter().map(Checked::of).collect(),
            model: model_of(&parts.effects),
        }
    }
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
