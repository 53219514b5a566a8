//! The master that steps slaves: Gauss-Seidel (serial), Jacobi (parallel) and interface-Jacobian.

use super::exchange::{Node, Wiring};
use super::extrapolation::Extrapolation;
use super::interface_jacobian::{InterfaceJacobian, Trajectory};
use super::loops::Loops;
use super::stop::Stop;
use super::{Algorithm, Error, Grid, Settings, Values};
use super::{gauss_seidel, initialize, jacobi};
use crate::results::Column;
use crate::system::SystemGraph;

/// Outcome of a macro step.
#[derive(Debug, Clone, PartialEq)]
pub enum Progress {
    /// All slaves are at the next communication point.
    Stepped,
    /// A slave asked for the end of the simulation (`fmi2Terminated`). If it did so at the end of the step, all others
    /// are there, too, and [`Master::time`] has moved on.
    Terminated {
        /// Component that did.
        component: String,
        /// Time that it reached \[s\], if it says.
        last_successful_time: Option<f64>,
    },
}

/// Work that a master has done so far.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Effort {
    /// `fmi2DoStep` calls of each component, in evaluation order; repeated steps count again.
    pub fmu_steps: Vec<u64>,
    /// Evaluations of blocks without states inside the master, with their derivatives.
    pub static_evaluations: u64,
    /// Rounds of Newton's method inside the master.
    pub newton_rounds: u64,
    /// Steps of coupled components, repetitions included.
    pub coupled_passes: u64,
}

/// Exchange of values over a step.
#[derive(Debug)]
pub(super) enum Scheme {
    /// Gauss-Seidel or Jacobi with inputs that are held.
    Held,
    /// Gauss-Seidel or Jacobi with inputs along polynomials.
    Extrapolated(Box<Extrapolation>),
    /// Coupled components solved in the master.
    InterfaceJacobian(Box<InterfaceJacobian>),
}

impl Scheme {
    fn notes(&self) -> &[String] {
        match self {
            Scheme::Held => &[],
            Scheme::Extrapolated(extrapolation) => extrapolation.notes(),
            Scheme::InterfaceJacobian(master) => master.notes(),
        }
    }

    /// Trajectories of system inputs (by place in the flat buffer) over the next step; none if all are held.
    pub fn trajectories(&mut self) -> Option<&mut Vec<(usize, Trajectory)>> {
        match self {
            Scheme::Held => None,
            Scheme::Extrapolated(extrapolation) => Some(extrapolation.trajectories()),
            Scheme::InterfaceJacobian(master) => Some(master.trajectories()),
        }
    }

    /// Shows every number that is carried from step to step, always in the same order.
    pub fn carry(&mut self, each: &mut dyn FnMut(&mut f64)) {
        match self {
            Scheme::Held => {}
            Scheme::Extrapolated(extrapolation) => extrapolation.carry(each),
            Scheme::InterfaceJacobian(master) => master.carry(each),
        }
    }
}

/// Instantiated and initialized slaves at a communication point.
#[derive(Debug)]
pub struct Master {
    /// In evaluation order.
    pub(super) nodes: Vec<Node>,
    pub(super) wiring: Wiring,
    pub(super) values: Values,
    grid: Grid,
    /// Number of the current communication point.
    point: u64,
    /// Macro steps made, those that were taken back included.
    made: u64,
    algorithm: Algorithm,
    pub(super) scheme: Scheme,
    /// Present for systems with algebraic loops.
    loops: Option<Box<Loops>>,
    notes: Vec<String>,
}

impl Master {
    /// Instantiates and initializes all components of a system at the start time.
    ///
    /// `inputs` gives the value of system inputs at the start time, as (index, value); the others have the start
    /// value of the variable they feed.
    ///
    /// # Errors
    /// Settings out of range, an FMU that fails, initial values that do not settle or are not finite.
    pub fn new(graph: &SystemGraph, settings: &Settings, inputs: &[(usize, f64)]) -> Result<Master, Error> {
        let grid = settings.validate()?;
        if settings.algorithm == Algorithm::Monolithic {
            return Err(Error::NoSteps);
        }
        let wiring = Wiring::new(graph, settings.read_all_outputs);
        let mut values = wiring.initial_values(graph);
        for &(input, value) in inputs {
            values.set(wiring.inputs[input], value);
        }
        let mut nodes = initialize::initialize(graph, &wiring, settings, &grid, &mut values)?;
        let loops = Loops::new(graph, &wiring, settings, &grid, &values)?.map(Box::new);
        let held = settings.extrapolation == 0 && settings.adaptive.is_none();
        let scheme = match settings.algorithm {
            Algorithm::InterfaceJacobian => {
                let loops = loops.as_deref();
                let new = InterfaceJacobian::new(graph, &wiring, settings, &grid, &mut nodes, &values, loops);
                Scheme::InterfaceJacobian(Box::new(new?))
            }
            _ if held => Scheme::Held,
            _ => {
                let new = Extrapolation::new(graph, &wiring, settings, &grid, &mut nodes, &values);
                Scheme::Extrapolated(Box::new(new?))
            }
        };
        let mut notes = loops.as_ref().map_or_else(Vec::new, |loops| loops.notes(&nodes));
        notes.extend_from_slice(scheme.notes());
        let algorithm = settings.algorithm;
        Ok(Master { nodes, wiring, values, grid, point: 0, made: 0, algorithm, scheme, loops, notes })
    }

    /// Shows every number that is carried from step to step beside values and slaves, with what iterations begin from,
    /// always in the same order.
    pub(super) fn carry(&mut self, each: &mut dyn FnMut(&mut f64)) {
        self.scheme.carry(each);
        if let Scheme::InterfaceJacobian(master) = &mut self.scheme {
            master.carry_guesses(each);
        }
        for group in self.loops.iter_mut().flat_map(|loops| loops.groups()) {
            group.carry(each);
        }
    }

