//! A system under construction: components with the FMUs they are derived from, and blocks put in series.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use tempfile::TempDir;

use airloop_cosim::system::ssp::{ComponentElement, ConnectionElement, Connector, Endpoint, Structure};
use airloop_cosim::system::ssv::{self, Parameter};
use airloop_fmi::derive::{Derivation, Value};

/// An FMU to derive; its file is `name.fmu`.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Name of the component and of its model.
    pub name: String,
    /// Name of the FMU that it is derived from.
    pub template: &'static str,
    /// One sentence.
    pub description: String,
    /// Start values.
    pub start: Vec<(String, Value)>,
}

/// An FMU of the system that gets start values of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Baked {
    /// Its file.
    pub source: PathBuf,
    /// Name beside the description.
    pub file: PathBuf,
    /// Name and start values.
    pub derivation: Derivation,
}

/// A block that goes in series.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// FMU part that the block becomes.
    pub part: Part,
    /// Its input and output on the way, with their unit.
    pub way: (&'static str, &'static str, Option<&'static str>),
    /// Further inputs, each with its unit and where its value comes from.
    pub further: Vec<(&'static str, Option<&'static str>, Endpoint)>,
}

/// A system and the FMUs that it needs.
#[derive(Debug, Clone)]
pub struct Network {
    /// The system; sources of components are file names.
    pub structure: Structure,
    /// FMUs to derive.
    pub parts: Vec<Part>,
    /// FMUs that are taken as they are: file, and name beside the description.
    pub copies: Vec<(PathBuf, PathBuf)>,
    /// FMUs of this project that get the values that the system gives their parameters, so that tools that read no
    /// parameter binding have them as well.
    pub baked: Vec<Baked>,
    /// Rates of states that blocks add to, for which an FMU gets an input: component, and variable.
    pub rates: Vec<(String, String)>,
    /// Unpacked archive that holds them.
    pub package: Option<Arc<TempDir>>,
    /// Connectors of the system whose columns in the records have another name: connector, column.
    pub columns: Vec<(String, String)>,
}

/// A connector of a component, or (empty name) of the system.
pub fn end(element: &str, connector: &str) -> Endpoint {
    Endpoint { element: (!element.is_empty()).then(|| element.to_owned()), connector: connector.into() }
}

impl Network {
    /// A system without components.
    pub fn new(name: &str, stop_time: f64) -> Network {
        Network {
            structure: Structure {
                file: PathBuf::from("system.ssd"),
                name: name.into(),
                connectors: Vec::new(),
                components: Vec::new(),
                connections: Vec::new(),
                parameters: Vec::new(),
                units: Vec::new(),
                start_time: Some(0.0),
                stop_time: Some(stop_time),
            },
            parts: Vec::new(),
            copies: Vec::new(),
            baked: Vec::new(),
            rates: Vec::new(),
            package: None,
            columns: Vec::new(),
        }
    }

    /// Adds a component.
    pub fn add(&mut self, part: Part) {
        let file = PathBuf::from(format!("{}.fmu", part.name));
        self.structure.components.push(ComponentElement {
            name: part.name.clone(),
            source: file.clone(),
            shown: file,
            connectors: Vec::new(),
            parameters: Vec::new(),
            line: 0,
        });
        self.parts.push(part);
    }

    /// Adds a component that is a file as it stands, with values of its Real parameters.
    pub fn add_copy(&mut self, name: &str, source: &Path, parameters: Vec<(String, f64)>) {
        let file = PathBuf::from(format!("{name}.fmu"));
        let parameter = |(name, value)| Parameter {
            name,
            value: ssv::Value::Real(value),
            unit: None,
            definition: None,
            file: PathBuf::new(),
            line: 0,
        };
        self.structure.components.push(ComponentElement {
            name: name.to_owned(),
            source: file.clone(),
            shown: file.clone(),
            connectors: Vec::new(),
            parameters: parameters.into_iter().map(parameter).collect(),
            line: 0,
        });
        self.copies.push((source.to_owned(), file));
    }

    /// Where the value of a connector comes from, and what its connection converts, factor and offset.
    pub fn source_of(&self, to: &Endpoint) -> Option<(Endpoint, Option<(f64, f64)>)> {
        let found = self.structure.connections.iter().find(|connection| connection.end == *to)?;
        Some((found.start.clone(), found.transformation))
    }

    /// Gives the connection that was added last a conversion, factor and offset.
    pub fn convert_last(&mut self, conversion: Option<(f64, f64)>) {
        if let Some(own) = self.structure.connections.last_mut()
            && conversion.is_some()
        {
            own.transformation = conversion;
        }
    }

