//! Co-simulation masters with a fixed communication step: Gauss-Seidel (serial), Jacobi (parallel) and
//! interface-Jacobian (linearly implicit, with rollback); and the [`monolithic`] coupling through Model Exchange.
//!
//! [`Master`] owns the slaves of a [`SystemGraph`] and steps them; [`simulate::run`] drives it over a time span with
//! inputs from a series and a recorder. What is optimized, plotted or compared is left to the modules above.
//!
//! Values are made consistent at the start by module `propagation`. The co-simulation masters keep to the strict
//! reading of FMI 2.0.5 section 4.2.4: between setting an input and reading an output of a slave there is always a
//! step. Algebraic loops (module `loops`) are the exception, through slaves that were found to allow it.

mod adaptive;
mod error;
mod exchange;
mod extrapolation;
mod gauss_seidel;
mod grid;
mod initialize;
#[allow(clippy::needless_range_loop, reason = "small matrices are read by row and column")]
mod interface_jacobian;
mod jacobi;
mod loops;
pub mod monolithic;
mod propagation;
pub mod simulate;
mod stop;
mod values;

use crate::results::{Column, Slot};
use crate::system::SystemGraph;
use crate::system::graph::DataType;
use airloop_fmi::StepStatus;

pub use adaptive::Adaptive;
pub use error::Error;
use exchange::{Node, Wiring};
use extrapolation::{Extrapolation, MAX_ORDER};
pub use grid::Grid;
pub use interface_jacobian::Coupling;
use interface_jacobian::InterfaceJacobian;
use loops::Loops;
use stop::{Stop, ended};
pub use values::Values;

/// Order in which slaves step and exchange values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Algorithm {
    /// Serial: in evaluation order, each slave gets the newest outputs of those before it.
    #[default]
    GaussSeidel,
    /// Parallel: all slaves get the outputs at the communication point, then all step.
    Jacobi,
    /// Linearly implicit: strongly coupled components are solved in the master before their slaves step.
    InterfaceJacobian,
    /// All components as one differential equation through Model Exchange, with error control and no coupling error;
    /// for [`simulate::run`] only.
    Monolithic,
}

impl Algorithm {
    /// Whether an output as it is in a row belongs to the interval before that row, and is written to the start of it.
    ///
    /// After a step, that is a sampled output ([`SystemGraph::stands_at_step_start`]). The monolithic master reads
    /// before the events of a time, so that there every discrete output is the one of the interval that ends.
    pub fn stands_at_start(self, graph: &SystemGraph, component: usize, variable: usize) -> bool {
        match self {
            Algorithm::Monolithic => graph.is_held(component, variable),
            _ => graph.stands_at_step_start(component, variable),
        }
    }
}

impl std::fmt::Display for Algorithm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Algorithm::GaussSeidel => "gauss-seidel",
            Algorithm::Jacobi => "jacobi",
            Algorithm::InterfaceJacobian => "interface-jacobian",
            Algorithm::Monolithic => "monolithic",
        })
    }
}

/// Settings of a master.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Start time \[s\]; default 0.
    pub start_time: f64,
    /// Stop time \[s\], reached exactly; default 1.
    pub stop_time: f64,
    /// Communication step size \[s\], positive; default 1 ms. The last step is shortened to meet the stop time.
    pub step_size: f64,
    /// Coupling of the components; default Gauss-Seidel.
    pub algorithm: Algorithm,
    /// Options of the interface-Jacobian master.
    pub coupling: Coupling,
    /// Order (0 to 2) of the polynomials that inputs follow inside a step of Gauss-Seidel or Jacobi; default 0, held.
    pub extrapolation: u32,
    /// Relative tolerance for the slaves, in (0, 1); default: each slave uses its own. Also that of the monolithic
    /// integrator, default [`monolithic::DEFAULT_TOLERANCE`].
    pub tolerance: Option<f64>,
    /// Adaptive communication steps, for [`simulate::run`]; default: none, all steps are of [`Settings::step_size`].
    pub adaptive: Option<Adaptive>,
    /// Read all outputs at every communication point (default), or only those that are connected.
    pub read_all_outputs: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            start_time: 0.0,
            stop_time: 1.0,
            step_size: 1e-3,
            algorithm: Algorithm::GaussSeidel,
            coupling: Coupling::default(),
            extrapolation: 0,
            tolerance: None,
            adaptive: None,
            read_all_outputs: true,
        }
    }
}

