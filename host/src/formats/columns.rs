//! Tables with a row for each frame of a flight: columns with units, as files that other programs read.

pub mod csv;
pub mod npz;
pub mod parquet;
pub mod quantity;
