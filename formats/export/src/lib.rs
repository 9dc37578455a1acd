//! What `export` writes for other programs.

pub mod columns;
#[cfg(feature = "mcap")]
pub mod foxglove;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
