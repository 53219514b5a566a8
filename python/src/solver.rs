//! A plan that is solved again and again.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use airloop_optim::Status;
use airloop_plan::{Error, prepare, solver, table};
use airloop_series::frame;
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::error::raise;

/// Status, whether a motion was found, objective, iterations, largest violation, and wall-clock time \[s\].
type Solution = (String, bool, f64, usize, f64, f64);
/// Time \[s\], and name, unit and values of each column.
type Motion<'py> = (Bound<'py, PyArray1<f64>>, Vec<(String, Option<String>, Bound<'py, PyArray1<f64>>)>);

/// A problem file over its FMUs, kept to be solved again.
#[pyclass(frozen, module = "airloop._native")]
pub struct Solver {
    inner: Mutex<solver::Solver>,
}

impl Solver {
    /// Works on the solver without the interpreter's lock.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut solver::Solver) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        let done = py.detach(|| work(&mut self.inner.lock().unwrap_or_else(PoisonError::into_inner)));
        done.map_err(raise)
    }
}

/// Ctrl-C, looked for after every iteration of a solver.
#[derive(Default)]
struct Signals {
    raised: Option<PyErr>,
}

impl Signals {
    fn look(&mut self) -> ControlFlow<()> {
        match Python::attach(|py| py.check_signals()) {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => {
                self.raised = Some(error);
                ControlFlow::Break(())
            }
        }
    }

    /// The exception that was raised, else the answer of the solver.
    fn or<T>(self, answer: Result<T, Error>) -> PyResult<T> {
        self.raised.map_or_else(|| answer.map_err(raise), Err)
    }
}

#[pymethods]
impl Solver {
    /// Reads a problem file and finds the first motion.
    #[new]
    fn new(py: Python<'_>, problem: PathBuf) -> PyResult<Solver> {
        let mut signals = Signals::default();
        let made = py.detach(|| {
            let prepared = prepare::prepare(&problem)?;
            solver::Solver::watched(prepared, None, &mut |_| signals.look())
        });
        Ok(Solver { inner: Mutex::new(signals.or(made)?) })
    }

    #[getter]
    fn states(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.with(py, |inner| Ok(owned(&inner.states())))
    }

    #[getter]
    fn inputs(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.with(py, |inner| Ok(owned(&inner.inputs())))
    }

    #[getter]
    fn bounds(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.with(py, |inner| Ok(owned(&inner.bounds())))
    }

    /// Initial states, in the order of the names.
    #[getter]
    fn initial<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(PyArray1::from_vec(py, self.with(py, |inner| Ok(inner.initial().to_vec()))?))
    }

    fn set_initial(&self, py: Python<'_>, states: PyReadonlyArray1<'_, f64>) -> PyResult<()> {
        let states = states.as_array().to_vec();
        self.with(py, |inner| inner.set_initial(&states))
    }

    fn set_bounds(&self, py: Python<'_>, name: &str, lower: f64, upper: f64) -> PyResult<()> {
        self.with(py, |inner| inner.set_bounds(name, [lower, upper]))
    }

    fn set_parameters(&self, py: Python<'_>, values: Vec<(String, f64)>) -> PyResult<()> {
        let values: Vec<(&str, f64)> = values.iter().map(|(name, value)| (name.as_str(), *value)).collect();
        self.with(py, |inner| inner.set_parameters(&values))
    }

    /// Moves the start of the next solve ahead by a time \[s\].
    fn shift(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        self.with(py, |inner| inner.shift(seconds))
    }

    /// Solves from the last solution.
    fn solve(&self, py: Python<'_>) -> PyResult<Solution> {
        let mut signals = Signals::default();
        let answer = py.detach(|| {
            let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
            let began = Instant::now();
            let solution = inner.solve_watched(&mut |_| signals.look())?;
            let seconds = began.elapsed().as_secs_f64();
            let is_solved = matches!(solution.status, Status::Solved | Status::Acceptable);
            // The first row of the table is the start.
            let iterations = solution.iterations.len().saturating_sub(1);
            let status = solution.status.to_string();
            Ok((status, is_solved, solution.objective, iterations, solution.violation, seconds))
        });
        signals.or(answer)
    }

    /// The motion of the last solve, as in `trajectory.csv` of `airloop optimize`.
    fn motion<'py>(&self, py: Python<'py>) -> PyResult<Motion<'py>> {
        let series = self.with(py, |inner| {
            let found = inner.trajectory()?;
            table::trajectory(inner.prepared(), &found)
        })?;
        let (time, channels) = frame::parts(series);
        let column = |channel: airloop_series::Channel| {
            (channel.name, channel.unit, PyArray1::from_vec(py, channel.values))
        };
        Ok((PyArray1::from_vec(py, time), channels.into_iter().map(column).collect()))
    }
}

fn owned(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}
