//! A skydiver as a co-simulation unit of FMI 3.0: its variables, their description, and the simulation step by step.

pub mod description;
pub mod skydiver;
pub mod variables;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
