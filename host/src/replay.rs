//! A recorded flight beside a simulated one.

pub mod comparison;
pub mod recorded;
pub mod start;
pub mod steps;
