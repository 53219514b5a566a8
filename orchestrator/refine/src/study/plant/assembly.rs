//! Instances of the components of a system, their places among states and values, and the order of evaluation.

use std::collections::BTreeMap;

use super::algebraic_loop;
use super::instance::{Pace, PartInstance, is_stepped};
use super::{Added, Feed, Part, Plant};
use crate::study::Problem;
use crate::study::names::{attachment_target, name_of, places, state_of_rate};
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{Component, Conversion, DataType, Source, Start};
use airloop_cosim::system::order::loop_groups;
use airloop_fmi::{Causality, Initial, InterfaceKind, Variability, VariableKind};

/// Step of the samples where nothing says another \[s\].
const USUAL_SAMPLE_STEP: f64 = 1e-3;

impl Plant {
    /// Instantiates the components of a graph, for Model Exchange where they have that; `attachments` are the inputs
    /// and the rates of states where blocks act, `extra` further signals, which have the last slots; `wanted`:
    /// variables that are shown although they are no outputs.
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
                known: places(graph),
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
                variables[v].causality == Causality::Local && wanted.contains(&name_of(graph, component, v))
            };
            let outputs = (0..variables.len())
                .filter(|&v| real(component, v) && (variables[v].causality == Causality::Output || asked(v)));
            let (stepped, own) = (is_stepped(component), states_of(component));
            let (states, outputs): (Vec<usize>, Vec<usize>) = outputs.partition(|v| own.contains(v));
            let (early, late): (Vec<usize>, Vec<usize>) = outputs
                .into_iter()
                .partition(|&v| stepped || asked(v) || component.fmu.feed_through(v).is_empty());
            let mut range = |list: &[usize]| {
                let first = count;
                for &variable in list {
                    places.insert((index, variable), count);
                    names.insert(name_of(graph, component, variable), count);
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
            let (stepped, own_states) = (is_stepped(component), states_of(component));
            let mut instance = PartInstance::new(component, &early.0)?;
            for (place, &variable) in own_states.iter().enumerate() {
                states.insert(name_of(graph, component, variable), nx + place);
            }
            let at_rates = blocks.iter().filter(|((component, _), _)| *component == index);
            let added = at_rates.filter_map(|(&(_, variable), blocks)| {
                let state = state_of_rate(component, variable)?;
                let place = own_states.iter().position(|own| *own == state)?;
                let slot = places.get(&(index, variable)).copied();
                Some(Added { state: nx + place, slot, blocks: blocks.clone() })
            });
            let added = added.collect();
            let own = nx..nx + instance.equations().map_or(0, |model| model.state_count());
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
                instance,
                pace: Pace::of(component, graph.single),
                states: own,
                state_references,
                feeds,
                feed_references,
                feed_values,
                added,
                early,
                late,
                shown,
                next_event: None,
                sample_time: None,
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
        let loops = algebraic_loop::all(graph, &order, &places, &parts);
        let starts = order.iter().map(|&index| graph.components[index].clone()).collect();
        let slots = vec![0.0; count];
        Ok(Plant {
            parts,
            starts,
            slots,
            system_inputs: graph.inputs.len(),
            extra_first,
            names,
            states,
            nx,
            initialized: false,
            probed: false,
            moved: false,
            sample_step: USUAL_SAMPLE_STEP,
            couples_slaves: false,
            loops,
        })
    }
}

/// Variables that are the continuous states of a component; a slave shows none.
fn states_of(component: &Component) -> Vec<usize> {
    if is_stepped(component) {
        return Vec::new();
    }
    component.fmu.description.continuous_states().collect()
}

/// Components in evaluation order. A slave holds its outputs, so that no loop passes through it: in a group that shares
/// one it comes last.
pub(super) fn order(graph: &SystemGraph) -> Vec<usize> {
    let mut order = graph.order.clone();
    for group in loop_groups(graph) {
        let first = order.iter().position(|index| group.contains(index)).unwrap_or(0);
        let own = &mut order[first..first + group.len()];
        own.sort_by_key(|&index| is_stepped(&graph.components[index]));
    }
    order
}
