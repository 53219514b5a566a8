//! From names to variables: every component, connector, connection, unit and start value is checked here.
//!
//! The result ([`SystemGraph`]) can be simulated without further questions.

use std::collections::HashMap;
use std::sync::Arc;

use super::graph::{
    Component, Connection, Conversion, DataType, Experiment, Source, SystemGraph, SystemInput, SystemOutput,
    unit_of,
};
use super::ssp::{ConnectionElement, Connector, Endpoint, Structure};
use super::{Error, notes, order, start};
use airloop_fmi::{Causality, Fmu, InterfaceKind, ModelDescription};
use airloop_series::units::{self, Compatibility, Unit};

pub use super::start::set_start_text;

/// Resolves a description with the FMU of each component (same order).
///
/// # Errors
/// The first thing that is wrong, with file, line and element.
pub fn resolve(
    structure: &Structure,
    fmus: Vec<Arc<Fmu>>,
    interface: Option<InterfaceKind>,
) -> Result<SystemGraph, Error> {
    for (element, fmu) in structure.components.iter().zip(&fmus) {
        for connector in &element.connectors {
            check_connector(structure, &element.name, connector, fmu)?;
        }
    }
    let components = structure
        .components
        .iter()
        .zip(fmus)
        .map(|(element, fmu)| Component { name: element.name.clone(), fmu, start_values: Vec::new() })
        .collect();
    let mut graph = SystemGraph {
        name: structure.name.clone(),
        file: structure.file.clone(),
        single: false,
        inputs: Vec::new(),
        outputs: Vec::new(),
        components,
        connections: Vec::new(),
        experiment: Experiment {
            start: structure.start_time,
            stop: structure.stop_time,
            step_size: None,
            tolerance: None,
        },
        order: Vec::new(),
        loops: Vec::new(),
        notes: Vec::new(),
        units: structure.units.clone(),
        package: None,
    };
    let resolver = Resolver { structure };
    let aliases = resolver.connect(&mut graph)?;
    for (index, element) in structure.components.iter().enumerate() {
        for parameter in &element.parameters {
            start::bind_component(&mut graph, index, parameter, &structure.units)?;
        }
    }
    for parameter in &structure.parameters {
        start::bind_system(&mut graph, parameter, &structure.units, &aliases)?;
    }
    graph.loops = order::algebraic_loops(&graph);
    if let Some(interface) = interface {
        order::check_loops(&graph, interface)?;
    }
    graph.order = order::evaluation_order(&graph);
    notes::missing_dependencies(&mut graph);
    notes::open_inputs(structure, &mut graph);
    Ok(graph)
}

/// Component variables behind the inputs and parameters of the system, by name.
pub(super) type Aliases = HashMap<String, Vec<(usize, usize, Conversion)>>;

fn check_connector(
    structure: &Structure,
    component: &str,
    connector: &Connector,
    fmu: &Fmu,
) -> Result<(), Error> {
    let (file, line) = (structure.file.clone(), connector.line);
    let (component, name) = (component.to_owned(), connector.name.clone());
    let Some(variable) = fmu.description.variable(&name) else {
        return Err(Error::NoSuchVariable { file, line, component, connector: name, fmu: fmu.shown.clone() });
    };
    let fits = match connector.kind.as_str() {
        "input" => variable.causality == Causality::Input,
        "output" => variable.causality == Causality::Output,
        "parameter" | "structuralParameter" => variable.causality == Causality::Parameter,
        "calculatedParameter" => variable.causality == Causality::CalculatedParameter,
        "local" => variable.causality == Causality::Local,
        "inout" | "constant" => true,
        _ => {
            return Err(Error::BadValue {
                file,
                line,
                what: format!("kind of connector `{name}` of component `{component}`"),
                value: connector.kind.clone(),
                allowed: "input, output, parameter or calculatedParameter",
            });
        }
    };
    if !fits {
        let (declared, actual) = (connector.kind.clone(), causality_name(variable.causality).to_owned());
        return Err(Error::Causality { file, line, component, connector: name, declared, actual });
    }
    let actual = DataType::of(variable);
    if let Some(declared) = connector.data_type.as_deref().filter(|text| data_type(text) != Some(actual)) {
        return Err(Error::ConnectorType {
            file,
            line,
            component,
            connector: name,
            declared: declared.into(),
            actual: actual.to_string(),
        });
    }
    if let (Some(declared), Some(own)) = (connector.unit.as_deref(), unit_of(variable)) {
        let table = UnitTable { declared: &structure.units };
        let place = format!("connector `{name}` of component `{component}` and the FMU's variable");
        let from = (declared, table.find(declared, &fmu.description));
        let to = (own, table.of_variable(own, &fmu.description));
        conversion(from, to).map_err(|problem| Error::UnitMismatch {
            file,
            line,
            place,
            from_unit: declared.into(),
            to_unit: own.into(),
            problem,
        })?;
    }
    Ok(())
}

