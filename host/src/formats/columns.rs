//! Tables with one row per frame of a flight: columns with units, in file formats that other programs read.

pub mod csv;
pub mod npz;
pub mod parquet;
pub mod quantity;
