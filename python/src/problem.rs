//! Conversion of the library's problems to Python exceptions, and of its reports to dictionaries.

use bodyflight_io::diagnostic::{Kind, Problem};
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyKeyboardInterrupt, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyType};
use serde::Serialize;

create_exception!(
    bodyflight,
    BodyflightError,
    PyException,
    "Base class of all errors. Attributes: message, file, line, place and help; None if not known."
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

/// Returns the exception of invalid input, which is a ValueError too.
fn bad_input(py: Python<'_>) -> PyResult<&Bound<'_, PyType>> {
    static BAD_INPUT: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let created = BAD_INPUT.get_or_try_init(py, || {
        let bases = (
            py.get_type::<BodyflightError>(),
            py.get_type::<PyValueError>(),
        );
        let of = PyDict::new(py);
        of.set_item("__module__", "bodyflight")?;
        of.set_item("__doc__", "A file or a value is invalid.")?;
        let created = py.get_type::<PyType>().call1(("BadInput", bases, of))?;
        Ok::<_, PyErr>(created.cast_into::<PyType>()?.unbind())
    });
    created.map(|created| created.bind(py))
}

/// Adds the exceptions to the module.
pub(crate) fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("BodyflightError", py.get_type::<BodyflightError>())?;
    module.add("BadInput", bad_input(py)?)?;
    module.add("Refused", py.get_type::<Refused>())?;
    module.add("Disagreement", py.get_type::<Disagreement>())?;
    module.add("Internal", py.get_type::<Internal>())?;
    module.add("DoubtWarning", py.get_type::<DoubtWarning>())
}

/// Converts a problem to an exception with the parts of the problem as attributes.
pub(crate) fn raise(problem: Problem) -> PyErr {
    let text = in_python(&problem.with_causes());
    let bad_input = |text| {
        Python::attach(|py| match bad_input(py) {
            Ok(kind) => PyErr::from_type(kind.clone(), (text,)),
            Err(error) => error,
        })
    };
    let error = match problem.kind {
        Kind::BadInput => bad_input(text),
        Kind::System => Refused::new_err(text),
        Kind::Disagreement | Kind::Doubt => Disagreement::new_err(text),
        Kind::Interrupted => return PyKeyboardInterrupt::new_err(()),
        Kind::Internal => Internal::new_err(text),
    };
    Python::attach(|py| {
        let value = error.value(py);
        let set = || -> PyResult<()> {
            value.setattr("message", in_python(&problem.message))?;
            value.setattr("file", problem.file.as_deref())?;
            value.setattr("line", problem.line)?;
            value.setattr("place", problem.place.as_deref().map(in_python))?;
            value.setattr("help", problem.help.as_deref().map(in_python))
        };
        // The exception itself matters more than its attributes.
        let _ = set();
        error
    })
}

/// What problems say about the command line, and the same in Python.
const IN_PYTHON: [(&str, &str); 6] = [
    (
        "bodyflight import FILE --out FOLDER",
        "bodyflight.import_recording(FILE, FOLDER)",
    ),
    (
        "bodyflight import FILE --mapping MAPPING.toml --out FOLDER",
        "bodyflight.import_recording(FILE, FOLDER, mapping=MAPPING.toml)",
    ),
    ("--force", "force=True"),
    ("--from and --to", "between"),
    ("; --json writes results to standard output", ""),
    (
        "bodyflight estimate --presets describes each preset",
        "docs/estimator.md describes the presets",
    ),
];

/// Replaces options of the command line in a sentence by the arguments of the same meaning, `--arm-frame` by `arm_frame`.
fn in_python(text: &str) -> String {
    let mut text = text.to_owned();
    for (there, here) in IN_PYTHON {
        text = text.replace(there, here);
    }
    let is_of_name = |c: &char| c.is_ascii_lowercase() || *c == '-';
    let mut parts = text.split("--");
    let mut replaced = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let name: String = part.chars().take_while(is_of_name).collect();
        let is_option = name.starts_with(|c: char| c.is_ascii_lowercase());
        replaced += if is_option { "" } else { "--" };
        replaced += &if is_option {
            name.replace('-', "_")
        } else {
            name.clone()
        };
        replaced += part.strip_prefix(&name).unwrap_or_default();
    }
    replaced
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

/// Converts a dictionary, such as [`dictionary`] returned, to a value of a report.
pub(crate) fn value(given: &Bound<'_, PyAny>) -> PyResult<serde_json::Value> {
    let text = given.py().import("json")?.call_method1("dumps", (given,))?;
    let text: String = text.extract()?;
    serde_json::from_str(&text)
        .map_err(|error| raise(Problem::bad_input("expected JSON").caused_by(error)))
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
