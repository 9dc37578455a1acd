//! Thresholds shared by the search in full flights and the search in tracks of a point.

/// Standard deviations of excess misfit, compared with simulated flights, above which flight and model disagree.
pub(crate) const DISAGREES: f64 = 5.0;

/// Share of the excess misfit that the named effects must explain together.
pub(crate) const EXPLAINS: f64 = 0.6;

/// Significance a gain must reach if no held-out flight can confirm it. Joint errors are constant throughout a flight,
/// so its own halves cannot confirm each other.
pub(crate) const SIGNIFICANT_ALONE: f64 = 9.0;

/// Standard deviations by which a held-out flight must gain.
pub(crate) const VOTE: f64 = 2.0;
