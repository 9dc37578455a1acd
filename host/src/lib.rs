//! Host side of bodyflight: recordings, subjects, and the verbs of the command line as functions.

pub mod diagnostic;
pub mod formats;
pub mod interrupt;
pub mod output;
pub mod progress;
pub mod replay;
pub mod unit;
pub mod verbs;
