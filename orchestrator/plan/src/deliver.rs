//! From planned forces to commands of the actuators, and to the motion that they bring about.
//!
//! Every actuator gets the command that [`super::feed_forward::invert`] finds, and for comparison the planned force
//! itself. Both are run through the FMU of the actuator; the forces that come out, on straight lines between the
//! samples, drive the plant, with no feedback.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use super::Error;
use super::catalog::Catalog;
use super::feed_forward::{self, Actuator, Command};
use super::file::Text;
use super::file::feed_forward::{Drive, FeedForward, Planned, Plant};
use super::prepare::Prepared;
use super::task::{Signal, positive, seconds};
use airloop_cosim::coupled::{Options, System};
use airloop_cosim::master::simulate::{self, End, Stimulus, Watch};
use airloop_cosim::master::{Algorithm, Settings};
use airloop_cosim::system::SystemGraph;
use airloop_fmi::InterfaceKind;
use airloop_ident::fit;
use airloop_ocp::transcription::{Dynamics, Point, Trajectory};
use airloop_series::{Interpolation, TimeSeries};

/// The two commands, in the order of all results.
pub const COMMANDS: [&str; 2] = ["optimized", "naive"];
/// Relative tolerance of the integrator of the plant.
const TOLERANCE: f64 = 1e-10;

/// Commands of the actuators and what they bring about.
#[derive(Debug)]
pub struct Delivery {
    /// Names of the forces, with the command of each kind ([`COMMANDS`]); outputs are those of the FMU.
    pub forces: Vec<(String, [Command; 2])>,
    /// The motion of the plant under each kind of command, where there is a plant.
    pub motions: Option<[Motion; 2]>,
    /// Planned forces, commands and delivered forces at the samples.
    pub table: TimeSeries,
}

/// A motion of the plant.
#[derive(Debug)]
pub struct Motion {
    /// All outputs of the plant.
    pub result: TimeSeries,
    /// Reason why it ended before the end of the plan, if it did.
    pub problem: Option<String>,
    /// Each state that is to be reached: reached minus planned at the end of the motion.
    pub final_error: BTreeMap<String, f64>,
}

/// Commands and motions of a plan, where its problem has `[feed_forward]`.
///
/// # Errors
/// [`Error`] names what in the file or the systems is wrong.
pub fn deliver(prepared: &Prepared, plan: &Trajectory, stop: &AtomicBool) -> Result<Option<Delivery>, Error> {
    let Some(section) = &prepared.statement.feed_forward else { return Ok(None) };
    let workshop = Workshop { prepared, plan, section, stop };
    workshop.deliver().map(Some)
}

struct Workshop<'a> {
    prepared: &'a Prepared,
    plan: &'a Trajectory,
    section: &'a FeedForward,
    stop: &'a AtomicBool,
}

