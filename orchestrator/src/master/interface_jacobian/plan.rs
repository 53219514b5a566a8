//! From a system graph to units and parts: which components are strongly coupled, what each FMU can do, and what
//! is done where it lacks something.

use std::collections::BTreeMap;

use super::coupled::Coupled;
use super::evaluator;
use super::local_model::{LocalModel, Origin};
use super::options::Coupling;
use super::radau::Radau;
use super::reduced::{Dynamic, Link, Reduced, Static};
use super::signal::Signal;
use super::static_block::{Function, Secant};
use super::unit::{Feed, Input, Outputs, Unit};
use super::{InterfaceJacobian, Part};
use crate::fmu::{DependencyKind, Variability, VariableKind};
use crate::master::exchange::{Node, Values, Wiring};
use crate::master::{Error, Grid, Settings};
use crate::system::SystemGraph;
use crate::system::graph::{DataType, Source};
use crate::system::order::{feed_through, strongly_connected};

/// What planning needs to know about the system.
struct Planner<'a> {
    graph: &'a SystemGraph,
    wiring: &'a Wiring,
    settings: &'a Settings,
    grid: &'a Grid,
    /// Unit of each component.
    number: Vec<usize>,
    /// Place in [`Outputs`] of each output (component, variable) that feeds a Real input.
    places: BTreeMap<(usize, usize), usize>,
    notes: Vec<String>,
}

/// Makes the master from initialised slaves.
pub(super) fn plan(
    graph: &SystemGraph,
    wiring: &Wiring,
    settings: &Settings,
    grid: &Grid,
    nodes: &mut [Node],
    values: &Values,
) -> Result<InterfaceJacobian, Error> {
    let mut number = vec![0; graph.components.len()];
    graph.order.iter().enumerate().for_each(|(unit, &component)| number[component] = unit);
    let mut planner =
        Planner { graph, wiring, settings, grid, number, places: BTreeMap::new(), notes: Vec::new() };
    planner.find_outputs();
    let mut units: Vec<Unit> = (0..nodes.len()).map(|unit| planner.unit(unit)).collect();
    let (parts, delayed) = planner.parts();
    planner.connect(&mut units, &delayed, values);

    let pieces = planner.pieces(&units);
    let count = planner.places.len();
    let mut outputs = Outputs {
        y: vec![0.0; count],
        rate: vec![0.0; count],
        begin: vec![0.0; count],
        signals: (0..count).map(|_| Signal::with_room(pieces)).collect(),
    };
    for (unit, node) in units.iter().zip(nodes.iter_mut()) {
        let places = unit.outputs.clone();
        unit.read(node, &mut outputs.y[places.clone()], &mut outputs.rate[places]).map_err(
            |stop| match stop {
                crate::master::Stop::Fmu(error) => Error::Fmu(*error),
                _ => nodes_error(graph, unit, grid),
            },
        )?;
    }
    let mut planned = Vec::with_capacity(parts.len());
    for (members, coupled) in parts {
        planned.push(match coupled {
            false => Part::Single(members[0]),
            true => Part::Coupled(Box::new(planner.couple(&mut units, &members, pieces)?)),
        });
    }
    let names = graph.order.iter().map(|&component| graph.components[component].name.clone()).collect();
    Ok(InterfaceJacobian {
        parts: planned,
        units,
        outputs,
        names,
        cuts: Vec::with_capacity(pieces),
        start: grid.start(),
        notes: planner.notes,
    })
}

fn nodes_error(graph: &SystemGraph, unit: &Unit, grid: &Grid) -> Error {
    let component = graph.components[graph.order[unit.number]].name.clone();
    Error::NotFinite { component, variable: "an output".into(), value: f64::NAN, time: grid.start() }
}

