//! A model as a list of numbers, for the page.

use bodyflight_core::aerodynamics::load_model::LoadModel;
use bodyflight_core::aerodynamics::{Aerodynamics, ArchFactor, Coefficients};
use bodyflight_core::air::Density;
use bodyflight_core::body::{Body, SEGMENT_COUNT, SegmentParameters};
use bodyflight_core::dynamics::muscle_input::{MODELS, MuscleForces};
use bodyflight_core::dynamics::{Dynamics, Inputs};
use bodyflight_core::frame::Vector;
use bodyflight_core::{AxisCoefficients, Real};
use bodyflight_core::{Segment, body::SegmentArray};
use nalgebra::{Matrix3, Vector3};

/// Numbers per segment: mass, length, joint offset, cg, inertia by columns, area, moment arm; drag, lift and moment
/// coefficients. Units as in [`SegmentParameters`].
const SEGMENT: usize = 2 + 3 + 3 + 9 + 3 + 1 + 3;

/// Numbers before the segments: height (m), density (kg/m3), arch factor (0: from the posture), index of the limb
/// groups, velocity of the air (m/s), damping, load model (0: the paper's), muscle forces (0: moments alone), standard
/// atmosphere (0: the constant density), and the altitude of the origin in it (m).
const HEAD: usize = 4 + 3 + 3 + 1 + 1 + 2;

/// Numbers per model.
pub const NUMBERS: usize = HEAD + SEGMENT_COUNT * SEGMENT;

/// A model and its constant inputs. Numbers represent a model with constant density or the standard atmosphere, and
/// without effects on the airflow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setup<T: Real = f32> {
    /// The model.
    pub dynamics: Dynamics<T>,
    /// The subject's damping.
    pub inputs: Inputs<T>,
}

impl<T: Real> Setup<T> {
    /// Converts the model to numbers. What they cannot represent is lost, and [`Setup::from_numbers`] then returns another
    /// model.
    pub fn numbers(&self) -> [T; NUMBERS] {
        let dynamics = &self.dynamics;
        let arch = match dynamics.aerodynamics.arch {
            ArchFactor::Fixed(factor) => factor,
            ArchFactor::FromPosture | ArchFactor::Scaled(_) => T::zero(),
        };
        let muscles = MODELS
            .iter()
            .zip(0u8..)
            .find(|((name, _), _)| *name == dynamics.muscles.name())
            .map_or(0, |(_, index)| index);
        let flag = |on: bool| T::of(f64::from(u8::from(on)));
        let (density, origin) = match dynamics.air.density {
            Density::Constant(density) => (density, None),
            Density::StandardAtmosphere { origin_altitude } => (T::zero(), Some(origin_altitude)),
            Density::Linear { density, .. } => (density, None),
        };
        let head = [
            dynamics.body.height,
            density,
            arch,
            T::of(f64::from(muscles)),
        ];
        let air = dynamics.air.velocity.to_array();
        let mut numbers = head
            .into_iter()
            .chain(air)
            .chain(self.inputs.damping.to_array())
            .chain([
                flag(dynamics.aerodynamics.model == LoadModel::FreeFly),
                flag(dynamics.muscles.forces == MuscleForces::Paper),
                flag(origin.is_some()),
                origin.unwrap_or_else(T::zero),
            ]);
        let mut all = [T::zero(); NUMBERS];
        let (first, rest) = all.split_at_mut(HEAD);
        first
            .iter_mut()
            .for_each(|n| *n = numbers.next().unwrap_or_else(T::zero));
        for (row, segment) in rest.chunks_exact_mut(SEGMENT).zip(Segment::ALL) {
            let p = &dynamics.body.segments[segment];
            let c = &dynamics.aerodynamics.coefficients[segment];
            let values = [p.mass, p.length]
                .into_iter()
                .chain(p.joint_offset.iter().copied())
                .chain(p.cg.iter().copied())
                .chain(p.inertia.iter().copied())
                .chain(p.area.iter().copied())
                .chain([p.moment_arm, c.drag, c.lift, c.moment]);
            row.iter_mut().zip(values).for_each(|(to, from)| *to = from);
        }
        all
    }

    /// Creates a model from numbers.
    pub fn from_numbers(numbers: &[T; NUMBERS]) -> Self {
        let (head, rows) = numbers.split_at(HEAD);
        let at = |k: usize| head.get(k).copied().unwrap_or_else(T::zero);
        let (height, density, arch) = (at(0), at(1), at(2));
        let row = |segment: Segment| {
            let from = segment as usize * SEGMENT;
            move |k: usize| rows.get(from + k).copied().unwrap_or_else(T::zero)
        };
        let segments = SegmentArray::from_fn(|segment| {
            let at = row(segment);
            let vector = |k: usize| Vector3::new(at(k), at(k + 1), at(k + 2));
            SegmentParameters {
                mass: at(0),
                length: at(1),
                joint_offset: vector(2),
                cg: vector(5),
                inertia: Matrix3::from_columns(&[vector(8), vector(11), vector(14)]),
                area: vector(17),
                moment_arm: at(20),
            }
        });
        let coefficients = SegmentArray::from_fn(|segment| {
            let at = row(segment);
            Coefficients {
                drag: at(21),
                lift: at(22),
                moment: at(23),
            }
        });
        let arch = if arch > T::zero() {
            ArchFactor::Fixed(arch)
        } else {
            ArchFactor::FromPosture
        };
        let named = MODELS.iter().zip(0u8..);
        let muscles = named
            .into_iter()
            .find(|(_, index)| T::of(f64::from(*index)) >= at(3))
            .map_or(MODELS[0].1, |((_, model), _)| *model);
        let mut dynamics = Dynamics::paper(Body { segments, height }, density);
        let model = if at(10) > T::zero() {
            LoadModel::FreeFly
        } else {
            LoadModel::Paper
        };
        dynamics.aerodynamics = Aerodynamics {
            coefficients,
            arch,
            model,
        };
        dynamics.muscles = muscles.with_forces(if at(11) > T::zero() {
            MuscleForces::Paper
        } else {
            MuscleForces::Moment
        });
        if at(12) > T::zero() {
            dynamics.air.density = Density::StandardAtmosphere {
                origin_altitude: at(13),
            };
        }
        dynamics.air.velocity = Vector::new(at(4), at(5), at(6));
        let mut inputs = Inputs::belly_turn();
        inputs.damping = AxisCoefficients::new(at(7), at(8), at(9));
        Self { dynamics, inputs }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cockpit::tests::setup;

    #[test]
    fn numbers_make_the_same_model() {
        for (_, muscles) in MODELS {
            for forces in [MuscleForces::Moment, MuscleForces::Paper] {
                let mut setup = setup();
                setup.dynamics.muscles = muscles.with_forces(forces);
                assert_eq!(Setup::from_numbers(&setup.numbers()), setup);
                setup.dynamics.air.density = Density::StandardAtmosphere {
                    origin_altitude: 3700.0,
                };
                assert_eq!(Setup::from_numbers(&setup.numbers()), setup);
            }
        }
    }
}
