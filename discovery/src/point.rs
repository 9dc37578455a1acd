//! Discovery in recordings of a point: satellites see where a skydiver is and how fast, not the posture.
//!
//! The balance of momentum in integral form: over windows of two seconds the velocity changes by what gravity and
//! drag add up to along the way that was measured. Nothing is differentiated. Drag area and lift of an unknown
//! posture are nuisances, one draw for every ten seconds, so an effect gets a name only where it acts on the whole
//! flight. Effects that need no posture are tried: drag area, wind, density over the height.

mod candidate;
mod fall;
pub mod report;
pub mod search;
#[cfg(test)]
mod tests;
pub mod track;
