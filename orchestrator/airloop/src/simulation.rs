//! One simulation made ready: a system, its start values, the records that drive it and that it is compared with, and
//! the settings of the master.
//!
//! The command line, the Python package and sweeps all begin a simulation with a [`Setup`]; what they do with the run
//! is theirs. Start reading at [`Setup::new`].

use std::path::Path;

use airloop_cosim::master::simulate::{self, Record, Run, Stimulus, Watch};
use airloop_cosim::master::{self, Adaptive, Algorithm, Coupling, Grid, Settings};
use airloop_cosim::results::summary::SignalRecord;
use airloop_cosim::system::{self, SystemGraph};
use airloop_fmi::InterfaceKind;
use airloop_series::{Interpolation, TimeSeries};

use crate::Error;
use crate::discrepancy::signals::{self, Link, Links, SignalTable};
use crate::discrepancy::{self, residual};

/// Communication step \[s\] where nothing else is said.
const DEFAULT_STEP: f64 = 1e-3;

/// All masters.
pub const ALGORITHMS: [Algorithm; 4] =
    [Algorithm::GaussSeidel, Algorithm::Jacobi, Algorithm::InterfaceJacobian, Algorithm::Monolithic];

/// The master of this name, if there is one.
pub fn algorithm(name: &str) -> Option<Algorithm> {
    ALGORITHMS.into_iter().find(|one| one.to_string() == name)
}

/// Interface of the FMUs that a master uses.
pub fn interface(algorithm: Algorithm) -> InterfaceKind {
    match algorithm {
        Algorithm::Monolithic => InterfaceKind::ModelExchange,
        _ => InterfaceKind::CoSimulation,
    }
}

/// Choices of a caller; what is left out comes from the records, then from the system, then from [`Settings`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Options {
    /// Start time \[s\].
    pub start: Option<f64>,
    /// Stop time \[s\].
    pub stop: Option<f64>,
    /// Communication step \[s\].
    pub step: Option<f64>,
    /// Coupling of the components.
    pub algorithm: Algorithm,
    /// Order of the polynomials that inputs follow inside a step; Gauss-Seidel and Jacobi only.
    pub extrapolation: Option<u32>,
    /// Relative tolerance of the slaves and of the monolithic master.
    pub tolerance: Option<f64>,
    /// Adaptive steps, if wanted; not for the monolithic master.
    pub adaptive: Option<Adaptive>,
    /// Steps repeated; interface-Jacobian master only.
    pub corrections: Option<u32>,
    /// Change of the outputs at which repeating ends; interface-Jacobian master only.
    pub iterate: Option<f64>,
    /// Whether inputs run along lines inside a step; interface-Jacobian master only.
    pub ramped: Option<bool>,
}

impl Options {
    /// Settings of the master between two times \[s\].
    ///
    /// # Errors
    /// [`master::Error::OptionOfOther`] for an option that the master does not have.
    pub fn settings(&self, graph: &SystemGraph, start: f64, stop: f64) -> Result<Settings, master::Error> {
        let other = |option, master| Err(master::Error::OptionOfOther { option, master });
        let coupling = self.corrections.map(|_| "corrections").or(self.iterate.map(|_| "iterate"));
        if let Some(option) = coupling.or(self.ramped.map(|_| "inputs"))
            && self.algorithm != Algorithm::InterfaceJacobian
        {
            return other(option, "interface-jacobian");
        }
        let extrapolates = matches!(self.algorithm, Algorithm::GaussSeidel | Algorithm::Jacobi);
        if self.extrapolation.is_some() && !extrapolates {
            return other("extrapolation", "gauss-seidel` or `--master jacobi");
        }
        if self.adaptive.is_some() && self.algorithm == Algorithm::Monolithic {
            return other("adaptive", "gauss-seidel`, `jacobi` or `interface-jacobian");
        }
        let default = Coupling::default();
        Ok(Settings {
            start_time: start,
            stop_time: stop,
            step_size: self.step.or(graph.experiment.step_size).unwrap_or(DEFAULT_STEP),
            algorithm: self.algorithm,
            coupling: Coupling {
                corrections: self.corrections.unwrap_or(default.corrections),
                tolerance: self.iterate,
                ramped: self.ramped.unwrap_or(default.ramped),
            },
            extrapolation: self.extrapolation.unwrap_or(0),
            tolerance: self.tolerance,
            adaptive: self.adaptive,
            read_all_outputs: true,
        })
    }
}

