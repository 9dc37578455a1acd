//! Arguments that are arrays: numpy's own, and whatever numpy makes arrays of, such as lists and other kinds of numbers.

use bodyflight_io::diagnostic::Problem;
use numpy::{
    Element, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::problem::raise;

/// A kind of element that functions work with.
pub(crate) trait Kind: Element {
    /// numpy's name of it.
    const NAME: &'static str;
    /// What is converted to it: letters of numpy's `dtype.kind`.
    const FROM: &'static [u8];
}

impl Kind for f32 {
    const NAME: &'static str = "float32";
    const FROM: &'static [u8] = b"fiu";
}

impl Kind for f64 {
    const NAME: &'static str = "float64";
    const FROM: &'static [u8] = b"fiu";
}

impl Kind for bool {
    const NAME: &'static str = "bool";
    const FROM: &'static [u8] = b"b";
}

/// Returns the argument called `name` as an array of `shape`, with rows one after another in memory; `None` stands for any
/// size. An array that is so already is not copied.
///
/// # Errors
/// Returns a TypeError if numpy makes no such numbers of it, and an error that names both shapes if it has another.
pub(crate) fn array<'py, T: Kind>(
    given: &Bound<'py, PyAny>,
    name: &str,
    shape: &[Option<usize>],
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let ready = given.cast::<PyArrayDyn<T>>().ok();
    let ready = ready.and_then(|array| array.try_readonly().ok());
    let array = match ready.filter(|array| array.as_slice().is_ok()) {
        Some(array) => array,
        None => converted(given, name, shape)?.try_readonly()?,
    };
    let found = array.shape();
    let fits = |(found, wanted): (&usize, &Option<usize>)| wanted.is_none_or(|size| size == *found);
    if found.len() != shape.len() || !found.iter().zip(shape).all(fits) {
        let found: Vec<_> = found.iter().copied().map(Some).collect();
        let problem = Problem::bad_input(format!(
            "expected an array of {}, found {}",
            sizes(shape),
            sizes(&found)
        ));
        return Err(raise(problem.at(name)));
    }
    Ok(array)
}

/// Same as [`array`], of numbers that are all finite.
///
/// # Errors
/// Same as [`array`], and an error that names the place of a number that is not finite.
pub(crate) fn finite<'py, T: Kind + Copy + Into<f64>>(
    given: &Bound<'py, PyAny>,
    name: &str,
    shape: &[Option<usize>],
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let array = array::<T>(given, name, shape)?;
    let numbers = array.as_slice()?;
    let wrong = |number: &T| !Into::<f64>::into(*number).is_finite();
    if let Some(index) = numbers.iter().position(wrong) {
        let found: f64 = numbers.get(index).copied().map_or(f64::NAN, Into::into);
        let columns = array.shape().get(1..).unwrap_or_default();
        let row = index / columns.iter().product::<usize>().max(1);
        let problem = Problem::bad_input(format!("expected finite numbers, found {found}"));
        return Err(raise(problem.at(format!("{name}, row {row}"))));
    }
    Ok(array)
}

/// Lets numpy convert an argument, unless that would read a meaning into it, as of a text or of complex numbers.
fn converted<'py, T: Kind>(
    given: &Bound<'py, PyAny>,
    name: &str,
    shape: &[Option<usize>],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    let py = given.py();
    let refused = |found: &str| {
        PyTypeError::new_err(format!(
            "{name}: expected an array of {}, {}, or what numpy converts to one, found {found}",
            T::NAME,
            sizes(shape)
        ))
    };
    let kind = || {
        let name = given.get_type().name();
        name.map_or_else(|_| "something else".to_owned(), |name| name.to_string())
    };
    let numpy = py.import("numpy")?;
    let array = numpy
        .call_method1("asarray", (given,))
        .map_err(|error| caused(py, refused(&kind()), error))?;
    let array = array.cast::<PyUntypedArray>()?;
    if !T::FROM.contains(&array.dtype().kind()) {
        return Err(refused(&match array.dtype().kind() {
            b'O' => kind(),
            _ => format!("{} of {}", kind(), array.dtype()),
        }));
    }
    // Rows one after another, at addresses of whole numbers.
    let converted = numpy.call_method1("require", (array, T::get_dtype(py), ["C", "ALIGNED"]))?;
    // numpy makes an array of one number of a number alone.
    let converted = converted.call_method1("reshape", (array.shape(),))?;
    Ok(converted.cast_into::<PyArrayDyn<T>>()?)
}

/// Returns an exception with the one that it was raised for.
fn caused(py: Python<'_>, error: PyErr, cause: PyErr) -> PyErr {
    error.set_cause(py, Some(cause));
    error
}

/// Returns a shape in words.
fn sizes(shape: &[Option<usize>]) -> String {
    let size = |size: &Option<usize>| size.map_or("n".to_owned(), |size| size.to_string());
    match shape {
        [] => "a single number".to_owned(),
        [Some(_) | None] => format!("{} numbers", shape.iter().map(size).collect::<String>()),
        _ => shape.iter().map(size).collect::<Vec<_>>().join(" by "),
    }
}
