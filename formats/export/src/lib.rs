//! What `export` writes for other programs.

pub mod about;
pub mod columns;
#[cfg(feature = "mcap")]
pub mod foxglove;
#[cfg(feature = "mcap")]
pub mod mcap;
#[cfg(feature = "mcap")]
pub mod protobuf;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
