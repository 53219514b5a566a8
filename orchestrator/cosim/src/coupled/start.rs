//! From a system graph to Model Exchange instances in continuous-time mode, consistent across all connections.

use super::Error;
use crate::system::SystemGraph;
use crate::system::graph::{Component, DataType, Source, Start};
use airloop_fmi::{Instance, Model, VariableKind};

/// Rounds of an event iteration, beyond which it counts as endless.
const MOST_ROUNDS: usize = 100;

/// Instances in the order of the components, in continuous-time mode at `time` \[s\].
pub(super) fn instances(graph: &SystemGraph, time: f64) -> Result<Vec<Model>, Error> {
    let mut models = Vec::with_capacity(graph.components.len());
    for component in &graph.components {
        if component.fmu.description.model_exchange.is_none() {
            let (component, fmu) = (component.name.clone(), component.fmu.shown.display().to_string());
            return Err(Error::NoModelExchange { component, fmu });
        }
        let mut model = Model::instantiate(&component.fmu, &component.name, false)?;
        set_start_values(&mut model, component)?;
        model.setup_experiment(None, time, None)?;
        model.enter_initialization_mode()?;
        models.push(model);
    }
    settle(graph, &mut models, time)?;
    for model in &mut models {
        model.exit_initialization_mode()?;
    }
    iterate(graph, &mut models, time)?;
    for model in &mut models {
        model.enter_continuous_time_mode()?;
    }
    Ok(models)
}

fn set_start_values(model: &mut Instance, component: &Component) -> Result<(), Error> {
    component.start_values.iter().try_for_each(|start| write(model, component, start.variable, &start.value))
}

/// Initialization mode: passes values on until no input changes.
fn settle(graph: &SystemGraph, models: &mut [Model], time: f64) -> Result<(), Error> {
    for input in 0..graph.inputs.len() {
        share_start(graph, models, input)?;
    }
    let rounds = graph.connections.len() + 2;
    let mut given = vec![None; graph.connections.len()];
    for _ in 0..rounds {
        if pass_on(graph, models, &mut given)?.is_none() {
            return Ok(());
        }
    }
    let cause = pass_on(graph, models, &mut given)?;
    let cause = cause.map_or_else(String::new, |name| format!("`{name}` changes in every round"));
    Err(Error::Unsettled { what: "the initialization", time, rounds, cause })
}

/// All variables that a system input feeds get the start value of the first of them.
fn share_start(graph: &SystemGraph, models: &mut [Model], input: usize) -> Result<(), Error> {
    let mut fed = graph.connections.iter().filter(|connection| connection.source == Source::Input(input));
    let Some(first) = fed.next() else { return Ok(()) };
    let start = read(&mut models[first.component], &graph.components[first.component], first.variable)?;
    for connection in fed {
        let value = match &start {
            Start::Real(value) => {
                Start::Real(connection.conversion.apply(first.conversion.inverse().apply(*value)))
            }
            other => other.clone(),
        };
        let component = connection.component;
        write(&mut models[component], &graph.components[component], connection.variable, &value)?;
    }
    Ok(())
}

/// One pass over all connections between components; the last input that changed.
fn pass_on(
    graph: &SystemGraph,
    models: &mut [Model],
    given: &mut [Option<Start>],
) -> Result<Option<String>, Error> {
    let mut changed = None;
    for (connection, given) in graph.connections.iter().zip(given) {
        let Source::Output { component, variable } = connection.source else { continue };
        let value = match read(&mut models[component], &graph.components[component], variable)? {
            Start::Real(value) => Start::Real(connection.conversion.apply(value)),
            other => other,
        };
        if given.as_ref() != Some(&value) {
            let target = &graph.components[connection.component];
            write(&mut models[connection.component], target, connection.variable, &value)?;
            changed = Some(target.path_of(connection.variable));
            *given = Some(value);
        }
    }
    Ok(changed)
}

/// Event iteration over the whole system, after which no time event may be left.
fn iterate(graph: &SystemGraph, models: &mut [Model], time: f64) -> Result<(), Error> {
    let mut given = vec![None; graph.connections.len()];
    for _ in 0..MOST_ROUNDS {
        let mut next = None;
        let mut again = None;
        for model in models.iter_mut() {
            let info = model.new_discrete_states()?;
            if info.terminate_simulation {
                return Err(Error::Terminated { component: model.name().to_owned(), time });
            }
            if info.new_discrete_states_needed {
                again = Some(model.name().to_owned());
            }
            if let (None, Some(event)) = (&next, info.next_event_time) {
                next = Some((model.name().to_owned(), event));
            }
        }
        let changed = pass_on(graph, models, &mut given)?;
        if changed.is_none() && again.is_none() {
            return match next {
                Some((component, time)) => Err(Error::Sampled { component, time }),
                None => Ok(()),
            };
        }
    }
    let cause = "a component asks for another round, or its outputs change in each".to_owned();
    Err(Error::Unsettled { what: "the event iteration", time, rounds: MOST_ROUNDS, cause })
}

/// Value of a variable.
pub(super) fn read(model: &mut Instance, component: &Component, variable: usize) -> Result<Start, Error> {
    let variable = &component.fmu.description.variables[variable];
    let reference = [variable.value_reference];
    Ok(match DataType::of(variable) {
        DataType::Real => {
            let mut value = [0.0];
            model.get_real(&reference, &mut value)?;
            Start::Real(value[0])
        }
        DataType::Integer | DataType::Enumeration => {
            let mut value = [0];
            model.get_integer(&reference, &mut value)?;
            Start::Integer(value[0])
        }
        DataType::Boolean => {
            let mut value = [false];
            model.get_boolean(&reference, &mut value)?;
            Start::Boolean(value[0])
        }
        DataType::String => Start::String(model.get_string(&reference)?.concat()),
    })
}

fn write(model: &mut Instance, component: &Component, variable: usize, value: &Start) -> Result<(), Error> {
    let variable = &component.fmu.description.variables[variable];
    let reference = [variable.value_reference];
    match (value, &variable.kind) {
        (Start::Real(value), VariableKind::Real(_)) => model.set_real(&reference, &[*value])?,
        (Start::Integer(value), _) => model.set_integer(&reference, &[*value])?,
        (Start::Boolean(value), _) => model.set_boolean(&reference, &[*value])?,
        (Start::String(value), _) => model.set_string(&reference, &[value.as_str()])?,
        (Start::Real(_), _) => unreachable!("connections and start values have the type of their variable"),
    }
    Ok(())
}
