//! A system of FMUs as one right-hand side with places where blocks of candidate effects can act.
//!
//! Model Exchange instances; values pass along the connections in the order of direct feed-through. A block acts on the
//! value that an input receives, so that a candidate needs no FMU of its own while the search goes on. Integration is
//! left to [`super::simulate`]. An FMU of Co-Simulation only is a sampled component: it steps from event to event, and
//! its outputs are held between them.

mod initialization;
pub mod response;
mod ring;
mod unit;

use std::collections::BTreeMap;
use std::ops::Range;

use super::Problem;
use super::names::{attachment_target, known, path};
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{Component, Conversion, DataType, Source, Start};
use airloop_cosim::system::order::loop_groups;
use airloop_fmi::{Causality, Initial, InterfaceKind, Variability, VariableKind};
use ring::Ring;
use unit::{Pace, Unit};

/// Source of the value of an input of a component.
#[derive(Debug, Clone)]
struct Feed {
    reference: u32,
    /// Slot of the source; none: the start value of the input.
    source: Option<(usize, Conversion)>,
    start: f64,
    /// Attachments that act here.
    blocks: Vec<usize>,
}

/// One component.
#[derive(Debug)]
struct Part {
    unit: Unit,
    /// Communication step of a slave.
    pace: Pace,
    states: Range<usize>,
    /// Value references of the states; empty where their start values cannot be set.
    state_references: Vec<u32>,
    feeds: Vec<Feed>,
    feed_references: Vec<u32>,
    feed_values: Vec<f64>,
    /// Outputs that follow the states alone, and those that follow inputs: value references and first slot.
    early: (Vec<u32>, Range<usize>),
    late: (Vec<u32>, Range<usize>),
    /// Outputs that are states: slot and place among all states.
    shown: Vec<(usize, usize)>,
    /// Time of its next event \[s\].
    next_event: Option<f64>,
    /// It wants to hear of every accepted step.
    told_of_steps: bool,
    /// Its outputs that something reads change at events only, if its states do.
    shows_events: bool,
    /// Its states, if any, and its outputs that something reads change at events only.
    only_events: bool,
    /// Event indicators: their number, and whether each was positive after the last event.
    indicators: usize,
    positive: Vec<bool>,
    /// It is in event mode.
    in_event: bool,
}

/// A parameter of the system: component in evaluation order and value reference.
pub type Parameter = (usize, u32);

/// The instances and the values that pass between them.
#[derive(Debug)]
pub struct Plant {
    parts: Vec<Part>,
    starts: Vec<Component>,
    /// Values: system inputs first, then outputs.
    pub slots: Vec<f64>,
    /// First slot of the further signals.
    pub extra_first: usize,
    names: BTreeMap<String, usize>,
    states: BTreeMap<String, usize>,
    /// Number of states.
    pub nx: usize,
    initialized: bool,
    /// Whether it is known which components change at events only.
    probed: bool,
    /// The states were set from outside: components that change at events only have not seen them.
    moved: bool,
    /// Step of the samples that slaves keep pace with \[s\].
    sample_step: f64,
    /// Blocks follow what slaves show, so that these step more finely than the samples.
    couples_slaves: bool,
    /// Algebraic loops.
    rings: Vec<Ring>,
}

/// Step of the samples where nothing says another \[s\].
const USUAL_SAMPLE_STEP: f64 = 1e-3;

