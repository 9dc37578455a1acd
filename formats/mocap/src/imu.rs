//! Raw inertial sensors on the limbs: rates and specific forces, a file for each sensor or one for all.
//!
//! [`mapping`] says where the numbers are and when the person was calibrated, [`stream`] reads each sensor with its own
//! clock, and [`worn`] finds bias, scale and mounting of each, looks for sensors that are exchanged, late or turned, and runs
//! the suit of the core over all of it.

mod arc;
mod arrival;
mod calibration;
mod checks;
mod clocks;
mod columns;
mod doubts;
mod exchange;
mod fused;
pub mod mapping;
mod mvnx;
pub mod stream;
mod windows;
pub mod worn;
