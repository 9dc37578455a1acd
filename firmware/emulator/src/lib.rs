//! The unit's own image on an emulated STM32F405, in virtual time.
//!
//! [`Chip`] runs the emulator of `firmware/emulator/stm32f405`, and [`Host`] is the host at its line: it greets,
//! configures and flies, and compares every estimate with the desktop's. `cargo xtask f405` runs the tests.

mod chip;
pub mod faults;
mod flight;
mod host;
mod result;
pub mod sensed;
pub mod tampered;
pub mod worn;

pub use chip::{Chip, Cost, Event, Look, Options, Provoked, Watchdog};
pub use flight::Flight;
pub use host::{Host, Limits, RATE};
pub use result::Result;
