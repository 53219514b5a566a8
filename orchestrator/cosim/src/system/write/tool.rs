//! Readers of a written system, and what each of them leaves out.

use std::borrow::Cow;
use std::path::Path;

use super::{Error, baked};
use crate::system::graph::{Connection, Conversion, DataType, Source, SystemGraph};

/// A reader of a written system.
///
/// | tool | connectors of the system | units, transformations | parameter sets |
/// |---|---|---|---|
/// | FMPy | yes | neither | no |
/// | OMSimulator | yes | units | yes |
/// | libcosim | refused | transformations | of parameters and inputs |
/// | Ecos | refused | transformations | by name |
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tool {
    /// Everything the standard has a place for, as FMPy, OMSimulator and this project read it.
    #[default]
    Any,
    /// FMPy: the same file, other notes.
    Fmpy,
    /// OMSimulator: the same file.
    Omsimulator,
    /// libcosim (Open Simulation Platform).
    Libcosim,
    /// Ecos.
    Ecos,
}

impl Tool {
    /// Whether connections may begin or end at the system.
    pub fn reads_system_connectors(self) -> bool {
        !matches!(self, Tool::Libcosim | Tool::Ecos)
    }

    /// Whether values are converted between the units of the ends of a connection.
    pub(super) fn reads_units(self) -> bool {
        self.reads_system_connectors()
    }

    /// Whether connectors and parameters may be Enumerations.
    pub(super) fn reads_enumerations(self) -> bool {
        self.reads_system_connectors()
    }

    /// The graph as the tool can read it: without connectors of the system where it knows none.
    pub(super) fn form<'a>(self, graph: &'a SystemGraph, file: &Path) -> Result<Cow<'a, SystemGraph>, Error> {
        if self.reads_system_connectors() {
            return Ok(Cow::Borrowed(graph));
        }
        let mut closed = graph.clone();
        closed.inputs.clear();
        closed.outputs.clear();
        closed.connections.retain(|connection| matches!(connection.source, Source::Output { .. }));
        for connection in &closed.connections {
            let variable =
                &closed.components[connection.component].fmu.description.variables[connection.variable];
            if DataType::of(variable) == DataType::Enumeration {
                return Err(Error::Unwritable {
                    file: file.into(),
                    what: format!("the connection to `{}`", path_into(&closed, connection)),
                    problem: format!("{self} knows no Enumerations; connect an Integer"),
                });
            }
        }
        Ok(Cow::Owned(closed))
    }

    /// Limits of a run in the tool, one sentence each; empty if there are none.
    pub fn notes(self, graph: &SystemGraph) -> Vec<String> {
        let mut notes = Vec::new();
        if !self.reads_system_connectors() {
            for input in &graph.inputs {
                notes.push(format!(
                    "{self} reads no connectors of the system: `{}` became constant start values",
                    input.name
                ));
            }
        } else if self == Tool::Any && !(graph.inputs.is_empty() && graph.outputs.is_empty()) {
            notes.push(
                "libcosim and Ecos refuse connectors of the system: use `--for libcosim` or `--for ecos` there"
                    .to_owned(),
            );
        }
        if self == Tool::Fmpy {
            let converted = |conversion: Conversion| conversion != Conversion::IDENTITY;
            for connection in graph.connections.iter().filter(|connection| converted(connection.conversion)) {
                notes.push(format!(
                    "FMPy passes values on as they are: `{}` gets those of `{}` without conversion of units or \
                     transformation",
                    path_into(graph, connection),
                    graph.source_name(connection.source)
                ));
            }
        }
        if matches!(self, Tool::Any | Tool::Fmpy) {
            for component in &graph.components {
                let outside = component.start_values.iter().filter(|start| !baked::holds(component, start));
                let names: Vec<&str> = outside
                    .map(|start| component.fmu.description.variables[start.variable].name.as_str())
                    .collect();
                if !names.is_empty() {
                    notes.push(format!(
                        "start values of component `{}` are only in its parameter set, which FMPy does not read: {}",
                        component.name,
                        names.join(", ")
                    ));
                }
            }
        }
        notes
    }
}

fn path_into(graph: &SystemGraph, connection: &Connection) -> String {
    graph.components[connection.component].path_of(connection.variable)
}

impl std::fmt::Display for Tool {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Tool::Any => "any tool",
            Tool::Fmpy => "FMPy",
            Tool::Omsimulator => "OMSimulator",
            Tool::Libcosim => "libcosim",
            Tool::Ecos => "Ecos",
        })
    }
}
