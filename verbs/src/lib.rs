//! The work of each command as a function: arguments in, a report out.

pub mod airborne;
pub mod bifurcation;
pub mod compare;
pub mod discover;
pub mod estimate;
pub mod export;
pub mod fall;
pub mod figures;
mod flight_text;
pub mod fmu;
pub mod hide;
pub mod import;
pub mod inspect;
pub mod inspect_imported;
pub mod output;
pub mod poses;
pub mod reproduce;
pub mod sensitivity;
pub mod simulate;
pub mod slimevr;
pub mod stability;
pub mod technique;
pub mod trim;
pub mod tune;
pub mod validate;
pub mod view;
