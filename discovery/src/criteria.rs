//! Thresholds, shared by flights with postures and those of a point.

/// Deviations of the misfit beyond that of drawn flights, from which on the flight disagrees with the model.
pub(crate) const DISAGREES: f64 = 5.0;

/// Share of what there is to explain that the effects named must explain together.
pub(crate) const EXPLAINS: f64 = 0.6;

/// Deviations of a gain beyond what drawn flights show, from which on it is significant where no flight held out has a
/// vote. What joints have wrong is the same all through one flight, so its own halves cannot vote on that.
pub(crate) const SIGNIFICANT_ALONE: f64 = 9.0;

/// Deviations by which a flight held out must gain.
pub(crate) const VOTE: f64 = 2.0;
