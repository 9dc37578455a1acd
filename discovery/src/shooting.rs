//! Short simulations from smoothed starts (multiple shooting), and their residuals.

pub(crate) mod earlier;
pub(crate) mod intervals;
pub(crate) mod joint_error;
pub(crate) mod perturbation;
pub(crate) mod prediction;
pub(crate) mod simulator;
pub(crate) mod smoothed_start;
pub(crate) mod stretch;
