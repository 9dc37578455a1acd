//! Host side of bodyflight: recordings, subjects, the commands as functions, and the command line itself.

// The command line refers to the library by name, as any other program would.
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