impl Plant {
    /// Instantiates the components of a graph, for Model Exchange where they have that; `attachments` are the inputs
    /// where blocks act, `extra` further signals, which have the last slots; `wanted`: variables that are shown
    /// although they are no outputs.
    ///
    /// # Errors
    /// Names that are no inputs, FMUs that fail.
    pub fn new(
        graph: &SystemGraph,
        attachments: &[String],
        extra: &[String],
        wanted: &[String],
    ) -> Result<Plant, Problem> {
        let order = order(graph);
        let mut blocks: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
        for (index, name) in attachments.iter().enumerate() {
            let targets = attachment_target(graph, name).ok_or_else(|| Problem::Name {
                what: "input",
                name: name.clone(),
                known: known(graph, &[Causality::Input]),
            })?;
            targets.into_iter().for_each(|target| blocks.entry(target).or_default().push(index));
        }
        let mut names: BTreeMap<String, usize> = BTreeMap::new();
        let mut count = 0;
        for input in &graph.inputs {
            names.insert(input.name.clone(), count);
            count += 1;
        }
        let real = |component: &Component, variable: usize| {
            DataType::of(&component.fmu.description.variables[variable]) == DataType::Real
        };
        // Slots of all Real outputs, early ones of a component before its late ones.
        let mut places: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        let mut ranges = Vec::new();
        for &index in &order {
            let component = &graph.components[index];
            let variables = &component.fmu.description.variables;
            let asked = |v: usize| {
                let name = if graph.single { variables[v].name.clone() } else { component.path_of(v) };
                variables[v].causality == Causality::Local && wanted.contains(&name)
            };
            let outputs = (0..variables.len())
                .filter(|&v| real(component, v) && (variables[v].causality == Causality::Output || asked(v)));
            let stepped = is_stepped(component);
            let own: Vec<usize> = match stepped {
                true => Vec::new(),
                false => component.fmu.description.continuous_states().collect(),
            };
            let (states, outputs): (Vec<usize>, Vec<usize>) = outputs.partition(|v| own.contains(v));
            let (early, late): (Vec<usize>, Vec<usize>) = outputs
                .into_iter()
                .partition(|&v| stepped || asked(v) || component.fmu.feed_through(v).is_empty());
            let mut range = |list: &[usize]| {
                let first = count;
                for &variable in list {
                    places.insert((index, variable), count);
                    let name = if graph.single {
                        variables[variable].name.clone()
                    } else {
                        component.path_of(variable)
                    };
                    names.insert(name, count);
                    count += 1;
                }
                let references: Vec<u32> = list.iter().map(|&v| variables[v].value_reference).collect();
                (references, first..count)
            };
            let place = |v: &usize| own.iter().position(|state| state == v).unwrap_or(0);
            let shown = states.iter().map(place).zip(range(&states).1).collect::<Vec<_>>();
            ranges.push((range(&early), range(&late), shown));
        }
        for output in &graph.outputs {
            if let Source::Output { component, variable } = output.source
                && let Some(&slot) = places.get(&(component, variable))
                && output.conversion == Conversion::IDENTITY
            {
                names.entry(output.name.clone()).or_insert(slot);
            }
        }
        let (mut parts, mut nx, mut states) = (Vec::new(), 0, BTreeMap::new());
        for (&index, (early, late, shown)) in order.iter().zip(ranges) {
            let component = &graph.components[index];
            let description = &component.fmu.description;
            let mut feeds = Vec::new();
            for (variable, declared) in description.variables.iter().enumerate() {
                if declared.causality != Causality::Input || !real(component, variable) {
                    continue;
                }
                let connection =
                    graph.connections.iter().find(|c| (c.component, c.variable) == (index, variable));
                let source = connection
                    .map(|connection| {
                        let slot = match connection.source {
                            Source::Input(input) => Some(input),
                            Source::Output { component, variable } => {
                                places.get(&(component, variable)).copied()
                            }
                        };
                        let place = || component.path_of(variable);
                        slot.map(|slot| (slot, connection.conversion))
                            .ok_or_else(|| Problem::System(format!("`{}` is not driven by a Real", place())))
                    })
                    .transpose()?;
                let start = match &declared.kind {
                    VariableKind::Real(real) => real.start.unwrap_or(0.0),
                    _ => 0.0,
                };
                let set = component.start_values.iter().find(|s| s.variable == variable);
                let start = match set.map(|s| &s.value) {
                    Some(Start::Real(value)) => *value,
                    _ => start,
                };
                let blocks = blocks.get(&(index, variable)).cloned().unwrap_or_default();
                feeds.push(Feed { reference: declared.value_reference, source, start, blocks });
            }
            let stepped = is_stepped(component);
            let mut unit = Unit::new(component, &early.0)?;
            let own_states: Vec<usize> = match stepped {
                true => Vec::new(),
                false => description.continuous_states().collect(),
            };
            for (place, &variable) in own_states.iter().enumerate() {
                let name = &description.variables[variable].name;
                let full = if graph.single { name.clone() } else { component.path_of(variable) };
                states.insert(full, nx + place);
            }
            let own = nx..nx + unit.equations().map_or(0, |model| model.state_count());
            let stateless = own.is_empty();
            let own_states = || own_states.iter().map(|&v| &description.variables[v]);
            let settable = own_states().all(|v| matches!(v.initial, Some(Initial::Exact | Initial::Approx)));
            let state_references =
                if settable { own_states().map(|v| v.value_reference).collect() } else { Vec::new() };
            let shown = shown.into_iter().map(|(place, slot)| (slot, nx + place)).collect();
            nx = own.end;
            let feed_references = feeds.iter().map(|feed| feed.reference).collect();
            let feed_values = vec![0.0; feeds.len()];
            let interface = component.fmu.interface(InterfaceKind::ModelExchange);
            let read = |place: (usize, usize)| {
                let is = |source: Source| source == Source::Output { component: place.0, variable: place.1 };
                let (name, path) = (&description.variables[place.1].name, component.path_of(place.1));
                graph.connections.iter().any(|connection| is(connection.source))
                    || graph.outputs.iter().any(|output| is(output.source))
                    || wanted.iter().any(|own| *own == path || own == name)
            };
            let mut own_places = places.keys().filter(|place| place.0 == index);
            let shows_events = stepped
                || description.number_of_event_indicators == 0
                    && own_places.all(|&place| {
                        description.variables[place.1].variability == Variability::Discrete || !read(place)
                    });
            let indicators = if stepped { 0 } else { description.number_of_event_indicators };
            parts.push(Part {
                unit,
                pace: Pace::of(component, graph.single),
                states: own,
                state_references,
                feeds,
                feed_references,
                feed_values,
                early,
                late,
                shown,
                next_event: None,
                indicators,
                positive: vec![false; indicators],
                in_event: false,
                shows_events,
                only_events: shows_events && stateless,
                told_of_steps: interface.is_some_and(|own| !own.completed_integrator_step_not_needed),
            });
        }
        // A system output that is the same variable as a state names that state as well.
        for output in &graph.outputs {
            if let Source::Output { component, variable } = output.source {
                let state = states.get(&graph.components[component].path_of(variable)).copied();
                state.into_iter().for_each(|state| {
                    states.entry(output.name.clone()).or_insert(state);
                });
            }
        }
        let extra_first = count;
        for name in extra {
            names.entry(name.clone()).or_insert(count);
            count += 1;
        }
        let rings = rings(graph, &order, &places, &parts);
        let starts = order.iter().map(|&index| graph.components[index].clone()).collect();
        let slots = vec![0.0; count];
        Ok(Plant {
            parts,
            starts,
            slots,
            extra_first,
            names,
            states,
            nx,
            initialized: false,
            probed: false,
            moved: false,
            sample_step: USUAL_SAMPLE_STEP,
            couples_slaves: false,
            rings,
        })
    }

