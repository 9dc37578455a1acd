//! The library of a skydiver as a co-simulation unit: the C functions of FMI 3.0 over
//! [`bodyflight::verbs::fmu::skydiver::Skydiver`].
//!
//! `bodyflight fmu` packs it with a description of its variables. What the standard has besides (clocks, events, other types
//! than 64-bit numbers, model exchange) answers with an error.
#![expect(
    unsafe_code,
    reason = "an interface of C: pointers come from the importer, who keeps to the standard"
)]

mod unsupported;

use std::ffi::{CStr, CString, c_char, c_void};
use std::path::PathBuf;
use std::ptr;
use std::slice;

use bodyflight::diagnostic::{Problem, Result};
use bodyflight::verbs::fmu::skydiver::Skydiver;

/// `fmi3OK`.
const OK: i32 = 0;
/// `fmi3Error`.
const ERROR: i32 = 3;

type Log = unsafe extern "C" fn(*mut c_void, i32, *const c_char, *const c_char);

/// A skydiver and who is told of problems.
pub struct Instance {
    skydiver: Skydiver,
    resources: PathBuf,
    environment: *mut c_void,
    log: Option<Log>,
}

/// Tells the importer of a problem.
fn tell(environment: *mut c_void, log: Option<Log>, problem: &Problem) {
    let Some(log) = log else {
        return;
    };
    let text = CString::new(problem.with_causes().replace('\0', " ")).unwrap_or_default();
    // SAFETY: the importer gave both, to be used with each other until the instance is freed.
    unsafe {
        log(
            environment,
            ERROR,
            c"logStatusError".as_ptr(),
            text.as_ptr(),
        )
    };
}

/// Runs `work` on an instance; a problem is told.
///
/// # Safety
/// `instance` is null or from [`fmi3InstantiateCoSimulation`] and not freed.
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

/// Numbers that an importer points to; none where there are none, whatever the pointer.
///
/// # Safety
/// `from` points to `count` numbers, where that is above 0.
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

/// Everything that is told is told always.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3SetDebugLogging(_: *mut Instance, _: bool) -> i32 {
    OK
}

/// A skydiver of the resources of the unit; null where they are not usable.
///
/// # Safety
/// `resources` is null or a text that ends with zero; `log` takes `environment`.
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
    // SAFETY: a text by the standard, null was looked for.
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

/// Ends an instance.
///
/// # Safety
/// `instance` is null or from [`fmi3InstantiateCoSimulation`], and not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeInstance(instance: *mut Instance) {
    if !instance.is_null() {
        // SAFETY: as above; it was made from a box.
        drop(unsafe { Box::from_raw(instance) });
    }
}

/// Begins at a time.
///
/// # Safety
/// `instance` is from [`fmi3InstantiateCoSimulation`].
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

/// Begins anew with what was set meanwhile.
///
/// # Safety
/// `instance` is from [`fmi3InstantiateCoSimulation`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3ExitInitializationMode(instance: *mut Instance) -> i32 {
    let begin = |instance: &mut Instance| {
        let time = instance.skydiver.get(0).unwrap_or(0.0);
        instance.skydiver.begin(time)
    };
    // SAFETY: as above.
    unsafe { with(instance, begin) }
}

/// Ends a flight.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3Terminate(_: *mut Instance) -> i32 {
    OK
}

/// As it was when it was made.
///
/// # Safety
/// `instance` is from [`fmi3InstantiateCoSimulation`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3Reset(instance: *mut Instance) -> i32 {
    let reset = |instance: &mut Instance| {
        instance.skydiver = Skydiver::read(&instance.resources)?;
        Ok(())
    };
    // SAFETY: as above.
    unsafe { with(instance, reset) }
}

/// Values of variables.
///
/// # Safety
/// `instance` is from [`fmi3InstantiateCoSimulation`], the pointers point to as many entries as they are given with.
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
            // SAFETY: within the values, whose number was looked at.
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
/// As of [`fmi3GetFloat64`].
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

/// Flies a step.
///
/// # Safety
/// `instance` is from [`fmi3InstantiateCoSimulation`], the pointers are null or point to one entry each.
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

/// Keeps the state, in place of one that was kept before.
///
/// # Safety
/// `instance` is from [`fmi3InstantiateCoSimulation`]; `state` points to null or to a state of this function.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetFMUState(
    instance: *mut Instance,
    state: *mut *mut Skydiver,
) -> i32 {
    let keep = |instance: &mut Instance| {
        // SAFETY: as above.
        let Some(state) = (unsafe { state.as_mut() }) else {
            return Err(Problem::bad_input("expected a place for the state"));
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

/// Returns to a state.
///
/// # Safety
/// `instance` is from [`fmi3InstantiateCoSimulation`], `state` from [`fmi3GetFMUState`] and not freed.
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

/// Forgets a state.
///
/// # Safety
/// `state` is null or points to a state of [`fmi3GetFMUState`], or to null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeFMUState(_: *mut Instance, state: *mut *mut Skydiver) -> i32 {
    // SAFETY: as above.
    if let Some(state) = unsafe { state.as_mut() }
        && !state.is_null()
    {
        // SAFETY: as above; it was made from a box.
        drop(unsafe { Box::from_raw(*state) });
        *state = ptr::null_mut();
    }
    OK
}
