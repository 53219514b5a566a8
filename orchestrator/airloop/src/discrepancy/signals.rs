//! Columns of a file and connectors of a system: matched by name, else by a `[signals]` table.

use std::collections::BTreeMap;
use std::path::Path;

use super::Error;
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{Conversion, DataType, Source, Start};
use airloop_fmi::{Initial, VariableKind};
use airloop_series::resample::{locate, value_at};
use airloop_series::units::{self, Compatibility};
use airloop_series::{Interpolation, TimeSeries, csv};

/// Columns by connector, as given by a `[signals]` table; empty if there is none.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SignalTable(pub BTreeMap<String, String>);

impl SignalTable {
    /// Reads the `[signals]` table of a TOML file: `connector = "column"`.
    ///
    /// # Errors
    /// [`Error::Csv`] for a file that cannot be read, [`Error::Table`] for one without such a table.
    pub fn read(file: &Path) -> Result<SignalTable, Error> {
        let table = |problem: String| Error::Table { file: file.into(), problem };
        let unread = |source| csv::Error::Io { path: file.into(), source };
        let text = airloop_series::file::read_to_string(file).map_err(unread)?;
        let document: toml::Table =
            text.parse().map_err(|error: toml::de::Error| table(error.to_string()))?;
        let signals = document
            .get("signals")
            .and_then(|signals| signals.as_table())
            .ok_or_else(|| table("there is no [signals] table".into()))?;
        let column = |(connector, column): (&String, &toml::Value)| match column.as_str() {
            Some(column) => Ok((connector.clone(), column.to_owned())),
            None => Err(table(format!("the column of `{connector}` is not a text"))),
        };
        Ok(SignalTable(signals.iter().map(column).collect::<Result<_, _>>()?))
    }

    /// Whether the system has the connectors of a table that was read from `file`.
    ///
    /// # Errors
    /// [`Error::UnknownConnector`].
    pub fn check(&self, graph: &SystemGraph, file: &Path) -> Result<(), Error> {
        let known: Vec<&str> = connectors(graph).collect();
        let is_unknown = |connector: &&String| !known.contains(&connector.as_str());
        let refuse = |connector: &String| Error::UnknownConnector {
            file: file.into(),
            connector: connector.clone(),
            known: known.join(", "),
        };
        self.0.keys().find(is_unknown).map_or(Ok(()), |connector| Err(refuse(connector)))
    }

    /// The table for a file that holds inputs only: entries of outputs belong to another file.
    #[must_use]
    pub fn without_outputs(&self, graph: &SystemGraph) -> SignalTable {
        let is_output = |name: &String| graph.outputs.iter().any(|output| output.name == *name);
        SignalTable(self.0.clone().into_iter().filter(|(connector, _)| !is_output(connector)).collect())
    }

    /// The table for a record whose inputs are not used, as they come from another file.
    #[must_use]
    pub fn without_inputs(&self, graph: &SystemGraph) -> SignalTable {
        let is_input = |name: &String| graph.inputs.iter().any(|input| input.name == *name);
        SignalTable(self.0.clone().into_iter().filter(|(connector, _)| !is_input(connector)).collect())
    }

    fn column<'a>(&'a self, connector: &'a str) -> &'a str {
        self.0.get(connector).map_or(connector, String::as_str)
    }
}

/// A connector and the channel that belongs to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// Index into the inputs or outputs of the system.
    pub connector: usize,
    /// Index of the channel.
    pub channel: usize,
    /// From the channel to the connector.
    pub conversion: Conversion,
}

/// Columns of a file that belong to signals of a system.
#[derive(Debug, Clone, PartialEq)]
pub struct Links {
    /// For inputs of the system.
    pub inputs: Vec<Link>,
    /// For outputs of the system.
    pub outputs: Vec<Link>,
    /// Columns that belong to no connector.
    pub unused: Vec<String>,
}