    /// Slot of a signal.
    pub fn slot(&self, name: &str) -> Option<usize> {
        self.names.get(name).copied()
    }

    /// Place of a state.
    pub fn state(&self, name: &str) -> Option<usize> {
        self.states.get(name).copied()
    }

    /// Names of the states in their order: that of the system where it has one.
    pub fn states_by_place(&self) -> Vec<String> {
        let mut found = vec![String::new(); self.nx];
        for (name, &place) in &self.states {
            let own = &mut found[place];
            // Of several names the one that is a signal, then the shortest.
            let better = own.is_empty()
                || (self.names.contains_key(name), std::cmp::Reverse(name.len()))
                    > (self.names.contains_key(own), std::cmp::Reverse(own.len()));
            if better {
                own.clone_from(name);
            }
        }
        found
    }

    /// Names of the slaves: components that step by themselves.
    pub fn slaves(&self) -> Vec<&str> {
        let own = self.parts.iter().filter(|part| matches!(part.unit, Unit::Stepped(_)));
        own.map(|part| part.unit.name()).collect()
    }

    /// Communication step of the slaves \[s\], the longest of them; none where there are none.
    pub fn communication_step(&self) -> Option<f64> {
        let own = self.parts.iter().filter(|part| matches!(part.unit, Unit::Stepped(_)));
        own.map(|part| part.pace.step(self.sample_step, self.couples_slaves)).max_by(f64::total_cmp)
    }

