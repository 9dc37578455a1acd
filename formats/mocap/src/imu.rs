//! Raw inertial sensors on the limbs: rates and specific forces, a file for each sensor or one for all.
//!
//! [`mapping`] says where the numbers are and when the person was calibrated, [`stream`] reads each sensor with its own
//! clock, [`calibration`] finds bias, scale and mounting, and [`worn`] runs the suit of the core over all of it.

pub mod calibration;
pub mod mapping;
pub mod stream;
mod windows;
pub mod worn;
