//! SlimeVR's trackers: inertial sensors on straps that send their orientation over Wi-Fi.
//!
//! [`packet`] decodes what they send, [`server`] answers them as their own server does and tells them apart, without a
//! socket, [`source`] puts it on the network, [`capture`] reads recorded traffic, and [`record`] writes a table for each
//! tracker with a mapping, which [`crate::imu`] reads. `docs/suit.md` describes what is sent and understood.

pub mod capture;
mod numbers;
pub mod packet;
pub mod record;
mod sample;
pub mod sensor_type;
pub mod server;
mod sorted;
pub mod source;
mod tracker;

pub use tracker::{SensorState, Tracker};
