//! The functions of FMI 3.0.

use std::ffi::{CStr, CString, c_char, c_void};
use std::path::PathBuf;

use bodyflight_fmi::skydiver::Skydiver;
use bodyflight_io::diagnostic::Problem;

use crate::instance::{self, ERROR, Instance, OK, numbers, with};

type Log = unsafe extern "C" fn(*mut c_void, i32, *const c_char, *const c_char);

/// The version of the standard.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

/// Accepts any setting: all messages are always sent.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3SetDebugLogging(_: *mut Instance, _: bool) -> i32 {
    OK
}

/// Creates a skydiver from the resources of the unit. Returns null if they are not usable.
///
/// # Safety
/// `resources` must be null or a zero-terminated string, and `log` must accept `environment`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateCoSimulation(
    _name: *const c_char,
    _token: *const c_char,
    resources: *const c_char,
    _visible: bool,
    _logging: bool,
    _event_mode: bool,
    _early_return: bool,
    _intermediate: *const u32,
    _intermediate_count: usize,
    environment: *mut c_void,
    log: Option<Log>,
    _update: *const c_void,
) -> *mut Instance {
    let tell = move |text: &CString| {
        if let Some(log) = log {
            // SAFETY: the importer passed both, to be used together until the instance is freed.
            unsafe {
                log(
                    environment,
                    ERROR,
                    c"logStatusError".as_ptr(),
                    text.as_ptr(),
                );
            };
        }
    };
    let folder = if resources.is_null() {
        Err(Problem::bad_input(
            "the unit needs the path of its resources",
        ))
    } else {
        // SAFETY: a string according to the standard; null was excluded above.
        let text = unsafe { CStr::from_ptr(resources) };
        Ok(PathBuf::from(text.to_string_lossy().into_owned()))
    };
    Instance::create(folder, Box::new(tell))
}

/// Frees an instance.
///
/// # Safety
/// `instance` must be null, or come from [`fmi3InstantiateCoSimulation`] and not be used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeInstance(instance: *mut Instance) {
    // SAFETY: as above.
    unsafe { instance::free(instance) };
}

/// Enters initialization and sets the start time.
///
/// # Safety
/// `instance` must come from [`fmi3InstantiateCoSimulation`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3EnterInitializationMode(
    instance: *mut Instance,
    _tolerance_defined: bool,
    _tolerance: f64,
    start: f64,
    _stop_defined: bool,
    _stop: f64,
) -> i32 {
    // SAFETY: as above.
    unsafe { with(instance, |instance| instance.skydiver.begin(start)) }
}

/// Leaves initialization and starts with the values that have been set.
///
/// # Safety
/// `instance` must come from [`fmi3InstantiateCoSimulation`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3ExitInitializationMode(instance: *mut Instance) -> i32 {
    // SAFETY: as above.
    unsafe { with(instance, Instance::begin) }
}

/// Terminates the simulation.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3Terminate(_: *mut Instance) -> i32 {
    OK
}

/// Resets the instance to its state after creation.
///
/// # Safety
/// `instance` must come from [`fmi3InstantiateCoSimulation`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3Reset(instance: *mut Instance) -> i32 {
    // SAFETY: as above.
    unsafe { with(instance, Instance::reset) }
}

/// Returns the values of variables.
///
/// # Safety
/// `instance` must come from [`fmi3InstantiateCoSimulation`], and each pointer must point to the given number of
/// entries.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetFloat64(
    instance: *mut Instance,
    references: *const u32,
    reference_count: usize,
    values: *mut f64,
    value_count: usize,
) -> i32 {
    let get = |instance: &mut Instance| {
        // SAFETY: as above.
        let references = unsafe { numbers(references, reference_count) };
        if references.len() != value_count {
            return Err(Problem::bad_input("expected a value for each variable"));
        }
        // SAFETY: as above; the number of values was checked.
        unsafe { instance.get(references, values) }
    };
    // SAFETY: as above.
    unsafe { with(instance, get) }
}

/// Sets variables.
///
/// # Safety
/// Same as [`fmi3GetFloat64`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SetFloat64(
    instance: *mut Instance,
    references: *const u32,
    reference_count: usize,
    values: *const f64,
    value_count: usize,
) -> i32 {
    let set = |instance: &mut Instance| {
        // SAFETY: as above.
        let (references, values) = unsafe {
            (
                numbers(references, reference_count),
                numbers(values, value_count),
            )
        };
        instance.set(references, values)
    };
    // SAFETY: as above.
    unsafe { with(instance, set) }
}

/// Simulates one step.
///
/// # Safety
/// `instance` must come from [`fmi3InstantiateCoSimulation`]; each pointer must be null or point to one entry.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3DoStep(
    instance: *mut Instance,
    _time: f64,
    duration: f64,
    _no_set_state_before: bool,
    event: *mut bool,
    terminate: *mut bool,
    early: *mut bool,
    reached: *mut f64,
) -> i32 {
    let step = |instance: &mut Instance| {
        for flag in [event, terminate, early] {
            // SAFETY: as above.
            if let Some(flag) = unsafe { flag.as_mut() } {
                *flag = false;
            }
        }
        let result = instance.skydiver.step(duration);
        // SAFETY: as above.
        if let Some(reached) = unsafe { reached.as_mut() } {
            *reached = instance.skydiver.get(0).unwrap_or(0.0);
        }
        result
    };
    // SAFETY: as above.
    unsafe { with(instance, step) }
}

/// Saves the state, replacing one saved before.
///
/// # Safety
/// `instance` must come from [`fmi3InstantiateCoSimulation`]; `state` must point to null or to a state from this
/// function.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetFMUState(
    instance: *mut Instance,
    state: *mut *mut Skydiver,
) -> i32 {
    // SAFETY: as above.
    unsafe { with(instance, |instance| instance.save(state)) }
}

/// Restores a saved state.
///
/// # Safety
/// `instance` must come from [`fmi3InstantiateCoSimulation`], and `state` from [`fmi3GetFMUState`] and not be freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SetFMUState(instance: *mut Instance, state: *const Skydiver) -> i32 {
    // SAFETY: as above.
    unsafe { with(instance, |instance| instance.restore(state)) }
}

/// Frees a saved state.
///
/// # Safety
/// `state` must be null, or point to null or to a state from [`fmi3GetFMUState`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeFMUState(_: *mut Instance, state: *mut *mut Skydiver) -> i32 {
    // SAFETY: as above.
    unsafe { instance::free_state(state) }
}
