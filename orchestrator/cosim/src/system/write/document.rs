//! The text of a system description and of the parameter set of a component.

use std::path::Path;

use super::connections::{Said, of_source, of_system, of_variable, said};
use super::types::{Enumerations, Units, component_connector, items, system_connector};
use super::xml::Xml;
use super::{Error, Tool, Version};
use crate::system::graph::{Component, Source, Start, SystemGraph, unit_of};
use crate::system::validate::UnitTable;
use crate::system::{ssp, ssv};
use airloop_fmi::{Causality, VariableKind};

const COMMON: &str = "http://ssp-standard.org/SSP1/SystemStructureCommon";
const TOOL: &str = concat!("airloop ", env!("CARGO_PKG_VERSION"));
/// Namespace of the annotation that OMSimulator reads.
const OPEN_MODELICA: &str =
    "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd";
/// Name of every parameter set: Ecos applies all sets of the one name that it is given.
pub const SET: &str = "initialValues";
/// Step size where the system suggests none \[s\]; that of the masters.
const STEP_SIZE: f64 = 1e-3;

/// Form of a document.
#[derive(Debug, Clone, Copy)]
pub(super) struct How {
    /// Version of the standard.
    pub version: Version,
    /// Reader.
    pub tool: Tool,
}

/// The `.ssd` text. `sources` are the URIs of the FMUs, `sets` those of the parameter sets of all components that have
/// start values; without `sets` the values are written into the description.
pub(super) fn description(
    graph: &SystemGraph,
    sources: &[String],
    sets: Option<&[Option<String>]>,
    how: How,
    file: &Path,
) -> Result<String, Error> {
    let used = connected(graph);
    let units = Units::of(graph, &used);
    let mut enumerations = Enumerations::default();
    let mut xml = Xml::new();
    let version = how.version.to_string();
    let mut root = vec![("xmlns:ssd", ssp::NAMESPACE), ("xmlns:ssc", COMMON)];
    if sets.is_none() {
        root.push(("xmlns:ssv", ssv::NAMESPACE));
    }
    root.push(("xmlns:oms", OPEN_MODELICA));
    root.extend([("version", version.as_str()), ("name", &graph.name), ("generationTool", TOOL)]);
    xml.open("ssd:SystemStructureDescription", &root);
    xml.open("ssd:System", &[("name", &graph.name)]);
    system_connectors(&mut xml, graph, &mut enumerations);
    if !graph.components.is_empty() {
        xml.open("ssd:Elements", &[]);
        for (index, component) in graph.components.iter().enumerate() {
            let name = component_name(graph, index);
            let kind = "application/x-fmu-sharedlibrary";
            xml.open(
                "ssd:Component",
                &[("name", name.as_str()), ("type", kind), ("source", &sources[index])],
            );
            if !used[index].is_empty() {
                xml.open("ssd:Connectors", &[]);
                for &variable in &used[index] {
                    let causality = component.fmu.description.variables[variable].causality;
                    let kind = if causality == Causality::Input { "input" } else { "output" };
                    component_connector(
                        &mut xml,
                        graph,
                        (&units, &mut enumerations),
                        (index, variable, kind),
                    );
                }
                xml.close();
            }
            binding(&mut xml, component, sets.map(|sets| sets[index].as_deref()), how);
            xml.close();
        }
        xml.close();
    }
    connections(&mut xml, graph, &units, how.tool);
    fixed_step(&mut xml, graph.experiment.step_size.unwrap_or(STEP_SIZE));
    xml.close();
    enumerations.write(&mut xml);
    units.write(&mut xml, "ssd:Units");
    let [start, stop] =
        [graph.experiment.start, graph.experiment.stop].map(|time| time.map(|t| format!("{t:?}")));
    let times: Vec<(&str, &str)> = [("startTime", &start), ("stopTime", &stop)]
        .into_iter()
        .filter_map(|(key, time)| Some((key, time.as_deref()?)))
        .collect();
    if !times.is_empty() {
        xml.empty("ssd:DefaultExperiment", &times);
    }
    xml.close();
    xml.finish(file)
}

