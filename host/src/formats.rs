//! File and stream formats: recordings, tracks, the MVN stream, and the files that describe a subject, a flight or a
//! model.

pub mod columns;
pub mod flight;
pub mod flysight;
pub mod foxglove;
pub mod import;
pub mod input;
pub mod input_history;
pub mod model_file;
pub mod mvn_network;
pub mod mvnx;
pub mod preset_file;
pub mod recording;
pub mod subject;
mod tolerances;
pub mod track;
pub mod xsens;
