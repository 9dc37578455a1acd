//! The native part of the Python package `bodyflight`: thin wrappers around the verbs of the command line, with arrays in place
//! of files. Names, defaults and errors are the same as on the command line.

mod arguments;
mod arrays;
mod compare;
mod discover;
mod environments;
mod estimate;
mod export;
mod files;
mod flight;
mod long;
mod mechanics;
mod observed;
mod options;
mod picture;
mod problem;
mod record;
mod side_by_side;
mod simulate;
mod skydiver;
mod skydivers;
mod step;
mod subject;
mod sweep;
mod task;
mod technique;
mod threads;

use pyo3::prelude::*;

/// The module that `bodyflight/__init__.py` re-exports.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    // numpy is loaded here, where an exception is passed on, and not by the first array that a function returns.
    module.py().import("numpy")?;
    numpy::PyArray1::<f64>::zeros(module.py(), 0, false);
    problem::add_to(module)?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<subject::Subject>()?;
    module.add_class::<flight::Flight>()?;
    module.add_class::<flight::Recording>()?;
    module.add_class::<arrays::MotionArrays>()?;
    module.add_class::<simulate::Run>()?;
    module.add_class::<estimate::Estimation>()?;
    module.add_class::<compare::Comparison>()?;
    module.add_class::<technique::Technique>()?;
    module.add_class::<skydivers::Skydivers>()?;
    module.add_class::<environments::Environments>()?;
    module.add_function(wrap_pyfunction!(simulate::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(estimate::estimate, module)?)?;
    module.add_function(wrap_pyfunction!(compare::compare, module)?)?;
    module.add_function(wrap_pyfunction!(technique::technique, module)?)?;
    module.add_function(wrap_pyfunction!(export::export, module)?)?;
    module.add_function(wrap_pyfunction!(export::fmu, module)?)?;
    module.add_function(wrap_pyfunction!(record::record, module)?)?;
    module.add_function(wrap_pyfunction!(export::program, module)?)?;
    module.add_function(wrap_pyfunction!(discover::discover, module)?)?;
    module.add_function(wrap_pyfunction!(sweep::sweep, module)?)?;
    module.add_function(wrap_pyfunction!(sweep::tune, module)?)?;
    module.add_function(wrap_pyfunction!(subject::trim, module)?)?;
    module.add_function(wrap_pyfunction!(flight::synth, module)?)?;
    module.add_class::<mechanics::Mechanics>()?;
    module.add_class::<mechanics::Linearization>()?;
    module.add_function(wrap_pyfunction!(mechanics::mechanics, module)?)?;
    module.add_function(wrap_pyfunction!(mechanics::posture, module)?)?;
    module.add_function(wrap_pyfunction!(mechanics::linearize, module)?)?;
    module.add_function(wrap_pyfunction!(files::inspect, module)?)?;
    module.add_function(wrap_pyfunction!(files::import_recording, module)?)?;
    module.add_function(wrap_pyfunction!(files::fall, module)?)?;
    module.add_function(wrap_pyfunction!(files::validate, module)?)?;
    module.add_function(wrap_pyfunction!(files::figures, module)?)?;
    module.add_function(wrap_pyfunction!(files::view, module)?)?;
    Ok(())
}
