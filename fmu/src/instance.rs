//! A running skydiver, whichever version of the standard its importer speaks.

use std::ffi::CString;
use std::path::PathBuf;
use std::ptr;
use std::slice;

use bodyflight_fmi::skydiver::Skydiver;
use bodyflight_io::diagnostic::{Problem, Result};

/// Status of a successful call, `fmi2OK` and `fmi3OK` in the standards.
pub const OK: i32 = 0;
/// Status of a failed call, `fmi2Error` and `fmi3Error` in the standards.
pub const ERROR: i32 = 3;

/// The importer's callback for messages, whichever its parameters.
pub(crate) type Log = Box<dyn Fn(&CString)>;

/// A skydiver, and the callback for error messages.
pub struct Instance {
    pub(crate) skydiver: Skydiver,
    resources: PathBuf,
    log: Log,
}

/// Reports a problem to the importer.
pub(crate) fn tell(log: &Log, problem: &Problem) {
    log(&CString::new(problem.with_causes().replace('\0', " ")).unwrap_or_default());
}

impl Instance {
    /// Creates a skydiver from a folder of resources. Returns null if they are not usable.
    pub(crate) fn create(resources: Result<PathBuf>, log: Log) -> *mut Self {
        let read = |resources: PathBuf| Ok((Skydiver::read(&resources)?, resources));
        match resources.and_then(read) {
            Ok((skydiver, resources)) => Box::into_raw(Box::new(Self {
                skydiver,
                resources,
                log,
            })),
            Err(problem) => {
                tell(&log, &problem);
                ptr::null_mut()
            }
        }
    }

    /// Begins anew with the resources as they are.
    pub(crate) fn reset(&mut self) -> Result<()> {
        self.skydiver = Skydiver::read(&self.resources)?;
        Ok(())
    }

    /// Begins with the values that have been set.
    pub(crate) fn begin(&mut self) -> Result<()> {
        let time = self.skydiver.get(0).unwrap_or(0.0);
        self.skydiver.begin(time)
    }

    /// Writes the values of variables.
    ///
    /// # Safety
    /// `values` must point to as many values as there are references, or be null if there are none.
    pub(crate) unsafe fn get(&self, references: &[u32], values: *mut f64) -> Result<()> {
        if values.is_null() && !references.is_empty() {
            return Err(Problem::bad_input("expected a value for each variable"));
        }
        for (place, reference) in references.iter().enumerate() {
            let value = self.skydiver.get(*reference as usize);
            let missing = || Problem::bad_input(format!("there is no variable {reference}"));
            // SAFETY: as above.
            unsafe { values.add(place).write(value.ok_or_else(missing)?) };
        }
        Ok(())
    }

    /// Sets variables.
    pub(crate) fn set(&mut self, references: &[u32], values: &[f64]) -> Result<()> {
        if references.len() != values.len() {
            return Err(Problem::bad_input("expected a value for each variable"));
        }
        let mut pairs = references.iter().zip(values);
        pairs.try_for_each(|(reference, value)| self.skydiver.set(*reference as usize, *value))
    }

    /// Saves the state, replacing one saved before.
    ///
    /// # Safety
    /// `state` must point to null or to a state from this function.
    pub(crate) unsafe fn save(&self, state: *mut *mut Skydiver) -> Result<()> {
        // SAFETY: as above.
        let Some(state) = (unsafe { state.as_mut() }) else {
            return Err(Problem::bad_input("expected a pointer for the state"));
        };
        // SAFETY: as above.
        match unsafe { state.as_mut() } {
            Some(kept) => kept.clone_from(&self.skydiver),
            None => *state = Box::into_raw(Box::new(self.skydiver.clone())),
        }
        Ok(())
    }

    /// Restores a saved state.
    ///
    /// # Safety
    /// `state` must come from [`Instance::save`] and not be freed.
    pub(crate) unsafe fn restore(&mut self, state: *const Skydiver) -> Result<()> {
        // SAFETY: as above.
        let Some(state) = (unsafe { state.as_ref() }) else {
            return Err(Problem::bad_input("expected a state"));
        };
        self.skydiver.clone_from(state);
        Ok(())
    }
}

/// Runs `work` on an instance and reports any problem.
///
/// # Safety
/// `instance` must be null, or come from [`Instance::create`] and not have been freed.
pub(crate) unsafe fn with(
    instance: *mut Instance,
    work: impl FnOnce(&mut Instance) -> Result<()>,
) -> i32 {
    // SAFETY: as above.
    let Some(instance) = (unsafe { instance.as_mut() }) else {
        return ERROR;
    };
    match work(instance) {
        Ok(()) => OK,
        Err(problem) => {
            tell(&instance.log, &problem);
            ERROR
        }
    }
}

/// Frees an instance.
///
/// # Safety
/// `instance` must be null, or come from [`Instance::create`] and not be used again.
pub(crate) unsafe fn free(instance: *mut Instance) {
    if !instance.is_null() {
        // SAFETY: as above; it was created from a box.
        drop(unsafe { Box::from_raw(instance) });
    }
}

/// Frees a saved state.
///
/// # Safety
/// `state` must be null, or point to null or to a state from [`Instance::save`].
pub(crate) unsafe fn free_state(state: *mut *mut Skydiver) -> i32 {
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

/// The values that an importer points to. Empty if `count` is zero, whatever the pointer.
///
/// # Safety
/// If `count` is above zero, `from` must point to that many values.
pub(crate) unsafe fn numbers<'a, T>(from: *const T, count: usize) -> &'a [T] {
    if count == 0 || from.is_null() {
        return &[];
    }
    // SAFETY: as above.
    unsafe { slice::from_raw_parts(from, count) }
}
