//! What was described, in numbers and words.

use bodyflight_core::dynamics::applied_load::AppliedLoad;
use schemars::JsonSchema;
use serde::Serialize;

/// A load of a description.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct DescribedLoad {
    /// In words: `moment about left, 25.0 +- 0.4 N m, 3.10 +- 0.01 Hz`.
    pub in_words: String,
    /// Size where every factor is one (N or N m).
    pub size: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Unit of the size.
    pub unit: &'static str,
    /// As `model.toml` has it.
    #[serde(skip)]
    pub load: AppliedLoad<f64>,
}

/// What was described.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Described {
    /// Its loads.
    pub loads: Vec<DescribedLoad>,
    /// What the likelihood gains in the flight that it was fitted to.
    pub gain: f64,
    /// What it had to gain: three for each number, and the logarithm of what there was to choose from.
    pub cost: f64,
    /// Share of what anything that pushes could explain.
    pub explained: f64,
    /// The same in the other flights.
    pub explained_held_out: Vec<f64>,
}
