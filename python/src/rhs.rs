//! A system as one differentiable right-hand side.

use std::sync::{Mutex, PoisonError};

use airloop_cosim::coupled::{self, Options};
use airloop_cosim::system::SystemGraph;
use airloop_dynamics::{Dynamics, EvaluationError, Point, Size};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::error::{SettingError, SimulationError, raise};

/// Values, and their derivatives by states and inputs, row by row.
type Derivatives<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

/// `dx/dt = f(t, x, u)`, `y = g(t, x, u)` of a system, with derivatives.
#[pyclass(frozen, module = "airloop._native")]
pub struct Rhs {
    dynamics: Mutex<coupled::System>,
    size: Size,
    names: Vec<String>,
    units: Vec<Option<String>>,
    start: Vec<f64>,
    notes: Vec<String>,
}

impl Rhs {
    /// Opens the system through Model Exchange.
    ///
    /// # Errors
    /// Same as [`coupled::System::open`].
    pub fn open(py: Python<'_>, graph: &SystemGraph, options: &Options) -> PyResult<Rhs> {
        let dynamics = py.detach(|| coupled::System::open(graph, options)).map_err(raise)?;
        Ok(Rhs {
            size: dynamics.size(),
            names: dynamics.names(),
            units: dynamics.units().to_vec(),
            start: dynamics.start_states().to_vec(),
            notes: dynamics.notes().to_vec(),
            dynamics: Mutex::new(dynamics),
        })
    }

    fn checked(&self, what: &str, values: &PyReadonlyArray1<'_, f64>, expected: usize) -> PyResult<Vec<f64>> {
        let values = values.as_array().to_vec();
        if values.len() != expected {
            let found = values.len();
            return Err(SettingError::new_err(format!(
                "`{what}` has {found} values; the system has {expected}"
            )));
        }
        Ok(values)
    }

    fn evaluate(
        &self,
        py: Python<'_>,
        (time, x, u): (f64, &PyReadonlyArray1<'_, f64>, &PyReadonlyArray1<'_, f64>),
        work: impl FnOnce(&mut coupled::System, Point<'_>) -> Result<(), EvaluationError> + Send,
    ) -> PyResult<()> {
        let states = self.checked("x", x, self.size.states)?;
        let inputs = self.checked("u", u, self.size.inputs)?;
        let done = py.detach(|| {
            let mut dynamics = self.dynamics.lock().unwrap_or_else(PoisonError::into_inner);
            work(&mut dynamics, Point { time, states: &states, inputs: &inputs })
        });
        done.map_err(|error| SimulationError::new_err(error.to_string()))
    }
}

#[pymethods]
impl Rhs {
    #[getter]
    fn sizes(&self) -> (usize, usize, usize) {
        (self.size.states, self.size.inputs, self.size.outputs)
    }

    #[getter]
    fn names(&self) -> Vec<String> {
        self.names.clone()
    }

    #[getter]
    fn units(&self) -> Vec<Option<String>> {
        self.units.clone()
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    #[getter]
    fn start<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.start)
    }

    /// Rates, then outputs.
    fn values<'py>(
        &self,
        py: Python<'py>,
        time: f64,
        x: PyReadonlyArray1<'py, f64>,
        u: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let mut values = vec![0.0; self.size.values()];
        self.evaluate(py, (time, &x, &u), |dynamics, at| dynamics.evaluate(at, &mut values))?;
        Ok(PyArray1::from_vec(py, values))
    }

    /// Rates and outputs with their derivatives by states, then inputs.
    fn derivatives<'py>(
        &self,
        py: Python<'py>,
        time: f64,
        x: PyReadonlyArray1<'py, f64>,
        u: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Derivatives<'py>> {
        let (rows, columns) = (self.size.values(), self.size.arguments());
        let (mut values, mut jacobian) = (vec![0.0; rows], vec![0.0; rows * columns]);
        self.evaluate(py, (time, &x, &u), |dynamics, at| dynamics.jacobian(at, &mut values, &mut jacobian))?;
        let jacobian = PyArray1::from_vec(py, jacobian).reshape([rows, columns])?;
        Ok((PyArray1::from_vec(py, values), jacobian))
    }
}
