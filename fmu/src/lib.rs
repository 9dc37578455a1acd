//! The library of a skydiver as a co-simulation unit: the C functions of FMI 3.0 over
//! [`bodyflight_fmi::skydiver::Skydiver`].
//!
//! `bodyflight fmu` packs it with a description of its variables. The rest of the standard (clocks, events, types other
//! than 64-bit floats, model exchange) returns an error.
#![expect(
    unsafe_code,
    reason = "a C interface: pointers come from the importer, which follows the standard"
)]

pub mod unsupported;

use std::ffi::{CStr, CString, c_char, c_void};
use std::path::PathBuf;
use std::ptr;
use std::slice;

use bodyflight_fmi::skydiver::Skydiver;
use bodyflight_io::diagnostic::{Problem, Result};

/// Status of a successful call, `fmi3OK` in the standard.
const OK: i32 = 0;
/// Status of a failed call, `fmi3Error` in the standard.
const ERROR: i32 = 3;

type Log = unsafe extern "C" fn(*mut c_void, i32, *const c_char, *const c_char);

/// A skydiver, and the callback for error messages.
pub struct Instance {
    skydiver: Skydiver,
    resources: PathBuf,
    environment: *mut c_void,
    log: Option<Log>,
}

/// Reports a problem to the importer.
fn tell(environment: *mut c_void, log: Option<Log>, problem: &Problem) {
    let Some(log) = log else {
        return;
    };
    let text = CString::new(problem.with_causes().replace('\0', " ")).unwrap_or_default();
    // SAFETY: the importer passed both, to be used together until the instance is freed.
    unsafe {
        log(
            environment,
            ERROR,
            c"logStatusError".as_ptr(),
            text.as_ptr(),
        )
    };
}

/// Runs `work` on an instance and reports any problem.
///
/// # Safety
/// `instance` must be null, or come from [`fmi3InstantiateCoSimulation`] and not have been freed.
unsafe fn with(instance: *mut Instance, work: impl FnOnce(&mut Instance) -> Result<()>) -> i32 {
    // SAFETY: as above.
    let Some(instance) = (unsafe { instance.as_mut() }) else {
        return ERROR;
    };
    match work(instance) {
        Ok(()) => OK,
        Err(problem) => {
            tell(instance.environment, instance.log, &problem);
            ERROR
        }
    }
}

/// The values that an importer points to. Empty if `count` is zero, whatever the pointer.
///
/// # Safety
/// If `count` is above zero, `from` must point to that many values.
unsafe fn numbers<'a, T>(from: *const T, count: usize) -> &'a [T] {
    if count == 0 || from.is_null() {
        return &[];
    }
    // SAFETY: as above.
    unsafe { slice::from_raw_parts(from, count) }
}

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
    if resources.is_null() {
        let problem = Problem::bad_input("the unit needs the path of its resources");
        tell(environment, log, &problem);
        return ptr::null_mut();
    }
    // SAFETY: a string according to the standard; null was excluded above.
    let text = unsafe { CStr::from_ptr(resources) };
    let resources = PathBuf::from(text.to_string_lossy().into_owned());
    match Skydiver::read(&resources) {
        Ok(skydiver) => Box::into_raw(Box::new(Instance {
            skydiver,
            resources,
            environment,
            log,
        })),
        Err(problem) => {
            tell(environment, log, &problem);
            ptr::null_mut()
        }
    }
}

/// Frees an instance.
///
/// # Safety
/// `instance` must be null, or come from [`fmi3InstantiateCoSimulation`] and not be used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeInstance(instance: *mut Instance) {
    if !instance.is_null() {
        // SAFETY: as above; it was created from a box.
        drop(unsafe { Box::from_raw(instance) });
    }
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
    let begin = |instance: &mut Instance| {
        let time = instance.skydiver.get(0).unwrap_or(0.0);
        instance.skydiver.begin(time)
    };
    // SAFETY: as above.
    unsafe { with(instance, begin) }
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
    let reset = |instance: &mut Instance| {
        instance.skydiver = Skydiver::read(&instance.resources)?;
        Ok(())
    };
    // SAFETY: as above.
    unsafe { with(instance, reset) }
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
        if references.len() != value_count || (values.is_null() && value_count > 0) {
            return Err(Problem::bad_input("expected a value for each variable"));
        }
        for (place, reference) in references.iter().enumerate() {
            let value = instance.skydiver.get(*reference as usize);
            let missing = || Problem::bad_input(format!("there is no variable {reference}"));
            // SAFETY: within the values, whose number was checked.
            unsafe { values.add(place).write(value.ok_or_else(missing)?) };
        }
        Ok(())
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
        if references.len() != values.len() {
            return Err(Problem::bad_input("expected a value for each variable"));
        }
        let mut pairs = references.iter().zip(values);
        pairs.try_for_each(|(reference, value)| instance.skydiver.set(*reference as usize, *value))
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
    let keep = |instance: &mut Instance| {
        // SAFETY: as above.
        let Some(state) = (unsafe { state.as_mut() }) else {
            return Err(Problem::bad_input("expected a pointer for the state"));
        };
        // SAFETY: as above.
        match unsafe { state.as_mut() } {
            Some(kept) => kept.clone_from(&instance.skydiver),
            None => *state = Box::into_raw(Box::new(instance.skydiver.clone())),
        }
        Ok(())
    };
    // SAFETY: as above.
    unsafe { with(instance, keep) }
}

/// Restores a saved state.
///
/// # Safety
/// `instance` must come from [`fmi3InstantiateCoSimulation`], and `state` from [`fmi3GetFMUState`] and not be freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SetFMUState(instance: *mut Instance, state: *const Skydiver) -> i32 {
    let restore = |instance: &mut Instance| {
        // SAFETY: as above.
        let Some(state) = (unsafe { state.as_ref() }) else {
            return Err(Problem::bad_input("expected a state"));
        };
        instance.skydiver.clone_from(state);
        Ok(())
    };
    // SAFETY: as above.
    unsafe { with(instance, restore) }
}

/// Frees a saved state.
///
/// # Safety
/// `state` must be null, or point to null or to a state from [`fmi3GetFMUState`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeFMUState(_: *mut Instance, state: *mut *mut Skydiver) -> i32 {
    // SAFETY: as above.
    if let Some(state) = unsafe { state.as_mut() }
        && !state.is_null()
    {
        // SAFETY: as above; it was created from a box.
        drop(unsafe { Box::from_raw(*state) });
        *state = ptr::null_mut();
    }
    OK
}