/// Names of the connectors of a system.
fn connectors(graph: &SystemGraph) -> impl Iterator<Item = &str> {
    let inputs = graph.inputs.iter().map(|input| input.name.as_str());
    inputs.chain(graph.outputs.iter().map(|output| output.name.as_str()))
}

/// Finds the channel of every connector of the system.
///
/// # Errors
/// A table entry without connector or column, units that do not fit, or values outside of the connector's type.
pub fn link(
    graph: &SystemGraph,
    series: &TimeSeries,
    table: &SignalTable,
    file: &Path,
) -> Result<Links, Error> {
    let inputs = graph.inputs.iter().map(|c| (c.name.as_str(), c.unit.as_deref(), c.data_type));
    let outputs = graph.outputs.iter().map(|c| (c.name.as_str(), c.unit.as_deref(), c.data_type));
    table.check(graph, file)?;
    for column in table.0.values() {
        if series.channel(column).is_none() {
            let (column, columns) = (column.clone(), column_names(series));
            return Err(csv::Error::MissingColumn { path: file.into(), column, columns }.into());
        }
    }
    let find = |(index, (name, unit, data_type)): (usize, (&str, Option<&str>, DataType))| {
        let column = table.column(name);
        let channel = series.channels().iter().position(|channel| channel.name == column)?;
        if data_type == DataType::String {
            return None;
        }
        Some(conversion(series, channel, name, unit, file).map(|conversion| Link {
            connector: index,
            channel,
            conversion,
        }))
    };
    let inputs: Vec<Link> = inputs.enumerate().filter_map(find).collect::<Result<_, _>>()?;
    let outputs: Vec<Link> = outputs.enumerate().filter_map(find).collect::<Result<_, _>>()?;
    for link in &inputs {
        let input = &graph.inputs[link.connector];
        let refused = |value: f64| graph.refused_number(link.connector, link.conversion.apply(value));
        check_values(series, link, (&input.name, input.data_type), &refused, file)?;
    }
    for link in &outputs {
        let output = &graph.outputs[link.connector];
        check_values(series, link, (&output.name, output.data_type), &|_| None, file)?;
    }
    let used = |channel: usize| inputs.iter().chain(&outputs).any(|link| link.channel == channel);
    let unused = series.channels().iter().enumerate().filter(|(index, _)| !used(*index));
    let unused = unused.map(|(_, channel)| channel.name.clone()).collect();
    Ok(Links { inputs, outputs, unused })
}

/// Every value of a column must be one that its connector can have; `refused` says what is allowed otherwise.
fn check_values(
    series: &TimeSeries,
    link: &Link,
    (signal, data_type): (&str, DataType),
    refused: &dyn Fn(f64) -> Option<String>,
    file: &Path,
) -> Result<(), Error> {
    let channel = &series.channels()[link.channel];
    let no_words = channel.words && data_type != DataType::Boolean;
    let row = match data_type {
        DataType::Real => None,
        _ => channel.values.iter().position(|value| refused(*value).is_some()),
    };
    let (row, allowed) = match (no_words, row) {
        (false, None) => return Ok(()),
        (true, _) => (0, "a number".to_owned()),
        (false, Some(row)) => (row, refused(channel.values[row]).unwrap_or_default()),
    };
    let bad = |value: f64, word: bool| if no_words { word } else { refused(value).is_some() };
    let error = csv::refuse(file, link.channel, signal, &allowed, bad).unwrap_or_else(|| csv::Error::Value {
        path: file.into(),
        line: row + 2,
        column: channel.name.clone(),
        value: channel.values[row].to_string(),
        signal: signal.into(),
        allowed,
    });
    Err(error.into())
}

/// Names of all columns, for messages.
pub fn column_names(series: &TimeSeries) -> String {
    let names: Vec<&str> = series.channels().iter().map(|channel| channel.name.as_str()).collect();
    names.join(", ")
}

