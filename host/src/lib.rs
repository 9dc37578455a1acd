//! Host side of bodyflight: recordings, subjects, and the verbs of the command line as functions.

pub mod comparison;
pub mod diagnostic;
pub mod discover;
pub mod estimate;
pub mod flight;
pub mod hide;
pub mod input_history;
pub mod inspect;
pub mod interrupt;
pub mod model_file;
pub mod monitor;
pub mod motion_history;
pub mod mvn_network;
pub mod mvnx;
pub mod output;
pub mod plot;
pub mod ports;
pub mod recording;
pub mod simulate;
pub mod stream;
pub mod subject;
pub mod synthesize;
pub mod tune;
pub mod view;
pub mod virtual_unit;
pub mod xsens;
