//! One simulation over a time span: inputs and measurement from records, result as arrays.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

use airloop::discrepancy::signals::{self, Links, SignalTable};
use airloop::discrepancy::{self, residual};
use airloop_cosim::master::simulate::{self, End, Stimulus, Watch};
use airloop_cosim::master::{self, Adaptive, Algorithm, Coupling, Settings};
use airloop_cosim::system::{self, SystemGraph};
use airloop_series::{Interpolation, TimeSeries, frame};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::error::{SettingError, raise};
use crate::record::Record;

/// Step size \[s\] where nothing else is said.
const DEFAULT_STEP: f64 = 1e-3;
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
    let all =
        [Algorithm::GaussSeidel, Algorithm::Jacobi, Algorithm::InterfaceJacobian, Algorithm::Monolithic];
    let known: Vec<String> = all.iter().map(ToString::to_string).collect();
    let found = all.into_iter().find(|one| one.to_string() == name);
    found.ok_or_else(|| crate::system::unknown("master", name, &known))
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

    /// Settings of the master.
    pub fn settings(&self, graph: &SystemGraph, start: f64, stop: f64) -> PyResult<Settings> {
        let other = |option, master| Err(raise(master::Error::OptionOfOther { option, master }));
        let algorithm = algorithm(&self.master)?;
        let given = self.corrections.map(|_| "corrections").or(self.iterate.map(|_| "iterate"));
        if let Some(option) = given.or(self.coupling_inputs.as_ref().map(|_| "inputs"))
            && algorithm != Algorithm::InterfaceJacobian
        {
            return other(option, "interface-jacobian");
        }
        let serial_or_parallel = matches!(algorithm, Algorithm::GaussSeidel | Algorithm::Jacobi);
        if self.extrapolation.is_some() && !serial_or_parallel {
            return other("extrapolation", "gauss-seidel` or `--master jacobi");
        }
        if self.adaptive && algorithm == Algorithm::Monolithic {
            return other("adaptive", "gauss-seidel`, `jacobi` or `interface-jacobian");
        }
        let default = Coupling::default();
        let ramped = match &self.coupling_inputs {
            Some(name) => one_of("coupling_inputs", name, [("ramped", true), ("held", false)])?,
            None => default.ramped,
        };
        let corrections = self.corrections.unwrap_or(default.corrections);
        let tolerance = self.step_tolerance.unwrap_or(Adaptive::default().tolerance);
        let adaptive = Adaptive { tolerance, min_step: self.min_step, max_step: self.max_step };
        Ok(Settings {
            start_time: start,
            stop_time: stop,
            step_size: self.step.or(graph.experiment.step_size).unwrap_or(DEFAULT_STEP),
            algorithm,
            coupling: Coupling { corrections, tolerance: self.iterate, ramped },
            extrapolation: self.extrapolation.unwrap_or(0),
            tolerance: self.tolerance,
            adaptive: self.adaptive.then_some(adaptive),
            read_all_outputs: true,
        })
    }
}

