//! Dynamics of a 16-segment skydiver.
#![no_std]
#![forbid(unsafe_code)]

pub mod aerodynamics;
pub mod air;
pub mod body;
pub mod dynamics;
pub mod effect;
pub mod estimator;
pub mod frame;
pub mod link;
pub mod maneuver;
pub mod math;
pub mod observation;
#[cfg(test)]
mod test_body;
pub mod xbus;

pub use body::posture::Posture;
pub use body::{Body, Segment, SegmentArray, SegmentParameters};
pub use math::Real;
