//! Dynamics of a 16-segment skydiver.
#![no_std]
#![forbid(unsafe_code)]

pub mod body;
pub mod frame;
pub mod link;
pub mod math;
pub mod xbus;

pub use body::posture::Posture;
pub use body::{Body, Segment, SegmentArray, SegmentParameters};
pub use math::Real;