impl Settings {
    /// Checks the settings and lays out the communication points.
    ///
    /// # Errors
    /// [`Error::Setting`] names the setting, its value and what is allowed.
    pub fn validate(&self) -> Result<Grid, Error> {
        if let Some(tolerance) = self.tolerance.filter(|tolerance| !(*tolerance > 0.0 && *tolerance < 1.0)) {
            return Err(Error::Setting { name: "tolerance", value: tolerance, allowed: "between 0 and 1" });
        }
        if self.extrapolation > MAX_ORDER {
            let value = f64::from(self.extrapolation);
            return Err(Error::Setting { name: "extrapolation", value, allowed: "0, 1 or 2" });
        }
        let iterate = self.coupling.tolerance.filter(|tolerance| !(*tolerance > 0.0 && *tolerance < 1.0));
        if let Some(tolerance) = iterate {
            return Err(Error::Setting { name: "iterate", value: tolerance, allowed: "between 0 and 1" });
        }
        Grid::new(self.start_time, self.stop_time, self.step_size)
    }
}

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

/// Instantiated and initialized slaves at a communication point.
#[derive(Debug)]
pub struct Master {
    /// In evaluation order.
    nodes: Vec<Node>,
    wiring: Wiring,
    values: Values,
    grid: Grid,
    /// Number of the current communication point.
    point: u64,
    /// Macro steps made, those that were taken back included.
    made: u64,
    algorithm: Algorithm,
    /// Present for that algorithm only.
    interface_jacobian: Option<Box<InterfaceJacobian>>,
    /// Present for Gauss-Seidel and Jacobi with inputs that are not held.
    extrapolation: Option<Box<Extrapolation>>,
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
        let interface_jacobian = match settings.algorithm {
            Algorithm::InterfaceJacobian => Some(Box::new(InterfaceJacobian::new(
                graph,
                &wiring,
                settings,
                &grid,
                &mut nodes,
                &values,
                loops.as_deref(),
            )?)),
            _ => None,
        };
        let extrapolation = match (settings.algorithm, settings.extrapolation) {
            (Algorithm::InterfaceJacobian | Algorithm::Monolithic, _) | (_, 0)
                if settings.adaptive.is_none() =>
            {
                None
            }
            _ => Some(Box::new(Extrapolation::new(graph, &wiring, settings, &grid, &mut nodes, &values)?)),
        };
        let algorithm = settings.algorithm;
        let mut notes = loops.as_ref().map_or_else(Vec::new, |loops| loops.notes(&nodes));
        let coupled = interface_jacobian.as_ref().map(|master| master.notes());
        let others = coupled.or(extrapolation.as_ref().map(|master| master.notes())).unwrap_or(&[]);
        notes.extend_from_slice(others);
        Ok(Master {
            nodes,
            wiring,
            values,
            grid,
            point: 0,
            made: 0,
            algorithm,
            interface_jacobian,
            extrapolation,
            loops,
            notes,
        })
    }

    /// Current communication point \[s\].
    pub fn time(&self) -> f64 {
        self.grid.time(self.point)
    }

    /// All communication points.
    pub fn grid(&self) -> &Grid {
        &self.grid
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
    fn blocks(&self) -> usize {
        let loops = self.loops.as_ref();
        let more = |node: usize| loops.is_some_and(|loops| loops.continues(node));
        (0..self.nodes.len()).filter(|&node| !more(node)).count()
    }

    /// Values of system inputs and outputs of components at the current communication point.
    pub fn values(&self) -> &Values {
        &self.values
    }

    /// Sets a system input (index into `graph.inputs`) for the step that begins here; `value` in the unit of the input.
    /// Integers are rounded, a Boolean is true unless the value is 0; String inputs keep their start value.
    #[inline]
    pub fn set_input(&mut self, input: usize, value: f64) {
        self.values.set(self.wiring.inputs[input], value);
    }

    /// Work done so far.
    pub fn effort(&self) -> Effort {
        let Some(interface_jacobian) = &self.interface_jacobian else {
            let Some(loops) = &self.loops else {
                return Effort { fmu_steps: vec![self.made; self.nodes.len()], ..Effort::default() };
            };
            let fmu_steps =
                (0..self.nodes.len()).map(|node| self.made + loops.repeated_steps(node)).collect();
            return Effort { fmu_steps, newton_rounds: loops.rounds(), ..Effort::default() };
        };
        let [static_evaluations, newton_rounds, coupled_passes] = interface_jacobian.inner_work();
        let newton_rounds = newton_rounds + self.loops.as_ref().map_or(0, |loops| loops.rounds());
        let fmu_steps = interface_jacobian.fmu_steps().collect();
        Effort { fmu_steps, static_evaluations, newton_rounds, coupled_passes }
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
            Err(stop) => self.explain(stop, (t, h), self.grid.time(self.point + 1)),
        }
    }

    /// Steps every slave from `t` to `t + h` \[s\].
    #[inline]
    fn advance(&mut self, t: f64, h: f64) -> Result<(), Stop> {
        self.made += 1;
        match self.algorithm {
            Algorithm::GaussSeidel | Algorithm::Jacobi
                if self.extrapolation.is_some() || self.loops.is_some() =>
            {
                self.step_otherwise(t, h)
            }
            Algorithm::GaussSeidel => gauss_seidel::step(&mut self.nodes, &mut self.values, t, h),
            Algorithm::Jacobi => jacobi::step(&mut self.nodes, &mut self.values, t, h),
            Algorithm::InterfaceJacobian => match &mut self.interface_jacobian {
                Some(master) => {
                    master.step(&mut self.nodes, &mut self.values, self.loops.as_deref_mut(), t, h)
                }
                None => Ok(()),
            },
            // There is no such master.
            Algorithm::Monolithic => Ok(()),
        }
    }

    /// With inputs that are not held, or with algebraic loops.
    #[inline(never)]
    fn step_otherwise(&mut self, t: f64, h: f64) -> Result<(), Stop> {
        let serial = self.algorithm == Algorithm::GaussSeidel;
        let (nodes, values) = (&mut self.nodes, &mut self.values);
        match (&mut self.extrapolation, &mut self.loops) {
            (Some(master), loops) => master.step(nodes, values, loops.as_deref_mut(), (t, h), serial),
            (None, Some(loops)) => loops.step(nodes, values, t, h, serial),
            (None, None) => Ok(()),
        }
    }

    #[cold]
    fn explain(&mut self, stop: Stop, (t, h): (f64, f64), end: f64) -> Result<Progress, Error> {
        match stop {
            Stop::Fmu(error) => Err(Error::Fmu(*error)),
            Stop::Coupling(failure) => match &self.interface_jacobian {
                Some(master) => Err(master.explain(&failure, &self.nodes, t, h)),
                None => Ok(Progress::Stepped),
            },
            Stop::Loop { failure, time } => Err(failure.at(time)),
            Stop::NotFinite { node } => Err(self.nodes[node].not_finite(&self.values, end)),
            Stop::Ended { node } => {
                self.point += 1;
                let component = self.nodes[node].name().to_owned();
                Ok(Progress::Terminated { component, last_successful_time: Some(end) })
            }
            Stop::Incomplete { node, status } => {
                let StepStatus::Discarded { last_successful_time, terminated } = status else {
                    return Ok(Progress::Stepped);
                };
                let alone = self.nodes.len() == 1;
                let node = &mut self.nodes[node];
                let component = node.name().to_owned();
                if terminated {
                    // The last values of a lone slave belong to the time it came to; reading them may be refused.
                    if alone && node.get_outputs(&mut self.values).is_err() {
                        return Ok(Progress::Terminated { component, last_successful_time: None });
                    }
                    return Ok(Progress::Terminated { component, last_successful_time });
                }
                let reached =
                    last_successful_time.map_or(String::new(), |last| format!(" (it came to t = {last} s)"));
                Err(Error::Discarded { component, time: t, step: h, reached, log: node.log_tail() })
            }
        }
    }
}

/// Slot of a value of some type in the flat buffers; `None` for String.
fn slot(data_type: DataType, index: usize) -> Option<Slot> {
    match data_type {
        DataType::Real => Some(Slot::Real(index)),
        DataType::Integer | DataType::Enumeration => Some(Slot::Integer(index)),
        DataType::Boolean => Some(Slot::Boolean(index)),
        DataType::String => None,
    }
}
