//! Problems of the library as Python exceptions, and its reports as dictionaries.

use bodyflight::diagnostic::{Kind, Problem};
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyKeyboardInterrupt, PyUserWarning};
use pyo3::prelude::*;
use serde::Serialize;

create_exception!(
    bodyflight,
    BodyflightError,
    PyException,
    "Base of all problems. Attributes: message, file, line, place, help; None where there is none."
);
create_exception!(
    bodyflight,
    BadInput,
    BodyflightError,
    "A file or value is not usable."
);
create_exception!(
    bodyflight,
    Refused,
    BodyflightError,
    "The system refused: a missing file, no permission, a full disk."
);
create_exception!(
    bodyflight,
    Disagreement,
    BodyflightError,
    "The run finished and its answer is no."
);
create_exception!(
    bodyflight,
    Internal,
    BodyflightError,
    "A bug of bodyflight."
);
create_exception!(
    bodyflight,
    DoubtWarning,
    PyUserWarning,
    "The result is there, and is not to be trusted: the sentence says why."
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

/// A problem as an exception with its parts as attributes.
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

/// A value that is none of those that an argument takes.
pub(crate) fn unknown(what: &str, found: &str, known: &[&'static str]) -> PyErr {
    raise(Problem::unknown(what, found, known.iter().copied()))
}

/// A report as the dictionary that `--json` prints.
pub(crate) fn dictionary(py: Python<'_>, report: &impl Serialize) -> PyResult<Py<PyAny>> {
    let text = serde_json::to_string(report)
        .map_err(|error| raise(Problem::internal("cannot write a report").caused_by(error)))?;
    Ok(py.import("json")?.call_method1("loads", (text,))?.unbind())
}

/// Warns of a result that is not to be trusted, with the sentence that says why.
pub(crate) fn warn_of_doubt(py: Python<'_>, doubt: Option<&str>) -> PyResult<()> {
    let Some(sentence) = doubt else {
        return Ok(());
    };
    let category = py.get_type::<DoubtWarning>();
    let text = std::ffi::CString::new(sentence.replace('\0', " "))?;
    PyErr::warn(py, &category, &text, 1)
}
