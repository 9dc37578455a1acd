//! Finds what a flight model misses in recorded flights: where simulation and measurement disagree, which effect is
//! missing, and how much of the gap it closes.
//!
//! This crate works on flights in memory and returns reports; files, figures and commands belong to the host. Each step
//! has its own module: the flight ([`track`]) and the noise of its sensors ([`recorded_noise`]); short simulations and
//! their residuals ([`stretch`], [`flown`]); the derivatives of the residuals with respect to everything that may be
//! wrong ([`linearization`], [`nuisance`]); the size of the errors in this flight ([`error_model`], [`problem`],
//! [`fitted`]); the effect that makes the flights most likely ([`contest`]); a load that describes what no effect
//! explains ([`description`]); the remaining residual ([`remainder`]); and errors in the files ([`adjustment`]). The
//! [`search`] combines these steps. [`point`] works without postures, and [`laboratory`] simulates flights with hidden
//! effects.
#![forbid(unsafe_code)]

pub mod adjustment;
mod beside;
pub mod candidate;
mod challenge;
pub mod contest;
mod criteria;
pub mod description;
pub mod effect_set;
pub mod error;
mod error_bars;
pub mod error_model;
pub mod error_prior;
pub mod fitted;
pub mod flown;
pub mod gap;
pub mod laboratory;
pub mod linearization;
mod moments;
pub mod motion_history;
pub mod normal_equations;
pub mod nuisance;
pub mod part;
pub mod point;
pub mod prepared;
pub mod problem;
mod product;
pub mod progress;
pub mod recorded_noise;
mod redundant;
pub mod remainder;
pub mod report;
pub mod search;
pub mod spectrum;
pub mod statistics;
mod strength;
pub mod stretch;
#[cfg(test)]
mod test_subject;
#[cfg(test)]
mod tests;
pub mod track;
pub mod varied;
mod verdict;
pub mod whitened;
pub mod window;
