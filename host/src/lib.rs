//! Host side of bodyflight: recordings, subjects, the verbs of the command line as functions, and the command line itself.

// The command line names the library as any program would.
extern crate self as bodyflight;

pub mod cli;
pub mod diagnostic;
pub mod formats;
pub mod interrupt;
pub mod output;
pub mod progress;
pub mod replay;
pub mod unit;
pub mod verbs;