    /// Adds a connection of two connectors with a unit, `value = factor * value`; the connectors are declared where
    /// they are not yet.
    pub fn connect(&mut self, start: Endpoint, to: Endpoint, unit: Option<&str>, factor: f64) {
        // What leaves the system comes in at an output of it, and the other way round.
        self.declare(&start, if start.element.is_some() { "output" } else { "input" }, unit);
        self.declare(&to, if to.element.is_some() { "input" } else { "output" }, unit);
        let transformation = (factor != 1.0).then_some((factor, 0.0));
        self.structure.connections.push(ConnectionElement {
            start,
            end: to,
            transformation,
            suppress_unit_conversion: false,
            line: 0,
        });
    }

    /// Takes the unit conversion off the connection to an input, factor and offset, and returns it.
    fn take_conversion(&mut self, to: &Endpoint) -> Option<(f64, f64)> {
        let own = self.structure.connections.iter_mut().find(|connection| connection.end == *to)?;
        to.element.as_ref()?;
        own.transformation.take()
    }

    fn declare(&mut self, place: &Endpoint, kind: &str, unit: Option<&str>) {
        let list = match &place.element {
            None => &mut self.structure.connectors,
            Some(name) => match self.structure.components.iter_mut().find(|c| c.name == *name) {
                Some(component) => &mut component.connectors,
                None => return,
            },
        };
        if !list.iter().any(|connector| connector.name == place.connector) {
            list.push(Connector {
                name: place.connector.clone(),
                kind: kind.into(),
                data_type: Some("Real".into()),
                unit: unit.map(str::to_owned),
                line: 0,
            });
        }
    }

    /// Puts a block in front of `to`, behind the blocks that are there already. An input without connection is driven
    /// by the block alone. `outputs`: outputs of the system that showed the signal show it behind the block.
    ///
    /// A block without units works in those of `to`: what a connection converts, it converts in front of the block.
    pub fn insert(&mut self, to: &Endpoint, block: Block, outputs: bool) {
        let (input, output, unit) = block.way;
        let name = block.part.name.clone();
        let factor = match unit {
            None => self.take_conversion(to),
            Some(_) => None,
        };
        self.add(block.part);
        let behind = end(&name, output);
        self.declare(&behind, "output", unit);
        let found = self.structure.connections.iter().position(|connection| connection.end == *to);
        match found.map(|index| self.structure.connections[index].start.clone()) {
            Some(start) => {
                for connection in &mut self.structure.connections {
                    let shown = outputs && connection.start == start && connection.end.element.is_none();
                    if connection.end == *to || shown {
                        connection.start = behind.clone();
                    }
                }
                self.connect(start, end(&name, input), unit, 1.0);
                self.convert_last(factor);
            }
            None => self.connect(behind, to.clone(), unit, 1.0),
        }
        for (input, unit, source) in block.further {
            self.connect(source, end(&name, input), unit, 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(name: &str) -> Part {
        Part { name: name.into(), template: "friction", description: String::new(), start: Vec::new() }
    }

    fn block(name: &str) -> Block {
        Block {
            part: part(name),
            way: ("in", "out", Some("N")),
            further: vec![("v", None, end("plant", "v"))],
        }
    }

    fn ways(network: &Network) -> Vec<String> {
        let mut found: Vec<String> =
            network.structure.connections.iter().map(|c| format!("{} -> {}", c.start, c.end)).collect();
        found.sort();
        found
    }

    #[test]
    fn blocks_stand_in_the_order_of_their_insertion_and_outputs_move_where_asked() {
        let mut network = Network::new("t", 1.0);
        ["drive", "plant"].iter().for_each(|name| network.add(part(name)));
        network.connect(end("drive", "F"), end("plant", "F"), Some("N"), 1.0);
        network.connect(end("drive", "F"), end("", "F"), Some("N"), 1.0);
        network.insert(&end("plant", "F"), block("a"), true);
        network.insert(&end("plant", "F"), block("b"), false);
        assert_eq!(
            ways(&network),
            [
                "a.out -> F (system)",
                "a.out -> b.in",
                "b.out -> plant.F",
                "drive.F -> a.in",
                "plant.v -> a.v",
                "plant.v -> b.v"
            ]
        );
    }

    #[test]
    fn a_free_input_is_driven_by_the_block_alone() {
        let mut network = Network::new("t", 1.0);
        network.add(part("plant"));
        network.insert(&end("plant", "tau"), block("a"), false);
        assert_eq!(ways(&network), ["a.out -> plant.tau", "plant.v -> a.v"]);
    }
}
