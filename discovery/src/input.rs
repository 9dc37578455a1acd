//! The flight, and the noise of its sensors.

pub mod flight;
pub(crate) mod sensor_noise;