fn causality_name(causality: Causality) -> &'static str {
    match causality {
        Causality::Parameter => "a parameter",
        Causality::CalculatedParameter => "a calculatedParameter",
        Causality::Input => "an input",
        Causality::Output => "an output",
        Causality::Local => "a local variable",
        Causality::Independent => "the independent variable",
    }
}

fn data_type(text: &str) -> Option<DataType> {
    Some(match text {
        "Real" | "Float64" | "Float32" => DataType::Real,
        "Boolean" => DataType::Boolean,
        "String" => DataType::String,
        "Enumeration" => DataType::Enumeration,
        text if text.starts_with("Int") || text.starts_with("UInt") => DataType::Integer,
        _ => return None,
    })
}

/// Units by name: those of the description and of FMUs, then the usual ones.
pub(super) struct UnitTable<'a> {
    pub declared: &'a [(String, Unit)],
}

impl UnitTable<'_> {
    /// A unit that the description names for something of an FMU.
    pub fn find(&self, name: &str, fmu: &ModelDescription) -> Option<Unit> {
        self.of_system(name).or_else(|| of_fmu(name, fmu)).or_else(|| units::lookup(name))
    }

    /// The unit of a variable: what its FMU means by the name counts.
    pub fn of_variable(&self, name: &str, fmu: &ModelDescription) -> Option<Unit> {
        of_fmu(name, fmu).or_else(|| self.of_system(name)).or_else(|| units::lookup(name))
    }

    fn of_system(&self, name: &str) -> Option<Unit> {
        self.declared.iter().find(|(declared, _)| declared == name).map(|(_, unit)| *unit)
    }
}

fn of_fmu(name: &str, fmu: &ModelDescription) -> Option<Unit> {
    fmu.units.iter().find(|unit| unit.name == name).and_then(|unit| unit.base)
}

/// Conversion between two units; what is wrong otherwise.
pub(super) fn conversion(
    from: (&str, Option<Unit>),
    to: (&str, Option<Unit>),
) -> Result<Conversion, &'static str> {
    match (from.1, to.1) {
        (Some(a), Some(b)) => match units::compatible(&a, &b) {
            Compatibility::Equal => Ok(Conversion::IDENTITY),
            Compatibility::Convertible { factor, offset } => Ok(Conversion { factor, offset }),
            Compatibility::Incompatible => {
                Err("have different dimensions; connect variables of the same quantity")
            }
        },
        _ if from.0 == to.0 => Ok(Conversion::IDENTITY),
        _ => {
            Err("cannot be compared, as one of them is not defined; declare it in <Units> with its BaseUnit")
        }
    }
}

/// An end of a connection, resolved.
struct Resolved {
    /// Component and variable, or `None` for a connector of the system.
    inner: Option<(usize, usize)>,
    kind: String,
    data_type: Option<DataType>,
    /// Unit of the connector: its own, else that of the variable.
    unit: Option<(String, Option<Unit>)>,
    /// From the connector to the variable; the identity unless the connector has a unit of its own.
    to_variable: Conversion,
}

struct Resolver<'a> {
    structure: &'a Structure,
}

