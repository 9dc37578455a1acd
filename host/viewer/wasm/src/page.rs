//! The functions that the page calls. One flight, one thread.
#![allow(
    unsafe_code,
    reason = "the module's interface: exported names, and one static that the page's only thread uses"
)]

use core::cell::UnsafeCell;

use bodyflight_core::AxisCoefficients;

use crate::cockpit::Cockpit;
use crate::frame;
use crate::setup::{self, Setup};

#[cfg(target_feature = "atomics")]
compile_error!(
    "the statics of the page are for one thread: build it without the feature `atomics`"
);

struct Held {
    setup: UnsafeCell<[f32; setup::NUMBERS]>,
    frame: UnsafeCell<frame::Frame>,
    cockpit: UnsafeCell<Option<Cockpit>>,
}

// SAFETY: WebAssembly without threads has a single thread; with threads this does not compile.
unsafe impl Sync for Held {}

static HELD: Held = Held {
    setup: UnsafeCell::new([0.0; setup::NUMBERS]),
    frame: UnsafeCell::new([0.0; frame::NUMBERS]),
    cockpit: UnsafeCell::new(None),
};

fn with(change: impl FnOnce(&mut Cockpit)) {
    // SAFETY: there is a single thread, and no function here calls another one that borrows.
    if let Some(cockpit) = unsafe { &mut *HELD.cockpit.get() } {
        change(cockpit);
    }
}

/// Returns where the page writes the numbers of the model.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn setup_numbers() -> *mut f32 {
    HELD.setup.get().cast()
}

/// Returns the number of model numbers.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn setup_length() -> usize {
    setup::NUMBERS
}

/// Returns the number of numbers per frame.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn frame_length() -> usize {
    frame::NUMBERS
}

/// Starts a flight.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn begin(start: usize) {
    // SAFETY: as in `with`.
    unsafe {
        let setup = Setup::from_numbers(&*HELD.setup.get());
        *HELD.cockpit.get() = Some(Cockpit::new(&setup, start));
    }
}

/// See [`Cockpit::command`].
#[unsafe(no_mangle)]
pub(crate) extern "C" fn command(control: usize, share: f32) {
    with(|cockpit| cockpit.command(control, share));
}

/// See [`Cockpit::can_hold`].
#[unsafe(no_mangle)]
pub(crate) extern "C" fn can_hold() -> u32 {
    let mut can = false;
    with(|cockpit| can = cockpit.can_hold());
    u32::from(can)
}

/// See [`Cockpit::hold`].
#[unsafe(no_mangle)]
pub(crate) extern "C" fn hold(on: u32) {
    with(|cockpit| cockpit.hold(on != 0));
}

/// See [`Cockpit::tilt`].
#[unsafe(no_mangle)]
pub(crate) extern "C" fn tilt() -> f32 {
    let mut tilt = 0.0;
    with(|cockpit| tilt = cockpit.tilt());
    tilt
}

/// See [`Cockpit::joint`].
#[unsafe(no_mangle)]
pub(crate) extern "C" fn joint(segment: usize, axis: usize, angle: f32) {
    with(|cockpit| cockpit.joint(segment, axis, angle));
}

/// See [`Cockpit::muscle`].
#[unsafe(no_mangle)]
pub(crate) extern "C" fn muscle(pitch: f32, yaw: f32, roll: f32) {
    with(|cockpit| cockpit.muscle(AxisCoefficients::new(pitch, yaw, roll)));
}

/// See [`Cockpit::tension`].
#[unsafe(no_mangle)]
pub(crate) extern "C" fn tension(share: f32) {
    with(|cockpit| cockpit.tension(share));
}

/// See [`Cockpit::is_on_ground`].
#[unsafe(no_mangle)]
pub(crate) extern "C" fn is_on_ground() -> u32 {
    let mut is = false;
    with(|cockpit| is = cockpit.is_on_ground());
    u32::from(is)
}

/// See [`Cockpit::damping`].
#[unsafe(no_mangle)]
pub(crate) extern "C" fn damping(pitch: f32, yaw: f32, roll: f32) {
    with(|cockpit| cockpit.damping(AxisCoefficients::new(pitch, yaw, roll)));
}

/// Advances the flight by some steps.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn step(count: u32) {
    with(|cockpit| (0..count).for_each(|_| cockpit.step()));
}

/// Returns the current frame.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn see() -> *const f32 {
    with(|cockpit| {
        // SAFETY: as in `with`.
        unsafe { *HELD.frame.get() = cockpit.frame() };
    });
    HELD.frame.get().cast()
}

#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    core::arch::wasm32::unreachable()
}
