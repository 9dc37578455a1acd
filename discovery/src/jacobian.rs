//! Derivatives of the residuals with respect to everything that may be wrong, by finite differences.

pub(crate) mod columns;
pub(crate) mod effect_parameters;
pub(crate) mod finite_difference;
pub(crate) mod layout;
pub(crate) mod linearization_point;
pub(crate) mod random_effects;
pub(crate) mod subject_error;
pub(crate) mod symmetric;
