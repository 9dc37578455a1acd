//! A line of the unit's log.

use std::fmt;

use serde::Serialize;

/// One log line.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Line {
    /// Time as printed by the program; none if it has no clock.
    pub time: Option<String>,
    /// `trace` to `error`; none for plain prints.
    pub level: Option<&'static str>,
    /// The message.
    pub text: String,
    /// File and line in the program's source, if the ELF file has debug information.
    pub location: Option<String>,
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(time) = &self.time {
            write!(f, "{time} ")?;
        }
        if let Some(level) = self.level {
            write!(f, "{level:5} ")?;
        }
        write!(f, "{}", self.text)
    }
}

/// Totals of what was decoded so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DefmtTotals {
    /// Lines decoded.
    pub lines: u64,
    /// Frames that do not belong to this program.
    pub malformed_frames: u64,
    /// Bytes received.
    pub bytes: u64,
}