/// A record and the name that it has in messages.
#[derive(Debug, Clone, Copy)]
pub struct Data<'a> {
    /// Path of the file, or what stands for it.
    pub label: &'a Path,
    /// Signals.
    pub series: &'a TimeSeries,
}

/// A record and the connectors that its columns belong to.
#[derive(Debug, Clone)]
pub struct Linked<'a> {
    /// Record.
    pub data: Data<'a>,
    /// Columns by connector.
    pub links: Links,
}

impl Linked<'_> {
    /// Whether the record has a column for this input of the system.
    fn drives(&self, graph: &SystemGraph, name: &str) -> bool {
        self.links.inputs.iter().any(|link| graph.inputs[link.connector].name == name)
    }
}

/// All that a simulation begins with.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// Choices of the caller.
    pub options: Options,
    /// Record that holds inputs of the system only.
    pub input: Option<Data<'a>>,
    /// Record to compare with; it drives the inputs where there is no `input`.
    pub measured: Option<Data<'a>>,
    /// Columns of another name than their connector.
    pub signals: SignalTable,
    /// Whether measured states begin at their first measured value.
    pub start_at_measured: bool,
    /// Continuous inputs between their samples.
    pub interpolation: Interpolation,
    /// Start values by name, as texts, in the unit of the variable.
    pub set: &'a [(String, String)],
    /// Words of a message for the place where a start value was given, from its name and value.
    pub place: fn(&str, &str) -> String,
}

/// A simulation that can begin.
#[derive(Debug, Clone)]
pub struct Setup<'a> {
    /// System with its start values.
    pub graph: SystemGraph,
    /// Settings of the master.
    pub settings: Settings,
    /// Communication points.
    pub grid: Grid,
    /// Record of inputs.
    pub input: Option<Linked<'a>>,
    /// Record to compare with.
    pub measured: Option<Linked<'a>>,
    /// Outputs whose states begin at the measured value.
    pub started: Vec<String>,
    interpolation: Interpolation,
}

impl<'a> Setup<'a> {
    /// Links the records, settles the time span and sets the start values.
    ///
    /// # Errors
    /// Columns without connector, units that do not fit, a record that has no output of the system or no time in
    /// common with the run, settings out of range, a start value that is unknown, out of its type or driven by
    /// something else.
    pub fn new(mut graph: SystemGraph, request: Request<'a>) -> Result<Setup<'a>, Error> {
        // Lengths of arrays decide which connectors there are.
        for (name, value) in request.set {
            if graph.is_length(name) {
                graph.set_start(name, value, &(request.place)(name, value))?;
            }
        }
        let (input, measured) = link(&graph, &request)?;
        let settings = settle(&graph, &request.options, input.as_ref().or(measured.as_ref()))?;
        if let Some(measured) = &measured {
            check_overlap(measured, &settings)?;
        }
        let grid = settings.validate()?;
        let mut started = Vec::new();
        if let Some(measured) = measured.as_ref().filter(|_| request.start_at_measured) {
            let (series, links) = (measured.data.series, &measured.links);
            started = signals::start_at_measured(&mut graph, series, links, settings.start_time);
        }
        set_start_values(&mut graph, request.set, request.place, input.as_ref().or(measured.as_ref()))?;
        let interpolation = request.interpolation;
        Ok(Setup { graph, settings, grid, input, measured, started, interpolation })
    }

    /// The record that drives the system.
    pub fn driver(&self) -> Option<&Linked<'a>> {
        self.input.as_ref().or(self.measured.as_ref())
    }

    /// Signals for the inputs of the system.
    pub fn stimulus(&self) -> Option<Stimulus<'a>> {
        let of = |link: &Link| (link.connector, link.channel, link.conversion.factor, link.conversion.offset);
        self.driver().map(|driver| Stimulus {
            series: driver.data.series,
            links: driver.links.inputs.iter().map(of).collect(),
            interpolation: self.interpolation,
        })
    }

    /// Simulates; `record` says which rows are kept, and where.
    ///
    /// # Errors
    /// Same as [`simulate::run`].
    pub fn run(&self, watch: Watch, record: Record) -> Result<Run, Error> {
        let stimulus = self.stimulus();
        Ok(simulate::run_recorded(&self.graph, &self.settings, stimulus.as_ref(), watch, record)?)
    }

    /// Fit of every measured output; empty without a measurement.
    ///
    /// # Errors
    /// Same as [`residual::compare`].
    pub fn compare(&self, run: &Run) -> Result<Vec<SignalRecord>, discrepancy::Error> {
        let Some(Linked { data, links }) = &self.measured else { return Ok(Vec::new()) };
        let simulated = (&self.graph, self.settings.algorithm);
        residual::compare(simulated, &run.result, data.series, links, data.label)
    }
}

