//! Flight dynamics of a skydiver modelled as 16 rigid segments, for desktops and microcontrollers.
//!
//! The crate needs neither `std` nor a heap, never panics, and gives bit-identical results on every machine. It
//! follows Clarke and Gutman's model of human body flight, with exact equations of motion.
//!
//! # A fall
//!
//! A [`Body`] is a table of 16 segments. Build it from a person's measurements ([`body::anthropometry`]) or supply
//! your own numbers. [`Dynamics`](dynamics::Dynamics) adds the air, and [`trim`](dynamics::trim) finds the steady
//! fall:
//!
//! ```
//! use bodyflight_core::body::anthropometry::{Person, Sex};
//! use bodyflight_core::body::pattern;
//! use bodyflight_core::dynamics::{Dynamics, trim::trim};
//!
//! let body = Person::new(1.75, 75.0, Sex::Male).body().unwrap();
//! let dynamics = Dynamics::<f32>::paper(body.cast(), 1.0);
//! let fall = trim(&dynamics, &pattern::neutral(), 0.0).unwrap();
//! assert!((45.0..55.0).contains(&fall.terminal_speed));
//! ```
//!
//! # A flight
//!
//! A flight turns a sequence of postures into motion. A [`FreeRun`](dynamics::free_run::FreeRun) follows recorded
//! postures, starting from a measured motion; [`Dynamics::step`](dynamics::Dynamics::step) is the single step
//! underneath, for loops of your own. [`maneuver`] defines postures and inputs over time as data, and [`effect`] adds
//! what the basic model may lack: wind, a rig, a biased sensor.
//!
//! # An estimate
//!
//! The [motion filter](estimator::motion) takes one posture and one measurement at a time. It estimates the skydiver's
//! inputs with error bars and reports when they cannot be trusted. [`PaperFilter`](estimator::PaperFilter) is the
//! filter of the paper, [`ReducedFilter`](estimator::ReducedFilter) its reduced form for the microcontroller, called
//! the unit throughout.
//!
//! # Serial links
//!
//! [`link`] is the protocol between host and unit and accounts for every loss; [`xbus`] reads Xsens MTi sensors. Both
//! work on plain bytes, whatever the transport.
//!
//! # Features
//!
//! `serde` reads and writes bodies, postures, motions, states and inputs as plain numbers: vectors as `[x, y, z]`,
//! rotations as quaternions `[w, x, y, z]`. `defmt` makes the link's messages and the coefficients loggable on a board.
//! Neither is on by default.
//!
//! # Conventions
//!
//! All quantities are in SI units. The inertial frame is X north, Y west, Z up; the body frame is X left, Y back, Z
//! head ([`frame`]). Names of rotations read from right to left: `inertial_from_body * vector_in_body`. Coefficients
//! about the body axes are in the order pitch, yaw, roll ([`AxisCoefficients`]). Models are generic over [`Real`]:
//! `f32` on the unit, `f64` for reference runs. Bodies, postures, loads, steps and observations are generic over
//! [`Lanes`], which also stands for several bodies side by side (feature `lanes`: four).
//!
//! The crate's `examples` folder has four programs: `fall`, `turn`, `estimate` and `decode`.
#![no_std]
#![forbid(unsafe_code)]

pub mod aerodynamics;
pub mod air;
pub mod axis;
pub mod body;
pub mod chain;
pub mod dynamics;
pub mod effect;
pub mod estimator;
pub mod flight_sample;
#[cfg(feature = "lanes")]
pub mod four;
pub mod frame;
pub mod link;
pub mod maneuver;
pub mod math;
pub mod observation;
pub mod sensor_noise;
#[cfg(feature = "serde")]
mod serialization;
pub mod suit;
#[cfg(test)]
mod test_body;
pub mod tolerances;
pub mod ubx;
pub mod xbus;

/// The crate of the vectors and rotations in this interface, so that users need not find out its version.
pub use nalgebra;

pub use axis::AxisCoefficients;
pub use body::posture::Posture;
pub use body::{Body, Segment, SegmentArray, SegmentParameters};
pub use math::{Lanes, Real};

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

/// Compiles and runs the example in the README as a doctest.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;
