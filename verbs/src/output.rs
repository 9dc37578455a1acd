//! Plots and figures.

pub mod figure;
pub mod limbs;
pub mod plot;