/// A record to compare with, and its connectors.
///
/// # Errors
/// Columns and units as in [`signals::link`]; [`discrepancy::Error::NothingMeasured`].
pub fn link_measured<'a>(
    graph: &SystemGraph,
    data: Data<'a>,
    table: &SignalTable,
) -> Result<Linked<'a>, discrepancy::Error> {
    let links = signals::link(graph, data.series, table, data.label)?;
    if links.outputs.is_empty() {
        let outputs: Vec<&str> = graph.outputs.iter().map(|output| output.name.as_str()).collect();
        return Err(discrepancy::Error::NothingMeasured {
            file: data.label.into(),
            columns: signals::column_names(data.series),
            known: outputs.join(", "),
        });
    }
    Ok(Linked { data, links })
}

/// Records of inputs and of a measurement, linked.
type Records<'a> = (Option<Linked<'a>>, Option<Linked<'a>>);

fn link<'a>(graph: &SystemGraph, request: &Request<'a>) -> Result<Records<'a>, Error> {
    let input = request.input.map(|data| {
        let links = signals::link(graph, data.series, &request.signals.without_outputs(graph), data.label)?;
        signals::only_inputs(graph, &links, data.series, data.label)?;
        Ok::<_, Error>(Linked { data, links })
    });
    let input = input.transpose()?;
    let table = match input {
        Some(_) => request.signals.without_inputs(graph),
        None if request.measured.is_some() => request.signals.clone(),
        None => SignalTable::default(),
    };
    let measured = request.measured.map(|data| link_measured(graph, data, &table)).transpose()?;
    Ok((input, measured))
}

/// Settings over the time span that the caller, the record or the system gives.
fn settle(graph: &SystemGraph, options: &Options, driver: Option<&Linked>) -> Result<Settings, Error> {
    let time = driver.map_or(&[][..], |driver| driver.data.series.time());
    let start = options.start.or(time.first().copied()).or(graph.experiment.start).unwrap_or(0.0);
    let missing = master::Error::Setting {
        name: "stop time",
        value: f64::NAN,
        allowed: "given with --stop, as the system has no default experiment and there are no data",
    };
    let stop = options.stop.or(time.last().copied()).or(graph.experiment.stop).ok_or(missing);
    // An option of another master is the mistake to name first.
    let settings = options.settings(graph, start, stop.as_ref().copied().unwrap_or(start))?;
    stop?;
    Ok(settings)
}

/// There must be something to compare, which is known before anything is simulated.
fn check_overlap(measured: &Linked, settings: &Settings) -> Result<(), discrepancy::Error> {
    let (time, span) = (measured.data.series.time(), settings.start_time..=settings.stop_time);
    let inside = time.iter().any(|t| span.contains(t));
    match (time.first(), time.last()) {
        (Some(&first), Some(&last)) if !inside => Err(discrepancy::Error::NoOverlap {
            file: measured.data.label.into(),
            first,
            last,
            start: settings.start_time,
            stop: settings.stop_time,
        }),
        _ => Ok(()),
    }
}

/// Sets start values, none of which may be driven by a connection or by `driver`.
///
/// # Errors
/// [`system::Error::Driven`]; a name that is unknown, or a value that its type does not allow.
pub fn set_start_values(
    graph: &mut SystemGraph,
    set: &[(String, String)],
    place: fn(&str, &str) -> String,
    driver: Option<&Linked>,
) -> Result<(), system::Error> {
    for (name, value) in set {
        let place = place(name, value);
        let driver = driver.filter(|driver| driver.drives(graph, name));
        let by = driver.map(|driver| format!("the data of {}", driver.data.label.display()));
        if let Some(by) = by.or_else(|| graph.driver_of(name)) {
            return Err(system::Error::Driven { place, name: name.clone(), by });
        }
        graph.set_start(name, value, &place)?;
    }
    Ok(())
}
