//! A row of the table that everything ends in.

use schemars::JsonSchema;
use serde::Serialize;

/// Something that real data must show, and whether they do.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Check {
    /// Of which data.
    pub data: String,
    /// What is compared.
    pub what: String,
    /// What was expected.
    pub expected: String,
    /// What was found.
    pub found: String,
    /// Whether it is so.
    pub holds: bool,
}
