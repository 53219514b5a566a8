//! One simulation over a time span: inputs and measurement from records, result as arrays.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

use airloop::discrepancy::residual;
use airloop::discrepancy::signals::SignalTable;
use airloop::simulation::{self, Request, Setup};
use airloop_cosim::master::simulate::{self, End, Watch};
use airloop_cosim::master::{Adaptive, Algorithm};
use airloop_cosim::results::summary::SignalRecord;
use airloop_cosim::system::SystemGraph;
use airloop_series::{Interpolation, TimeSeries, frame};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::error::raise;
use crate::record::Record;

/// Length \[s\] of a simulation whose caller commands the steps and names no stop time.
pub const OPEN_END: f64 = 1e9;

/// Name, unit, column, fit \[%\], RMS error and samples of a measured signal.
pub type Fit = (String, Option<String>, String, Option<f64>, f64, usize);

/// Options of a run, with the names of the command line.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options {
    /// Start time \[s\].
    pub start: Option<f64>,
    /// Stop time \[s\].
    pub stop: Option<f64>,
    step: Option<f64>,
    master: String,
    extrapolation: Option<u32>,
    tolerance: Option<f64>,
    interpolation: String,
    initial: String,
    adaptive: bool,
    step_tolerance: Option<f64>,
    min_step: Option<f64>,
    max_step: Option<f64>,
    corrections: Option<u32>,
    iterate: Option<f64>,
    coupling_inputs: Option<String>,
    /// Start values by name, as texts.
    pub set: Vec<(String, String)>,
    /// Columns of another name, by connector.
    signals: BTreeMap<String, String>,
}

/// Records of a run.
pub struct Data<'a> {
    /// Inputs of the system only.
    pub input: Option<&'a Record>,
    /// Measurement, with the inputs where there are no others.
    pub measured: Option<&'a Record>,
}

/// The master of this name.
pub fn algorithm(name: &str) -> PyResult<Algorithm> {
    let known = || simulation::ALGORITHMS.map(|one| one.to_string()).to_vec();
    simulation::algorithm(name).ok_or_else(|| crate::system::unknown("master", name, &known()))
}

fn one_of<T: Copy>(what: &str, name: &str, choices: [(&str, T); 2]) -> PyResult<T> {
    let found = choices.iter().find(|(known, _)| *known == name);
    let known = choices.map(|(known, _)| known.to_owned());
    found.map(|(_, choice)| *choice).ok_or_else(|| crate::system::unknown(what, name, &known))
}

impl Options {
    /// Reads a dictionary that has a value or None for every option.
    pub fn read(options: &Bound<'_, PyDict>) -> PyResult<Options> {
        options.extract()
    }

    /// Choices as the library has them.
    pub fn choices(&self) -> PyResult<simulation::Options> {
        let ramped = self.coupling_inputs.as_deref();
        let ramped = ramped
            .map(|name| one_of("coupling_inputs", name, [("ramped", true), ("held", false)]))
            .transpose()?;
        let tolerance = self.step_tolerance.unwrap_or(Adaptive::default().tolerance);
        let adaptive = Adaptive { tolerance, min_step: self.min_step, max_step: self.max_step };
        Ok(simulation::Options {
            start: self.start,
            stop: self.stop,
            step: self.step,
            algorithm: algorithm(&self.master)?,
            extrapolation: self.extrapolation,
            tolerance: self.tolerance,
            adaptive: self.adaptive.then_some(adaptive),
            corrections: self.corrections,
            iterate: self.iterate,
            ramped,
        })
    }
}

/// Place of a start value in messages.
pub fn place(name: &str, value: &str) -> String {
    format!("set={{\"{name}\": {value}}}")
}

