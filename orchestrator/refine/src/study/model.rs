//! A study ready to be simulated: records, the parameter vector, and the place in the system of each of its entries.

use std::sync::{Mutex, PoisonError};

use super::Problem;
use super::begin::Begin;
use super::catalog::Candidate;
use super::declaration::{Attachment, ForceRule, Initial, InitialWord, Role};
use super::law::{Law, Point, Variable};
use super::noise::SensorNoise;
use super::plant::{Parameter, Plant};
use super::read::Record;
use crate::engine::fit::Free;
use crate::regime::deviation;
use airloop_cosim::system::SystemGraph;

/// A measured output.
#[derive(Debug, Clone)]
pub struct Output {
    /// Column.
    pub name: String,
    /// Output of the system.
    pub port: String,
    /// Slot of the system's signal.
    pub slot: usize,
    /// Unit.
    pub unit: String,
    /// Rms of the sensor noise.
    pub noise: f64,
    /// Whether the study states it.
    pub noise_is_stated: bool,
    /// Entry of the parameter vector that is its offset, if the declared model has one.
    pub offset: Option<usize>,
}

/// Role of an entry of the parameter vector.
#[derive(Debug, Clone)]
pub enum Target {
    /// A parameter of the system.
    Declared(Parameter),
    /// Relative change of a parameter of the system that is known to a tolerance.
    Correction {
        /// Parameter of the system.
        parameter: Parameter,
        /// Its declared value.
        declared: f64,
    },
    /// Offset of an output.
    Offset,
    /// Parameter of a candidate.
    Effect,
}

/// An entry of the parameter vector.
#[derive(Debug, Clone)]
pub struct Entry {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Role of the entry.
    pub target: Target,
    /// Value to start from.
    pub start: f64,
    /// Bounds and difference step.
    pub free: Free,
}

/// Where blocks act.
#[derive(Debug, Clone)]
pub struct Tap {
    /// Input of the system or of a component, or rate of a state.
    pub name: String,
    /// Slots of velocity, position, pressure force and pressure.
    pub signals: [Option<usize>; 4],
    /// Names of velocity and position in words: those of the vocabulary where a channel is declared, else of the
    /// system.
    pub words: [String; 2],
    /// Units of the value that passes, of velocity and position.
    pub units: [String; 3],
    /// Whether a channel is declared.
    pub stated: bool,
    /// Where its signals come from.
    pub attachment: Attachment,
    /// -1 where a larger value makes the velocity fall: what is taken off is added then.
    pub sign: f64,
    /// Velocity over which friction changes its sign.
    pub vt: f64,
    /// Velocity at which friction changes its sign.
    pub v0: f64,
    /// Its motion is a rotation.
    pub angular: bool,
    /// Coulomb friction of the declared model: entry of the parameter vector, or its value.
    pub coulomb: Option<Level>,
    /// Coefficient of the viscous friction that the declared model has here and keeps fixed; 0 without.
    pub viscous: f64,
    /// Attachment at the same input that shows the motion there, where this one shows a motion at other inputs.
    pub crossed: Option<usize>,
}

/// A value of the declared model.
#[derive(Debug, Clone, Copy)]
pub enum Level {
    /// Entry of the parameter vector.
    Entry(usize),
    /// Fixed value.
    Value(f64),
}

impl Level {
    /// Value for a parameter vector.
    pub fn of(self, p: &[f64]) -> f64 {
        match self {
            Level::Entry(index) => p[index],
            Level::Value(value) => value,
        }
    }
}

/// Place and kind of the change that a candidate makes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Action {
    /// A block at an attachment.
    Block {
        /// Law.
        law: Law,
        /// Attachment.
        tap: usize,
    },
    /// A change of a measured command with memory.
    Command {
        /// Kind.
        kind: super::command::Command,
        /// System input.
        input: usize,
    },
    /// A sensor.
    Sensor {
        /// Kind.
        kind: Sensor,
        /// Output.
        output: usize,
    },
}

