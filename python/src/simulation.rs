//! Step by step: one instance of a system in a loop that Python commands.

use std::sync::{Arc, Mutex, MutexGuard};

use airloop_cosim::master::Settings;
use airloop_cosim::master::embedded::Value;
use airloop_cosim::system::SystemGraph;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyString};

use crate::error::{ClosedError, SettingError, raise};
use crate::lane::{Lane, Names, checked};
use crate::system::started;

/// An instance of a system.
#[pyclass(frozen, module = "airloop._native")]
pub struct Simulation {
    graph: Arc<SystemGraph>,
    settings: Settings,
    names: Names,
    lane: Mutex<Option<Lane>>,
}

impl Simulation {
    /// Makes the instances.
    ///
    /// # Errors
    /// Same as [`Lane::new`].
    pub fn open(py: Python<'_>, graph: Arc<SystemGraph>, settings: &Settings) -> PyResult<Simulation> {
        let lane = py.detach(|| Lane::new(&graph, settings)).map_err(raise)?;
        let names = Names::new(&graph);
        Ok(Simulation { graph, settings: *settings, names, lane: Mutex::new(Some(lane)) })
    }

    /// Waits for the instance without the interpreter's lock, as another thread may be in a step.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Lane) -> PyResult<T> + Send,
    ) -> PyResult<T> {
        let closed =
            || ClosedError::new_err("the simulation is closed; make a new one with system.instantiate()");
        let mut lane = self.lock(py);
        lane.as_mut().ok_or_else(closed).and_then(work)
    }

    fn lock(&self, py: Python<'_>) -> MutexGuard<'_, Option<Lane>> {
        match self.lane.try_lock() {
            Ok(lane) => lane,
            // A panic in another thread leaves no half-set value that a later call could see.
            Err(std::sync::TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(std::sync::TryLockError::WouldBlock) => {
                py.detach(|| drop(self.lane.lock()));
                self.lock(py)
            }
        }
    }
}

#[pymethods]
impl Simulation {
    #[getter]
    fn time(&self, py: Python<'_>) -> PyResult<f64> {
        self.with(py, |lane| Ok(lane.time()))
    }

    #[getter]
    fn ended(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.with(py, |lane| Ok(lane.ended().map(str::to_owned)))
    }

    #[getter]
    fn closed(&self, py: Python<'_>) -> bool {
        self.lock(py).is_none()
    }

    /// Sets system inputs by name.
    #[pyo3(signature = (**values))]
    fn set(&self, py: Python<'_>, values: Option<&Bound<'_, PyDict>>) -> PyResult<()> {
        let Some(values) = values else { return Ok(()) };
        let mut lane = self.lock(py);
        let lane = lane.as_mut().ok_or_else(|| ClosedError::new_err("the simulation is closed"))?;
        for (name, value) in values {
            let name = name.cast::<PyString>()?;
            let input = self.names.input(name.to_str()?)?;
            lane.set(input, checked(&self.graph, input, value.extract()?)?);
        }
        Ok(())
    }

    /// Steps on.
    #[pyo3(signature = (step=None, count=1))]
    fn step(&self, py: Python<'_>, step: Option<f64>, count: u64) -> PyResult<f64> {
        const STEPS_BETWEEN_CHECKS: u64 = 4096;
        let mut left = count;
        loop {
            let some = left.min(STEPS_BETWEEN_CHECKS);
            let mut lane = self.lock(py);
            let lane = lane.as_mut().ok_or_else(|| {
                ClosedError::new_err("the simulation is closed; make a new one with system.instantiate()")
            })?;
            py.detach(|| lane.step(step, some)).map_err(crate::lane::Stop::raise)?;
            left -= some;
            if left == 0 || lane.ended().is_some() {
                return Ok(lane.time());
            }
            py.check_signals()?;
        }
    }

    /// A value by name.
    fn get<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let place = self.names.place(name)?;
        let value = self.with(py, |lane| lane.read(&self.graph, place).map_err(raise))?;
        Ok(match value {
            Value::Real(value) => value.into_pyobject(py)?.into_any(),
            Value::Integer(value) => value.into_pyobject(py)?.into_any(),
            Value::Boolean(value) => value.into_pyobject(py)?.to_owned().into_any(),
            Value::String(value) => value.into_pyobject(py)?.into_any(),
        })
    }

    /// Time and state as bytes.
    fn save<'py>(&self, py: Python<'py>) -> PyResult<(f64, Bound<'py, PyBytes>)> {
        let (time, bytes) = self.with(py, |lane| lane.save().map_err(raise))?;
        Ok((time, PyBytes::new(py, &bytes)))
    }

    /// Returns to a saved state.
    fn restore(&self, py: Python<'_>, time: f64, state: &[u8]) -> PyResult<()> {
        let done = self.with(py, |lane| lane.restore(time, state).map_err(raise))?;
        let refused =
            || SettingError::new_err("this state is not one of this system; give what save() returned");
        done.then_some(()).ok_or_else(refused)
    }

    /// Makes the instances anew, at the start time and with start values.
    fn reset(&self, py: Python<'_>, set: Vec<(String, String)>) -> PyResult<()> {
        let changed = started(&self.graph, &set)?;
        let mut lane = self.lock(py);
        if lane.is_none() {
            return Err(ClosedError::new_err(
                "the simulation is closed; make a new one with system.instantiate()",
            ));
        }
        // The old ones go first: some FMUs have one instance in a process.
        let old = lane.take();
        let made = py.detach(|| {
            drop(old);
            Lane::new(&changed, &self.settings)
        });
        *lane = Some(made.map_err(raise)?);
        Ok(())
    }

    /// Frees the instances; a second call does nothing.
    fn close(&self, py: Python<'_>) {
        let lane = self.lock(py).take();
        py.detach(|| drop(lane));
    }
}
