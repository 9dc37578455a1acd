//! Replays a recorded flight alongside a simulated one.

pub mod comparison;
pub mod recorded;
pub mod start;
pub mod steps;