/// Sensor effects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sensor {
    /// `y + value`
    Offset,
    /// `(1 + gain) y`
    Gain,
    /// `y(t - delay)`
    Delay,
    /// `tau y' = value - y`
    Lag,
    /// `y + slope t`
    Drift,
    /// `y + coef y^2`
    Nonlinearity,
    /// `y` rounded to a multiple of a step
    Quantization,
    /// An effect of one's own: index into [`Study::own`].
    Own(usize),
}

/// A study.
#[derive(Debug)]
pub struct Study {
    /// Name.
    pub name: String,
    /// System.
    pub graph: SystemGraph,
    /// Segments.
    pub records: Vec<Record>,
    /// Names of further signals.
    pub extra: Vec<String>,
    /// Variables that attachments name; they are shown although they may be no outputs.
    pub shown: Vec<String>,
    /// Whether system inputs are held between samples.
    pub held: Vec<bool>,
    /// Runge-Kutta steps per sample.
    pub substeps: usize,
    /// Whether each state is unobservable: no output shows where it begins; empty: not looked for.
    pub unobservable: Vec<bool>,
    /// Where the fits of the initial states begin that no column of `[states]` shows, `[nx]`; empty: at zero.
    pub begins: Vec<Begin>,
    /// Measured outputs.
    pub outputs: Vec<Output>,
    /// Parameter vector: the declared model first, then candidates.
    pub entries: Vec<Entry>,
    /// Entries of the declared model.
    pub declared: usize,
    /// Fixed parameters of the system.
    pub fixed: Vec<(Parameter, f64)>,
    /// Where blocks act.
    pub taps: Vec<Tap>,
    /// Effects of one's own, which [`Law::Own`] names by their place.
    pub own: Vec<std::sync::Arc<crate::vocabulary::Own>>,
    /// Signals at the attachments with the declared model, by record: step \[s\] and `[taps][n]`; kept where an effect
    /// of one's own has to take energy.
    pub motion: Vec<(f64, Vec<Vec<Point>>)>,
    /// Free forms that laws are made of, which [`Law::Surface`] names by their place.
    pub surfaces: Vec<crate::law::surface::Surface>,
    /// Candidates.
    pub candidates: Vec<Candidate>,
    /// Ranges at each attachment: velocity, position, pressure force, pressure, the value that passes.
    pub ranges: Vec<[(f64, f64); 5]>,
    /// Positions at each attachment with the declared model; empty: not looked for.
    pub positions: Vec<Vec<f64>>,
    /// Restart of the simulation \[s\].
    pub windows: Option<f64>,
    /// By record: how its windows answer noise of the states that they start from; empty: not known.
    pub starts: Vec<super::starts::Starts>,
    /// Force residual: rule, velocity state, tap, output column of the driving force.
    pub force: Option<(ForceRule, usize, usize, String)>,
    /// Whether components have time events, so states of their own that no sensor shows.
    pub sampled: bool,
    /// Whether components step by themselves: their states are neither seen nor set, so that they always begin at the
    /// start of a record.
    pub steps_alone: bool,
    /// Noise of the sensors.
    pub sensors: SensorNoise,
    /// Remarks.
    pub notes: Vec<String>,
    /// Candidates that cannot be tested and why.
    pub not_testable: Vec<(String, String)>,
    /// Instances not in use.
    pub pool: Mutex<Vec<Plant>>,
    /// Why the first simulation failed in which an FMU did, and whether its process was lost.
    pub failure: Mutex<Option<(String, bool)>>,
}

/// Samples of a `window` \[s\] with a `step` \[s\], two at least.
pub fn window_samples(window: f64, step: f64) -> usize {
    ((window / step).round() as usize).max(2)
}

impl Study {
    /// An instance of the system of one's own.
    ///
    /// # Errors
    /// The FMUs cannot be instantiated.
    pub fn take(&self) -> Result<Plant, Problem> {
        if let Some(mut plant) = self.pool.lock().unwrap_or_else(PoisonError::into_inner).pop() {
            // Nothing follows from what it did last.
            plant.slots.fill(0.0);
            return Ok(plant);
        }
        let names: Vec<String> = self.taps.iter().map(|tap| tap.name.clone()).collect();
        Plant::new(&self.graph, &names, &self.extra, &self.shown)
    }

