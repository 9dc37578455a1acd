//! The command line of bodyflight: arguments and output. The work is done by the library `bodyflight-verbs`.
//!
//! The command line is a library function, so that the Python package can call it too.

pub mod cli;
