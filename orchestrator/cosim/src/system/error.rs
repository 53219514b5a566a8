//! Reason why a system cannot be read or simulated.

use std::path::{Path, PathBuf};

/// Reason why a system cannot be read or simulated; each message names file, element and what to do.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "file, line and names, as in each message")]
pub enum Error {
    /// A file cannot be read.
    #[error("{}: the file cannot be read: {source}", file.display())]
    Io { file: PathBuf, source: std::io::Error },
    /// A file cannot be written.
    #[error("{}: the file cannot be written: {source}", file.display())]
    Write { file: PathBuf, source: std::io::Error },
    /// The file is of a kind that cannot be a system.
    #[error("{}: not a system; give an .ssd, an .ssp or an .fmu file", file.display())]
    Kind { file: PathBuf },
    /// A system cannot be written to a file of this kind.
    #[error("{}: a system is written as .ssd or .ssp; choose one of these endings", file.display())]
    WriteKind { file: PathBuf },
    /// A part of the system has no place in the file.
    #[error("{}: {what} cannot be written: {problem}", file.display())]
    Unwritable { file: PathBuf, what: String, problem: String },
    /// The XML is not well formed, or too large or too deep.
    #[error("{}: line {line}: {problem}", file.display())]
    Xml { file: PathBuf, line: usize, problem: String },
    /// An element lacks an attribute.
    #[error("{}: line {line}: <{element}> has no attribute `{attribute}`; add it", file.display())]
    MissingAttribute { file: PathBuf, line: usize, element: String, attribute: &'static str },
    /// An attribute or value cannot be read.
    #[error("{}: line {line}: `{value}` is not {allowed} ({what})", file.display())]
    BadValue { file: PathBuf, line: usize, what: String, value: String, allowed: &'static str },
    /// An element that the schema does not know at this place.
    #[error("{}: line {line}: unexpected element <{element}> in <{parent}>; remove it or correct its name", file.display())]
    UnknownElement { file: PathBuf, line: usize, element: String, parent: String },
    /// A part of the SSP standard that is not supported.
    #[error("{}: line {line}: {feature} is not supported; {advice}", file.display())]
    Unsupported { file: PathBuf, line: usize, feature: String, advice: &'static str },
    /// Two elements of one name.
    #[error("{}: line {line}: the {what} `{name}` appears twice; rename one of them", file.display())]
    Duplicate { file: PathBuf, line: usize, what: &'static str, name: String },
    /// A component's FMU is not there.
    #[error("{}: component `{component}`: there is no file {}; build or copy the FMU, or correct `source`", file.display(), fmu.display())]
    MissingFmu { file: PathBuf, component: String, fmu: PathBuf },
    /// A parameter set is not there.
    #[error("{}: line {line}: there is no file {}; write the parameter set, or correct `source`", file.display(), set.display())]
    MissingSet { file: PathBuf, line: usize, set: PathBuf },
    /// A package without a description.
    #[error("{}: the package has no SystemStructure.ssd at its root; it has: {found}", file.display())]
    NoDescription { file: PathBuf, found: String },
    /// A component's FMU cannot be used.
    #[error("{}", of_fmu(file, component, source))]
    Fmu { file: PathBuf, component: String, source: Box<airloop_fmi::Error> },
    /// Start values cannot be put into a component's FMU.
    #[error("{}: component `{component}`: {source}", file.display())]
    Derive { file: PathBuf, component: String, source: Box<airloop_fmi::derive::DeriveError> },
    /// An archive cannot be opened.
    #[error(transparent)]
    Archive(Box<airloop_fmi::Error>),
    /// The FMU cannot be stepped by a master.
    #[error("{}: component `{component}`: {} has no Co-Simulation interface; only `--master monolithic` works without", file.display(), fmu.display())]
    NoCoSimulation { file: PathBuf, component: String, fmu: PathBuf },
    /// The FMU cannot be integrated by the monolithic master.
    #[error("{}: component `{component}`: {} has no Model Exchange interface, which `--master monolithic` needs; run it with `--master gauss-seidel`", file.display(), fmu.display())]
    NoModelExchange { file: PathBuf, component: String, fmu: PathBuf },
    /// A connection names a component that is not there.
    #[error("{}: line {line}: unknown component `{component}` in a connection; the system has: {known}", file.display())]
    UnknownComponent { file: PathBuf, line: usize, component: String, known: String },
    /// A connection names a connector that is not there.
    #[error("{}: line {line}: unknown connector `{connector}` of {owner} in a connection; it has: {known}", file.display())]
    UnknownConnector { file: PathBuf, line: usize, owner: String, connector: String, known: String },
    /// A connector of a component is not a variable of its FMU.
    #[error("{}: line {line}: connector `{connector}` of component `{component}` is not a variable of {}; correct the name", file.display(), fmu.display())]
    NoSuchVariable { file: PathBuf, line: usize, component: String, connector: String, fmu: PathBuf },
    /// Kind of a connector and causality of its variable differ.
    #[error("{}: line {line}: connector `{connector}` of component `{component}` is declared as {declared}, but the FMU's variable is {actual}; correct `kind`", file.display())]
    Causality {
        file: PathBuf,
        line: usize,
        component: String,
        connector: String,
        declared: String,
        actual: String,
    },
    /// Declared type and type of the variable differ.
    #[error("{}: line {line}: connector `{connector}` of component `{component}` is declared as {declared}, but the FMU's variable is {actual}; correct the type", file.display())]
    ConnectorType {
        file: PathBuf,
        line: usize,
        component: String,
        connector: String,
        declared: String,
        actual: String,
    },
    /// A connection that runs into an output or out of an input.
    #[error("{}: line {line}: connection {from} -> {to}: {which} is {kind}; a connection runs from an output (or system input) to an input (or system output)", file.display())]
    Direction { file: PathBuf, line: usize, from: String, to: String, which: String, kind: String },
    /// Types of the two ends differ.
    #[error("{}: line {line}: connection {from} -> {to}: {from_type} cannot be connected to {to_type}; both ends need one type", file.display())]
    TypeMismatch { file: PathBuf, line: usize, from: String, to: String, from_type: String, to_type: String },
    /// Units of the two ends have different dimensions, or one of them is not known.
    #[error("{}: line {line}: {place}: the units [{from_unit}] and [{to_unit}] {problem}", file.display())]
    UnitMismatch {
        file: PathBuf,
        line: usize,
        place: String,
        from_unit: String,
        to_unit: String,
        problem: &'static str,
    },
    /// Two connections into one input.
    #[error("{}: line {line}: {target} already has a connection, from {first}; a second one, from {second}, is not allowed: remove one, or add the signals in a component", file.display())]
    TwoSources { file: PathBuf, line: usize, target: String, first: String, second: String },
    /// A parameter that does not exist.
    #[error("{place}: there is no variable `{name}`{hint}")]
    UnknownParameter { place: String, name: String, hint: String },
    /// A variable that may not be given a start value.
    #[error("{place}: `{name}` may not be given a start value: it is {why}")]
    NotSettable { place: String, name: String, why: String },
    /// A start value for an input that gets its values from elsewhere.
    #[error("{place}: it would have no effect: `{name}` is driven by {by}")]
    Driven { place: String, name: String, by: String },
    /// A start value of the wrong type or outside the variable's range.
    #[error("{place}: `{name}` cannot be set to `{value}`: allowed is {allowed}")]
    StartValue { place: String, name: String, value: String, allowed: String },
    /// Variables that depend on each other at the same instant and cannot be solved for.
    #[error("{}: algebraic loop: {}, with `{culprit}`, which is not a continuous Real and cannot be solved for; break it with a component whose output does not depend directly on its input (a delay or a filter){master}, or declare true `dependencies` in the FMU", file.display(), variables.join(" -> "))]
    AlgebraicLoop { file: PathBuf, variables: Vec<String>, culprit: String, master: &'static str },
}

/// Message on the FMU of a component; where the FMU is itself the system, it names the file already.
fn of_fmu(file: &Path, component: &str, source: &airloop_fmi::Error) -> String {
    let (file, source) = (file.display().to_string(), source.to_string());
    if source.starts_with(&format!("{file}: ")) {
        source
    } else {
        format!("{file}: component `{component}`: {source}")
    }
}
