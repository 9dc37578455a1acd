//! What is implausible in a recording.

use serde::Serialize;

/// Something implausible in a flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Warning {
    /// The frame that shows it.
    pub frame: u64,
    /// What was found and what was expected.
    pub message: String,
    /// The segment concerned, if it is a single one.
    pub segment: Option<String>,
    /// Time of the first and the last frame concerned (s), if they are known.
    pub span_s: Option<[f64; 2]>,
    /// Whether the recording contradicts itself, or the files about it, so that results from it cannot be trusted.
    pub is_fault: bool,
}

impl Warning {
    /// A remark about a frame that does not make the recording useless.
    pub const fn new(frame: u64, message: String) -> Self {
        Self {
            frame,
            message,
            segment: None,
            span_s: None,
            is_fault: false,
        }
    }

    /// A contradiction within the recording, with the time that it concerns (s).
    pub(super) fn fault(frame: u64, span_s: [f64; 2], message: String) -> Self {
        Self {
            span_s: Some(span_s),
            is_fault: true,
            ..Self::new(frame, message)
        }
    }
}

/// The faults among warnings in a sentence, `None` if there are none.
pub fn faults(warnings: &[Warning]) -> Option<String> {
    let faults = warnings.iter().filter(|warning| warning.is_fault);
    let said: Vec<&str> = faults.map(|warning| warning.message.as_str()).collect();
    (!said.is_empty()).then(|| format!("the recording cannot be trusted: {}", said.join("; ")))
}

impl core::fmt::Display for Warning {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "frame {}: {}", self.frame, self.message)
    }
}
