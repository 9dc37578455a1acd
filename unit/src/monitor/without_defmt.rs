//! Stands for the decoder of logs in a program that was built without it.

use std::path::Path;

use bodyflight_io::diagnostic::{Problem, Result};

use super::log_line::{DefmtTotals, Line};

/// The decoder of logs, which this program does not have.
#[derive(Debug)]
pub enum Defmt {}

impl Defmt {
    /// Says that this program cannot decode logs.
    ///
    /// # Errors
    /// Always returns an error.
    pub fn open(_: &Path) -> Result<Self> {
        Err(Problem::not_built_in("the decoder of the unit's logs"))
    }

    /// Never called: there is no value.
    pub fn has_locations(&self) -> bool {
        match *self {}
    }

    /// Never called: there is no value.
    pub fn totals(&self) -> &DefmtTotals {
        match *self {}
    }

    /// Never called: there is no value.
    pub fn push(&mut self, _: &[u8]) -> Vec<Line> {
        match *self {}
    }
}
