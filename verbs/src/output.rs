//! Plots and figures.

pub mod bodies;
pub mod figure;
pub mod limbs;
pub mod plot;
