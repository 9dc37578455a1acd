//! Dynamics of a 16-segment skydiver.
#![no_std]
#![forbid(unsafe_code)]

pub mod aerodynamics;
pub mod air;
pub mod axis;
pub mod body;
pub mod dynamics;
pub mod effect;
pub mod estimator;
pub mod frame;
pub mod link;
pub mod maneuver;
pub mod math;
pub mod observation;
pub mod sensor_noise;
#[cfg(test)]
mod test_body;
pub mod xbus;

pub use axis::AxisCoefficients;
pub use body::posture::Posture;
pub use body::{Body, Segment, SegmentArray, SegmentParameters};
pub use math::Real;

/// Version of this crate: major, minor, patch.
pub const VERSION: [u16; 3] = [
    decimal(env!("CARGO_PKG_VERSION_MAJOR")),
    decimal(env!("CARGO_PKG_VERSION_MINOR")),
    decimal(env!("CARGO_PKG_VERSION_PATCH")),
];

const fn decimal(text: &str) -> u16 {
    match u16::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => 0,
    }
}
