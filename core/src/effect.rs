//! Effects that the model may lack: each a change of the model's tables by a few named parameters.
//!
//! An [`Effect`] changes a [`Model`], that is the segment table, the coefficients, the air or the conscious
//! inputs, before a flight begins. The step itself does not know of effects: it keeps its one evaluation of
//! the forces, effects compose by being applied one after another, and a model without effects keeps its
//! bits. What an effect is, how it shows and what it is confused with is data, [`Description`].

pub mod coefficients;
pub mod inputs;
pub mod mass;
pub mod wind;

use core::fmt;

use nalgebra::Vector3;

use crate::body::Segment;
use crate::dynamics::muscle_input::MuscleInput;
use crate::dynamics::{Dynamics, Inputs};
use crate::math::Real;

/// Most parameters that an effect has.
pub const PARAMETER_COUNT: usize = 3;

/// A parameter of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Name in files, with its unit as suffix unless dimensionless.
    pub name: &'static str,
    /// Value at which the effect is absent.
    pub neutral: f64,
    /// Smallest plausible value.
    pub low: f64,
    /// Largest plausible value.
    pub high: f64,
}

/// What an effect is, in words and ranges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Description {
    /// Name in files and reports.
    pub name: &'static str,
    /// What it does to the model.
    pub form: &'static str,
    /// Its parameters, at most [`PARAMETER_COUNT`].
    pub parameters: &'static [Parameter],
    /// Where the form comes from.
    pub source: &'static str,
    /// What it looks like in a flight.
    pub signature: &'static str,
    /// Names of the effects that it is confused with.
    pub confused_with: &'static [&'static str],
    /// The maneuver that tells them apart.
    pub separated_by: &'static str,
}

/// The model that effects change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Model<T: Real> {
    /// Body, coefficients and air.
    pub dynamics: Dynamics<T>,
    /// Muscle input in addition to the skydiver's (dimensionless).
    pub muscle: MuscleInput<T>,
    /// Factors on the damping coefficients [pitch, yaw, roll].
    pub damping_factor: Vector3<T>,
}

impl<T: Real> Model<T> {
    /// The model without effects.
    pub fn new(dynamics: Dynamics<T>) -> Self {
        Self {
            dynamics,
            muscle: MuscleInput::none(),
            damping_factor: Vector3::from_element(T::one()),
        }
    }

    /// What the skydiver's inputs become.
    pub fn inputs(&self, inputs: &Inputs<T>) -> Inputs<T> {
        Inputs {
            muscle: MuscleInput {
                yaw: inputs.muscle.yaw + self.muscle.yaw,
                pitch: inputs.muscle.pitch + self.muscle.pitch,
                roll: inputs.muscle.roll + self.muscle.roll,
            },
            damping: inputs.damping.component_mul(&self.damping_factor),
        }
    }
}

/// An effect of the library.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Effect {
    /// Horizontal wind.
    Wind,
    /// The person is heavier or lighter.
    Mass,
    /// Centre of gravity of the trunk elsewhere.
    CgOffset,
    /// Drag coefficients of segment groups.
    Drag,
    /// Lift coefficients of segment groups.
    Lift,
    /// Moment coefficients of segment groups.
    Moment,
    /// Damping changed, or negative.
    Damping,
    /// Constant muscle input.
    Muscle,
}

/// A parameter list that an effect does not take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EffectError {
    /// The parameter.
    pub parameter: &'static Parameter,
    /// Its value.
    pub found: f64,
}

impl fmt::Display for EffectError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Parameter {
            name, low, high, ..
        } = self.parameter;
        write!(f, "{name}: expected {low} to {high}, found {}", self.found)
    }
}

impl core::error::Error for EffectError {}

impl Effect {
    /// All effects.
    pub const ALL: [Self; 8] = [
        Self::Wind,
        Self::Mass,
        Self::CgOffset,
        Self::Drag,
        Self::Lift,
        Self::Moment,
        Self::Damping,
        Self::Muscle,
    ];

    /// What the effect is.
    pub const fn description(self) -> &'static Description {
        match self {
            Self::Wind => &wind::WIND,
            Self::Mass => &mass::MASS,
            Self::CgOffset => &mass::CG_OFFSET,
            Self::Drag => &coefficients::DRAG,
            Self::Lift => &coefficients::LIFT,
            Self::Moment => &coefficients::MOMENT,
            Self::Damping => &inputs::DAMPING,
            Self::Muscle => &inputs::MUSCLE,
        }
    }

    /// The effect of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|effect| effect.description().name == name)
    }

    /// The values at which the effect is absent, zero beyond its parameters.
    pub fn neutral(self) -> [f64; PARAMETER_COUNT] {
        let mut values = [0.0; PARAMETER_COUNT];
        for (value, parameter) in values.iter_mut().zip(self.description().parameters) {
            *value = parameter.neutral;
        }
        values
    }

    /// Changes `model` by the effect; `values` in the order of its parameters, those beyond are not read.
    ///
    /// # Errors
    /// Where a value is not a number or outside its plausible range; then the model is unchanged.
    pub fn apply<T: Real>(
        self,
        values: &[f64; PARAMETER_COUNT],
        model: &mut Model<T>,
    ) -> Result<(), EffectError> {
        for (parameter, &found) in self.description().parameters.iter().zip(values) {
            if !(parameter.low..=parameter.high).contains(&found) {
                return Err(EffectError { parameter, found });
            }
        }
        let values = &values.map(T::of);
        match self {
            Self::Wind => wind::blow(values, model),
            Self::Mass => mass::scale(values, model),
            Self::CgOffset => mass::shift(values, model),
            Self::Drag => coefficients::scale(values, model, |c| &mut c.drag),
            Self::Lift => coefficients::scale(values, model, |c| &mut c.lift),
            Self::Moment => coefficients::scale(values, model, |c| &mut c.moment),
            Self::Damping => inputs::scale_damping(values, model),
            Self::Muscle => inputs::add_muscle(values, model),
        }
        Ok(())
    }
}

/// Whether a segment belongs to the trunk.
const fn is_trunk(segment: Segment) -> bool {
    matches!(
        segment,
        Segment::Pelvis | Segment::Abdomen | Segment::Thorax
    )
}

#[cfg(test)]
mod tests;
