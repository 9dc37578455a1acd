//! Host side of bodyflight: recordings, subjects, and the verbs of the command line as functions.

pub mod comparison;
pub mod diagnostic;
pub mod flight;
pub mod input_history;
pub mod interrupt;
pub mod output;
pub mod plot;
pub mod simulate;
pub mod synthesize;
pub mod tune;
