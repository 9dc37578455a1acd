//! The functions that the page calls. One flight by keyboard and one with changes, one thread.
#![allow(
    unsafe_code,
    reason = "the module's interface: exported names, and one static that the page's only thread uses"
)]

use core::cell::UnsafeCell;

use bodyflight_core::AxisCoefficients;
use bodyflight_core::body::joint_angle::JointAngle;
use bodyflight_core::dynamics::free_run::Equations;

use crate::cockpit::Cockpit;
use crate::frame;
use crate::setup::{self, Setup};
use crate::what_if::{self, Change, Changes, ROW, Row, SEEN, START, WhatIf};

#[cfg(target_feature = "atomics")]
compile_error!(
    "the statics of the page are for one thread: build it without the feature `atomics`"
);

struct Held {
    setup: UnsafeCell<[f32; setup::NUMBERS]>,
    frame: UnsafeCell<frame::Frame>,
    cockpit: UnsafeCell<Option<Cockpit>>,
    model: UnsafeCell<[f64; setup::NUMBERS]>,
    start: UnsafeCell<[f64; START]>,
    row: UnsafeCell<[f64; ROW]>,
    seen: UnsafeCell<[f64; SEEN]>,
    changes: UnsafeCell<Option<Changes>>,
    changed: UnsafeCell<Option<WhatIf>>,
}

// SAFETY: WebAssembly without threads has a single thread; with threads this does not compile.
unsafe impl Sync for Held {}

static HELD: Held = Held {
    setup: UnsafeCell::new([0.0; setup::NUMBERS]),
    frame: UnsafeCell::new([0.0; frame::NUMBERS]),
    cockpit: UnsafeCell::new(None),
    model: UnsafeCell::new([0.0; setup::NUMBERS]),
    start: UnsafeCell::new([0.0; START]),
    row: UnsafeCell::new([0.0; ROW]),
    seen: UnsafeCell::new([0.0; SEEN]),
    changes: UnsafeCell::new(None),
    changed: UnsafeCell::new(None),
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

/// Returns where the page writes the numbers of the model of a recorded flight.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn model_numbers() -> *mut f64 {
    HELD.model.get().cast()
}

/// Returns where the page writes the numbers of the initial motion, see [`START`].
#[unsafe(no_mangle)]
pub(crate) extern "C" fn start_numbers() -> *mut f64 {
    HELD.start.get().cast()
}

/// Returns where the page writes a row, see [`ROW`].
#[unsafe(no_mangle)]
pub(crate) extern "C" fn row_numbers() -> *mut f64 {
    HELD.row.get().cast()
}

/// Forgets all changes, and sets the factors on mass and area and whether known inputs are left out.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn change_body(mass_factor: f64, area_factor: f64, without_inputs: u32) {
    let changes = Changes::of_body(mass_factor, area_factor, without_inputs != 0);
    // SAFETY: as in `with`.
    unsafe { *HELD.changes.get() = Some(changes) };
}

/// Adds a change (rad) of an angle, by its index in [`JointAngle::all`], from one time to another (s) or, if they are
/// equal, all the time. Returns whether there was room for it.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn change_joint(index: usize, by: f64, from: f64, to: f64) -> u32 {
    // SAFETY: as in `with`.
    let changes = unsafe { &mut *HELD.changes.get() };
    let angle = JointAngle::all().nth(index);
    let added = changes.as_mut().zip(angle).is_some_and(|(changes, angle)| {
        let window = (from < to).then_some([from, to]);
        changes.add(Change { angle, by, window })
    });
    u32::from(added)
}

/// Starts the flight with the changes.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn begin_changed(as_published: u32) {
    let equations = if as_published == 0 {
        Equations::Exact
    } else {
        Equations::AsPublished
    };
    // SAFETY: as in `with`.
    unsafe {
        let setup = Setup::from_numbers(&*HELD.model.get());
        let start = what_if::motion(&*HELD.start.get());
        let changes = (*HELD.changes.get()).unwrap_or_default();
        *HELD.changed.get() = Some(WhatIf::new(&setup, equations, start, &changes));
    }
}

/// See [`WhatIf::push`].
#[unsafe(no_mangle)]
pub(crate) extern "C" fn push_row() -> u32 {
    // SAFETY: as in `with`.
    let (row, changed) = unsafe { (&*HELD.row.get(), &mut *HELD.changed.get()) };
    let row = Row::from_numbers(row);
    u32::from(changed.as_mut().is_some_and(|flight| flight.push(&row)))
}

/// See [`WhatIf::finish`].
#[unsafe(no_mangle)]
pub(crate) extern "C" fn finish_changed() {
    // SAFETY: as in `with`.
    if let Some(flight) = unsafe { &mut *HELD.changed.get() } {
        flight.finish();
    }
}

/// See [`WhatIf::seen`].
#[unsafe(no_mangle)]
pub(crate) extern "C" fn see_changed() -> *const f64 {
    // SAFETY: as in `with`.
    unsafe {
        if let Some(flight) = &*HELD.changed.get() {
            *HELD.seen.get() = flight.seen();
        }
    }
    HELD.seen.get().cast()
}

/// Returns the frame of the flight with the changes.
#[unsafe(no_mangle)]
pub(crate) extern "C" fn frame_changed() -> *const f32 {
    // SAFETY: as in `with`.
    unsafe {
        if let Some(frame) = (*HELD.changed.get()).as_ref().and_then(WhatIf::frame) {
            *HELD.frame.get() = frame;
        }
    }
    HELD.frame.get().cast()
}

#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    core::arch::wasm32::unreachable()
}
