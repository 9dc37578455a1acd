//! A recorded flight beside a simulated one.

pub mod comparison;
pub mod steps;
