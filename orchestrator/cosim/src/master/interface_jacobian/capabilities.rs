//! Capabilities of each FMU of a coupled component, and substitutes for missing ones; every such choice becomes a
//! note, or the refusal of the run where nothing can take its place.

use super::evaluator;
use super::local_model::{LocalModel, Origin};
use super::plan::{Planner, nominal};
use super::static_block::{Function, Secant};
use super::unit::Unit;
use crate::master::{Coupling, Error};
use crate::system::graph::Source;
use airloop_fmi::DependencyKind;

impl Planner<'_> {
    /// Refuses what a coupled component cannot do with this FMU.
    fn refuse(&self, unit: usize, reason: &str) -> Error {
        Error::Unsuitable { component: self.name(unit).to_owned(), reason: reason.to_owned() }
    }

    pub fn check(&self, unit: &Unit, members: &[usize]) -> Result<(), Error> {
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

    /// Whether an input of the unit reaches one of its connected outputs directly.
    pub fn has_feed_through(&self, unit: &Unit) -> bool {
        let component = self.component(unit.number);
        let index = self.graph.order[unit.number];
        self.places
            .keys()
            .filter(|(owner, _)| *owner == index)
            .flat_map(|&(_, variable)| component.fmu.feed_through(variable))
            .any(|&variable| unit.inputs.iter().any(|input| input.variable == variable))
    }

    /// Whether steps can be taken back; if not, the prediction has to do.
    pub fn choose_repeats(
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

    pub fn local_model(&mut self, unit: &Unit, repeats: bool) -> Result<LocalModel, Error> {
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
            if !repeats && !unit.rates {
                return Err(self.refuse(
                    unit.number,
                    "has neither directional derivatives nor output derivatives, and its steps are not repeated,",
                ));
            }
            if self.has_feed_through(unit) {
                return Err(self
                    .refuse(unit.number, "has states, direct feed-through and no directional derivatives"));
            }
            let name = self.name(unit.number);
            self.notes.push(match repeats {
                true => format!(
                    "component `{name}` has no directional derivatives: its input gains come from {nu} repeated steps per communication step"
                ),
                false => format!(
                    "component `{name}` has no directional derivatives: its input gains are learned from step to step (Broyden)"
                ),
            });
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

    /// Method by which a static block is evaluated.
    pub fn function(&mut self, unit: &Unit, repeats: bool) -> Result<Function, Error> {
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
            let model = evaluator::instantiate(component, unit, self.settings)?;
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
