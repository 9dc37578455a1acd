//! Effects that the model may lack: each a change of the model by a few named parameters.
//!
//! An [`Effect`] changes a [`Model`] before a flight begins: the segment table, the coefficients, the air, the
//! stream at single segments, the conscious inputs, or what the sensors make of the motion. The step itself
//! does not know of effects, effects compose by being applied one after another, and a model without effects
//! keeps its bits. What an effect is, how it shows and what it is confused with is data, [`Description`].
//!
//! To add one, copy a file of this folder and add its row to the table below. `docs/effects.md` lists them all.

mod added_mass;
mod arch;
mod belt;
mod booties;
mod cg_offset;
mod damping;
mod density;
mod drag;
mod exit_speed;
mod force_lag;
mod gnss_latency;
mod gyro_bias;
mod heading_drift;
mod lift;
mod mass;
mod moment;
mod mounting;
mod muscle;
mod posture_delay;
mod rate_lag;
mod reynolds;
mod rig;
mod rotation;
pub mod sensors;
mod shelter;
mod tunnel;
mod wind;

use core::fmt;

use crate::aerodynamics::Coefficients;
use crate::axis::AxisCoefficients;
use crate::body::Segment;
use crate::dynamics::{Dynamics, Inputs};
use crate::math::Real;
use sensors::Sensors;

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

impl Parameter {
    /// Whether it can only be larger than where it does nothing.
    pub fn is_one_sided(&self) -> bool {
        self.low >= self.neutral
    }

    /// The value a share of the way from neutral to an end of the range: the low end where `share` is negative.
    pub fn towards_end(&self, share: f64) -> f64 {
        self.neutral + share.abs() * (self.end(share) - self.neutral)
    }

    /// The share of the way to its end that a value has gone, never negative; zero where there is no way.
    pub fn share_of_range(&self, value: f64) -> f64 {
        let away = value - self.neutral;
        let way = self.end(away) - self.neutral;
        if way == 0.0 { 0.0 } else { away / way }
    }

    fn end(&self, side: f64) -> f64 {
        if side < 0.0 { self.low } else { self.high }
    }
}

/// Where an effect acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// On the body: the motion itself changes.
    Physics,
    /// On what is recorded of it.
    Measurement,
}

const fn parameter(name: &'static str, neutral: f64, low: f64, high: f64) -> Parameter {
    Parameter {
        name,
        neutral,
        low,
        high,
    }
}

/// What an effect is, in words and ranges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Description {
    /// Name in files and reports.
    pub name: &'static str,
    /// Where it acts.
    pub kind: Kind,
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
    pub muscle: AxisCoefficients<T>,
    /// Factors on the damping coefficients.
    pub damping_factor: AxisCoefficients<T>,
    /// What sensors make of the motion.
    pub sensors: Sensors<T>,
    /// Height at which the flight starts (m, inertial).
    pub start_height: T,
}

impl<T: Real> Model<T> {
    /// The model without effects, for a flight that starts at `start_height` (m, inertial).
    pub fn new(dynamics: Dynamics<T>, start_height: T) -> Self {
        Self {
            dynamics,
            muscle: AxisCoefficients::zero(),
            damping_factor: AxisCoefficients::repeat(T::one()),
            sensors: Sensors::perfect(),
            start_height,
        }
    }

    /// What the skydiver's inputs become.
    pub fn inputs(&self, inputs: &Inputs<T>) -> Inputs<T> {
        Inputs {
            muscle: inputs.muscle.zip_map(self.muscle, |own, more| own + more),
            damping: inputs
                .damping
                .zip_map(self.damping_factor, |own, factor| own * factor),
        }
    }
}

macro_rules! effects {
    ($( #[doc = $meaning:literal] $variant:ident = $module:ident, )*) => {
        /// An effect of the library.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Effect {
            $( #[doc = $meaning] $variant, )*
        }

        impl Effect {
            /// All effects.
            pub const ALL: &'static [Self] = &[$( Self::$variant, )*];

            /// What the effect is.
            pub const fn description(self) -> &'static Description {
                match self { $( Self::$variant => &$module::EFFECT, )* }
            }

            fn change<T: Real>(self, values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
                match self { $( Self::$variant => $module::apply(values, model), )* }
            }
        }
    };
}

effects! {
    /// Horizontal wind.
    Wind = wind,
    /// Density that changes with the altitude.
    DensityGradient = density,
    /// Velocity profile of a wind tunnel.
    TunnelProfile = tunnel,
    /// The rig on the back.
    Rig = rig,
    /// A mass at the hips.
    WeightBelt = belt,
    /// Centre of gravity of the trunk elsewhere.
    CgOffset = cg_offset,
    /// The person is heavier or lighter.
    Mass = mass,
    /// More area on the lower legs.
    Booties = booties,
    /// Drag coefficients of segment groups.
    Drag = drag,
    /// Lift coefficients of segment groups.
    Lift = lift,
    /// Moment coefficients of segment groups.
    Moment = moment,
    /// Stronger or weaker effect of the arch.
    Arch = arch,
    /// Air carried along.
    AddedMass = added_mass,
    /// Drag that falls with the speed.
    Reynolds = reynolds,
    /// Limbs in the wake of the trunk.
    Shelter = shelter,
    /// Local flow from rotation.
    LocalFlow = rotation,
    /// Loads late after the posture.
    ForceLag = force_lag,
    /// Constant muscle input.
    Muscle = muscle,
    /// Damping changed, or negative.
    Damping = damping,
    /// Speed of the aircraft unknown.
    ExitSpeed = exit_speed,
    /// Sensor of the pelvis askew.
    Mounting = mounting,
    /// Constant error of the angular velocity.
    GyroBias = gyro_bias,
    /// Heading that drifts.
    HeadingDrift = heading_drift,
    /// Postures late.
    PostureDelay = posture_delay,
    /// Velocity late.
    GnssLatency = gnss_latency,
    /// Angular velocity filtered.
    RateLag = rate_lag,
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
    /// The effect of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL
            .iter()
            .copied()
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
        self.change(&values.map(T::of), model);
        Ok(())
    }
}

/// Multiplies a coefficient of each segment by the factor of its group: trunk and head, arms, legs.
fn scale_group<T: Real>(
    values: &[T; PARAMETER_COUNT],
    model: &mut Model<T>,
    coefficient: impl Fn(&mut Coefficients<T>) -> &mut T,
) {
    let [trunk, arms, legs] = *values;
    for (segment, coefficients) in model.dynamics.aerodynamics.coefficients.iter_mut() {
        let factor = match segment {
            Segment::Head => trunk,
            _ if is_trunk(segment) => trunk,
            Segment::LeftUpperArm
            | Segment::LeftForearm
            | Segment::LeftHand
            | Segment::RightUpperArm
            | Segment::RightForearm
            | Segment::RightHand => arms,
            _ => legs,
        };
        *coefficient(coefficients) *= factor;
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
