//! A description as reported, in numbers and words.

use bodyflight_core::dynamics::applied_load::AppliedLoad;
use serde::Serialize;

/// A load of a description.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DescribedLoad {
    /// In words: `moment about left, 25.0 +- 0.4 N m, 3.100 +- 0.004 Hz`.
    pub in_words: String,
    /// Size where every factor is one (N or N m).
    pub size: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Unit of the size.
    pub unit: &'static str,
    /// The load as written to `model.toml`.
    #[serde(skip)]
    pub load: AppliedLoad<f64>,
}

/// A description of what no effect of the library explains.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Described {
    /// The loads.
    pub loads: Vec<DescribedLoad>,
    /// Gain of log-likelihood in the flight it was fitted to.
    pub gain: f64,
    /// Gain it had to exceed: three for each parameter, plus the logarithm of the number of alternatives.
    pub cost: f64,
    /// Share of what arbitrary forces and moments could explain.
    pub explained: f64,
    /// The same share in the other flights.
    pub explained_held_out: Vec<f64>,
}
