//! The core on a Cortex-M4F. Under QEMU's `-icount shift=7` an instruction takes 128 ns of virtual time, which is 1.6
//! ticks of the 12.5 MHz SysTick. `cargo xtask on-target` runs it.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[path = "on_target/target.rs"]
mod target;

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this is an image for the unit's processor: cargo xtask on-target runs it in QEMU");
}