impl Planner<'_> {
    fn component(&self, unit: usize) -> &crate::system::graph::Component {
        &self.graph.components[self.graph.order[unit]]
    }

    fn name(&self, unit: usize) -> &str {
        &self.component(unit).name
    }

    /// Outputs that feed Real inputs, unit by unit.
    fn find_outputs(&mut self) {
        let mut used: Vec<(usize, usize)> = Vec::new();
        for connection in &self.graph.connections {
            if let Source::Output { component, variable } = connection.source
                && self.is_real(component, variable)
            {
                used.push((self.number[component], variable));
            }
        }
        used.sort_unstable();
        used.dedup();
        for (place, (unit, variable)) in used.into_iter().enumerate() {
            self.places.insert((self.graph.order[unit], variable), place);
        }
    }

    fn is_real(&self, component: usize, variable: usize) -> bool {
        DataType::of(&self.graph.components[component].fmu.description.variables[variable]) == DataType::Real
    }

    fn unit(&self, number: usize) -> Unit {
        let index = self.graph.order[number];
        let component = &self.graph.components[index];
        let description = &component.fmu.description;
        let interface = description.co_simulation.clone().unwrap_or_default();
        let mut variables: Vec<(usize, usize)> = self
            .places
            .iter()
            .filter(|((owner, _), _)| *owner == index)
            .map(|((_, variable), place)| (*place, *variable))
            .collect();
        variables.sort_unstable();
        let first = variables.first().map_or(0, |(place, _)| *place);
        let discrete: Vec<bool> = variables
            .iter()
            .map(|(_, variable)| description.variables[*variable].variability == Variability::Discrete)
            .collect();
        let fed = |variable: usize| {
            self.graph
                .connections
                .iter()
                .any(|connection| connection.component == index && connection.variable == variable)
        };
        let fed_directly = |output: usize| feed_through(component, output).into_iter().any(fed);
        // A description without Model Exchange need not list states: then an output that no input feeds directly
        // gives them away.
        let is_static = description.derivatives.is_empty()
            && description.number_of_event_indicators == 0
            && !discrete.contains(&true)
            && (description.model_exchange.is_some()
                || variables.iter().all(|(_, variable)| fed_directly(*variable)));
        let fixed_step = !interface.can_handle_variable_communication_step_size;
        let samples = discrete.contains(&true).then_some(description.default_experiment.step_size).flatten();
        let whole = |sample: f64| {
            let ratio = self.grid.step() / sample;
            (ratio - ratio.round()).abs() < 1e-6
        };
        Unit {
            number,
            inputs: Vec::new(),
            input_references: Vec::new(),
            outputs: first..first + variables.len(),
            output_references: variables
                .iter()
                .map(|(_, variable)| description.variables[*variable].value_reference)
                .collect(),
            output_nominals: variables
                .iter()
                .map(|(_, variable)| nominal(&description.variables[*variable].kind))
                .collect(),
            is_static,
            sample: samples.filter(|&sample| sample > 0.0 && (!fixed_step || whole(sample))),
            fixed_step,
            ramps: interface.can_interpolate_inputs && self.settings.coupling.ramped,
            rates: interface.max_output_derivative_order > 0,
            rollback: interface.can_get_and_set_fmu_state,
            u: Vec::new(),
            value: Vec::new(),
            slope: Vec::new(),
            orders: Vec::new(),
            before: vec![[0.0; 2]; variables.len()],
            discrete,
            saved: None,
            steps: 0,
        }
    }

    /// Members of every part in the order of their steps, whether they are coupled, and the connections (by
    /// position) whose value is taken at the beginning of the step.
    fn parts(&self) -> (Vec<(Vec<usize>, bool)>, Vec<bool>) {
        let count = self.graph.components.len();
        let edge = |position: usize| match self.graph.connections[position].source {
            Source::Output { component, .. } => {
                Some((self.number[component], self.number[self.graph.connections[position].component]))
            }
            Source::Input(_) => None,
        };
        let components = |delayed: &[bool]| {
            let mut next = vec![Vec::new(); count];
            for position in (0..self.graph.connections.len()).filter(|&position| !delayed[position]) {
                if let Some((from, to)) = edge(position) {
                    next[from].push(to);
                }
            }
            let mut found = strongly_connected(&next);
            // Tarjan's algorithm finds a component after those it feeds.
            found.reverse();
            found.iter_mut().for_each(|members| members.sort_unstable());
            let looped = |members: &Vec<usize>| members.len() > 1 || next[members[0]].contains(&members[0]);
            found.iter().map(|members| (members.clone(), looped(members))).collect::<Vec<_>>()
        };
        let mut delayed = vec![false; self.graph.connections.len()];
        let sampled: Vec<bool> = (0..count).map(|unit| self.is_sampled(unit)).collect();
        for (members, looped) in components(&delayed) {
            for (position, delayed) in delayed.iter_mut().enumerate() {
                let inside = edge(position).is_some_and(|(from, to)| {
                    members.contains(&from) && members.contains(&to) && sampled[to]
                });
                *delayed |= looped && inside;
            }
        }
        (components(&delayed), delayed)
    }

    /// Whether all outputs of a unit that feed something change at its samples only.
    fn is_sampled(&self, unit: usize) -> bool {
        let index = self.graph.order[unit];
        let variables = &self.graph.components[index].fmu.description.variables;
        let mut discrete = self.graph.connections.iter().filter_map(|connection| match connection.source {
            Source::Output { component, variable } if component == index => {
                Some(variables[variable].variability == Variability::Discrete)
            }
            _ => None,
        });
        let first = discrete.next();
        first.unwrap_or(false) && discrete.all(|discrete| discrete)
    }

    /// Fills in the inputs of all units.
    fn connect(&mut self, units: &mut [Unit], delayed: &[bool], values: &Values) {
        for (position, connection) in self.graph.connections.iter().enumerate() {
            if !self.is_real(connection.component, connection.variable) {
                continue;
            }
            let unit = &mut units[self.number[connection.component]];
            let feed = match connection.source {
                Source::Output { component, variable } => {
                    let place = self.places[&(component, variable)];
                    if delayed[position] { Feed::Begin(place) } else { Feed::Signal(place) }
                }
                source => Feed::System(self.wiring.index_of(source)),
            };
            let description = &self.graph.components[connection.component].fmu.description;
            let variable = &description.variables[connection.variable];
            unit.inputs.push(Input {
                feed,
                conversion: connection.conversion,
                variable: connection.variable,
                nominal: nominal(&variable.kind),
            });
            unit.input_references.push(variable.value_reference);
            unit.u.push(connection.conversion.apply(values.reals[self.wiring.index_of(connection.source)]));
        }
        for number in 0..units.len() {
            let unit = &mut units[number];
            unit.value = unit.u.clone();
            unit.slope = vec![0.0; unit.u.len()];
            unit.orders = vec![1; unit.u.len().max(unit.outputs.len())];
            let step = self.grid.step();
            match unit.sample {
                Some(sample) if sample < step * (1.0 - 1e-6) => self.notes.push(format!(
                    "component `{}`: one FMU step per sample of {sample} s (its default experiment)",
                    self.name(number)
                )),
                None if unit.discrete.contains(&true) => self.notes.push(format!(
                    "component `{}` does not tell its sample time (step size of its default experiment): its discrete outputs are held over the communication step",
                    self.name(number)
                )),
                _ => {}
            }
            let late = unit.inputs.iter().any(|input| matches!(input.feed, Feed::Begin(_)));
            if late {
                self.notes.push(format!(
                    "component `{}` is sampled: inputs from components that it drives are those at the beginning of the communication step",
                    self.name(number)
                ));
            }
        }
    }

    /// Room for the pieces of a signal over one step.
    fn pieces(&self, units: &[Unit]) -> usize {
        let of_unit =
            |unit: &Unit| unit.sample.map_or(0.0, |sample| (self.grid.step() / sample).ceil() + 2.0);
        (units.iter().map(of_unit).sum::<f64>() as usize).min(1_000_000) + 3
    }

    /// Refuses what a coupled component cannot do with this FMU.
    fn refuse(&self, unit: usize, reason: &str) -> Error {
        Error::Unsuitable { component: self.name(unit).to_owned(), reason: reason.to_owned() }
    }

    fn check(&self, unit: &Unit, members: &[usize]) -> Result<(), Error> {
        let description = &self.component(unit.number).fmu.description;
        if unit.discrete.contains(&true) {
            return Err(
                self.refuse(unit.number, "passes on discrete and continuous outputs in a coupled component")
            );
        }
        if description.number_of_event_indicators > 0 {
            return Err(self.refuse(unit.number, "has state events in a coupled component"));
        }
        for connection in &self.graph.connections {
            let Source::Output { component, variable } = connection.source else { continue };
            let inside =
                self.number[component] == unit.number && members.contains(&self.number[connection.component]);
            let reals =
                self.is_real(component, variable) && self.is_real(connection.component, connection.variable);
            if inside && !reals {
                return Err(
                    self.refuse(unit.number, "exchanges other than Real values in a coupled component")
                );
            }
        }
        Ok(())
    }

    /// A strongly coupled component.
    fn couple(&mut self, units: &mut [Unit], members: &[usize], pieces: usize) -> Result<Coupled, Error> {
        members.iter().try_for_each(|&member| self.check(&units[member], members))?;
        let (dynamic, fixed): (Vec<usize>, Vec<usize>) =
            members.iter().partition(|&&member| !units[member].is_static);
        let (fixed, circular) = self.order_statics(units, &fixed);
        let mut coupling = self.settings.coupling;
        self.choose_repeats(units, members, &dynamic, &mut coupling)?;

        let mut implicit = circular;
        let (mut x, mut u, mut y) = (0, 0, 0);
        let next = |at: &mut usize, count: usize| {
            *at += count;
            *at - count..*at
        };
        let (mut dynamics, mut statics, mut nominals) = (Vec::new(), Vec::new(), Vec::new());
        for &number in &dynamic {
            let model = self.local_model(&units[number], coupling.repeats())?;
            let through = self.has_feed_through(&units[number]);
            implicit |= through;
            nominals.extend_from_slice(&model.nominal);
            dynamics.push(Dynamic {
                unit: number,
                x: next(&mut x, model.nx),
                u: next(&mut u, model.nu),
                y: next(&mut y, model.ny),
                model,
            });
        }
        for &number in &fixed {
            let function = self.function(&units[number], coupling.repeats())?;
            statics.push(Static {
                unit: number,
                u: next(&mut u, units[number].inputs.len()),
                y: next(&mut y, units[number].outputs.len()),
                function,
            });
        }
        // Place in `Outputs` of every output of the problem.
        let places: Vec<usize> =
            dynamic.iter().chain(&fixed).flat_map(|&number| units[number].outputs.clone()).collect();
        let inputs = dynamic
            .iter()
            .chain(&fixed)
            .flat_map(|&number| units[number].inputs.clone())
            .map(|input| {
                let inside = match input.feed {
                    Feed::Signal(place) => places.iter().position(|&other| other == place),
                    _ => None,
                };
                (inside.map_or(Link::Outside(input.feed), Link::Inside), input)
            })
            .collect();
        let problem = Reduced::new(dynamics, statics, inputs, implicit);
        let repeats = coupling.repeats();
        Ok(Coupled {
            members: members.to_vec(),
            radau: Radau::new(&problem, pieces),
            problem,
            nominal: nominals,
            coupling,
            repeats,
            last_step: 0.0,
            nudged: vec![0.0; places.len()],
            y: vec![0.0; places.len()],
            rate: vec![0.0; places.len()],
            passes: 0,
        })
    }

    /// Static units in feed-through order, and whether they form a circle.
    fn order_statics(&self, units: &[Unit], fixed: &[usize]) -> (Vec<usize>, bool) {
        let mut next = vec![Vec::new(); fixed.len()];
        for (to, &number) in fixed.iter().enumerate() {
            for input in &units[number].inputs {
                let Feed::Signal(place) = input.feed else { continue };
                if let Some(from) = fixed.iter().position(|&other| units[other].outputs.contains(&place)) {
                    next[from].push(to);
                }
            }
        }
        let found = strongly_connected(&next);
        let circular =
            found.iter().any(|members| members.len() > 1 || next[members[0]].contains(&members[0]));
        (found.into_iter().rev().flatten().map(|position| fixed[position]).collect(), circular)
    }

    /// Whether an input of the unit reaches one of its connected outputs directly.
    fn has_feed_through(&self, unit: &Unit) -> bool {
        let component = self.component(unit.number);
        let index = self.graph.order[unit.number];
        self.places
            .keys()
            .filter(|(owner, _)| *owner == index)
            .flat_map(|&(_, variable)| feed_through(component, variable))
            .any(|variable| unit.inputs.iter().any(|input| input.variable == variable))
    }

    /// Whether steps can be taken back; if not, the prediction has to do.
    fn choose_repeats(
        &mut self,
        units: &[Unit],
        members: &[usize],
        dynamic: &[usize],
        coupling: &mut Coupling,
    ) -> Result<(), Error> {
        let stuck = dynamic.iter().copied().find(|&number| !units[number].rollback);
        if let Some(number) = stuck
            && coupling.repeats()
        {
            if coupling.tolerance.is_some() {
                return Err(self.refuse(
                    number,
                    "cannot save and restore its state, which --iterate needs (or leave --iterate out)",
                ));
            }
            coupling.corrections = 0;
            let names: Vec<&str> = members.iter().map(|&member| self.name(member)).collect();
            let note = format!(
                "coupled component {}: no correction, as `{}` cannot save and restore its state; the error of the last step corrects the next prediction",
                names.join(", "),
                self.name(number)
            );
            self.notes.push(note);
        }
        Ok(())
    }

    fn local_model(&mut self, unit: &Unit, repeats: bool) -> Result<LocalModel, Error> {
        let description = &self.component(unit.number).fmu.description;
        let reference = |variable: usize| description.variables[variable].value_reference;
        let states: Vec<usize> = description.continuous_states().collect();
        let offered = description
            .co_simulation
            .as_ref()
            .is_some_and(|interface| interface.provides_directional_derivative)
            && !states.is_empty()
            && states.len() == description.derivatives.len();
        let (nu, ny) = (unit.inputs.len(), unit.outputs.len());
        let (origin, nominals) = if offered {
            let derivatives = description.derivatives.iter().map(|unknown| reference(unknown.variable));
            let unknowns = derivatives.chain(unit.output_references.iter().copied()).collect();
            let nominals = states.iter().map(|&state| nominal(&description.variables[state].kind)).collect();
            let states = states.iter().map(|&state| reference(state)).collect();
            (Origin::Derivatives { states, unknowns }, nominals)
        } else {
            if !unit.rollback || !repeats {
                return Err(self.refuse(
                    unit.number,
                    "has no directional derivatives, and steps cannot be repeated to find its input gains,",
                ));
            }
            if self.has_feed_through(unit) {
                return Err(self
                    .refuse(unit.number, "has states, direct feed-through and no directional derivatives"));
            }
            self.notes.push(format!(
                "component `{}` has no directional derivatives: its input gains come from {nu} repeated steps per communication step",
                self.name(unit.number)
            ));
            (Origin::Differences, unit.output_nominals.clone())
        };
        if !unit.ramps && self.settings.coupling.ramped {
            self.notes.push(format!(
                "component `{}` takes no input derivatives: its inputs are held at their mean over the step",
                self.name(unit.number)
            ));
        }
        if !unit.rates {
            self.notes.push(format!(
                "component `{}` gives no output derivatives: the error of its prediction is taken to grow with the square of time",
                self.name(unit.number)
            ));
        }
        Ok(LocalModel::new(origin, nominals, nu, ny))
    }

    /// How a static block is evaluated.
    fn function(&mut self, unit: &Unit, repeats: bool) -> Result<Function, Error> {
        let component = self.component(unit.number);
        let description = &component.fmu.description;
        let index = self.graph.order[unit.number];
        let others = self
            .graph
            .connections
            .iter()
            .any(|connection| connection.component == index && !self.is_real(index, connection.variable));
        let name = component.name.clone();
        if let Some(interface) = &description.model_exchange
            && !interface.can_be_instantiated_only_once_per_process
            && !others
        {
            let derivatives = interface.provides_directional_derivative;
            let model = evaluator::instantiate(component, unit, self.settings, self.grid)?;
            if !derivatives {
                self.notes.push(format!(
                    "component `{name}` has no directional derivatives: its slopes are difference quotients"
                ));
            }
            return Ok(Function::Exchange { model: Box::new(model), derivatives });
        }
        let slave = description.co_simulation.as_ref();
        let derivatives = slave.is_some_and(|interface| interface.provides_directional_derivative);
        let corrected = unit.rollback && repeats;
        if !derivatives && !unit.rollback {
            return Err(self.refuse(
                unit.number,
                "cannot be evaluated through Model Exchange, has no directional derivatives and cannot take a step back,",
            ));
        }
        self.notes.push(format!(
            "component `{name}` cannot be evaluated through Model Exchange: it is approximated by its {}",
            if corrected { "secant to a predicted input, at the cost of a further step" } else { "tangent" }
        ));
        let weight = unit.inputs.iter().map(|input| {
            let linear = self.is_linear_in(unit, input.variable);
            if linear { 0.0 } else { input.nominal.powi(-2) }
        });
        Ok(Function::Secant(Secant::new(weight.collect(), unit.outputs.len(), derivatives)))
    }

    /// Whether all connected outputs of a unit depend on an input with a constant factor or not at all.
    fn is_linear_in(&self, unit: &Unit, input: usize) -> bool {
        let description = &self.component(unit.number).fmu.description;
        let index = self.graph.order[unit.number];
        self.places.keys().filter(|(owner, _)| *owner == index).all(|(_, output)| {
            let unknown = description.outputs.iter().find(|unknown| unknown.variable == *output);
            let known = unknown.and_then(|unknown| unknown.dependencies.as_ref());
            known.is_some_and(|known| {
                let mut kinds = known.iter().filter(|known| known.variable == input);
                kinds.all(|known| known.kind != DependencyKind::Dependent)
            })
        })
    }
}

fn nominal(kind: &VariableKind) -> f64 {
    let declared = match kind {
        VariableKind::Real(real) => real.nominal,
        _ => None,
    };
    declared.map(f64::abs).filter(|nominal| *nominal > 0.0 && nominal.is_finite()).unwrap_or(1.0)
}