/// The `.ssv` text of the start values of a component.
pub(super) fn parameter_set(component: &Component, how: How, file: &Path) -> Result<String, Error> {
    let mut xml = Xml::new();
    let root = [("xmlns:ssv", ssv::NAMESPACE), ("xmlns:ssc", COMMON)];
    set(&mut xml, component, how, &root);
    xml.finish(file)
}

/// Components of a description have no dot in their name; that of a single FMU comes from its file.
pub(super) fn component_name(graph: &SystemGraph, index: usize) -> String {
    graph.components[index].name.replace('.', "_")
}

/// Variables of each component that are connected, in the order of the FMU.
fn connected(graph: &SystemGraph) -> Vec<Vec<usize>> {
    let mut used = vec![Vec::new(); graph.components.len()];
    let mut add = |source: Source| {
        if let Source::Output { component, variable } = source {
            used[component].push(variable);
        }
    };
    for connection in &graph.connections {
        add(connection.source);
        add(Source::Output { component: connection.component, variable: connection.variable });
    }
    graph.outputs.iter().for_each(|output| add(output.source));
    for variables in &mut used {
        variables.sort_unstable();
        variables.dedup();
    }
    used
}

fn system_connectors(xml: &mut Xml, graph: &SystemGraph, enumerations: &mut Enumerations) {
    if graph.inputs.is_empty() && graph.outputs.is_empty() {
        return;
    }
    xml.open("ssd:Connectors", &[]);
    for (index, input) in graph.inputs.iter().enumerate() {
        let first = graph.connections.iter().find(|connection| connection.source == Source::Input(index));
        let behind = first.map(|to| Source::Output { component: to.component, variable: to.variable });
        let typed = (input.data_type, input.unit.as_deref());
        system_connector(xml, graph, enumerations, (&input.name, "input"), typed, behind);
    }
    for output in &graph.outputs {
        let typed = (output.data_type, output.unit.as_deref());
        system_connector(xml, graph, enumerations, (&output.name, "output"), typed, Some(output.source));
    }
    xml.close();
}

/// The annotation by which OMSimulator knows that the components are stepped by a master, and its step \[s\].
fn fixed_step(xml: &mut Xml, step_size: f64) {
    xml.open("ssd:Annotations", &[]);
    xml.open("ssc:Annotation", &[("type", "org.openmodelica")]);
    xml.open("oms:Annotations", &[]);
    xml.open("oms:SimulationInformation", &[]);
    let step_size = format!("{step_size:?}");
    let master =
        [("description", "oms-ma"), ("stepSize", step_size.as_str()), ("relativeTolerance", "0.0001")];
    xml.empty("oms:FixedStepMaster", &master);
    for _ in 0..4 {
        xml.close();
    }
}

fn connections(xml: &mut Xml, graph: &SystemGraph, units: &Units, tool: Tool) {
    if graph.connections.is_empty() && graph.outputs.is_empty() {
        return;
    }
    xml.open("ssd:Connections", &[]);
    // A reader goes by the units that are written; one that asks the FMUs first, by those of the graph.
    let tables = [&units.declared[..], &graph.units[..]];
    let (from_system, inner): (Vec<_>, Vec<_>) =
        graph.connections.iter().partition(|connection| matches!(connection.source, Source::Input(_)));
    for connection in from_system.into_iter().chain(inner) {
        let (component, variable) = (connection.component, connection.variable);
        let readings = tables.map(|table| {
            let end = of_variable(graph, table, component, variable);
            (of_source(graph, table, connection.source), end)
        });
        let how = said(connection.conversion, &readings, tool.reads_units());
        let end = Source::Output { component, variable };
        write_connection(xml, graph, connection.source, (Some(end), ""), how);
    }
    for output in &graph.outputs {
        let readings = tables.map(|table| {
            let end = of_system(output.unit.as_deref(), table);
            (of_source(graph, table, output.source), end)
        });
        let how = said(output.conversion, &readings, tool.reads_units());
        write_connection(xml, graph, output.source, (None, &output.name), how);
    }
    xml.close();
}

