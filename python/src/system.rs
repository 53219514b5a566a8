//! A system that was read for one interface of its FMUs.

use std::path::PathBuf;
use std::sync::Arc;

use airloop::simulation;
use airloop_cosim::coupled;
use airloop_cosim::system::SystemGraph;
use airloop_fmi::InterfaceKind;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::batch::Batch;
use crate::error::{SettingError, raise};
use crate::record::Record;
use crate::rhs::Rhs;
use crate::run;
use crate::simulation::Simulation;

/// Name, unit and type of a connector.
type Connector = (String, Option<String>, String);
/// Start, stop and step of the default experiment \[s\].
type Experiment = (Option<f64>, Option<f64>, Option<f64>);

/// A system of FMUs.
#[pyclass(frozen, module = "airloop._native")]
pub struct System {
    /// Data of the system; instances share its FMUs.
    pub graph: Arc<SystemGraph>,
}

#[pymethods]
impl System {
    /// Reads an `.ssd`, `.ssp` or `.fmu` for the interface `co-simulation`, `model-exchange` or `any`.
    #[new]
    fn new(py: Python<'_>, path: PathBuf, interface: &str) -> PyResult<System> {
        let open = match interface {
            "co-simulation" => |path: &PathBuf| SystemGraph::open_for(path, InterfaceKind::CoSimulation),
            "model-exchange" => |path: &PathBuf| SystemGraph::open_for(path, InterfaceKind::ModelExchange),
            _ => |path: &PathBuf| SystemGraph::open_to_read(path),
        };
        let graph = py.detach(|| open(&path)).map_err(raise)?;
        Ok(System { graph: Arc::new(graph) })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.graph.name
    }

    #[getter]
    fn inputs(&self) -> Vec<Connector> {
        let inputs = self.graph.inputs.iter();
        inputs.map(|input| (input.name.clone(), input.unit.clone(), input.data_type.to_string())).collect()
    }

    #[getter]
    fn outputs(&self) -> Vec<Connector> {
        let outputs = self.graph.outputs.iter();
        outputs
            .map(|output| (output.name.clone(), output.unit.clone(), output.data_type.to_string()))
            .collect()
    }

    #[getter]
    fn components(&self) -> Vec<(String, String)> {
        let components = self.graph.components.iter();
        components.map(|one| (one.name.clone(), one.fmu.description.model_name.clone())).collect()
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.graph.notes.clone()
    }

    #[getter]
    fn experiment(&self) -> Experiment {
        let experiment = &self.graph.experiment;
        (experiment.start, experiment.stop, experiment.step_size)
    }

    /// Simulates; see [`run::run`].
    #[pyo3(signature = (options, input=None, measured=None, progress=None))]
    fn run<'py>(
        &self,
        py: Python<'py>,
        options: &Bound<'py, PyDict>,
        input: Option<&Record>,
        measured: Option<&Record>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let options = run::Options::read(options)?;
        run::run(py, &self.graph, &options, &run::Data { input, measured }, progress)
    }

    /// Fit of the columns of a result to a measurement, as (name, unit, column, fit \[%\], RMS error, samples).
    fn fit(
        &self,
        master: &str,
        result: &Record,
        measured: &Record,
        signals: std::collections::BTreeMap<String, String>,
    ) -> PyResult<Vec<run::Fit>> {
        run::fit(&self.graph, run::algorithm(master)?, &result.series, measured, signals)
    }

    /// Instances whose steps the caller commands.
    fn instantiate(&self, py: Python<'_>, options: &Bound<'_, PyDict>) -> PyResult<Simulation> {
        let (graph, settings) = self.prepared(options)?;
        Simulation::open(py, graph, &settings)
    }

    /// Many instances side by side.
    fn instantiate_batch(
        &self,
        py: Python<'_>,
        options: &Bound<'_, PyDict>,
        batch: usize,
        threads: Option<usize>,
    ) -> PyResult<Batch> {
        let (graph, settings) = self.prepared(options)?;
        Batch::open(py, graph, &settings, batch, threads)
    }

    /// The system as one right-hand side with derivatives.
    fn rhs(
        &self,
        py: Python<'_>,
        states: Option<Vec<String>>,
        inputs: Option<Vec<String>>,
        outputs: Vec<String>,
        time: f64,
        set: Vec<(String, String)>,
    ) -> PyResult<Rhs> {
        let graph = started(&self.graph, &set)?;
        let options = coupled::Options { states, inputs, outputs, time };
        Rhs::open(py, &graph, &options)
    }
}

impl System {
    fn prepared(
        &self,
        options: &Bound<'_, PyDict>,
    ) -> PyResult<(Arc<SystemGraph>, airloop_cosim::master::Settings)> {
        let options = run::Options::read(options)?;
        let graph = started(&self.graph, &options.set)?;
        let experiment = &graph.experiment;
        let start = options.start.or(experiment.start).unwrap_or(0.0);
        let stop = options.stop.unwrap_or(start + run::OPEN_END);
        let settings = options.choices()?.settings(&graph, start, stop).map_err(raise)?;
        Ok((Arc::new(graph), settings))
    }
}

/// The system with start values.
///
/// # Errors
/// A name or value that does not fit.
pub fn started(graph: &SystemGraph, set: &[(String, String)]) -> PyResult<SystemGraph> {
    let mut graph = graph.clone();
    simulation::set_start_values(&mut graph, set, run::place, None).map_err(raise)?;
    Ok(graph)
}

/// A name that is none of those that are known.
pub fn unknown(what: &str, name: &str, known: &[String]) -> PyErr {
    SettingError::new_err(format!("there is no {what} `{name}`; known are: {}", known.join(", ")))
}
