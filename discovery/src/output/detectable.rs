//! What the flights would have shown: how strong an effect must be to gain what a name needs. An effect that is not named
//! is absent only as far as it would have been seen.

use crate::named_effect::{EffectSet, as_map};
use bodyflight_core::effect::{Effect, Parameter};
use nalgebra::DMatrix;
use serde::Serialize;

use crate::error::Result;
use crate::hypotheses::decision::DECISION;
use crate::hypotheses::hypothesis::Hypothesis;
use crate::hypotheses::score_test::{JointFit, columns_of};
use crate::jacobian::effect_parameters::{ParameterId, parameters_of};
use crate::likelihood::schur::InformationForm;
use crate::progress::Progress;

/// Standard deviations of an estimate that 19 of 20 normal errors do not fall below.
const NINETEEN_OF_TWENTY: f64 = 1.645;

/// How strong an effect must be for flights like these to show it, itself or as one of several that they cannot tell apart.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Detectable {
    /// Name of the effect.
    pub name: &'static str,
    /// By parameter, the least distance from its neutral value with which 19 of 20 such flights show the effect while its other
    /// parameters are neutral, to first order; null if that is beyond the plausible range.
    #[serde(serialize_with = "as_map")]
    #[cfg_attr(
        feature = "schema",
        schemars(with = "std::collections::BTreeMap<String, Option<f64>>")
    )]
    pub least: Vec<(&'static str, Option<f64>)>,
}

impl Detectable {
    /// Whether a single parameter within its plausible range is enough.
    pub fn is_possible(&self) -> bool {
        self.least.iter().any(|(_, least)| least.is_some())
    }
}

/// Limits of the effects with a value that are not named, beside those that are. Empty where flights are too short to name
/// an effect.
///
/// # Errors
/// Returns an error if the search was cancelled.
pub(crate) fn detectable(
    joint_fit: &JointFit<'_>,
    progress: &dyn Progress,
) -> Result<Vec<Detectable>> {
    if joint_fit.is_thin() {
        return Ok(Vec::new());
    }
    let Some([here, there]) = joint_fit.all_effects(progress)? else {
        return Ok(Vec::new());
    };
    let is_named = |effect: &Effect| joint_fit.effects.iter().any(|(named, _)| named == effect);
    let others = Effect::ALL.iter().copied();
    let others = others.filter(|effect| !effect.is_random() && !is_named(effect));
    Ok(others
        .map(|effect| limits(joint_fit, effect, &here, &there))
        .collect())
}

fn limits(
    joint_fit: &JointFit<'_>,
    effect: Effect,
    here: &[DMatrix<f64>],
    there: &[DMatrix<f64>],
) -> Detectable {
    let needed = Needed::of(joint_fit, effect, here, there);
    let parameters = effect.description().parameters.iter().enumerate();
    let least = parameters.map(|(index, parameter)| {
        let prior = ParameterId { effect, index }.prior_deviation();
        let least = needed.as_ref().and_then(|n| n.least(index, prior));
        let most = f64::max(
            parameter.high - parameter.neutral,
            parameter.neutral - parameter.low,
        );
        let least = least.map(|least| least.max(material(parameter)));
        (parameter.name, least.filter(|least| *least <= most))
    });
    Detectable {
        name: effect.description().name,
        least: least.collect(),
    }
}

/// Distance from neutral, towards the nearer end of the range, that is strong enough to matter.
fn material(parameter: &Parameter) -> f64 {
    let share = DECISION.material_share_of_range;
    let ends =
        [share, -share].map(|share| (parameter.towards_end(share) - parameter.neutral).abs());
    ends.into_iter()
        .filter(|end| *end > 0.0)
        .fold(f64::INFINITY, f64::min)
}

/// What a name of an effect needs.
struct Needed {
    /// Gain of log-likelihood.
    gain: f64,
    /// Information of all flights about the effect's parameters, as far as suit, subject and the effects already named
    /// cannot do the same within their tolerances.
    information: DMatrix<f64>,
}

impl Needed {
    fn of(
        joint_fit: &JointFit<'_>,
        effect: Effect,
        here: &[DMatrix<f64>],
        there: &[DMatrix<f64>],
    ) -> Option<Self> {
        let named = &joint_fit.effects;
        let mut effects = named.clone();
        effects.push((effect, effect.neutral()));
        let columns = columns_of(&effects);
        let [before, after] = [named, &effects].map(|effects| joint_fit.precision(effects));
        let information = |flights: &[DMatrix<f64>], precision| {
            let form = InformationForm::joint(flights, &columns, precision)?;
            beside(&form.information, named)
        };
        let own = vec![(effect, effect.neutral())];
        let deviations = JointFit::prior(&own);
        let mut posterior = information(here, &after)?;
        for (k, deviation) in deviations.iter().enumerate() {
            posterior[(k, k)] += deviation.powi(-2);
        }
        let covariance = posterior.cholesky()?.inverse();
        let mut gained = information(here, &before)?;
        let mut unsure = 0.0;
        for flight in there.chunks(1) {
            gained += information(flight, &before)?;
            unsure += 0.5 * (&covariance * information(flight, &after)?).trace();
        }
        let absent = Hypothesis {
            effect,
            effects: own,
            covariance,
            tempering: 1.0,
            gain: 0.0,
            gains_held_out: Vec::new(),
            gain_without_refit: None,
        };
        let gain = DECISION.certain_odds() - absent.log_odds() + unsure;
        Some(Self {
            gain,
            information: gained,
        })
    }

    /// The least distance from neutral of one parameter, with the standard deviation of its prior.
    fn least(&self, index: usize, prior: f64) -> Option<f64> {
        let information = self.information[(index, index)];
        let useful = information - prior.powi(-2);
        let least = (2.0 * self.gain / useful).sqrt() + NINETEEN_OF_TWENTY / information.sqrt();
        (useful > 0.0 && least.is_finite()).then_some(least)
    }
}

/// Information about the last parameters, with those of the named effects, which come first, marginalized out.
fn beside(information: &DMatrix<f64>, named: &EffectSet) -> Option<DMatrix<f64>> {
    let first = parameters_of(named.iter().map(|(effect, _)| *effect)).len();
    let own = information.ncols() - first;
    let rest = information.view((first, first), (own, own)).into_owned();
    if first == 0 {
        return Some(rest);
    }
    let mut known = information.view((0, 0), (first, first)).into_owned();
    for (k, deviation) in JointFit::prior(named).iter().enumerate() {
        known[(k, k)] += deviation.powi(-2);
    }
    let cross = information.view((0, first), (first, own)).into_owned();
    Some(rest - cross.tr_mul(&known.cholesky()?.solve(&cross)))
}
