//! Finds what a flight model misses in recorded flights: where simulation and measurement disagree, which effect is
//! missing, and how much of the gap it closes.
//!
//! Flights come in memory and reports go out; files, figures and commands are the host's. The steps, one file each:
//! the flight ([`track`]) and how noisy its sensors are ([`recorded_noise`]), short free runs and their residuals
//! ([`stretch`], [`flown`]), what everything that may be wrong changes in them ([`linearization`], [`nuisance`]), how
//! large the errors are that are wrong in this flight ([`error_model`], [`problem`], [`fitted`]), which effect makes the flights
//! likelier ([`contest`]) and what that comes to once everything is fitted anew beside it, which load describes what none explains ([`description`]), what is left ([`remainder`]) and what files have wrong ([`adjustment`]). The [`search`]
//! strings them together. [`point`] does without postures, and [`laboratory`] flies what is to be found.
#![forbid(unsafe_code)]

pub mod adjustment;
mod beside;
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
pub mod problem;
mod product;
pub mod progress;
pub mod recorded_noise;
pub mod remainder;
pub mod report;
pub mod search;
pub mod statistics;
pub mod stretch;
#[cfg(test)]
mod test_subject;
#[cfg(test)]
mod tests;
pub mod track;
mod verdict;
pub mod whitened;