/// Simulates a system; the dictionary has the arrays `time` and `columns` (name, unit, array), `status`, `message`,
/// `error`, `steps`, `notes`, `start_values`, `initialization_s`, `simulation_s` and `fits`.
///
/// # Errors
/// The run cannot start; KeyboardInterrupt. A failure after the start is in `error`, with the result so far.
pub fn run<'py>(
    py: Python<'py>,
    graph: &SystemGraph,
    options: &Options,
    data: &Data<'_>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let interpolation = [("linear", Interpolation::Linear), ("hold", Interpolation::Hold)];
    let request = Request {
        options: options.choices()?,
        input: data.input.map(Record::data),
        measured: data.measured.map(Record::data),
        signals: SignalTable(options.signals.clone()),
        start_at_measured: one_of("initial", &options.initial, [("measured", true), ("zero", false)])?,
        interpolation: one_of("interpolation", &options.interpolation, interpolation)?,
        set: &options.set,
        place,
    };
    let setup = Setup::new(graph.clone(), request).map_err(raise)?;
    let run = simulate(py, &setup, progress)?;
    let fits = match setup.compare(&run) {
        _ if run.result.len() < 2 => Vec::new(),
        Ok(fits) => fits.into_iter().map(flat).collect(),
        Err(error) if matches!(run.end, End::Completed) => return Err(raise(error)),
        Err(_) => Vec::new(),
    };
    let (status, message, error) = match run.end {
        End::Completed => ("completed", None, None),
        End::Terminated { component, time } => {
            let at = time.or(run.result.time().last().copied()).unwrap_or(setup.settings.start_time);
            ("terminated", Some(format!("component {component} ended the simulation at t = {at} s")), None)
        }
        End::Interrupted => ("interrupted", None, None),
        End::Failed(error) => {
            let text = error.to_string();
            ("failed", Some(text), Some(raise(error)))
        }
    };
    let answer = PyDict::new(py);
    let (time, channels) = frame::parts(run.result);
    answer.set_item("time", PyArray1::from_vec(py, time))?;
    let columns = PyList::empty(py);
    for channel in channels {
        columns.append((channel.name, channel.unit, PyArray1::from_vec(py, channel.values)))?;
    }
    answer.set_item("columns", columns)?;
    answer.set_item("status", status)?;
    answer.set_item("message", message)?;
    answer.set_item("error", error.map(|error| error.into_value(py)))?;
    answer.set_item("steps", run.steps)?;
    answer.set_item("notes", setup.graph.notes.iter().chain(&run.notes).cloned().collect::<Vec<_>>())?;
    answer.set_item("start_values", setup.started)?;
    answer.set_item("initialization_s", run.initialization.as_secs_f64())?;
    answer.set_item("simulation_s", run.stepping.as_secs_f64())?;
    answer.set_item("fits", fits)?;
    Ok(answer)
}

/// Runs without the interpreter's lock; looks for signals (Ctrl-C) and tells the progress now and then.
fn simulate(py: Python<'_>, setup: &Setup<'_>, progress: Option<Py<PyAny>>) -> PyResult<simulate::Run> {
    let stop = AtomicBool::new(false);
    let mut raised = None;
    let run = py.detach(|| {
        let mut look = |done: u64, all: u64| {
            let looked = Python::attach(|py| {
                py.check_signals()?;
                progress.as_ref().map_or(Ok(()), |progress| progress.call1(py, (done, all)).map(drop))
            });
            if let Err(error) = looked {
                raised = Some(error);
                stop.store(true, Ordering::Relaxed);
            }
        };
        setup.run(Watch { stop: &stop, progress: &mut look }, simulate::Record::default())
    });
    match raised {
        Some(error) => Err(error),
        None => run.map_err(raise),
    }
}

/// Fit of a result to a measurement.
///
/// # Errors
/// Columns without connector, or no time in common.
pub fn fit(
    graph: &SystemGraph,
    algorithm: Algorithm,
    result: &TimeSeries,
    measured: &Record,
    signals: BTreeMap<String, String>,
) -> PyResult<Vec<Fit>> {
    let table = SignalTable(signals).without_inputs(graph);
    let linked = simulation::link_measured(graph, measured.data(), &table).map_err(raise)?;
    let simulated = (graph, algorithm);
    let fits = residual::compare(simulated, result, &measured.series, &linked.links, &measured.label);
    Ok(fits.map_err(raise)?.into_iter().map(flat).collect())
}

fn flat(one: SignalRecord) -> Fit {
    (one.name, one.unit, one.column, one.fit_percent, one.rms_error, one.samples)
}