fn conversion(
    series: &TimeSeries,
    channel: usize,
    connector: &str,
    unit: Option<&str>,
    file: &Path,
) -> Result<Conversion, Error> {
    let channel = &series.channels()[channel];
    let (Some(found), Some(wanted)) = (channel.unit.as_deref(), unit) else {
        return Ok(Conversion::IDENTITY);
    };
    let relation = match (units::lookup(found), units::lookup(wanted)) {
        _ if found == wanted => Compatibility::Equal,
        (Some(found), Some(wanted)) => units::compatible(&found, &wanted),
        _ => Compatibility::Incompatible,
    };
    match relation {
        Compatibility::Equal => Ok(Conversion::IDENTITY),
        Compatibility::Convertible { factor, offset } => Ok(Conversion { factor, offset }),
        Compatibility::Incompatible => Err(Error::Unit {
            file: file.into(),
            column: channel.name.clone(),
            found: found.into(),
            connector: connector.into(),
            wanted: wanted.into(),
        }),
    }
}

/// An input file may only hold inputs.
///
/// # Errors
/// [`csv::Error::UnknownColumn`] for a column that is not an input of the system.
pub fn only_inputs(
    graph: &SystemGraph,
    links: &Links,
    series: &TimeSeries,
    file: &Path,
) -> Result<(), Error> {
    let is_input = |name: &str| links.inputs.iter().any(|link| series.channels()[link.channel].name == name);
    match series.channels().iter().find(|channel| !is_input(&channel.name)) {
        None => Ok(()),
        Some(channel) => {
            let inputs: Vec<&str> = graph.inputs.iter().map(|input| input.name.as_str()).collect();
            let (column, known) = (channel.name.clone(), inputs.join(", "));
            Err(csv::Error::UnknownColumn { path: file.into(), column, known }.into())
        }
    }
}

/// Sets continuous states that are measured to their measured value at `t` \[s\]; returns the names of the
/// connectors that were set.
///
/// A state is set if its FMU takes a start value for it (`initial` exact or approx) and it is an output of the
/// system; others keep the start values of the FMU.
pub fn start_at_measured(graph: &mut SystemGraph, series: &TimeSeries, links: &Links, t: f64) -> Vec<String> {
    let mut set = Vec::new();
    for link in &links.outputs {
        let output = &graph.outputs[link.connector];
        let Source::Output { component, variable } = output.source else { continue };
        let description = &graph.components[component].fmu.description;
        let is_state = description.variables.iter().any(
            |other| matches!(&other.kind, VariableKind::Real(real) if real.derivative == Some(variable)),
        );
        let settable =
            matches!(description.variables[variable].initial, Some(Initial::Exact | Initial::Approx));
        if !is_state || !settable {
            continue;
        }
        let position = locate(series.time(), t, 0);
        let measured = value_at(&series.channels()[link.channel].values, position, Interpolation::Linear);
        let value = output.conversion.inverse().apply(link.conversion.apply(measured));
        set.push(output.name.clone());
        graph.components[component].set_start(variable, Start::Real(value));
    }
    set
}

/// Continuous states that keep the start value of their model, as `component.variable`.
pub fn states_at_default(graph: &SystemGraph) -> Vec<String> {
    let mut names = Vec::new();
    for component in &graph.components {
        for variable in &component.fmu.description.variables {
            let VariableKind::Real(real) = &variable.kind else { continue };
            let Some(state) = real.derivative else { continue };
            if !component.start_values.iter().any(|start| start.variable == state) {
                names.push(component.path_of(state));
            }
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_table_is_read_and_mistakes_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("map.toml");
        std::fs::write(&file, "[signals]\nx = \"pos\"\n").unwrap();
        let table = SignalTable::read(&file).unwrap();
        assert_eq!((table.column("x"), table.column("y")), ("pos", "y"));
        for (text, expected) in
            [("x = 1", "no [signals] table"), ("[signals]\nx = 1", "column of `x`"), ("[", "TOML")]
        {
            std::fs::write(&file, text).unwrap();
            let message = SignalTable::read(&file).unwrap_err().to_string();
            assert!(message.contains(expected) && message.contains("map.toml"), "{message}");
        }
    }
}