/// Columns of the records and the connectors that they belong to.
struct Linked<'a> {
    input: Option<(&'a Record, Links)>,
    measured: Option<(&'a Record, Links)>,
}

impl<'a> Linked<'a> {
    fn new(graph: &SystemGraph, data: &Data<'a>, table: SignalTable) -> Result<Linked<'a>, airloop::Error> {
        let link = |record: &'a Record, table: &SignalTable| {
            signals::link(graph, &record.series, table, &record.label).map(|links| (record, links))
        };
        let of_input = table.without_outputs(graph);
        let input = data.input.map(|record| link(record, &of_input)).transpose()?;
        if let Some((record, links)) = &input {
            signals::only_inputs(graph, links, &record.series, &record.label)?;
        }
        let table = if input.is_some() { table.without_inputs(graph) } else { table };
        let measured = data.measured.map(|record| link(record, &table)).transpose()?;
        if let Some((record, links)) = &measured {
            comparable(graph, record, links)?;
        }
        Ok(Linked { input, measured })
    }

    /// The record that drives the system.
    fn driver(&self) -> Option<&(&'a Record, Links)> {
        self.input.as_ref().or(self.measured.as_ref())
    }
}

fn comparable(graph: &SystemGraph, record: &Record, links: &Links) -> Result<(), airloop::Error> {
    if !links.outputs.is_empty() {
        return Ok(());
    }
    let outputs: Vec<&str> = graph.outputs.iter().map(|output| output.name.as_str()).collect();
    let (file, known) = (record.label.clone(), outputs.join(", "));
    let columns = signals::column_names(&record.series);
    Err(discrepancy::Error::NothingMeasured { file, columns, known }.into())
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
    let mut graph = graph.clone();
    let linked = Linked::new(&graph, data, SignalTable(options.signals.clone())).map_err(raise)?;
    let settings = settings(options, &graph, linked.driver().map(|(record, _)| &record.series))?;
    let mut started = Vec::new();
    let from_measured = one_of("initial", &options.initial, [("measured", true), ("zero", false)])?;
    if let Some((record, links)) = linked.measured.as_ref().filter(|_| from_measured) {
        started = signals::start_at_measured(&mut graph, &record.series, links, settings.start_time);
    }
    for (name, value) in &options.set {
        let place = format!("set={{\"{name}\": {value}}}");
        let drives =
            |links: &Links| links.inputs.iter().any(|link| graph.inputs[link.connector].name == *name);
        let driver = linked.driver().filter(|(_, links)| drives(links));
        let by = driver.map(|(record, _)| format!("the data of {}", record.label.display()));
        if let Some(by) = by.or_else(|| graph.driver_of(name)) {
            return Err(raise(system::Error::Driven { place, name: name.clone(), by }));
        }
        graph.set_start(name, value, &place).map_err(raise)?;
    }
    let interpolation = [("linear", Interpolation::Linear), ("hold", Interpolation::Hold)];
    let interpolation = one_of("interpolation", &options.interpolation, interpolation)?;
    let stimulus = linked.driver().map(|(record, links)| Stimulus {
        series: &record.series,
        links: links
            .inputs
            .iter()
            .map(|link| (link.connector, link.channel, link.conversion.factor, link.conversion.offset))
            .collect(),
        interpolation,
    });
    let run = simulate(py, &graph, &settings, stimulus.as_ref(), progress)?;
    let fits = match &linked.measured {
        Some((record, links)) if run.result.len() > 1 => {
            let compared = (&graph, settings.algorithm);
            match (residual::compare(compared, &run.result, &record.series, links, &record.label), &run.end) {
                (Ok(fits), _) => fits,
                (Err(error), End::Completed) => return Err(raise(error)),
                (Err(_), _) => Vec::new(),
            }
        }
        _ => Vec::new(),
    };
    let fits: Vec<Fit> = fits
        .into_iter()
        .map(|one| (one.name, one.unit, one.column, one.fit_percent, one.rms_error, one.samples))
        .collect();
    let (status, message, error) = match run.end {
        End::Completed => ("completed", None, None),
        End::Terminated { component, time } => {
            let at = time.or(run.result.time().last().copied()).unwrap_or(settings.start_time);
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
    answer.set_item("notes", graph.notes.iter().chain(&run.notes).cloned().collect::<Vec<_>>())?;
    answer.set_item("start_values", started)?;
    answer.set_item("initialization_s", run.initialization.as_secs_f64())?;
    answer.set_item("simulation_s", run.stepping.as_secs_f64())?;
    answer.set_item("fits", fits)?;
    Ok(answer)
}

fn settings(options: &Options, graph: &SystemGraph, data: Option<&TimeSeries>) -> PyResult<Settings> {
    let experiment = &graph.experiment;
    let first = data.and_then(|data| data.time().first().copied());
    let last = data.and_then(|data| data.time().last().copied());
    let start = options.start.or(first).or(experiment.start).unwrap_or(0.0);
    let stop = options.stop.or(last).or(experiment.stop).ok_or_else(|| {
        SettingError::new_err("give `stop`, as the system has no default experiment and there are no data")
    })?;
    let settings = options.settings(graph, start, stop)?;
    settings.validate().map_err(raise)?;
    Ok(settings)
}

/// Runs without the interpreter's lock; looks for signals (Ctrl-C) and tells the progress now and then.
fn simulate(
    py: Python<'_>,
    graph: &SystemGraph,
    settings: &Settings,
    stimulus: Option<&Stimulus<'_>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<simulate::Run> {
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
        simulate::run(graph, settings, stimulus, Watch { stop: &stop, progress: &mut look })
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
    let links = signals::link(graph, &measured.series, &table, &measured.label).map_err(raise)?;
    comparable(graph, measured, &links).map_err(raise)?;
    let fits = residual::compare((graph, algorithm), result, &measured.series, &links, &measured.label);
    let flat = |one: airloop_cosim::results::summary::SignalRecord| {
        (one.name, one.unit, one.column, one.fit_percent, one.rms_error, one.samples)
    };
    Ok(fits.map_err(raise)?.into_iter().map(flat).collect())
}
