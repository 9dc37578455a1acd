//! The functions of FMI 2.0.

use std::ffi::{CStr, CString, c_char, c_void};
use std::path::PathBuf;

use bodyflight_fmi::resource_location::folder_of;
use bodyflight_fmi::skydiver::Skydiver;
use bodyflight_io::diagnostic::{Problem, Result};

use crate::instance::{self, ERROR, Instance, OK, numbers, with};

/// `fmi2CoSimulation` in the standard.
const CO_SIMULATION: i32 = 1;
/// `fmi2False` in the standard.
const FALSE: i32 = 0;

/// The importer's callbacks, of which messages use the first and the last.
#[repr(C)]
pub struct Callbacks {
    log: Option<
        unsafe extern "C" fn(*mut c_void, *const c_char, i32, *const c_char, *const c_char, ...),
    >,
    allocate: *const c_void,
    free: *const c_void,
    step_finished: *const c_void,
    environment: *mut c_void,
}

/// The types for which this library was compiled.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

/// The version of the standard.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

/// Accepts any setting: all messages are always sent.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetDebugLogging(
    _: *mut Instance,
    _: i32,
    _: usize,
    _: *const *const c_char,
) -> i32 {
    OK
}

/// Creates a skydiver from the resources of the unit. Returns null if they are not usable, or for model exchange.
///
/// # Safety
/// `name` and `location` must be null or zero-terminated strings, and `callbacks` must be null or point to callbacks that stay
/// until the instance is freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2Instantiate(
    name: *const c_char,
    kind: i32,
    _token: *const c_char,
    location: *const c_char,
    callbacks: *const Callbacks,
    _visible: i32,
    _logging: i32,
) -> *mut Instance {
    // SAFETY: as above.
    let (name, location) = unsafe { (text(name), text(location)) };
    let name = CString::new(name.unwrap_or_default()).unwrap_or_default();
    // SAFETY: as above.
    let callbacks = unsafe { callbacks.as_ref() };
    let log = callbacks.and_then(|them| Some((them.log?, them.environment)));
    let tell = move |text: &CString| {
        if let Some((log, environment)) = log {
            // SAFETY: the importer passed both, to be used together until the instance is freed. The text is an argument of
            // the format, since it may have percent signs.
            unsafe {
                log(
                    environment,
                    name.as_ptr(),
                    ERROR,
                    c"logStatusError".as_ptr(),
                    c"%s".as_ptr(),
                    text.as_ptr(),
                );
            };
        }
    };
    Instance::create(resources(kind, location.as_deref()), Box::new(tell))
}

/// The text at a pointer; `None` if it is null.
///
/// # Safety
/// `pointer` must be null or a zero-terminated string.
unsafe fn text(pointer: *const c_char) -> Option<String> {
    if pointer.is_null() {
        return None;
    }
    // SAFETY: as above.
    let text = unsafe { CStr::from_ptr(pointer) };
    Some(text.to_string_lossy().into_owned())
}

fn resources(kind: i32, location: Option<&str>) -> Result<PathBuf> {
    if kind != CO_SIMULATION {
        return Err(Problem::bad_input(
            "a skydiver is a unit for co-simulation, not for model exchange",
        ));
    }
    location.and_then(folder_of).ok_or_else(|| {
        Problem::bad_input(format!(
            "expected the resources of the unit as a file: URI, found {}",
            location.unwrap_or("none")
        ))
    })
}

/// Frees an instance.
///
/// # Safety
/// `instance` must be null, or come from [`fmi2Instantiate`] and not be used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2FreeInstance(instance: *mut Instance) {
    // SAFETY: as above.
    unsafe { instance::free(instance) };
}

/// Sets the start time.
///
/// # Safety
/// `instance` must come from [`fmi2Instantiate`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetupExperiment(
    instance: *mut Instance,
    _tolerance_defined: i32,
    _tolerance: f64,
    start: f64,
    _stop_defined: i32,
    _stop: f64,
) -> i32 {
    // SAFETY: as above.
    unsafe { with(instance, |instance| instance.skydiver.begin(start)) }
}