    /// Current communication point \[s\].
    pub fn time(&self) -> f64 {
        self.grid.time(self.point)
    }

    /// All communication points.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Takes a communication point for the present one, once slaves and values are those of it.
    pub(super) fn go_to(&mut self, point: u64) {
        self.point = point;
    }

    /// Macro steps done.
    pub fn steps(&self) -> u64 {
        self.point
    }

    /// Whether the stop time is reached.
    pub fn finished(&self) -> bool {
        self.point >= self.grid.steps()
    }

    /// Components, those that share an algebraic loop as one.
    pub(super) fn blocks(&self) -> usize {
        let loops = self.loops.as_ref();
        let more = |node: usize| loops.is_some_and(|loops| loops.continues(node));
        (0..self.nodes.len()).filter(|&node| !more(node)).count()
    }

    /// Values of system inputs and outputs of components at the current communication point.
    pub fn values(&self) -> &Values {
        &self.values
    }

    /// Sets a system input (index into `graph.inputs`) for the step that begins here. Integers are rounded, a
    /// Boolean is true unless the value is 0; String inputs keep their start value.
    #[inline]
    pub fn set_input(&mut self, input: usize, value: f64) {
        self.values.set(self.wiring.inputs[input], value);
    }

    /// Work done so far.
    pub fn effort(&self) -> Effort {
        let loops = self.loops.as_deref();
        let newton_rounds = loops.map_or(0, Loops::rounds);
        if let Scheme::InterfaceJacobian(master) = &self.scheme {
            let [static_evaluations, rounds, coupled_passes] = master.inner_work();
            let (fmu_steps, newton_rounds) = (master.fmu_steps().collect(), newton_rounds + rounds);
            return Effort { fmu_steps, static_evaluations, newton_rounds, coupled_passes };
        }
        let steps = |node| self.made + loops.map_or(0, |loops| loops.repeated_steps(node));
        let fmu_steps = (0..self.nodes.len()).map(steps).collect();
        Effort { fmu_steps, newton_rounds, ..Effort::default() }
    }

    /// Substitutes of the master for missing capabilities of FMUs, one sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Columns for a recorder: system inputs and outputs by their plain name, then, unless the system is a single
    /// FMU, all outputs of components as `component.variable`. Strings are not recorded.
    pub fn columns(&self, graph: &SystemGraph) -> Vec<Column> {
        self.wiring.columns(graph, self.algorithm)
    }

    /// One macro step: every slave from this communication point to the next. Allocates nothing (unless a String
    /// is exchanged).
    ///
    /// # Errors
    /// A call into an FMU failed, a step was discarded, or an output is not finite. The values of
    /// [`Master::values`] then belong to no common time.
    #[inline]
    pub fn step(&mut self) -> Result<Progress, Error> {
        let (t, h) = (self.grid.time(self.point), self.grid.step_size(self.point));
        match self.advance(t, h) {
            Ok(()) => {
                self.point += 1;
                Ok(Progress::Stepped)
            }
            Err(stop) => {
                let (component, last_successful_time) =
                    self.explain(stop, (t, h), self.grid.time(self.point + 1))?;
                Ok(Progress::Terminated { component, last_successful_time })
            }
        }
    }

    /// Steps every slave from `t` to `t + h` \[s\].
    #[inline]
    pub(super) fn advance(&mut self, t: f64, h: f64) -> Result<(), Stop> {
        self.made += 1;
        let serial = self.algorithm == Algorithm::GaussSeidel;
        let (nodes, values, loops) = (&mut self.nodes, &mut self.values, self.loops.as_deref_mut());
        match (&mut self.scheme, loops) {
            (Scheme::Held, None) if serial => gauss_seidel::step(nodes, values, t, h),
            (Scheme::Held, None) => jacobi::step(nodes, values, t, h),
            (Scheme::Held, Some(loops)) => loops.step(nodes, values, t, h, serial),
            (Scheme::Extrapolated(inputs), loops) => inputs.step(nodes, values, loops, (t, h), serial),
            (Scheme::InterfaceJacobian(master), loops) => master.step(nodes, values, loops, t, h),
        }
    }

    /// The end that a component asked for with a step from `t` with `h` to `end` \[s\], as (component, time \[s\] that
    /// it reached), or why the step failed.
    #[cold]
    pub(super) fn explain(
        &mut self,
        stop: Stop,
        (t, h): (f64, f64),
        end: f64,
    ) -> Result<(String, Option<f64>), Error> {
        match stop {
            Stop::Fmu(error) => Err(Error::Fmu(*error)),
            Stop::Unsolved(error) => Err(*error),
            Stop::NotFinite { node } => Err(self.nodes[node].not_finite(&self.values, end)),
            Stop::Ended { node } => {
                self.point += 1;
                Ok((self.nodes[node].name().to_owned(), Some(end)))
            }
            Stop::Incomplete { node, last_successful_time: last, terminated } => {
                let alone = self.nodes.len() == 1;
                let node = &mut self.nodes[node];
                let component = node.name().to_owned();
                if terminated {
                    // The last values of a lone slave belong to the time it came to; reading them may be refused.
                    let unread = alone && node.get_outputs(&mut self.values).is_err();
                    return Ok((component, last.filter(|_| !unread)));
                }
                let reached = last.map_or(String::new(), |last| format!(" (it came to t = {last} s)"));
                let (function, status) = node.discard_names();
                let log = node.log_tail();
                Err(Error::Discarded { component, function, status, time: t, step: h, reached, log })
            }
        }
    }
}
