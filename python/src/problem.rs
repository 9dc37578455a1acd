//! Conversion of the library's problems to Python exceptions, and of its reports to dictionaries.

use bodyflight_io::diagnostic::{Kind, Problem};
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyKeyboardInterrupt, PyUserWarning};
use pyo3::prelude::*;
use serde::Serialize;

create_exception!(
    bodyflight,
    BodyflightError,
    PyException,
    "Base class of all errors. Attributes: message, file, line, place and help; None if not known."
);
create_exception!(
    bodyflight,
    BadInput,
    BodyflightError,
    "A file or a value is invalid."
);
create_exception!(
    bodyflight,
    Refused,
    BodyflightError,
    "The operating system refused: a file is missing, permission is denied, or the disk is full."
);
create_exception!(
    bodyflight,
    Disagreement,
    BodyflightError,
    "The run finished, but a check failed."
);
create_exception!(
    bodyflight,
    Internal,
    BodyflightError,
    "A bug in bodyflight."
);
create_exception!(
    bodyflight,
    DoubtWarning,
    PyUserWarning,
    "The result should not be trusted, for the reason in the message."
);

/// Adds the exceptions to the module.
pub(crate) fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("BodyflightError", py.get_type::<BodyflightError>())?;
    module.add("BadInput", py.get_type::<BadInput>())?;
    module.add("Refused", py.get_type::<Refused>())?;
    module.add("Disagreement", py.get_type::<Disagreement>())?;
    module.add("Internal", py.get_type::<Internal>())?;
    module.add("DoubtWarning", py.get_type::<DoubtWarning>())
}

/// Converts a problem to an exception with the parts of the problem as attributes.
pub(crate) fn raise(problem: Problem) -> PyErr {
    let text = problem.with_causes();
    let error = match problem.kind {
        Kind::BadInput => BadInput::new_err(text),
        Kind::System => Refused::new_err(text),
        Kind::Disagreement | Kind::Doubt => Disagreement::new_err(text),
        Kind::Interrupted => return PyKeyboardInterrupt::new_err(()),
        Kind::Internal => Internal::new_err(text),
    };
    Python::attach(|py| {
        let value = error.value(py);
        let set = || -> PyResult<()> {
            value.setattr("message", &problem.message)?;
            value.setattr("file", problem.file.as_deref())?;
            value.setattr("line", problem.line)?;
            value.setattr("place", problem.place.as_deref())?;
            value.setattr("help", problem.help.as_deref())
        };
        // The exception itself matters more than its attributes.
        let _ = set();
        error
    })
}

/// Creates the exception for a value that is not among the known ones.
pub(crate) fn unknown(what: &str, found: &str, known: &[&'static str]) -> PyErr {
    raise(Problem::unknown(what, found, known.iter().copied()))
}

/// Converts a report to the dictionary that `--json` prints.
pub(crate) fn dictionary(py: Python<'_>, report: &impl Serialize) -> PyResult<Py<PyAny>> {
    let text = serde_json::to_string(report)
        .map_err(|error| raise(Problem::internal("cannot write a report").caused_by(error)))?;
    Ok(py.import("json")?.call_method1("loads", (text,))?.unbind())
}

/// Issues a DoubtWarning with the reason, if there is one.
pub(crate) fn warn_of_doubt(py: Python<'_>, doubt: Option<&str>) -> PyResult<()> {
    let Some(sentence) = doubt else {
        return Ok(());
    };
    let category = py.get_type::<DoubtWarning>();
    let text = std::ffi::CString::new(sentence.replace('\0', " "))?;
    PyErr::warn(py, &category, &text, 1)
}
