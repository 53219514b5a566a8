//! Simulations of a system over factors.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use airloop::discrepancy::signals::SignalTable;
use airloop::simulation::{self, Data, Options, Request, Setup};
use airloop_cosim::master::Algorithm;
use airloop_cosim::master::simulate::{End, Record, Run};
use airloop_cosim::results::summary::SignalRecord;
use airloop_cosim::system::SystemGraph;
use airloop_series::{Interpolation, TimeSeries, csv};

use super::limit::Limit;
use super::{Outcome, Place, Task, Work, quantity};
use crate::Error;
use crate::file::{Of, PlanFile, Quantity, Run as RunTable, Signals};
use crate::sample::Value;
use crate::table::{Cell, Column, Type};

/// Begin of the names of factors that are settings.
const SETTING: &str = "run.";

/// A record that was read once for all tasks.
struct Recorded {
    path: PathBuf,
    /// Name in the plan.
    name: String,
    series: TimeSeries,
}

impl Recorded {
    fn read(base: &Path, name: &str) -> Result<Recorded, Error> {
        let path = base.join(name);
        let series = csv::read(&path).map_err(airloop::Error::from)?;
        Ok(Recorded { path, name: name.to_owned(), series })
    }

    fn data(&self) -> Data<'_> {
        Data { label: Path::new(&self.name), series: &self.series }
    }
}

/// Simulations of a system.
pub struct Simulate {
    system: PathBuf,
    /// The system for every master that is used.
    graphs: Vec<(Algorithm, SystemGraph)>,
    run: RunTable,
    set: Vec<(String, String)>,
    inputs: Vec<Recorded>,
    measured: Option<Recorded>,
    quantities: Vec<Quantity>,
    signals: Option<Signals>,
    limit: Limit,
    further: Vec<PathBuf>,
}

impl Simulate {
    /// Opens system and records.
    ///
    /// # Errors
    /// Files that cannot be opened, quantities without signal.
    pub fn open(plan: &PlanFile, base: &Path) -> Result<Simulate, Error> {
        let wrong = |place: &str, problem: &str| Error::Plan { place: place.into(), problem: problem.into() };
        let system = plan.system.as_ref().ok_or_else(|| wrong("system", "name the system to simulate"))?;
        let system = base.join(system);
        match &plan.signals {
            None if plan.quantities.is_empty() => {
                return Err(wrong("[[quantities]]", "name at least one: name, signal, of"));
            }
            Some(signals) if signals.names.is_empty() || signals.every == 0 => {
                return Err(wrong("[signals]", "give at least one of `names`, and `every` of at least 1"));
            }
            _ => {}
        }
        for quantity in &plan.quantities {
            let place = format!("quantity `{}`", quantity.name);
            match (&quantity.signal, quantity.of, quantity.level) {
                (Some(_), Some(Of::Event), None) => {
                    return Err(wrong(&place, "an event needs `level`, in the unit of the signal"));
                }
                (Some(_), Some(Of::RmsError | Of::Fit), _) if plan.run.measured.is_none() => {
                    return Err(wrong(&place, "there is nothing to compare with; give `measured` in [run]"));
                }
                (Some(_), Some(_), _) if quantity.file.is_none() && quantity.pointer.is_none() => {}
                _ => return Err(wrong(&place, "a quantity of a simulation has `signal` and `of`")),
            }
        }
        let listed = |name: &str| {
            let factor = plan.factors.iter().find(|factor| factor.name == format!("{SETTING}{name}"));
            let values = factor.and_then(|factor| factor.values.clone()).unwrap_or_default();
            values.iter().filter_map(|value| value.as_str().map(str::to_owned)).collect::<Vec<_>>()
        };
        let mut masters = listed("master");
        masters.extend(plan.run.master.clone());
        if masters.is_empty() {
            masters.push(Algorithm::default().to_string());
        }
        let mut graphs = Vec::new();
        for name in masters {
            let algorithm = master(&name)?;
            let graph = SystemGraph::open_for(&system, simulation::interface(algorithm));
            graphs.push((algorithm, graph.map_err(airloop::Error::from)?));
        }
        let inputs = listed("input").into_iter().chain(plan.run.input.clone());
        let inputs = inputs.map(|name| Recorded::read(base, &name)).collect::<Result<Vec<_>, _>>()?;
        let measured = plan.run.measured.as_ref().map(|name| Recorded::read(base, name)).transpose()?;
        let text = |value: &toml::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        Ok(Simulate {
            system,
            graphs,
            run: plan.run.clone(),
            set: plan.run.set.iter().map(|(name, value)| (name.clone(), text(value))).collect(),
            inputs,
            measured,
            quantities: plan.quantities.clone(),
            signals: plan.signals.clone(),
            limit: Limit::of(plan),
            further: plan.inputs.iter().map(|name| base.join(name)).collect(),
        })
    }

