//! Replays a recorded flight alongside a simulated one.

pub mod comparison;
pub mod conditions;
pub mod flight;
pub mod frames;
pub mod gnss;
pub mod input_history;
pub mod joint_change;
pub mod live;
pub mod model_file;
mod model_run;
mod motion_history;
pub mod person;
mod precision;
pub mod preset_file;
pub mod recorded;
mod side_by_side;
pub mod start;
pub mod steps;
pub mod subject;
pub mod support;
mod tolerances;
pub mod variants;

pub use precision::Precision;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
