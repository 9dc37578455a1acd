//! The core for the viewer's page: frames and models as lists of numbers, flying by keyboard, and recorded flights with
//! changes. The host uses the first two natively, so replays and flights in the page agree.
//!
//! Everything except `page`, the functions that the page calls, is safe code and tested natively.
#![cfg_attr(target_arch = "wasm32", no_std)]

pub mod autopilot;
pub mod cockpit;
pub mod frame;
#[cfg(target_arch = "wasm32")]
mod page;
pub mod setup;
pub mod what_if;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
