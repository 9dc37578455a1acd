//! Effects that the model may lack, each of which changes the model by a few named parameters.
//!
//! An [`Effect`] changes a [`Model`] before a flight begins: the segment table, the coefficients, the air, the local
//! airstream at segments, the conscious inputs, or the errors of the sensors. The integration step needs no knowledge
//! of effects, effects combine by being applied in sequence, and a model without effects gives bit-identical results. A
//! [`Description`] states for each effect what it changes, how it shows in a flight, and which effects look similar.
//!
//! To add one, copy a file of this folder and add its row to the table below. `docs/effects.md` lists them all.

mod added_mass;
mod arch;
mod arm_shape;
mod belt;
mod booties;
mod cg_offset;
mod damping;
mod damping_over_time;
mod density;
mod description;
mod drag;
mod exit_speed;
mod foot_drag;
mod force_lag;
mod forearm_drag;
mod gnss_latency;
mod gyro_bias;
mod heading_drift;
pub mod history;
mod leg_shape;
mod lift;
mod mass;
mod model;
mod moment;
mod mounting;
mod muscle;
mod muscle_over_time;
mod posture_delay;
pub mod random;
mod rate_lag;
mod reynolds;
mod rig;
mod rig_size;
mod rotation;
pub mod sensors;
mod shank_drag;
mod shelter;
mod thigh_drag;
mod trunk_shape;
mod tunnel;
mod turbulence;
mod updraft;
mod upper_arm_drag;
mod wind;
mod wind_shear;

use core::fmt;

use crate::math::Real;
use description::parameter;
use model::{Group, is_trunk, scale_areas, scale_group, scale_sides};

pub use description::{Description, Kind, PARAMETER_COUNT, Parameter};
pub use model::Model;

macro_rules! effects {
    ($( #[doc = $meaning:literal] $variant:ident = $module:ident, )*) => {
        /// An effect that can be applied to a [`Model`].
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Effect {
            $( #[doc = $meaning] $variant, )*
        }

        impl Effect {
            /// All effects.
            pub const ALL: &'static [Self] = &[$( Self::$variant, )*];

            /// Returns the description of the effect.
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
    /// Horizontal wind that changes with height.
    WindShear = wind_shear,
    /// Vertical wind.
    Updraft = updraft,
    /// Air density that changes with altitude.
    DensityGradient = density,
    /// Velocity profile of a wind tunnel.
    TunnelProfile = tunnel,
    /// Mass and area of the rig on the back.
    Rig = rig,
    /// A mass at the hips.
    WeightBelt = belt,
    /// Displaced centre of gravity of the trunk.
    CgOffset = cg_offset,
    /// Error of the person's mass.
    Mass = mass,
    /// Booties: more area on shanks and feet.
    Booties = booties,
    /// Errors of the drag coefficients of segment groups.
    Drag = drag,
    /// Drag of the upper arms, left and right separately.
    UpperArmDrag = upper_arm_drag,
    /// Drag of forearms and hands, left and right separately.
    ForearmDrag = forearm_drag,
    /// Drag of the thighs, left and right separately.
    ThighDrag = thigh_drag,
    /// Drag of the shanks, left and right separately.
    ShankDrag = shank_drag,
    /// Drag of the feet, left and right separately.
    FootDrag = foot_drag,
    /// Area and drag added by the rig.
    RigSize = rig_size,
    /// Areas of trunk and head along each axis.
    TrunkShape = trunk_shape,
    /// Areas of the arms along each axis.
    ArmShape = arm_shape,
    /// Areas of the legs along each axis.
    LegShape = leg_shape,
    /// Errors of the lift coefficients of segment groups.
    Lift = lift,
    /// Errors of the moment coefficients of segment groups.
    Moment = moment,
    /// Stronger or weaker effect of the arch on the drag.
    Arch = arch,
    /// Air that accelerates with the body.
    AddedMass = added_mass,
    /// Drag coefficients that decrease with speed.
    Reynolds = reynolds,
    /// Shelter of limbs in the wake of the trunk.
    Shelter = shelter,
    /// Local airstream due to the body's rotation.
    LocalFlow = rotation,
    /// Loads that lag behind the posture.
    ForceLag = force_lag,
    /// Constant muscle input.
    Muscle = muscle,
    /// Changed or negative damping.
    Damping = damping,
    /// Unknown speed of the aircraft at exit.
    ExitSpeed = exit_speed,
    /// Misalignment of the sensor on the pelvis.
    Mounting = mounting,
    /// Constant error of the measured angular velocity.
    GyroBias = gyro_bias,
    /// Drift of the measured heading.
    HeadingDrift = heading_drift,
    /// Delay of the recorded postures.
    PostureDelay = posture_delay,
    /// Delay of the measured velocity.
    GnssLatency = gnss_latency,
    /// Delay of the measured angular velocity by a low-pass filter.
    RateLag = rate_lag,
    /// Velocity of the air that changes at random.
    Turbulence = turbulence,
    /// Muscle input that changes at random.
    MuscleOverTime = muscle_over_time,
    /// Damping that changes at random.
    DampingOverTime = damping_over_time,
}

/// A parameter value that an effect rejects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EffectError {
    /// Parameter that is out of range.
    pub parameter: &'static Parameter,
    /// Value found, in the unit of the parameter.
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
    /// Returns the effect with this name, or `None` if there is none.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL
            .iter()
            .copied()
            .find(|effect| effect.description().name == name)
    }

    /// Returns whether the effect changes at random. Only its strength is then known, and a model uses its mean, which
    /// changes nothing.
    pub const fn is_random(self) -> bool {
        matches!(self.description().kind, Kind::Random)
    }

    /// Returns the values at which the effect is absent, padded with zeros.
    pub fn neutral(self) -> [f64; PARAMETER_COUNT] {
        let mut values = [0.0; PARAMETER_COUNT];
        for (value, parameter) in values.iter_mut().zip(self.description().parameters) {
            *value = parameter.neutral;
        }
        values
    }

    /// Applies the effect to `model`, with `values` in the order of its parameters; values beyond its parameters are
    /// ignored.
    ///
    /// # Errors
    /// Returns an error if a value is not a number or outside its plausible range; the model is then unchanged.
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

/// The model with effects applied in the order of the library, since some act on what others have changed. An effect
/// with a value outside its plausible range is left out.
pub fn extended<T: Real>(
    model: &Model<T>,
    effects: &[(Effect, [f64; PARAMETER_COUNT])],
) -> Model<T> {
    let mut model = *model;
    for next in Effect::ALL {
        for (_, values) in effects.iter().filter(|(effect, _)| effect == next) {
            // A refused effect leaves the model unchanged.
            let _ = next.apply(values, &mut model);
        }
    }
    model
}

#[cfg(test)]
mod tests;
