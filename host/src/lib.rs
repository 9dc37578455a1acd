//! Host side of bodyflight: recordings, subjects, and the verbs of the command line as functions.

pub mod diagnostic;
