//! Files that are whole or absent, and the plots in them.

pub mod destination;
pub mod files;
pub mod limbs;
pub mod plot;
