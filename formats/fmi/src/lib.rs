//! A skydiver as a co-simulation unit of FMI 2.0 or 3.0: its variables, their description, and the simulation step by step.

pub mod description;
pub mod resource_location;
pub mod skydiver;
pub mod standard;
pub mod variables;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
