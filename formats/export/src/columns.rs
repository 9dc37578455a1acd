//! Tables with one row per frame of a flight: columns with units, in file formats that other programs read.

pub mod csv;
#[cfg(feature = "npz")]
pub mod npz;
#[cfg(feature = "parquet")]
pub mod parquet;
pub mod quantity;