    /// Does something with the setup of a task; `fresh` FMUs are those of no other task if they have processes of their
    /// own.
    fn with_setup<T>(&self, task: &Task, fresh: bool, with: impl FnOnce(&Setup) -> T) -> Result<T, Error> {
        let mut run = self.run.clone();
        let mut set = self.set.clone();
        for (name, value) in &task.values {
            match (name.strip_prefix(SETTING), value) {
                (None, value) => {
                    set.retain(|(earlier, _)| earlier != name);
                    set.push((name.clone(), value.to_string()));
                }
                (Some("master"), Value::Text(text)) => run.master = Some(text.clone()),
                (Some("input"), Value::Text(text)) => run.input = Some(text.clone()),
                (Some("step"), Value::Number(number)) => run.step = Some(*number),
                (Some("stop"), Value::Number(number)) => run.stop = Some(*number),
                (Some("tolerance"), Value::Number(number)) => run.tolerance = Some(*number),
                _ => {
                    let problem = format!(
                        "`{value}`; settings are run.master and run.input (texts), run.step, run.stop and run.tolerance (numbers)"
                    );
                    return Err(Error::Plan { place: format!("factor `{name}`"), problem });
                }
            }
        }
        let algorithm = run.master.as_deref().map_or(Ok(Algorithm::default()), master)?;
        let graph = self.graphs.iter().find(|(one, _)| *one == algorithm);
        let (_, graph) = graph.expect("a system was opened for every master of the plan");
        let graph = match fresh && super::is_isolated(graph) {
            true => SystemGraph::open_for(&self.system, simulation::interface(algorithm))
                .map_err(airloop::Error::from)?,
            false => graph.clone(),
        };
        let record = |name: &String| {
            let found = self.inputs.iter().find(|one| one.name == *name);
            found.ok_or_else(|| Error::Plan {
                place: "factor `run.input`".into(),
                problem: format!("`{name}` was not read; list the records as texts in `values`"),
            })
        };
        let input = run.input.as_ref().map(record).transpose()?;
        let setup = Setup::new(
            graph,
            Request {
                options: Options {
                    start: run.start,
                    stop: run.stop,
                    step: run.step,
                    algorithm,
                    extrapolation: run.extrapolation,
                    tolerance: run.tolerance,
                    ..Options::default()
                },
                input: input.map(Recorded::data),
                measured: self.measured.as_ref().map(Recorded::data),
                signals: SignalTable(run.signals.clone()),
                start_at_measured: true,
                interpolation: if run.hold { Interpolation::Hold } else { Interpolation::Linear },
                set: &set,
                place: |name, value| format!("`{name}` = {value}"),
            },
        )?;
        Ok(with(&setup))
    }

    fn simulate(&self, setup: &Setup, stop: &AtomicBool) -> Option<Outcome> {
        let columns = self.quantities.len();
        let run = match self.limit.watch(stop, |watch| setup.run(watch, Record::default())) {
            Ok(run) => run,
            Err(error) => return Some(Outcome::failed("failed", columns, error.to_string())),
        };
        match &run.end {
            End::Interrupted => self.limit.stopped(stop, columns),
            End::Failed(error) => Some(Outcome::failed("failed", columns, error.to_string())),
            End::Terminated { component, .. } => Some(Outcome {
                status: "terminated",
                cause: Some(format!("component {component} ended the simulation")),
                ..self.outcome(setup, &run)
            }),
            End::Completed => Some(self.outcome(setup, &run)),
        }
    }

    fn outcome(&self, setup: &Setup, run: &Run) -> Outcome {
        let fits = match setup.compare(run) {
            Ok(fits) => fits,
            Err(error) => return Outcome::failed("failed", self.quantities.len(), error.to_string()),
        };
        let cell = |one: &Quantity| self.value(one, run, &fits).map_or(Cell::Empty, Cell::Number);
        let cells = self.quantities.iter().map(cell).collect();
        Outcome { signals: self.kept(&run.result), ..Outcome::ok(cells) }
    }

    /// Time and signals that are kept, thinned out.
    fn kept(&self, result: &TimeSeries) -> Vec<Vec<f64>> {
        let Some(signals) = &self.signals else { return Vec::new() };
        let last = result.time().len().saturating_sub(1);
        let every = usize::try_from(signals.every).unwrap_or(usize::MAX);
        let thin = |values: &[f64]| {
            let chosen = values.iter().enumerate().filter(|(row, _)| row % every == 0 || *row == last);
            chosen.map(|(_, value)| *value).collect::<Vec<f64>>()
        };
        let channels = signals.names.iter().map(|name| match result.channel(name) {
            Some(channel) => thin(&channel.values),
            // A variable that this master does not record.
            None => thin(&vec![f64::NAN; last + 1]),
        });
        std::iter::once(thin(result.time())).chain(channels).collect()
    }

