//! What the Cortex-M boards share: panics and faults that are told after the next start, and the stack's
//! high water. Linking it brings the handlers of panics and hard faults.
#![cfg(target_os = "none")]
#![no_std]

pub mod faults;
mod retained;
pub mod stack;
