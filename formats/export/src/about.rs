//! What a file says about itself: the flight, the person, and the run that made it.

use std::collections::BTreeMap;
use std::time::Duration;

/// Facts about an exported flight, for formats that keep metadata.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct About {
    /// Facts by name, such as `subject`.
    pub facts: BTreeMap<String, String>,
    /// Unix time of frame 0, if the recording has it.
    pub began: Option<Duration>,
}

/// The program that writes the files, as formats name it.
pub const PROGRAM: &str = concat!("bodyflight ", env!("CARGO_PKG_VERSION"));
