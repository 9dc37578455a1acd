//! The core as the viewer's page sees it: what one frame shows, as numbers; the model as numbers; and a flight by
//! keyboard. The host uses the first two natively, so a replay and a flight in the page show the same.
//!
//! Everything is safe and tested natively but `page`, the functions that the page calls.
#![cfg_attr(target_arch = "wasm32", no_std)]

pub mod autopilot;
pub mod cockpit;
pub mod frame;
#[cfg(target_arch = "wasm32")]
mod page;
pub mod setup;
