//! The likelihood of a flight: its variance components by restricted maximum likelihood, with the constants
//! marginalized out.

pub(crate) mod convergence;
pub(crate) mod factor;
pub(crate) mod flight_problem;
pub(crate) mod gauss_newton;
pub(crate) mod gemm;
pub(crate) mod known_residuals;
pub(crate) mod linear_fit;
pub(crate) mod prior;
pub(crate) mod random_effect_fit;
pub(crate) mod reml;
pub(crate) mod schur;
pub(crate) mod variance_components;
