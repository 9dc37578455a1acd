//! Conversion of columns to numpy arrays without a copy.

use bodyflight_core::dynamics::Motion;
use numpy::{PyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// Converts rows of `N` numbers to an array, n by `N`.
pub(crate) fn rows<const N: usize>(
    py: Python<'_>,
    rows: Vec<[f64; N]>,
) -> PyResult<Py<PyArray2<f64>>> {
    let count = rows.len();
    let flat = PyArray1::from_vec(py, rows.into_flattened());
    Ok(flat.reshape([count, N])?.unbind())
}

/// Converts tables of `M` rows and `N` columns to an array, n by `M` by `N`.
pub(crate) fn tables<const N: usize, const M: usize>(
    py: Python<'_>,
    tables: Vec<[[f64; N]; M]>,
) -> PyResult<Py<PyArray<f64, numpy::Ix3>>> {
    let count = tables.len();
    let flat = PyArray1::from_vec(py, tables.into_flattened().into_flattened());
    Ok(flat.reshape([count, M, N])?.unbind())
}

/// Returns attributes of an object, from which pickle and copy make it again.
pub(crate) fn parts<'py, T>(
    object: &Bound<'py, T>,
    names: &[&str],
) -> PyResult<Bound<'py, PyTuple>> {
    let attribute = |name: &&str| object.as_any().getattr(*name);
    let found = names.iter().map(attribute).collect::<PyResult<Vec<_>>>()?;
    PyTuple::new(object.py(), found)
}

/// A motion over time, collected row by row.
#[derive(Default)]
pub(crate) struct Motions {
    position: Vec<[f64; 3]>,
    velocity: Vec<[f64; 3]>,
    inertial_from_body: Vec<[f64; 4]>,
    angular_velocity: Vec<[f64; 3]>,
}

/// A motion over n frames, as arrays.
#[pyclass(frozen, module = "bodyflight")]
pub(crate) struct MotionArrays {
    /// Position of the pelvis: north, west, up (m); n by 3.
    #[pyo3(get)]
    position: Py<PyArray2<f64>>,
    /// Velocity of the pelvis: north, west, up (m/s); n by 3.
    #[pyo3(get)]
    velocity: Py<PyArray2<f64>>,
    /// Attitude as quaternion w, x, y, z; n by 4.
    #[pyo3(get)]
    inertial_from_body: Py<PyArray2<f64>>,
    /// Angular velocity in body axes (rad/s); n by 3.
    #[pyo3(get)]
    angular_velocity: Py<PyArray2<f64>>,
}

#[pymethods]
impl MotionArrays {
    /// Creates a motion from its parts, as pickle does.
    #[new]
    const fn new(
        position: Py<PyArray2<f64>>,
        velocity: Py<PyArray2<f64>>,
        inertial_from_body: Py<PyArray2<f64>>,
        angular_velocity: Py<PyArray2<f64>>,
    ) -> Self {
        Self {
            position,
            velocity,
            inertial_from_body,
            angular_velocity,
        }
    }

    fn __getnewargs__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let names = [
            "position",
            "velocity",
            "inertial_from_body",
            "angular_velocity",
        ];
        parts(slf, &names)
    }
}

impl Motions {
    pub(crate) fn push(&mut self, motion: &Motion<f64>) {
        self.position.push(motion.position.to_array());
        self.velocity.push(motion.velocity_inertial().to_array());
        self.inertial_from_body
            .push(motion.inertial_from_body.wxyz());
        self.angular_velocity
            .push(motion.angular_velocity.to_array());
    }

    pub(crate) fn arrays(self, py: Python<'_>) -> PyResult<Py<MotionArrays>> {
        let arrays = MotionArrays {
            position: rows(py, self.position)?,
            velocity: rows(py, self.velocity)?,
            inertial_from_body: rows(py, self.inertial_from_body)?,
            angular_velocity: rows(py, self.angular_velocity)?,
        };
        Py::new(py, arrays)
    }
}
