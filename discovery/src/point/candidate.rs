//! Effects that need no posture, fitted jointly.

use bodyflight_core::effect::{Effect, PARAMETER_COUNT};

use crate::effect_set::EffectSet;

/// An effect that needs no posture, and which of its parameters are tied together.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    pub(super) effect: Effect,
    /// For each parameter of the effect, the index of the free value that sets it.
    pub(super) ties: [usize; PARAMETER_COUNT],
    /// Number of free values.
    pub(super) count: usize,
}

/// Without a posture, trunk, arms and legs are indistinguishable.
pub(super) const CANDIDATES: [Candidate; 3] = [
    Candidate {
        effect: Effect::Drag,
        ties: [0, 0, 0],
        count: 1,
    },
    Candidate {
        effect: Effect::Wind,
        ties: [0, 1, 1],
        count: 2,
    },
    Candidate {
        effect: Effect::DensityGradient,
        ties: [0, 0, 0],
        count: 1,
    },
];

impl Candidate {
    /// The effect's parameters for these free values, clamped to their plausible ranges.
    pub(super) fn values(&self, numbers: &[f64]) -> [f64; PARAMETER_COUNT] {
        let mut values = self.effect.neutral();
        let parameters = self.effect.description().parameters;
        for ((value, parameter), tie) in values.iter_mut().zip(parameters).zip(self.ties) {
            *value = numbers[tie].clamp(parameter.low, parameter.high);
        }
        values
    }

    pub(super) fn neutral(&self) -> Vec<f64> {
        self.effect.neutral()[..self.count].to_vec()
    }

    /// Half the plausible range: the standard deviation of the prior.
    pub(super) fn prior_deviation(&self) -> f64 {
        let parameter = &self.effect.description().parameters[0];
        0.5 * (parameter.high - parameter.low)
    }
}

/// Effects of the point, fitted.
#[derive(Clone)]
pub(super) struct Fit {
    pub(super) found: Vec<(Candidate, Vec<f64>)>,
    pub(super) errors: Vec<f64>,
    pub(super) misfit: f64,
}

pub(super) fn effects_of(found: &[(Candidate, Vec<f64>)]) -> EffectSet {
    let values = |(candidate, numbers): &(Candidate, Vec<f64>)| {
        (candidate.effect, candidate.values(numbers))
    };
    found.iter().map(values).collect()
}
