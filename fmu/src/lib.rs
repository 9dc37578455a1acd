//! The library of a skydiver as a co-simulation unit: the C functions of FMI 2.0 and 3.0 over
//! [`bodyflight_fmi::skydiver::Skydiver`].
//!
//! `bodyflight fmu` packs it with a description of its variables. The rest of the standards (clocks, events, types other
//! than 64-bit floats, model exchange) returns an error.
#![expect(
    unsafe_code,
    reason = "a C interface: pointers come from the importer, which follows the standard"
)]

pub mod fmi2;
pub mod fmi3;
pub mod instance;
pub mod unsupported;
