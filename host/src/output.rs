//! Output files, either complete or absent, and plots.

pub mod destination;
pub mod figure;
pub mod files;
pub mod limbs;
pub mod plot;
