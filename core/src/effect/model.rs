//! The model that effects modify.

use nalgebra::Vector3;

use super::description::PARAMETER_COUNT;
use super::random::Random;
use super::sensors::Sensors;
use crate::aerodynamics::Coefficients;
use crate::axis::AxisCoefficients;
use crate::body::Segment;
use crate::dynamics::applied_load::AppliedLoads;
use crate::dynamics::{Dynamics, Inputs};
use crate::math::Real;

/// Body, coefficients, air, conscious inputs and sensors, as modified by an [`Effect`](super::Effect).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Model<T: Real> {
    /// Body, coefficients and air.
    pub dynamics: Dynamics<T>,
    /// Muscle input added to the skydiver's own (dimensionless).
    pub muscle: AxisCoefficients<T>,
    /// User-defined loads.
    pub applied: AppliedLoads<T>,
    /// Factors on the damping coefficients; one leaves them unchanged.
    pub damping_factor: AxisCoefficients<T>,
    /// Errors of the sensors.
    pub sensors: Sensors<T>,
    /// Strengths of the effects that change at random; a simulation step does not use them.
    pub random: Random<T>,
    /// Height at which the flight starts (m, inertial).
    pub start_height: T,
}

impl<T: Real> Model<T> {
    /// Creates a model without effects, for a flight that starts at `start_height` (m, inertial).
    pub fn new(dynamics: Dynamics<T>, start_height: T) -> Self {
        Self {
            dynamics,
            muscle: AxisCoefficients::zero(),
            applied: AppliedLoads::none(),
            damping_factor: AxisCoefficients::repeat(T::one()),
            sensors: Sensors::perfect(),
            random: Random::none(),
            start_height,
        }
    }

    /// Returns the skydiver's inputs with the added muscle input and the factors on the damping applied.
    pub fn inputs(&self, inputs: &Inputs<T>) -> Inputs<T> {
        Inputs {
            muscle: inputs.muscle.zip_map(self.muscle, |own, more| own + more),
            damping: inputs
                .damping
                .zip_map(self.damping_factor, |own, factor| own * factor),
            residual: inputs.residual,
        }
    }
}

/// Groups of segments that share a factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Group {
    Trunk,
    Arms,
    Legs,
}

impl Group {
    /// Returns the group of a segment.
    const fn of(segment: Segment) -> Self {
        match segment {
            Segment::Head => Self::Trunk,
            _ if is_trunk(segment) => Self::Trunk,
            Segment::LeftUpperArm
            | Segment::LeftForearm
            | Segment::LeftHand
            | Segment::RightUpperArm
            | Segment::RightForearm
            | Segment::RightHand => Self::Arms,
            _ => Self::Legs,
        }
    }
}

/// Multiplies a coefficient of each segment by the factor for its group: trunk and head, arms, legs.
pub(super) fn scale_group<T: Real>(
    values: &[T; PARAMETER_COUNT],
    model: &mut Model<T>,
    coefficient: impl Fn(&mut Coefficients<T>) -> &mut T,
) {
    let [trunk, arms, legs] = *values;
    for (segment, coefficients) in model.dynamics.aerodynamics.coefficients.iter_mut() {
        let factor = match Group::of(segment) {
            Group::Trunk => trunk,
            Group::Arms => arms,
            Group::Legs => legs,
        };
        *coefficient(coefficients) *= factor;
    }
}

/// Multiplies the drag coefficients of a group's segments on the left and on the right.
pub(super) fn scale_sides<T: Real>(
    values: &[T; PARAMETER_COUNT],
    model: &mut Model<T>,
    sides: [&[Segment]; 2],
) {
    for (segments, factor) in sides.into_iter().zip(*values) {
        for &segment in segments {
            model.dynamics.aerodynamics.coefficients[segment].drag *= factor;
        }
    }
}

/// Multiplies the areas of a group's segments seen along each of their axes.
pub(super) fn scale_areas<T: Real>(
    values: &[T; PARAMETER_COUNT],
    model: &mut Model<T>,
    group: Group,
) {
    let factors = Vector3::from(*values);
    for (segment, parameters) in model.dynamics.body.segments.iter_mut() {
        if Group::of(segment) == group {
            parameters.area.component_mul_assign(&factors);
        }
    }
}

/// Returns whether a segment belongs to the trunk.
pub(super) const fn is_trunk(segment: Segment) -> bool {
    matches!(
        segment,
        Segment::Pelvis | Segment::Abdomen | Segment::Thorax
    )
}
