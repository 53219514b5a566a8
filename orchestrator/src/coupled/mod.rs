//! A system of FMUs as one right-hand side with derivatives, for optimisation and control.
//!
//! [`System::open`] makes Model Exchange instances of all components; values pass along the connections within one
//! evaluation, so that there is no coupling error. Derivatives follow by the chain rule over those of the components;
//! second derivatives are central differences of the components' first ones. Parts that are linear with constant
//! factors are learnt once and need no calls.
//!
//! `anatomy` takes the components as functions, `learn` finds what is constant, `program` orders the work, `work` does it.
//! Meshes and solvers are left to `transcription` and `optim`. Events have no place here: what happens at them is fixed
//! when the system is opened.

mod anatomy;
mod calls;
mod chain;
mod error;
mod learn;
mod memory;
mod names;
mod options;
mod program;
mod start;
mod work;

use std::sync::Arc;

use crate::fmu::{Error as FmuError, Model, Status, VariableKind};
use crate::optim::EvaluationError;
use crate::system::SystemGraph;
use crate::system::graph::{Component, Conversion, Start};
use crate::transcription::dynamics::{Dynamics, Entry, Point, Size, Structure};
use anatomy::{Anatomy, Origin};
use memory::Known;
use program::{Maker, Place, Program};
use work::{Trouble, Work};

pub use error::Error;
pub use options::Options;

/// Name of the parameter that chooses between a sampled and a continuous form, and its item for the latter.
const REALISATION: (&str, &str) = ("realisation", "continuous");

/// What all instances of one dynamics share.
#[derive(Debug)]
struct Plan {
    graph: SystemGraph,
    time: f64,
    size: Size,
    structure: Structure,
    program: Program,
    /// Value of the rate of each state.
    rates: Vec<usize>,
    outputs: Vec<(Place, Conversion)>,
    names: Vec<String>,
    units: Vec<Option<String>>,
    nominals: Vec<f64>,
    start: Vec<f64>,
    /// `component.variable` of each value.
    value_names: Vec<String>,
    /// `component.variable` of each argument of each component.
    argument_names: Vec<Vec<String>>,
    notes: Vec<String>,
}

/// A system of FMUs as one [`Dynamics`].
#[derive(Debug)]
pub struct System {
    plan: Arc<Plan>,
    /// In the order of the components.
    models: Vec<Model>,
    work: Work,
    /// An FMU refused so that it has to be made anew.
    broken: bool,
}

