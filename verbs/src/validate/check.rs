//! A row of the table of results.

use serde::Serialize;

/// A requirement on real data, and whether it holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Check {
    /// Name of the data.
    pub data: String,
    /// The quantity that is compared.
    pub what: String,
    /// Expected value.
    pub expected: String,
    /// Value found.
    pub found: String,
    /// Whether the check passes.
    pub holds: bool,
}