    /// Says the step of the samples \[s\], which slaves keep pace with from the next initialization on, and whether
    /// blocks follow what slaves show.
    pub fn keep_pace(&mut self, step: f64, coupled: bool) {
        self.sample_step = step;
        self.couples_slaves = coupled;
    }

    /// Names of all signals, for messages.
    pub fn signal_names(&self) -> String {
        self.names.keys().take(30).cloned().collect::<Vec<_>>().join(", ")
    }

    /// Names of all states, for messages.
    pub fn state_names(&self) -> String {
        self.states.keys().take(30).cloned().collect::<Vec<_>>().join(", ")
    }

    /// A Real parameter by name, with its start value and least and largest value.
    pub fn parameter(graph: &SystemGraph, name: &str) -> Option<(Parameter, f64, (f64, f64))> {
        let (component, variable) = path(graph, name)?;
        let declared = &graph.components[component].fmu.description.variables[variable];
        let VariableKind::Real(real) = &declared.kind else { return None };
        if declared.causality != Causality::Parameter {
            return None;
        }
        let set = graph.components[component].start_values.iter().find(|s| s.variable == variable);
        let value = match set.map(|s| &s.value) {
            Some(Start::Real(value)) => *value,
            _ => real.start?,
        };
        let place = order(graph).iter().position(|&index| index == component)?;
        let bounds = (real.min.unwrap_or(f64::NEG_INFINITY), real.max.unwrap_or(f64::INFINITY));
        Some(((place, declared.value_reference), value, bounds))
    }

    /// Says that the states were set from outside.
    pub fn moved(&mut self) {
        self.moved = true;
    }

    /// Whether the states rest between events.
    pub fn rests(&self) -> bool {
        self.parts.iter().all(|part| part.states.is_empty() || part.only_events)
    }

    /// Time of the next event \[s\].
    pub fn next_event(&self) -> Option<f64> {
        self.parts.iter().filter_map(|part| part.next_event).min_by(f64::total_cmp)
    }

    /// Whether components have state events.
    pub fn has_state_events(&self) -> bool {
        self.parts.iter().any(|part| part.indicators > 0)
    }