impl System {
    /// Instantiates and initialises the components of a system, and learns the structure of its derivatives.
    ///
    /// # Errors
    /// [`Error`]: a component without Model Exchange or with time events, an algebraic loop, unknown names, or an FMU
    /// that fails.
    pub fn open(graph: &SystemGraph, options: &Options) -> Result<System, Error> {
        if let Some(one) = graph.loops.first() {
            return Err(Error::AlgebraicLoop { path: graph.loop_names(one) });
        }
        let mut graph = graph.clone();
        let mut notes = choose_continuous(&mut graph);
        let inputs = names::inputs(&graph, options.inputs.as_deref())?;
        notes.extend(held_inputs(&graph, &inputs));
        let mut models = start::instances(&graph, options.time)?;
        let anatomy = Anatomy::new(&graph, &inputs, options)?;
        notes.extend(anatomy.notes.iter().cloned());
        let (locals, learnt, intact) = learn::learn(&graph, &anatomy, &mut models, options.time)?;
        notes.extend(learnt);
        let idle = learn::idle_states(&anatomy, &locals);
        let (states, state_names) = choose_states(&graph, &anatomy, &idle, options)?;
        let left_out: Vec<_> = idle.into_iter().filter(|state| !states.contains(state)).collect();
        notes.extend(learn::idle_note(&graph, &left_out));
        notes.extend(event_note(&graph));

        let size = Size { states: states.len(), inputs: inputs.len(), outputs: options.outputs.len() };
        let column = |component: usize, state: usize| states.iter().position(|&s| s == (component, state));
        let columns = anatomy.blocks.iter().enumerate();
        let columns = columns
            .map(|(component, block)| (0..block.states).map(|state| column(component, state)).collect());
        let maker = Maker {
            anatomy: &anatomy,
            locals: &locals,
            columns: columns.collect(),
            states: size.states,
            width: size.arguments(),
        };
        let value_names: Vec<String> = anatomy
            .values
            .iter()
            .map(|value| graph.components[value.component].path_of(value.variable))
            .collect();
        let program = maker.make().map_err(|waiting| Error::AlgebraicLoop {
            path: waiting.into_iter().map(|value| value_names[value].clone()).collect(),
        })?;
        let rates: Vec<usize> =
            states.iter().map(|&(component, state)| anatomy.blocks[component].values.start + state).collect();
        let place = |((origin, conversion), owner): (&(Origin, Conversion), &usize)| match *origin {
            Origin::State(state) => {
                let column = column(*owner, state).expect("a state that is shown is not left out");
                (Place::Column(column), *conversion)
            }
            Origin::Input(input, inner) => (Place::Column(size.states + input), inner.then(*conversion)),
            Origin::Value(value, inner) => (Place::Value(value), inner.then(*conversion)),
        };
        let outputs: Vec<(Place, Conversion)> =
            anatomy.outputs.iter().zip(&anatomy.owners).map(place).collect();
        let mut plan = Plan {
            structure: Structure::dense(size),
            time: options.time,
            size,
            program,
            rates,
            names: Vec::new(),
            units: Vec::new(),
            nominals: Vec::new(),
            start: states.iter().map(|&(component, state)| locals[component].anchor[state]).collect(),
            outputs,
            value_names,
            argument_names: argument_names(&graph, &anatomy),
            notes,
            graph,
        };
        plan.structure = plan.structure();
        plan.describe(&anatomy, &states, state_names, &inputs, options);
        if !intact {
            models = start::instances(&plan.graph, plan.time)?;
        }
        let widths: Vec<usize> = anatomy.blocks.iter().map(|block| block.arguments.len()).collect();
        let work = Work::new(&plan.program, widths, size);
        let mut system = System { plan: Arc::new(plan), models, work, broken: false };
        system.work.combine_constants(&system.plan.program);
        Ok(system)
    }

    /// Units of states, inputs and outputs, where they have one, `[n_x + n_u + n_g]`.
    pub fn units(&self) -> &[Option<String>] {
        &self.plan.units
    }

    /// What was assumed, left out or approximated, one sentence each.
    pub fn notes(&self) -> &[String] {
        &self.plan.notes
    }

    /// States at which the components were initialised, `[n_x]`.
    pub fn start_states(&self) -> &[f64] {
        &self.plan.start
    }

    /// Makes the instances anew after an FMU refused for good.
    fn repair(&mut self) -> Result<(), EvaluationError> {
        if self.broken {
            self.models = start::instances(&self.plan.graph, self.plan.time).map_err(|error| {
                EvaluationError { function: "the system".to_owned(), reason: error.to_string() }
            })?;
            self.work.forget();
            self.broken = false;
        }
        Ok(())
    }

    /// Brings values, or values and first derivatives, to a point.
    fn at(&mut self, at: Point<'_>, wanted: Known) -> Result<(), EvaluationError> {
        self.repair()?;
        let (program, models) = (&self.plan.program, &mut self.models);
        let done = self.work.recall(at).and_then(|known| {
            match (known, wanted) {
                (Known::Nothing, Known::Derivatives) => {
                    self.work.visit(program, models)?;
                    self.work.differentiate(program, models)?;
                }
                (Known::Nothing, _) => self.work.visit(program, models)?,
                (Known::Values, Known::Derivatives) => self.work.revisit(program, models)?,
                _ => return Ok(()),
            }
            self.work.remember(wanted);
            Ok(())
        });
        done.map_err(|trouble| self.explain(trouble))
    }

