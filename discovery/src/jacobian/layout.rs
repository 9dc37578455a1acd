//! The order of the variance components in vectors and matrices.

use bodyflight_core::effect::Effect;
use nalgebra::SVector;

/// Variance components: four groups of sensors, joint wander by degree, moments and forces in each window, and the
/// strengths of [`random_effects`](crate::likelihood::random_effects).
pub(crate) const COMPONENTS: usize = FIRST_RANDOM + 7;
/// The first strength. All are zero unless an effect that changes at random is in the model.
pub(crate) const FIRST_RANDOM: usize = 9;
/// The components of joint wander.
pub(crate) const WANDER: [usize; 3] = [4, 5, 6];
/// The components of moments and forces, which are independent in each tenth of a second.
pub(crate) const WRENCH: [usize; 2] = [7, 8];
/// A value for each variance component.
pub(crate) type Components = SVector<f64, COMPONENTS>;

/// Indices of an effect's sizes among the variance components. Turbulence has one; the others have one about each axis.
pub(crate) fn components(effect: Effect) -> core::ops::Range<usize> {
    match effect {
        Effect::Turbulence => FIRST_RANDOM..FIRST_RANDOM + 1,
        Effect::MuscleOverTime => FIRST_RANDOM + 1..FIRST_RANDOM + 4,
        Effect::DampingOverTime => FIRST_RANDOM + 4..FIRST_RANDOM + 7,
        _ => 0..0,
    }
}
