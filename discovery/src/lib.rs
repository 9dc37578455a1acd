//! Finds what a flight model misses in recorded flights: where simulation and measurement disagree, which effect is
//! missing, and how much of the gap it closes.
//!
//! Flights come in memory and reports go out; files, figures and commands are the host's. The steps, one file each:
//! the flight ([`track`]), whether its sensors agree with one another ([`check`]), short free runs and their residuals
//! ([`stretch`]), what each effect would change in them and what may be wrong without being one ([`linearization`],
//! [`nuisance`]), effects fitted to them ([`fit`]), flights in which nothing is missing (`null_distribution`), the
//! choice of an effect (`choice`), and the [`search`] that strings them together. [`point`] does without postures, and
//! [`laboratory`] flies what is to be found.
#![forbid(unsafe_code)]

pub mod check;
mod choice;
mod criteria;
pub mod effect_set;
pub mod error;
pub mod fit;
pub mod flown;
pub mod gap;
mod held_out;
pub mod laboratory;
pub mod linearization;
pub mod momentum;
pub mod motion_history;
pub mod normal_equations;
pub mod nuisance;
mod null_distribution;
pub mod point;
pub mod progress;
mod race;
pub mod regime;
pub mod report;
pub mod search;
pub mod stability;
pub mod statistics;
pub mod stretch;
#[cfg(test)]
mod test_subject;
#[cfg(test)]
mod tests;
pub mod track;