    #[cold]
    fn explain(&mut self, trouble: Trouble) -> EvaluationError {
        match trouble {
            Trouble::Fmu { component, error } => {
                let discarded = matches!(&error, FmuError::Call(call) if call.status == Status::Discard);
                self.broken = !discarded;
                let function = format!("component `{}`", self.plan.graph.components[component].name);
                EvaluationError { function, reason: error.to_string() }
            }
            Trouble::NotFinite { value, found } => {
                let function = format!("`{}`", self.plan.value_names[value]);
                EvaluationError { function, reason: format!("it is {found}") }
            }
            Trouble::Derivative { component, argument, found } => {
                let variable = self.plan.argument_names[component][argument].as_str();
                EvaluationError {
                    function: format!("a derivative by `{variable}`"),
                    reason: format!("it is {found}"),
                }
            }
            Trouble::Argument { column, found } => {
                let function = format!("`{}`", self.plan.names[column]);
                EvaluationError { function, reason: format!("it is {found}, no finite number") }
            }
        }
    }
}

impl Dynamics for System {
    fn size(&self) -> Size {
        self.plan.size
    }

    fn structure(&self) -> &Structure {
        &self.plan.structure
    }

    fn names(&self) -> Vec<String> {
        self.plan.names.clone()
    }

    fn nominals(&self) -> Vec<f64> {
        self.plan.nominals.clone()
    }

    fn evaluate(&mut self, at: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError> {
        self.at(at, Known::Values)?;
        self.work.write_values(&self.plan.rates, &self.plan.outputs, values);
        Ok(())
    }

    fn jacobian(
        &mut self,
        at: Point<'_>,
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.at(at, Known::Derivatives)?;
        let plan = &*self.plan;
        self.work.write_values(&plan.rates, &plan.outputs, values);
        self.work.combine(&plan.program);
        self.work.write_jacobian(&plan.rates, &plan.outputs, jacobian);
        Ok(())
    }

    fn hessian(
        &mut self,
        at: Point<'_>,
        weights: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.at(at, Known::Derivatives)?;
        let plan = &*self.plan;
        self.work.combine(&plan.program);
        self.work.weigh(&plan.program, &plan.rates, &plan.outputs, weights);
        let done = self.work.bend(&plan.program, &mut self.models, hessian);
        done.map_err(|trouble| self.explain(trouble))
    }

    fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError> {
        let refuse = |error: Error| EvaluationError {
            function: "another instance of the system".to_owned(),
            reason: error.to_string(),
        };
        let plan = Arc::clone(&self.plan);
        let models = start::instances(&plan.graph, plan.time).map_err(refuse)?;
        Ok(Box::new(System { models, work: self.work.fresh(), plan, broken: false }))
    }
}

impl Plan {
    /// Structure of the derivatives, from the patterns of the values.
    fn structure(&self) -> Structure {
        let unit = |column: usize| {
            (0..self.size.arguments())
                .map(|other| if other == column { Entry::Constant } else { Entry::Zero })
                .collect::<Vec<Entry>>()
        };
        let of = |place: Place| match place {
            Place::Column(column) => unit(column),
            Place::Value(value) => self.program.patterns[value].clone(),
            Place::Fixed(_) => vec![Entry::Zero; self.size.arguments()],
        };
        let rates = self.rates.iter().map(|&value| Place::Value(value));
        let rows = rates.chain(self.outputs.iter().map(|&(place, _)| place)).flat_map(of);
        Structure::new(self.size, rows.collect())
    }