    fn value(&self, quantity: &Quantity, run: &Run, fits: &[SignalRecord]) -> Option<f64> {
        let signal = quantity.signal.as_deref()?;
        let fit = || fits.iter().find(|fit| fit.name == signal);
        match quantity.of? {
            Of::RmsError => fit().map(|fit| fit.rms_error),
            Of::Fit => fit().and_then(|fit| fit.fit_percent),
            of => quantity::of(&run.result, signal, of, quantity.level.unwrap_or(0.0), quantity.direction),
        }
    }

    /// Unit of a signal of the first system, none if it has none, nothing if there is no such signal.
    fn unit(&self, signal: &str) -> Option<Option<String>> {
        let graph = &self.graphs[0].1;
        let inputs = graph.inputs.iter().map(|input| (input.name.clone(), input.unit.clone()));
        let outputs = graph.outputs.iter().map(|output| (output.name.clone(), output.unit.clone()));
        let inner = graph.components.iter().flat_map(|component| {
            let variables = component.fmu.description.variables.iter().enumerate();
            variables.map(|(index, variable)| {
                let unit = airloop_cosim::system::graph::unit_of(variable).map(str::to_owned);
                (component.path_of(index), unit)
            })
        });
        inputs.chain(outputs).chain(inner).find(|(name, _)| name == signal).map(|(_, unit)| unit)
    }
}

impl Work for Simulate {
    fn factor_columns(&self, plain: &[Column]) -> Vec<Column> {
        let with_unit = |column: &Column| Column {
            unit: match column.kind {
                Type::Text => None,
                _ => self.unit(&column.name).flatten(),
            },
            ..column.clone()
        };
        plain.iter().map(with_unit).collect()
    }

    fn columns(&self) -> Vec<Column> {
        let unit = |quantity: &Quantity| match quantity.of {
            Some(Of::Event) => Some("s".to_owned()),
            Some(Of::Fit) => Some("%".to_owned()),
            _ => self.unit(quantity.signal.as_deref().unwrap_or_default()).flatten(),
        };
        let column = |one: &Quantity| Column { unit: unit(one), ..Column::new(&one.name, Type::Number) };
        self.quantities.iter().map(column).collect()
    }

    fn signals(&self) -> Vec<Column> {
        let Some(signals) = &self.signals else { return Vec::new() };
        let column =
            |name: &String| Column { unit: self.unit(name).flatten(), ..Column::new(name, Type::Number) };
        let time = Column { unit: Some("s".into()), ..Column::new("time", Type::Number) };
        std::iter::once(time).chain(signals.names.iter().map(column)).collect()
    }

    fn inputs(&self) -> Vec<PathBuf> {
        let mut all = vec![self.system.clone()];
        all.extend(self.inputs.iter().chain(&self.measured).map(|record| record.path.clone()));
        all.extend(self.further.iter().cloned());
        all
    }

    fn check(&self, task: &Task) -> Result<(), Error> {
        let quantities = self
            .quantities
            .iter()
            .map(|one| (format!("quantity `{}`", one.name), one.signal.as_deref().unwrap_or_default()));
        let signals = self.signals.iter().flat_map(|signals| &signals.names);
        let signals = signals.map(|name| ("[signals] names".to_owned(), name.as_str()));
        for (place, signal) in quantities.chain(signals) {
            if self.unit(signal).is_none() {
                let outputs: Vec<&str> =
                    self.graphs[0].1.outputs.iter().map(|output| output.name.as_str()).collect();
                let problem = format!(
                    "there is no signal `{signal}`; outputs of the system are: {}, others component.variable",
                    outputs.join(", ")
                );
                return Err(Error::Plan { place, problem });
            }
        }
        self.with_setup(task, false, |_| ())
    }

    fn run(&self, task: &Task, place: Place) -> Option<Outcome> {
        match self.with_setup(task, true, |setup| self.simulate(setup, place.stop)) {
            Ok(outcome) => outcome,
            Err(error) => Some(Outcome::failed("failed", self.quantities.len(), error.to_string())),
        }
    }
}

fn master(name: &str) -> Result<Algorithm, Error> {
    simulation::algorithm(name).ok_or_else(|| Error::Plan {
        place: "master".into(),
        problem: format!(
            "there is no `{name}`; known are: {}",
            simulation::ALGORITHMS.map(|one| one.to_string()).join(", ")
        ),
    })
}
