//! The report: verdict, remaining residual, adjusted parameters.

pub mod adjusted_parameters;
pub mod description;
pub mod detectable;
pub mod report;
pub mod residual_rms;
pub mod residual_wrench;
pub(crate) mod verdict;
