//! The system with the controller in the place of its inputs.

use std::path::{Path, PathBuf};

use super::design::Stabilized;
use super::settings::Settings;
use crate::Error;
use crate::catalog::Catalog;
use airloop_cosim::system::graph::{
    Component, Connection, Conversion, DataType, Source, Start, SystemInput, SystemOutput,
};
use airloop_cosim::system::write::{self, Version};
use airloop_cosim::system::{SystemGraph, order};
use airloop_fmi::{Fmu, InterfaceKind};

/// Name of the component.
pub const COMPONENT: &str = "controller";

/// Name of the system input that is added to a measured signal.
pub fn noise_input(signal: &str) -> String {
    format!("noise_{signal}")
}

/// Writes the closed loop into `folder` and gives its file: an `.ssd` that refers to the FMUs where they are, or an
/// `.ssp` where those come from one. It begins at the start of the plan; sensor noise is an input for each measured
/// signal, the former inputs are outputs.
///
/// # Errors
/// A measured signal that no output shows, or files that cannot be read or written.
pub fn write_closed_loop(
    graph: &SystemGraph,
    catalog: &Catalog,
    stabilized: &Stabilized,
    (states, settings): (&[usize], &Settings),
    fmu: &Path,
    folder: &Path,
) -> Result<PathBuf, Error> {
    let ending = if graph.package.is_some() { "ssp" } else { "ssd" };
    let file = folder.join(format!("closed_loop.{ending}"));
    let mut closed = closed_loop(graph, catalog, stabilized, states, fmu)?;
    for (name, value) in &settings.parameters {
        let (line, _) = settings.source.line_column(name.place);
        closed.set_start(&name.text, &value.to_string(), &format!("[parameters], line {line}"))?;
    }
    write::write(&closed, &file, Version::V1_0)?;
    // It is read back once, so that whatever is wrong with it is said now.
    SystemGraph::open_for(&file, InterfaceKind::CoSimulation)?;
    Ok(file)
}

fn closed_loop(
    graph: &SystemGraph,
    catalog: &Catalog,
    stabilized: &Stabilized,
    states: &[usize],
    fmu: &Path,
) -> Result<SystemGraph, Error> {
    let place = |problem: String| Error::Place { place: graph.file.display().to_string(), problem };
    let mut closed = graph.clone();
    closed.single = false;
    closed.name = format!("{}_stabilized", graph.name);
    let names: Vec<&str> = graph.components.iter().map(|component| component.name.as_str()).collect();
    let name = [COMPONENT.to_owned()].into_iter().chain((2..).map(|k| format!("{COMPONENT}{k}")));
    let name = name.into_iter().find(|name| !names.contains(&name.as_str())).unwrap_or_default();
    let fmu = Fmu::open(fmu)
        .map_err(|error| Error::Place { place: fmu.display().to_string(), problem: error.to_string() })?;
    let controller = closed.components.len();
    let variable = |name: String| {
        fmu.description
            .index_of(&name)
            .ok_or_else(|| place(format!("the FMU of the controller has no `{name}`")))
    };
    // Former inputs: from the controller.
    let mut replaced = Vec::new();
    for (j, &input) in stabilized.inputs.iter().enumerate() {
        let connector = &catalog.variables()[input].name;
        let position = graph.inputs.iter().position(|one| one.name == *connector);
        let position = position.ok_or_else(|| place(format!("the system has no input `{connector}`")))?;
        replaced.push((
            position,
            Source::Output { component: controller, variable: variable(format!("u[{}]", j + 1))? },
        ));
    }
    let kept: Vec<usize> =
        (0..graph.inputs.len()).filter(|i| replaced.iter().all(|(old, _)| old != i)).collect();
    closed.inputs = kept.iter().map(|&i| graph.inputs[i].clone()).collect();
    let moved = |source: Source| match source {
        Source::Input(i) => match replaced.iter().find(|(old, _)| *old == i) {
            Some((_, new)) => *new,
            None => Source::Input(kept.iter().position(|&old| old == i).unwrap_or(i)),
        },
        other => other,
    };
    closed.connections.iter_mut().for_each(|connection| connection.source = moved(connection.source));
    closed.outputs.iter_mut().for_each(|output| output.source = moved(output.source));
    for &(position, source) in &replaced {
        let input = &graph.inputs[position];
        if closed.outputs.iter().all(|output| output.name != input.name) {
            closed.outputs.push(SystemOutput {
                name: input.name.clone(),
                unit: input.unit.clone(),
                data_type: DataType::Real,
                source,
                conversion: Conversion::IDENTITY,
            });
        }
    }
    // Measured signals and their noise: to the controller.
    for (i, &index) in stabilized.measured.iter().enumerate() {
        let signal = &catalog.variables()[index];
        let source = shown(graph, &signal.path).ok_or_else(|| {
            place(format!(
                "no output of a component shows `{}`; measure something that an output shows",
                signal.name
            ))
        })?;
        let to = |source: Source, name: String| -> Result<Connection, Error> {
            let conversion = Conversion::IDENTITY;
            Ok(Connection { source, component: controller, variable: variable(name)?, conversion })
        };
        closed.connections.push(to(source, format!("y[{}]", i + 1))?);
        closed.connections.push(to(Source::Input(closed.inputs.len()), format!("noise[{}]", i + 1))?);
        let (name, unit) = (noise_input(&signal.name), signal.unit.clone());
        closed.inputs.push(SystemInput { name, unit, data_type: DataType::Real });
    }
    if let Some((component, output)) = stabilized.mode {
        closed.connections.push(Connection {
            source: Source::Output { component, variable: output },
            component: controller,
            variable: variable("mode".into())?,
            conversion: Conversion::IDENTITY,
        });
    }
    closed.components.push(Component { name, fmu: fmu.clone(), start_values: Vec::new() });
    for (&state, &value) in states.iter().zip(&stabilized.nominal.states[0]) {
        let variable = &catalog.variables()[state];
        if variable.start != Some(value)
            && let Some((component, index)) = find(graph, &variable.path)
        {
            closed.components[component].set_start(index, Start::Real(value));
        }
    }
    closed.experiment.start = Some(stabilized.nominal.start);
    let end = stabilized.nominal.time(stabilized.nominal.samples());
    // A plan that ends is held for as long as it took.
    let hold = if stabilized.repeated.is_some() { 0.0 } else { end - stabilized.nominal.start };
    closed.experiment.stop = Some(end + hold);
    closed.order = order::evaluation_order(&closed);
    closed.loops = order::algebraic_loops(&closed);
    Ok(closed)
}

/// Component and variable of a path of the catalog.
pub fn find(graph: &SystemGraph, path: &str) -> Option<(usize, usize)> {
    graph.components.iter().enumerate().find_map(|(index, component)| {
        let inside = path.strip_prefix(component.name.as_str()).and_then(|rest| rest.strip_prefix('.'));
        let name = inside.or(graph.single.then_some(path))?;
        component.fmu.description.index_of(name).map(|variable| (index, variable))
    })
}

/// The output that shows a variable: itself, or one with the same value reference.
fn shown(graph: &SystemGraph, path: &str) -> Option<Source> {
    let (component, index) = find(graph, path)?;
    let description = &graph.components[component].fmu.description;
    let reference = description.variables[index].value_reference;
    let mut outputs = description.outputs.iter().map(|unknown| unknown.variable);
    let variable = outputs.find(|&output| {
        let variable = &description.variables[output];
        variable.value_reference == reference && DataType::of(variable) == DataType::Real
    })?;
    Some(Source::Output { component, variable })
}