/// A connection to a variable of a component, or to the named connector of the system.
fn write_connection(
    xml: &mut Xml,
    graph: &SystemGraph,
    start: Source,
    (end, name): (Option<Source>, &str),
    how: Said,
) {
    let place = |source: Source| match source {
        Source::Input(index) => (None, graph.inputs[index].name.as_str()),
        Source::Output { component, variable } => (
            Some(component_name(graph, component)),
            graph.components[component].fmu.description.variables[variable].name.as_str(),
        ),
    };
    let (start_element, start_connector) = place(start);
    let (end_element, end_connector) = end.map_or((None, name), place);
    let mut attributes = Vec::new();
    attributes.extend(start_element.as_deref().map(|name| ("startElement", name)));
    attributes.push(("startConnector", start_connector));
    attributes.extend(end_element.as_deref().map(|name| ("endElement", name)));
    attributes.push(("endConnector", end_connector));
    if how.suppress {
        attributes.push(("suppressUnitConversion", "true"));
    }
    let Some(linear) = how.transformation else { return xml.empty("ssd:Connection", &attributes) };
    xml.open("ssd:Connection", &attributes);
    let (factor, offset) = (format!("{:?}", linear.factor), format!("{:?}", linear.offset));
    xml.empty("ssc:LinearTransformation", &[("factor", &factor), ("offset", &offset)]);
    xml.close();
}

/// The binding of the start values: a reference to a set, or the set itself.
fn binding(xml: &mut Xml, component: &Component, source: Option<Option<&str>>, how: How) {
    if component.start_values.is_empty() {
        return;
    }
    xml.open("ssd:ParameterBindings", &[]);
    let kind = ("type", "application/x-ssp-parameter-set");
    match source.flatten() {
        Some(source) => xml.empty("ssd:ParameterBinding", &[kind, ("source", source)]),
        None => {
            xml.open("ssd:ParameterBinding", &[kind]);
            xml.open("ssd:ParameterValues", &[]);
            set(xml, component, how, &[]);
            xml.close();
            xml.close();
        }
    }
    xml.close();
}

fn set(xml: &mut Xml, component: &Component, how: How, namespaces: &[(&str, &str)]) {
    let version = how.version.to_string();
    let description = &component.fmu.description;
    let mut units = Units::default();
    let mut attributes = namespaces.to_vec();
    attributes.extend([("version", version.as_str()), ("name", SET)]);
    xml.open("ssv:ParameterSet", &attributes);
    xml.open("ssv:Parameters", &[]);
    for start in &component.start_values {
        let variable = &description.variables[start.variable];
        xml.open("ssv:Parameter", &[("name", &variable.name)]);
        let number = start.value.to_string();
        match (&start.value, &variable.kind) {
            (Start::Real(value), _) => {
                let number = format!("{value:?}");
                let unit = unit_of(variable).and_then(|name| {
                    Some((name, UnitTable { declared: &[] }.of_variable(name, description)?))
                });
                match unit {
                    Some((name, unit)) => {
                        units.add(name, Some(unit));
                        xml.empty("ssv:Real", &[("value", &number), ("unit", name)]);
                    }
                    None => xml.empty("ssv:Real", &[("value", &number)]),
                }
            }
            (Start::Integer(value), VariableKind::Enumeration { declared_type, .. })
                if how.tool.reads_enumerations() =>
            {
                let items = items(description, declared_type);
                let item = items.iter().find(|(_, known)| known == value).map_or(&number, |(name, _)| name);
                xml.empty("ssv:Enumeration", &[("value", item)]);
            }
            (Start::Integer(_), _) => xml.empty("ssv:Integer", &[("value", &number)]),
            (Start::Boolean(_), _) => xml.empty("ssv:Boolean", &[("value", &number)]),
            (Start::String(text), _) => xml.empty("ssv:String", &[("value", text)]),
        }
        xml.close();
    }
    xml.close();
    units.write(xml, "ssv:Units");
    xml.close();
}