/// Enters initialization.
///
/// # Safety
/// `instance` must come from [`fmi2Instantiate`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2EnterInitializationMode(instance: *mut Instance) -> i32 {
    // SAFETY: as above.
    unsafe { with(instance, Instance::begin) }
}

/// Leaves initialization and starts with the values that have been set.
///
/// # Safety
/// `instance` must come from [`fmi2Instantiate`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2ExitInitializationMode(instance: *mut Instance) -> i32 {
    // SAFETY: as above.
    unsafe { with(instance, Instance::begin) }
}

/// Terminates the simulation.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2Terminate(_: *mut Instance) -> i32 {
    OK
}

/// Resets the instance to its state after creation.
///
/// # Safety
/// `instance` must come from [`fmi2Instantiate`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2Reset(instance: *mut Instance) -> i32 {
    // SAFETY: as above.
    unsafe { with(instance, Instance::reset) }
}

/// Returns the values of variables.
///
/// # Safety
/// `instance` must come from [`fmi2Instantiate`], and each pointer must point to `count` entries.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetReal(
    instance: *mut Instance,
    references: *const u32,
    count: usize,
    values: *mut f64,
) -> i32 {
    // SAFETY: as above.
    unsafe {
        with(instance, |instance| {
            instance.get(numbers(references, count), values)
        })
    }
}

/// Sets variables.
///
/// # Safety
/// Same as [`fmi2GetReal`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetReal(
    instance: *mut Instance,
    references: *const u32,
    count: usize,
    values: *const f64,
) -> i32 {
    // SAFETY: as above.
    unsafe {
        with(instance, |instance| {
            instance.set(numbers(references, count), numbers(values, count))
        })
    }
}

/// Simulates one step.
///
/// # Safety
/// `instance` must come from [`fmi2Instantiate`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2DoStep(
    instance: *mut Instance,
    _time: f64,
    duration: f64,
    _no_set_state_before: i32,
) -> i32 {
    // SAFETY: as above.
    unsafe { with(instance, |instance| instance.skydiver.step(duration)) }
}

/// Tells the time (`fmi2LastSuccessfulTime`, 2), which is the only number of the status.
///
/// # Safety
/// `instance` must come from [`fmi2Instantiate`], and `value` must be null or point to one entry.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetRealStatus(
    instance: *mut Instance,
    kind: i32,
    value: *mut f64,
) -> i32 {
    let get = |instance: &mut Instance| {
        // SAFETY: as above.
        match (kind, unsafe { value.as_mut() }) {
            (2, Some(value)) => {
                *value = instance.skydiver.get(0).unwrap_or(0.0);
                Ok(())
            }
            _ => Err(Problem::bad_input(
                "expected the kind of status 2, the time",
            )),
        }
    };
    // SAFETY: as above.
    unsafe { with(instance, get) }
}

/// Tells that the simulation was not terminated (`fmi2Terminated`, 3).
///
/// # Safety
/// `value` must be null or point to one entry.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetBooleanStatus(_: *mut Instance, kind: i32, value: *mut i32) -> i32 {
    // SAFETY: as above.
    match (kind, unsafe { value.as_mut() }) {
        (3, Some(value)) => {
            *value = FALSE;
            OK
        }
        _ => ERROR,
    }
}

/// Saves the state, replacing one saved before.
///
/// # Safety
/// `instance` must come from [`fmi2Instantiate`]; `state` must point to null or to a state from this function.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetFMUstate(
    instance: *mut Instance,
    state: *mut *mut Skydiver,
) -> i32 {
    // SAFETY: as above.
    unsafe { with(instance, |instance| instance.save(state)) }
}

/// Restores a saved state.
///
/// # Safety
/// `instance` must come from [`fmi2Instantiate`], and `state` from [`fmi2GetFMUstate`] and not be freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetFMUstate(instance: *mut Instance, state: *const Skydiver) -> i32 {
    // SAFETY: as above.
    unsafe { with(instance, |instance| instance.restore(state)) }
}

/// Frees a saved state.
///
/// # Safety
/// `state` must be null, or point to null or to a state from [`fmi2GetFMUstate`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2FreeFMUstate(_: *mut Instance, state: *mut *mut Skydiver) -> i32 {
    // SAFETY: as above.
    unsafe { instance::free_state(state) }
}