impl Workshop<'_> {
    fn deliver(&self) -> Result<Delivery, Error> {
        let source = &self.prepared.statement.source;
        let graph = self.open(&self.section.actuator, InterfaceKind::ModelExchange)?;
        let catalog = Catalog::new(&graph);
        let sample = seconds(source, &self.section.sample_time)?;
        positive(source, sample, self.section.sample_time.place, "sample time")?;
        let found = catalog.want(source, &self.section.command)?;
        let largest = catalog.value(source, &self.section.largest, found)?;
        let settings = feed_forward::Settings {
            lower: -largest,
            upper: largest,
            scale: largest,
            smoothness: self.section.smoothness,
        };
        let (actuator, states) = self.actuator(&graph, &catalog, sample)?;
        let times = self.times(sample);
        let mut table = TimeSeries::new(times.clone())?;
        let mut forces = Vec::new();
        for (name, planned) in &self.section.forces {
            let wanted = self.planned(planned, &times)?;
            table.push(format!("{}.planned", name.text), None, wanted.clone())?;
            let mut both = Vec::new();
            for (kind, command) in COMMANDS.iter().zip([
                feed_forward::invert(&actuator, &wanted, settings),
                feed_forward::direct(&actuator, &wanted, settings),
            ]) {
                let mut command = command?;
                let before = wanted[0] / actuator.gain()?;
                let start = actuator.steady_state(before)?;
                command.y = self.through_fmu(&states, &start, &command.u, sample)?;
                command.fit = fit::nrmse(&wanted, &command.y).map_err(feed_forward::Error::from)?;
                table.push(format!("{}.command.{kind}", name.text), None, command.u.clone())?;
                table.push(format!("{}.delivered.{kind}", name.text), None, command.y.clone())?;
                both.push(command);
            }
            let both: [Command; 2] = both.try_into().expect("two kinds of commands");
            forces.push((name.text.clone(), both));
        }
        let motions = match &self.section.plant {
            None => None,
            Some(plant) => {
                Some([self.motion(plant, &forces, &times, 0)?, self.motion(plant, &forces, &times, 1)?])
            }
        };
        Ok(Delivery { forces, motions, table })
    }

    fn open(&self, file: &Text, interface: InterfaceKind) -> Result<SystemGraph, Error> {
        let source = &self.prepared.statement.source;
        let folder = source.file.parent().unwrap_or(Path::new(""));
        let path = folder.join(&file.text);
        if !path.exists() {
            return Err(source.error_at(file.place, format!("there is no file {}", path.display())));
        }
        Ok(SystemGraph::open_for(&path, interface)?)
    }

    /// The sampled actuator, and the names of its states.
    fn actuator(
        &self,
        graph: &SystemGraph,
        catalog: &Catalog,
        sample: f64,
    ) -> Result<(Actuator, Vec<String>), Error> {
        let source = &self.prepared.statement.source;
        let path =
            |name: &Text| Ok::<_, Error>(catalog.variables()[catalog.want(source, name)?.0].path.clone());
        let options = Options {
            states: None,
            inputs: Some(vec![path(&self.section.command)?]),
            outputs: vec![path(&self.section.output)?],
            time: 0.0,
        };
        let mut system = System::open(graph, &options)?;
        let size = system.size();
        let (n, width) = (size.states, size.arguments());
        let rest = vec![0.0; n];
        let (mut values, mut jacobian) = (vec![0.0; size.values()], vec![0.0; size.values() * width]);
        let mut at = |state: &[f64]| {
            let point = Point { time: 0.0, states: state, inputs: &[0.0] };
            system.jacobian(point, &mut values, &mut jacobian).map(|()| (values.clone(), jacobian.clone()))
        };
        let (offset, found) = at(&rest)?;
        let (_, elsewhere) = at(&vec![1.0; n])?;
        if offset.iter().any(|value| *value != 0.0) || found != elsewhere {
            let problem =
                format!("`{}` is not linear; commands are found for linear actuators only", graph.name);
            return Err(source.error_at(self.section.actuator.place, problem));
        }
        let a: Vec<f64> = (0..n).flat_map(|i| found[i * width..i * width + n].to_vec()).collect();
        let b: Vec<f64> = (0..n).map(|i| found[i * width + n]).collect();
        let output = &found[n * width..];
        let actuator = Actuator::sampled(&a, &b, output[..n].to_vec(), output[n], sample)?;
        Ok((actuator, system.names()[..n].to_vec()))
    }

    /// Samples from the start of the plan to its end.
    fn times(&self, sample: f64) -> Vec<f64> {
        let phases = &self.plan.phases;
        let (start, end) = (phases[0].begin(), phases[phases.len() - 1].end());
        let count = ((end - start) / sample + 1e-9).floor() as usize;
        (0..=count).map(|k| start + k as f64 * sample).collect()
    }

    /// A planned variable at times.
    fn planned(&self, planned: &Planned, times: &[f64]) -> Result<Vec<f64>, Error> {
        let (source, catalog) = (&self.prepared.statement.source, &self.prepared.catalog);
        let (index, _) = catalog.want(source, &planned.variable)?;
        let signal = self.prepared.task.signals.of(index);
        let value: Box<dyn Fn(f64) -> f64> = match signal {
            Some(Signal::State(i)) => Box::new(move |t| self.plan.states_at(t)[i]),
            Some(Signal::Input(i)) => Box::new(move |t| self.plan.inputs_at(t)[i]),
            _ => {
                let problem =
                    format!("`{}` is neither a state nor an input of the plan", planned.variable.text);
                return Err(source.error_at(planned.variable.place, problem));
            }
        };
        Ok(times.iter().map(|&t| planned.factor * value(t)).collect())
    }

    /// Output of the actuator's FMU at the samples, from a state.
    fn through_fmu(
        &self,
        states: &[String],
        start: &[f64],
        commands: &[f64],
        sample: f64,
    ) -> Result<Vec<f64>, Error> {
        let mut graph = self.open(&self.section.actuator, InterfaceKind::CoSimulation)?;
        for (name, value) in states.iter().zip(start) {
            graph.set_start(name, &value.to_string(), "the steady state of the actuator")?;
        }
        // One more sample, so that the last one stands at the start of a step, too.
        let held = commands.iter().chain(commands.last()).copied().collect();
        let mut series = TimeSeries::new((0..=commands.len()).map(|k| k as f64 * sample).collect())?;
        series.push(self.section.command.text.clone(), None, held)?;
        let settings = Settings {
            stop_time: commands.len() as f64 * sample,
            step_size: sample,
            algorithm: Algorithm::GaussSeidel,
            ..Settings::default()
        };
        let run = self.run(&graph, &settings, &series, Interpolation::Hold)?;
        let column = run.result.channel(&self.section.output.text);
        match (run.end, column) {
            (End::Completed, Some(column)) => Ok(column.values[..commands.len()].to_vec()),
            (End::Failed(error), _) => Err(error.into()),
            (_, None) => {
                let problem =
                    format!("`{}` is not an output of the actuator's system", self.section.output.text);
                Err(self.prepared.statement.source.error_at(self.section.output.place, problem))
            }
            _ => Err(Error::Place {
                place: "the run of the actuator".into(),
                problem: "it ended early".into(),
            }),
        }
    }

    fn run(
        &self,
        graph: &SystemGraph,
        settings: &Settings,
        series: &TimeSeries,
        interpolation: Interpolation,
    ) -> Result<simulate::Run, Error> {
        let mut links = Vec::new();
        for (channel, one) in series.channels().iter().enumerate() {
            let Some(input) = graph.inputs.iter().position(|input| input.name == one.name) else {
                let known: Vec<&str> = graph.inputs.iter().map(|input| input.name.as_str()).collect();
                let problem = format!("`{}` is not an input of it; it has: {}", one.name, known.join(", "));
                return Err(Error::Place { place: format!("system `{}`", graph.name), problem });
            };
            links.push((input, channel, 1.0, 0.0));
        }
        let stimulus = Stimulus { series, links, interpolation };
        let watch = Watch { stop: self.stop, progress: &mut |_, _| {} };
        Ok(simulate::run(graph, settings, Some(&stimulus), watch)?)
    }

    /// The plant under the forces of one kind of command.
    fn motion(
        &self,
        plant: &Plant,
        forces: &[(String, [Command; 2])],
        times: &[f64],
        kind: usize,
    ) -> Result<Motion, Error> {
        let source = &self.prepared.statement.source;
        let mut graph = self.open(&plant.system, InterfaceKind::ModelExchange)?;
        for (name, value) in &plant.parameters {
            let (line, _) = source.line_column(name.place);
            graph.set_start(&name.text, &value.to_string(), &format!("line {line}"))?;
        }
        let end = self.plan.phases[self.plan.phases.len() - 1].end();
        let (mut longer, last) = (times.to_vec(), times.len() - 1);
        let over = end - times[last];
        if over > 1e-9 {
            longer.push(end);
        }
        let mut series = TimeSeries::new(longer.clone())?;
        for (name, drive) in &plant.inputs {
            let values = match drive {
                Drive::Planned(planned) => self.planned(planned, &longer)?,
                Drive::Force(force, factor) => {
                    let Some((_, commands)) = forces.iter().find(|(one, _)| *one == force.text) else {
                        let problem = format!("there is no force `{}` in [feed_forward.forces]", force.text);
                        return Err(source.error_at(force.place, problem));
                    };
                    let y = &commands[kind].y;
                    let mut values: Vec<f64> = y.iter().map(|y| factor * y).collect();
                    if longer.len() > times.len() {
                        // On the line of the last two samples.
                        let slope = (y[last] - y[last - last.min(1)])
                            / (times[last] - times[last - last.min(1)]).max(1e-9);
                        values.push(factor * (y[last] + slope * over));
                    }
                    values
                }
            };
            series.push(name.text.clone(), None, values)?;
        }
        let settings = Settings {
            start_time: longer[0],
            stop_time: end,
            step_size: times[1.min(last)] - times[0],
            // Only this one lets inputs follow lines within a step.
            algorithm: Algorithm::Monolithic,
            tolerance: Some(TOLERANCE),
            ..Settings::default()
        };
        let run = self.run(&graph, &settings, &series, Interpolation::Linear)?;
        let problem = match run.end {
            End::Completed => None,
            End::Terminated { component, time } => Some(format!(
                "component `{component}` ended the motion{}",
                time.map_or(String::new(), |time| format!(" at t = {time:.4} s"))
            )),
            End::Interrupted => Some("the motion was interrupted".into()),
            End::Failed(error) => Some(error.to_string()),
        };
        let mut final_error = BTreeMap::new();
        for (output, state) in &plant.states {
            let planned = Planned { variable: state.clone(), factor: 1.0 };
            let planned = self.planned(&planned, &[end])?[0];
            let Some(channel) = run.result.channel(&output.text) else {
                let problem = format!("`{}` is not an output of the plant", output.text);
                return Err(source.error_at(output.place, problem));
            };
            if let Some(reached) = channel.values.last() {
                final_error.insert(output.text.clone(), reached - planned);
            }
        }
        Ok(Motion { result: run.result, problem, final_error })
    }
}
