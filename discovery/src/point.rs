//! Discovery in the track of a point: satellite receivers record position and velocity, but no posture.
//!
//! The momentum balance is used in integral form: over windows of two seconds, the change of velocity must equal
//! gravity and drag integrated along the measured path, and nothing is differentiated. Drag area and lift of the
//! unknown posture are nuisance parameters, drawn independently every ten seconds, so an effect is named only if it
//! acts throughout the fall. Only effects that need no posture are tried: drag area, wind and the change of density
//! with height.

mod candidate;
mod fall;
pub mod report;
pub mod search;
#[cfg(test)]
mod tests;
pub mod track;