    /// Whether an event indicator has another sign than after the last event, where the system was evaluated last.
    ///
    /// # Errors
    /// An FMU that fails.
    pub fn crossed(&mut self) -> Result<bool, airloop_fmi::Error> {
        for part in self.parts.iter_mut().filter(|part| part.indicators > 0) {
            let Some(model) = part.unit.equations() else { continue };
            let mut values = vec![0.0; part.indicators];
            model.get_event_indicators(&mut values)?;
            if values.iter().zip(&part.positive).any(|(value, positive)| (*value > 0.0) != *positive) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The events of `time` \[s\], one component after the other; they may change the states `x`, `[nx]`. `state`: a
    /// state event, which concerns all components that have some; else those whose time has come.
    ///
    /// # Errors
    /// An FMU that fails.
    pub fn event(
        &mut self,
        (time, state): (f64, bool),
        x: &mut [f64],
        block: &impl Fn(usize, f64, &[f64]) -> f64,
    ) -> Result<(), airloop_fmi::Error> {
        for part in &mut self.parts {
            let is_due = part.next_event.is_some_and(|next| next <= time) || state && part.indicators > 0;
            match &mut part.unit {
                Unit::Stepped(own) if is_due => own.advance(time)?,
                Unit::Stepped(_) => {}
                Unit::Equations(model) => {
                    model.set_time(time)?;
                    if !part.states.is_empty() {
                        model.set_continuous_states(&x[part.states.clone()])?;
                    }
                    if is_due {
                        model.enter_event_mode()?;
                    }
                }
            }
            part.in_event = is_due;
        }
        self.settle(time, x, block)
    }

    /// Event iterations of the components whose event is due, which are in event mode.
    fn settle(
        &mut self,
        time: f64,
        x: &mut [f64],
        block: &impl Fn(usize, f64, &[f64]) -> f64,
    ) -> Result<(), airloop_fmi::Error> {
        let (slots, pace) = (&mut self.slots, (self.sample_step, self.couples_slaves));
        for part in &mut self.parts {
            part.show(x, slots)?;
        }
        // Events of components in a loop change what the others get: solved before them and after.
        for ring in &mut self.rings {
            ring.solve(&mut self.parts, slots, block)?;
        }
        for part in &mut self.parts {
            if let Unit::Stepped(own) = &part.unit {
                // Between its communication points a slave keeps the inputs that it has.
                if part.in_event {
                    part.in_event = false;
                    part.next_event = (!own.has_ended()).then(|| time + part.pace.step(pace.0, pace.1));
                    part.feed(slots, block)?;
                    part.unit.stepped().map_or(Ok(()), |own| own.take_inputs())?;
                    part.show(x, slots)?;
                }
                continue;
            }
            part.feed(slots, block)?;
            let Some(model) = part.unit.equations() else { continue };
            if part.in_event {
                let mut event = model.new_discrete_states()?;
                while event.new_discrete_states_needed {
                    event = model.new_discrete_states()?;
                }
                // An event that stays where it is would never end.
                part.next_event = event.next_event_time.filter(|next| *next > time);
                model.enter_continuous_time_mode()?;
                part.in_event = false;
                if part.indicators > 0 {
                    let mut values = vec![0.0; part.indicators];
                    model.get_event_indicators(&mut values)?;
                    part.positive = values.into_iter().map(|value| value > 0.0).collect();
                }
                if !part.states.is_empty() {
                    model.get_continuous_states(&mut x[part.states.clone()])?;
                }
                part.show(x, slots)?;
            }
            part.follow(slots)?;
        }
        for ring in &mut self.rings {
            ring.solve(&mut self.parts, slots, block)?;
        }
        Ok(())
    }

    /// Tells the components that want to know of an accepted step.
    ///
    /// # Errors
    /// An FMU that fails.
    pub fn step_done(&mut self) -> Result<(), airloop_fmi::Error> {
        for part in self.parts.iter_mut().filter(|part| part.told_of_steps) {
            part.unit.equations().map_or(Ok(()), |model| model.completed_integrator_step(true).map(drop))?;
        }
        Ok(())
    }

    /// Derivatives `dx`, `[nx]`, and all outputs (in [`Plant::slots`]) at `time` \[s\] for the states `x`, `[nx]`; the
    /// system inputs stand in the first slots. `block(attachment, value, slots)` gives the value behind an attachment.
    ///
    /// # Errors
    /// An FMU that fails.
    pub fn evaluate(
        &mut self,
        time: f64,
        x: &[f64],
        dx: &mut [f64],
        block: &impl Fn(usize, f64, &[f64]) -> f64,
    ) -> Result<(), airloop_fmi::Error> {
        let (slots, all) = (&mut self.slots, std::mem::take(&mut self.moved));
        let changes = |part: &&mut Part| all || !part.only_events;
        for part in self.parts.iter_mut().filter(changes) {
            if let Some(model) = part.unit.equations() {
                model.set_time(time)?;
                if !part.states.is_empty() {
                    model.set_continuous_states(&x[part.states.clone()])?;
                }
            }
            part.show(x, slots)?;
        }
        let mut rings = self.rings.iter_mut().peekable();
        let mut solved = 0;
        for place in 0..self.parts.len() {
            if let Some(ring) = rings.next_if(|ring| ring.parts.start == place) {
                ring.solve(&mut self.parts, slots, block)?;
                solved = ring.parts.end;
            }
            let part = &mut self.parts[place];
            if part.unit.stepped().is_some() || !all && part.only_events {
                continue;
            }
            // The solution of a loop has set the inputs of its components.
            if place >= solved {
                part.feed(slots, block)?;
                part.follow(slots)?;
            }
            if let Some(model) = part.unit.equations().filter(|_| !part.states.is_empty()) {
                model.get_derivatives(&mut dx[part.states.clone()])?;
            }
        }
        Ok(())
    }
}

/// Whether a component has no equations to evaluate, only steps.
fn is_stepped(component: &Component) -> bool {
    component.fmu.interface(InterfaceKind::ModelExchange).is_none()
}

/// Components in evaluation order. A slave holds its outputs, so that no loop passes through it: in a group that shares
/// one it comes last.
fn order(graph: &SystemGraph) -> Vec<usize> {
    let mut order = graph.order.clone();
    for group in loop_groups(graph) {
        let first = order.iter().position(|index| group.contains(index)).unwrap_or(0);
        let own = &mut order[first..first + group.len()];
        own.sort_by_key(|&index| is_stepped(&graph.components[index]));
    }
    order
}

/// The algebraic loops, with the outputs that lead back to an earlier component.
fn rings(
    graph: &SystemGraph,
    order: &[usize],
    slots: &BTreeMap<(usize, usize), usize>,
    parts: &[Part],
) -> Vec<Ring> {
    let mut found: Vec<Ring> = Vec::new();
    for group in loop_groups(graph) {
        let first = order.iter().position(|index| group.contains(index)).unwrap_or(0);
        let equations = group.iter().filter(|&&index| !is_stepped(&graph.components[index])).count();
        let members = first..first + equations;
        let mut unknown: Vec<usize> = Vec::new();
        for connection in &graph.connections {
            let Source::Output { component, variable } = connection.source else { continue };
            let place = |component: usize| order.iter().position(|&index| index == component);
            let (Some(from), Some(to)) = (place(component), place(connection.component)) else { continue };
            let back = members.contains(&from) && members.contains(&to) && from >= to;
            let slot = slots.get(&(component, variable)).filter(|slot| parts[from].late.1.contains(slot));
            unknown.extend(slot.filter(|_| back));
        }
        unknown.sort_unstable();
        unknown.dedup();
        if !unknown.is_empty() {
            found.push(Ring::new(members, unknown));
        }
    }
    found.sort_by_key(|ring| ring.parts.start);
    found
}

impl Part {
    /// Takes the outputs that follow the states alone.
    fn show(&mut self, x: &[f64], slots: &mut [f64]) -> Result<(), airloop_fmi::Error> {
        for &(slot, state) in &self.shown {
            slots[slot] = x[state];
        }
        let early = &mut slots[self.early.1.clone()];
        match &mut self.unit {
            _ if early.is_empty() => Ok(()),
            Unit::Stepped(own) => {
                early.copy_from_slice(own.shown());
                Ok(())
            }
            Unit::Equations(model) => model.get_real(&self.early.0, early),
        }
    }

    /// Takes the outputs that follow the inputs.
    fn follow(&mut self, slots: &mut [f64]) -> Result<(), airloop_fmi::Error> {
        if self.late.0.is_empty() {
            return Ok(());
        }
        self.unit.get_real(&self.late.0, &mut slots[self.late.1.clone()])
    }

    /// Sets the inputs.
    fn feed(
        &mut self,
        slots: &[f64],
        block: &impl Fn(usize, f64, &[f64]) -> f64,
    ) -> Result<(), airloop_fmi::Error> {
        if self.feeds.is_empty() {
            return Ok(());
        }
        for (feed, value) in self.feeds.iter().zip(&mut self.feed_values) {
            *value = feed.source.map_or(feed.start, |(slot, conversion)| conversion.apply(slots[slot]));
            for &attachment in &feed.blocks {
                *value = block(attachment, *value, slots);
            }
        }
        self.unit.set_real(&self.feed_references, &self.feed_values)
    }
}