impl Resolver<'_> {
    /// Adds all connections, inputs and outputs to the graph.
    fn connect(&self, graph: &mut SystemGraph) -> Result<Aliases, Error> {
        let file = &self.structure.file;
        let mut taken: HashMap<&Endpoint, &Endpoint> = HashMap::new();
        let mut aliases: Aliases = HashMap::new();
        let mut sources: HashMap<&str, (Source, Resolved, Conversion)> = HashMap::new();
        let mut feeds: Vec<(&str, &ConnectionElement, Resolved)> = Vec::new();
        for connection in &self.structure.connections {
            let start = self.end(graph, &connection.start, connection.line)?;
            let end = self.end(graph, &connection.end, connection.line)?;
            let parameter = self.check_direction(connection, &start, &end)?;
            if let Some(first) = taken.insert(&connection.end, &connection.start) {
                return Err(Error::TwoSources {
                    file: file.clone(),
                    line: connection.line,
                    target: connection.end.to_string(),
                    first: first.to_string(),
                    second: connection.start.to_string(),
                });
            }
            self.check_types(connection, &start, &end)?;
            let conversion = self.conversion(connection, &start, &end)?;
            match (start.inner, end.inner) {
                (Some((component, variable)), Some(target)) => graph.connections.push(Connection {
                    source: Source::Output { component, variable },
                    component: target.0,
                    variable: target.1,
                    conversion,
                }),
                (None, Some(target)) => {
                    let name = connection.start.connector.as_str();
                    aliases.entry(name.into()).or_default().push((target.0, target.1, conversion));
                    if !parameter {
                        feeds.push((name, connection, end));
                    }
                }
                (Some((component, variable)), None) => {
                    let source = Source::Output { component, variable };
                    sources.insert(&connection.end.connector, (source, start, conversion));
                }
                (None, None) => {
                    let index = self.input_index(&connection.start.connector);
                    sources.insert(&connection.end.connector, (Source::Input(index), start, conversion));
                }
            }
        }
        self.add_inputs(graph, &feeds, &aliases);
        self.add_outputs(graph, &sources);
        Ok(aliases)
    }

    /// Position of an input among the inputs of the system.
    fn input_index(&self, name: &str) -> usize {
        let inputs = self.structure.connectors.iter().filter(|connector| connector.kind == "input");
        inputs.take_while(|connector| connector.name != name).count()
    }

    fn add_inputs(
        &self,
        graph: &mut SystemGraph,
        feeds: &[(&str, &ConnectionElement, Resolved)],
        aliases: &Aliases,
    ) {
        for connector in self.structure.connectors.iter().filter(|connector| connector.kind == "input") {
            let index = graph.inputs.len();
            let first = feeds.iter().find(|(name, ..)| *name == connector.name).map(|(.., end)| end);
            if first.is_none() {
                graph.notes.push(format!("the system input `{}` is not connected", connector.name));
            }
            let declared = connector.data_type.as_deref().and_then(data_type);
            graph.inputs.push(SystemInput {
                name: connector.name.clone(),
                unit: connector
                    .unit
                    .clone()
                    .or_else(|| first.and_then(|end| end.unit.as_ref().map(|(name, _)| name.clone()))),
                data_type: declared.or(first.and_then(|end| end.data_type)).unwrap_or(DataType::Real),
            });
            if first.is_none() {
                continue;
            }
            for &(component, variable, conversion) in aliases.get(&connector.name).into_iter().flatten() {
                graph.connections.push(Connection {
                    source: Source::Input(index),
                    component,
                    variable,
                    conversion,
                });
            }
        }
    }

    fn add_outputs(&self, graph: &mut SystemGraph, sources: &HashMap<&str, (Source, Resolved, Conversion)>) {
        for connector in self.structure.connectors.iter().filter(|connector| connector.kind == "output") {
            let Some((source, start, conversion)) = sources.get(connector.name.as_str()) else {
                graph.notes.push(format!("the system output `{}` is not connected", connector.name));
                continue;
            };
            let declared = connector.data_type.as_deref().and_then(data_type);
            let own_unit = || start.unit.as_ref().map(|(name, _)| name.clone());
            graph.outputs.push(SystemOutput {
                name: connector.name.clone(),
                unit: connector.unit.clone().or_else(own_unit),
                data_type: declared.or(start.data_type).unwrap_or(DataType::Real),
                source: *source,
                conversion: *conversion,
            });
        }
    }

    fn end(&self, graph: &SystemGraph, end: &Endpoint, line: usize) -> Result<Resolved, Error> {
        let file = self.structure.file.clone();
        let table = UnitTable { declared: &self.structure.units };
        let Some(element) = &end.element else {
            let Some(connector) = self.structure.connectors.iter().find(|c| c.name == end.connector) else {
                let (owner, known) = ("the system".to_owned(), names(&self.structure.connectors));
                return Err(Error::UnknownConnector {
                    file,
                    line,
                    owner,
                    connector: end.connector.clone(),
                    known,
                });
            };
            let unit = |name: &String| (name.clone(), table.of_system(name).or_else(|| units::lookup(name)));
            return Ok(Resolved {
                inner: None,
                kind: connector.kind.clone(),
                data_type: connector.data_type.as_deref().and_then(data_type),
                unit: connector.unit.as_ref().map(unit),
                to_variable: Conversion::IDENTITY,
            });
        };
        let Some(index) = self.structure.components.iter().position(|c| &c.name == element) else {
            let names: Vec<&str> = self.structure.components.iter().map(|c| c.name.as_str()).collect();
            return Err(Error::UnknownComponent {
                file,
                line,
                component: element.clone(),
                known: names.join(", "),
            });
        };
        let connectors = &self.structure.components[index].connectors;
        let Some(connector) = connectors.iter().find(|c| c.name == end.connector) else {
            let (owner, known) = (format!("component `{element}`"), names(connectors));
            return Err(Error::UnknownConnector {
                file,
                line,
                owner,
                connector: end.connector.clone(),
                known,
            });
        };
        let description = &graph.components[index].fmu.description;
        let variable =
            description.index_of(&connector.name).expect("connectors were checked against the FMU");
        let own = &description.variables[variable];
        let variable_unit = unit_of(own).map(|name| (name.to_owned(), table.of_variable(name, description)));
        let declared = connector.unit.as_ref().filter(|_| DataType::of(own) == DataType::Real);
        let unit = declared
            .map(|name| (name.clone(), table.find(name, description)))
            .or_else(|| variable_unit.clone());
        let to_variable = match (&unit, &variable_unit) {
            // Units that do not fit were refused with the connector.
            (Some(from), Some(to)) => {
                conversion((&from.0, from.1), (&to.0, to.1)).unwrap_or(Conversion::IDENTITY)
            }
            _ => Conversion::IDENTITY,
        };
        Ok(Resolved {
            inner: Some((index, variable)),
            kind: connector.kind.clone(),
            data_type: Some(DataType::of(own)),
            unit,
            to_variable,
        })
    }

    /// Whether the connection passes on a parameter of the system; an error for a connection the wrong way round.
    fn check_direction(
        &self,
        connection: &ConnectionElement,
        start: &Resolved,
        end: &Resolved,
    ) -> Result<bool, Error> {
        let start_fits = match start.inner {
            Some(_) => start.kind == "output",
            None => start.kind == "input" || start.kind == "parameter",
        };
        let end_fits = match end.inner {
            Some(_) => end.kind == "input" || end.kind == "parameter",
            None => end.kind == "output",
        };
        let parameters = (start.kind == "parameter", end.kind == "parameter");
        let wrong = match (start_fits, end_fits) {
            (false, _) => Some((&connection.start, &start.kind)),
            (_, false) => Some((&connection.end, &end.kind)),
            _ if parameters.0 != parameters.1 => Some((&connection.end, &end.kind)),
            _ => None,
        };
        match wrong {
            None => Ok(parameters.1),
            Some((which, kind)) => Err(Error::Direction {
                file: self.structure.file.clone(),
                line: connection.line,
                from: connection.start.to_string(),
                to: connection.end.to_string(),
                which: which.to_string(),
                kind: format!("of kind `{kind}`"),
            }),
        }
    }

    fn check_types(
        &self,
        connection: &ConnectionElement,
        start: &Resolved,
        end: &Resolved,
    ) -> Result<(), Error> {
        let mismatch = |from_type: String, to_type: String| Error::TypeMismatch {
            file: self.structure.file.clone(),
            line: connection.line,
            from: connection.start.to_string(),
            to: connection.end.to_string(),
            from_type,
            to_type,
        };
        match (start.data_type, end.data_type) {
            // The number of an item.
            (Some(DataType::Enumeration), Some(DataType::Integer)) if connection.transformation.is_none() => {
                Ok(())
            }
            (Some(a), Some(b)) if a != b => Err(mismatch(a.to_string(), b.to_string())),
            (Some(a), _) | (_, Some(a)) if a != DataType::Real && connection.transformation.is_some() => {
                Err(mismatch(a.to_string(), "a linear transformation (Real only)".into()))
            }
            _ => Ok(()),
        }
    }

    fn conversion(
        &self,
        connection: &ConnectionElement,
        start: &Resolved,
        end: &Resolved,
    ) -> Result<Conversion, Error> {
        let linear = connection.transformation.map(|(factor, offset)| Conversion { factor, offset });
        let units = match (&start.unit, &end.unit) {
            (Some(from), Some(to)) if !connection.suppress_unit_conversion => {
                conversion((&from.0, from.1), (&to.0, to.1)).map_err(|problem| Error::UnitMismatch {
                    file: self.structure.file.clone(),
                    line: connection.line,
                    place: format!("connection {} -> {}", connection.start, connection.end),
                    from_unit: from.0.clone(),
                    to_unit: to.0.clone(),
                    problem,
                })?
            }
            _ => Conversion::IDENTITY,
        };
        let between = units.then(linear.unwrap_or(Conversion::IDENTITY));
        Ok(start.to_variable.inverse().then(between).then(end.to_variable))
    }
}

fn names(connectors: &[Connector]) -> String {
    let names: Vec<&str> = connectors.iter().map(|connector| connector.name.as_str()).collect();
    if names.is_empty() { "none".into() } else { names.join(", ") }
}
