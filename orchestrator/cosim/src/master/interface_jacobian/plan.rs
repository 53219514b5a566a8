//! From a system graph to units and parts: which components are strongly coupled, what each FMU can do, and what
//! is done where it lacks something.

use std::collections::BTreeMap;

use super::coupled::Coupled;
use super::radau::Radau;
use super::reduced::{Dynamic, Link, Reduced, Static};
use super::signal::Signal;
use super::unit::{Feed, Input, Outputs, Unit};
use crate::master::exchange::{Node, Wiring};
use crate::master::stop::Stop;
use crate::master::{Error, Grid, Settings, Values};
use crate::system::SystemGraph;
use crate::system::graph::{DataType, Source};
use crate::system::order::strongly_connected;
use airloop_fmi::{Variability, VariableKind};

/// Data about the system that planning needs.
pub(super) struct Planner<'a> {
    pub graph: &'a SystemGraph,
    pub wiring: &'a Wiring,
    pub settings: &'a Settings,
    pub grid: &'a Grid,
    /// Unit of each component.
    pub number: Vec<usize>,
    /// Place in [`Outputs`] of each output (component, variable) that feeds a Real input.
    pub places: BTreeMap<(usize, usize), usize>,
    pub notes: Vec<String>,
}

/// Units and their outputs alone, for masters that step in the plain order.
pub(in crate::master) fn interfaces(
    graph: &SystemGraph,
    wiring: &Wiring,
    settings: &Settings,
    grid: &Grid,
    nodes: &mut [Node],
    values: &Values,
) -> Result<(Vec<Unit>, Outputs), Error> {
    let planner = Planner::new(graph, wiring, settings, grid);
    let mut units: Vec<Unit> = (0..nodes.len()).map(|unit| planner.unit(unit)).collect();
    planner.connect(&mut units, &vec![false; graph.connections.len()], values);
    let outputs = planner.outputs(&units, nodes, 0)?;
    Ok((units, outputs))
}

impl<'a> Planner<'a> {
    pub fn new(
        graph: &'a SystemGraph,
        wiring: &'a Wiring,
        settings: &'a Settings,
        grid: &'a Grid,
    ) -> Planner<'a> {
        let mut number = vec![0; graph.components.len()];
        graph.order.iter().enumerate().for_each(|(unit, &component)| number[component] = unit);
        let mut planner =
            Planner { graph, wiring, settings, grid, number, places: BTreeMap::new(), notes: Vec::new() };
        planner.find_outputs();
        planner
    }

    /// Outputs at their initial values, with room for signals of so many pieces.
    pub fn outputs(&self, units: &[Unit], nodes: &mut [Node], pieces: usize) -> Result<Outputs, Error> {
        let count = self.places.len();
        let mut outputs = Outputs {
            y: vec![0.0; count],
            rate: vec![0.0; count],
            begin: vec![0.0; count],
            trajectories: Vec::new(),
            signals: (0..count).map(|_| Signal::with_room(pieces)).collect(),
        };
        for (unit, node) in units.iter().zip(nodes) {
            let places = unit.outputs.clone();
            let read = unit.read(node, &mut outputs.y[places.clone()], &mut outputs.rate[places]);
            read.map_err(|stop| match stop {
                Stop::Fmu(error) => Error::Fmu(*error),
                _ => Error::NotFinite {
                    component: self.name(unit.number).to_owned(),
                    variable: "an output".into(),
                    value: f64::NAN,
                    time: self.grid.start(),
                },
            })?;
        }
        Ok(outputs)
    }

    pub fn component(&self, unit: usize) -> &crate::system::graph::Component {
        &self.graph.components[self.graph.order[unit]]
    }

    pub fn name(&self, unit: usize) -> &str {
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

    pub fn is_real(&self, component: usize, variable: usize) -> bool {
        DataType::of(&self.graph.components[component].fmu.description.variables[variable]) == DataType::Real
    }

    pub fn unit(&self, number: usize) -> Unit {
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
        let fed_directly = |output: usize| component.fmu.feed_through(output).iter().copied().any(fed);
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
            ended: false,
            steps: 0,
        }
    }

    /// Members of every part in the order of their steps, whether they are coupled, and the connections (by
    /// position) whose value is taken at the beginning of the step.
    pub fn parts(&self) -> (Vec<(Vec<usize>, bool)>, Vec<bool>) {
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
    pub fn connect(&self, units: &mut [Unit], delayed: &[bool], values: &Values) {
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
        for unit in units {
            unit.value = unit.u.clone();
            unit.slope = vec![0.0; unit.u.len()];
            unit.orders = vec![1; unit.u.len().max(unit.outputs.len())];
        }
    }

    /// Notes what becomes of sampled units.
    pub fn note_samples(&mut self, units: &[Unit]) {
        for unit in units {
            let name = self.name(unit.number).to_owned();
            match unit.sample {
                Some(sample) if sample < self.grid.step() * (1.0 - 1e-6) => self.notes.push(format!(
                    "component `{name}`: one FMU step per sample of {sample} s (its default experiment)"
                )),
                None if unit.discrete.contains(&true) => self.notes.push(format!(
                    "component `{name}` does not tell its sample time (step size of its default experiment): its discrete outputs are held over the communication step"
                )),
                _ => {}
            }
            if unit.inputs.iter().any(|input| matches!(input.feed, Feed::Begin(_))) {
                self.notes.push(format!(
                    "component `{name}` is sampled: inputs from components that it drives are those at the beginning of the communication step"
                ));
            }
        }
    }

    /// Room for the pieces of a signal over one step.
    pub fn pieces(&self, units: &[Unit]) -> usize {
        let of_unit =
            |unit: &Unit| unit.sample.map_or(0.0, |sample| (self.grid.step() / sample).ceil() + 2.0);
        (units.iter().map(of_unit).sum::<f64>() as usize).min(1_000_000) + 3
    }

    /// A strongly coupled component.
    pub fn couple(&mut self, units: &mut [Unit], members: &[usize], pieces: usize) -> Result<Coupled, Error> {
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
            loops: Vec::new(),
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
}

/// Nominal value of a variable; 1 where none is declared.
pub(in crate::master) fn nominal(kind: &VariableKind) -> f64 {
    let declared = match kind {
        VariableKind::Real(real) => real.nominal,
        _ => None,
    };
    declared.map(f64::abs).filter(|nominal| *nominal > 0.0 && nominal.is_finite()).unwrap_or(1.0)
}