    /// Names, units, magnitudes and start values.
    fn describe(
        &mut self,
        anatomy: &Anatomy,
        states: &[(usize, usize)],
        state_names: Vec<String>,
        inputs: &[usize],
        options: &Options,
    ) {
        let graph = &self.graph;
        self.units = states.iter().map(|&(c, state)| names::state_unit(graph, c, state)).collect();
        self.nominals = states.iter().map(|&(c, state)| anatomy.blocks[c].arguments[state].nominal).collect();
        for (position, &input) in inputs.iter().enumerate() {
            self.units.push(graph.inputs[input].unit.clone());
            let mut fed = anatomy.blocks.iter().flat_map(|block| &block.arguments);
            let nominal = fed.find_map(|argument| match argument.origin {
                Origin::Input(own, conversion) if own == position => {
                    Some((argument.nominal / conversion.factor).abs())
                }
                _ => None,
            });
            self.nominals.push(nominal.unwrap_or(1.0));
        }
        for (name, &(place, conversion)) in options.outputs.iter().zip(&self.outputs) {
            self.units.push(names::output_unit(graph, name));
            let nominal = match place {
                Place::Column(column) => self.nominals[column],
                Place::Value(value) => anatomy.values[value].nominal,
                Place::Fixed(_) => 1.0,
            };
            self.nominals.push((nominal * conversion.factor).abs());
        }
        self.names = state_names;
        self.names.extend(inputs.iter().map(|&input| graph.inputs[input].name.clone()));
        self.names.extend(options.outputs.iter().cloned());
    }
}

fn argument_names(graph: &SystemGraph, anatomy: &Anatomy) -> Vec<Vec<String>> {
    let of = |(component, block): (&Component, &anatomy::Block)| {
        block.arguments.iter().map(|argument| component.path_of(argument.variable)).collect()
    };
    graph.components.iter().zip(&anatomy.blocks).map(of).collect()
}

/// States in the order of the problem, as (component, position), and their names.
fn choose_states(
    graph: &SystemGraph,
    anatomy: &Anatomy,
    idle: &[(usize, usize)],
    options: &Options,
) -> Result<(Vec<(usize, usize)>, Vec<String>), Error> {
    let all = anatomy.blocks.iter().enumerate();
    let all = all.flat_map(|(component, block)| (0..block.states).map(move |state| (component, state)));
    let name = |&(component, state): &(usize, usize)| names::state_name(graph, component, state);
    let mut moving = all.filter(|state| !idle.contains(state));
    let Some(wanted) = &options.states else {
        let states: Vec<_> = moving.collect();
        let names = states.iter().map(name).collect();
        return Ok((states, names));
    };
    let states = wanted.iter().map(|name| names::state(graph, name)).collect::<Result<Vec<_>, _>>()?;
    if let Some((index, _)) =
        states.iter().enumerate().find(|(index, state)| states[..*index].contains(state))
    {
        return Err(Error::Twice { role: "state", name: wanted[index].clone() });
    }
    match moving.find(|state| !states.contains(state)) {
        Some(state) => Err(Error::StateMissing { name: name(&state) }),
        None => Ok((states, wanted.clone())),
    }
}

/// Components that have a sampled and a continuous form take the latter, unless they were told which.
fn choose_continuous(graph: &mut SystemGraph) -> Vec<String> {
    let mut notes = Vec::new();
    for component in &mut graph.components {
        let description = &component.fmu.description;
        let Some(index) = description.index_of(REALISATION.0) else { continue };
        let VariableKind::Enumeration { declared_type, .. } = &description.variables[index].kind else {
            continue;
        };
        let mut types = description.types.iter().filter(|definition| definition.name == *declared_type);
        let item =
            types.find_map(|definition| definition.items.iter().find(|(name, _)| name == REALISATION.1));
        let Some(&(_, value)) = item else { continue };
        if component.start_values.iter().all(|start| start.variable != index) {
            component.set_start(index, Start::Integer(value));
            notes.push(format!(
                "component `{}` runs in its continuous form (`{}` = {})",
                component.name, REALISATION.0, REALISATION.1
            ));
        }
    }
    notes
}

/// Says which inputs keep their start values.
fn held_inputs(graph: &SystemGraph, inputs: &[usize]) -> Option<String> {
    let held = (0..graph.inputs.len()).filter(|input| !inputs.contains(input));
    let held: Vec<String> = held.map(|input| format!("`{}`", graph.inputs[input].name)).collect();
    (!held.is_empty()).then(|| format!("the inputs {} keep their start values", held.join(", ")))
}

/// Says which components have events that an optimisation does not see.
fn event_note(graph: &SystemGraph) -> Option<String> {
    let components = graph.components.iter();
    let with = components.filter(|component| component.fmu.description.number_of_event_indicators > 0);
    let with: Vec<String> = with.map(|component| format!("`{}`", component.name)).collect();
    (!with.is_empty()).then(|| {
        format!(
            "state events of {} are not handled: what holds at the start holds throughout",
            with.join(", ")
        )
    })
}
