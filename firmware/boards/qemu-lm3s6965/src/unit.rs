//! The unit on this board: UART0 to the host, UART1 from an inertial sensor, logs by semihosting.
//!
//! `cargo xtask hil` builds it, starts it in QEMU and streams a flight to it.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[path = "unit/target.rs"]
mod target;

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this is an image for the unit's processor: cargo xtask hil runs it in QEMU");
}
