//! `airloop inspect` for systems: components, connectors, connections, evaluation order.

use super::table::table;
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{Conversion, Start};

/// The JSON that `airloop inspect --json` prints for a system.
pub fn json(graph: &SystemGraph) -> serde_json::Value {
    let components = graph.components.iter().map(|component| {
        let description = &component.fmu.description;
        let starts = component.start_values.iter().map(|start| {
            let value = match &start.value {
                Start::Real(value) => (*value).into(),
                Start::Integer(value) => (*value).into(),
                Start::Boolean(value) => (*value).into(),
                Start::String(value) => value.as_str().into(),
            };
            (description.variables[start.variable].name.clone(), value)
        });
        serde_json::json!({
            "name": component.name,
            "model": description.model_name,
            "fmu": component.fmu.shown,
            "start_values": starts.collect::<serde_json::Map<_, _>>(),
        })
    });
    let inputs = graph.inputs.iter().map(|input| {
        serde_json::json!({ "name": input.name, "unit": input.unit, "type": input.data_type.to_string() })
    });
    let outputs = graph.outputs.iter().map(|output| {
        serde_json::json!({
            "name": output.name,
            "unit": output.unit,
            "type": output.data_type.to_string(),
            "source": graph.source_name(output.source),
            "factor": output.conversion.factor,
            "offset": output.conversion.offset,
        })
    });
    let connections = graph.connections.iter().map(|connection| {
        serde_json::json!({
            "from": graph.source_name(connection.source),
            "to": graph.components[connection.component].path_of(connection.variable),
            "factor": connection.conversion.factor,
            "offset": connection.conversion.offset,
        })
    });
    let order = graph.order.iter().map(|&index| graph.components[index].name.as_str());
    serde_json::json!({
        "file": graph.file,
        "system": graph.name,
        "components": components.collect::<Vec<_>>(),
        "inputs": inputs.collect::<Vec<_>>(),
        "outputs": outputs.collect::<Vec<_>>(),
        "connections": connections.collect::<Vec<_>>(),
        "algebraic_loops": graph.loops.iter().map(|one| graph.loop_names(one)).collect::<Vec<_>>(),
        "evaluation_order": order.collect::<Vec<_>>(),
        "notes": graph.notes,
    })
}

/// The text that `airloop inspect` prints for a system.
pub fn describe(graph: &SystemGraph) -> String {
    let mut text =
        format!("System {} ({})\n\nComponents in evaluation order\n", graph.name, graph.file.display());
    let components: Vec<Vec<String>> = graph
        .order
        .iter()
        .map(|&index| {
            let component = &graph.components[index];
            let description = &component.fmu.description;
            let values: Vec<String> = component
                .start_values
                .iter()
                .map(|start| format!("{} = {}", description.variables[start.variable].name, start.value))
                .collect();
            vec![
                component.name.clone(),
                description.model_name.clone(),
                component.fmu.shown.display().to_string(),
                values.join(", "),
            ]
        })
        .collect();
    text += &indented(&table(&["component", "model", "FMU", "start values"], &components, &[]));
    text += "\nConnectors of the system\n";
    let unit = |unit: &Option<String>| unit.clone().unwrap_or_default();
    let inputs = graph.inputs.iter().map(|input| {
        vec![
            input.name.clone(),
            "input".into(),
            input.data_type.to_string(),
            unit(&input.unit),
            String::new(),
        ]
    });
    let outputs = graph.outputs.iter().map(|output| {
        let source = format!("{}{}", graph.source_name(output.source), factor(output.conversion));
        vec![output.name.clone(), "output".into(), output.data_type.to_string(), unit(&output.unit), source]
    });
    let connectors: Vec<Vec<String>> = inputs.chain(outputs).collect();
    text += &indented(&table(&["name", "kind", "type", "unit", "source"], &connectors, &[]));
    text += "\nConnections\n";
    let connections: Vec<Vec<String>> = graph
        .connections
        .iter()
        .map(|connection| {
            vec![
                graph.source_name(connection.source),
                format!("-> {}", graph.components[connection.component].path_of(connection.variable)),
                factor(connection.conversion).trim().to_owned(),
            ]
        })
        .collect();
    text += &indented(&table(&["from", "to", "conversion"], &connections, &[]));
    for one in &graph.loops {
        text += &format!("\nAlgebraic loop: {}\n", graph.loop_names(one).join(" -> "));
    }
    for note in &graph.notes {
        text += &format!("\nNote: {note}\n");
    }
    text
}

fn factor(conversion: Conversion) -> String {
    match conversion {
        Conversion::IDENTITY => String::new(),
        Conversion { factor, offset: 0.0 } => format!(" x {factor}"),
        Conversion { factor, offset } => format!(" x {factor} + {offset}"),
    }
}

fn indented(text: &str) -> String {
    text.lines().map(|line| format!("  {line}\n")).collect()
}