    /// Ends the instances not in use: the attachments are no longer those that they were made for.
    pub fn forget_instances(&mut self) {
        self.pool.get_mut().unwrap_or_else(PoisonError::into_inner).clear();
    }

    /// Notes why a simulation failed, if it is the first; values that an FMU refuses are those of a model that
    /// diverges.
    pub fn failed(&self, problem: &Problem) {
        if !problem.is_refusal() {
            let mut first = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
            first.get_or_insert_with(|| (problem.to_string(), problem.is_loss()));
        }
    }

    /// Why the first simulation failed in which an FMU did.
    pub fn failure(&self) -> Option<String> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).clone().map(|own| own.0)
    }

    /// The same, if the process of that FMU was lost.
    pub fn loss(&self) -> Option<String> {
        self.failure
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
            .filter(|own| own.1)
            .map(|own| own.0)
    }

    /// Gives an instance back.
    pub fn give(&self, plant: Plant) {
        self.pool.lock().unwrap_or_else(PoisonError::into_inner).push(plant);
    }

    /// Range of the input that is an attachment over all records, in its unit, those for validation included; none
    /// where records do not have it.
    pub fn recorded(&self, tap: usize) -> Option<(f64, f64)> {
        let input = self.graph.inputs.iter().position(|input| input.name == self.taps[tap].name)?;
        let values = self.records.iter().filter_map(|record| record.inputs[input].as_ref()).flatten();
        let widened = |(low, high): (f64, f64), value: &f64| (low.min(*value), high.max(*value));
        let found = values.fold((f64::INFINITY, f64::NEG_INFINITY), widened);
        (found.0 <= found.1).then_some(found)
    }

    /// Range of a variable at an attachment.
    pub fn range(&self, tap: usize, variable: Variable) -> (f64, f64) {
        let Some(own) = self.ranges.get(tap) else { return (0.0, 0.0) };
        match variable {
            Variable::Velocity => own[0],
            Variable::Position => own[1],
            Variable::PressureForce => own[2],
            Variable::Value => own[4],
            Variable::Time => {
                let end = |record: &Record| record.n as f64 * record.step;
                (0.0, self.records.iter().map(end).fold(0.0, f64::max))
            }
        }
    }

    /// Whether spans of a record are simulated from its beginning: the states at other times are neither measured nor
    /// fitted.
    pub fn from_start(&self, record: &Record) -> bool {
        let unknown = || record.states.iter().any(Option::is_none);
        if self.windows.is_some() {
            return unknown();
        }
        match &record.initial {
            Initial::Given(_) => true,
            Initial::Word(InitialWord::Fit) => self.steps_alone,
            Initial::Word(InitialWord::Measured) => self.sampled || unknown(),
        }
    }

    /// Spread of every output over the estimation records: standard deviation about the mean of all.
    pub fn spreads(&self) -> Vec<f64> {
        let one = |o: usize| {
            let records = self.records.iter().filter(|record| record.role == Role::Estimation);
            deviation(&records.flat_map(|record| record.outputs[o].iter().copied()).collect::<Vec<f64>>())
        };
        (0..self.outputs.len()).map(one).collect()
    }

    /// Samples from one restart of the simulation to the next on records with this `step` \[s\]; none without windows.
    pub fn window(&self, step: f64) -> Option<usize> {
        self.windows.map(|window| window_samples(window, step))
    }

    /// Parameter vector of the declared model; candidates at zero.
    pub fn start(&self) -> Vec<f64> {
        self.entries.iter().map(|entry| entry.start).collect()
    }

    /// Free parameters of the declared model.
    pub fn declared_free(&self) -> Vec<Free> {
        self.entries[..self.declared].iter().map(|entry| entry.free).collect()
    }
}
