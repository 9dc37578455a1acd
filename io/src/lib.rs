//! What every reader and writer of bodyflight shares: diagnostics that name the place and the next step, inputs that
//! may be compressed, outputs that are complete or absent, and a request to stop that leaves files whole.
//!
//! ```
//! use std::path::Path;
//!
//! use bodyflight_io::{diagnostic::Problem, input};
//!
//! let problem: Problem = input::text(Path::new("no such file.toml")).unwrap_err();
//! assert_eq!(problem.kind.exit_code(), 3);
//! assert_eq!(problem.to_string(), "no such file.toml: cannot read this file");
//! ```

pub mod destination;
pub mod diagnostic;
pub mod file_kind;
pub mod files;
pub mod input;
pub mod interrupt;
pub mod progress;
mod scratch;
pub mod text;
pub mod udp;
