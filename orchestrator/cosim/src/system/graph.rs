//! The system graph: components with their FMUs, connections resolved to variables, start values.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tempfile::TempDir;

use super::order::Loop;
use super::ssp::{self, Structure};
use super::{Error, resize, start, validate};
use airloop_fmi::{Causality, Fmu, InterfaceKind, Variability, Variable, VariableKind};

/// Type of a connector or variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DataType {
    /// Real number.
    Real,
    /// Integer of at most 64 bits.
    Integer,
    /// Truth value.
    Boolean,
    /// Text.
    String,
    /// Item of an enumeration, handled as its integer value.
    Enumeration,
}

impl std::fmt::Display for DataType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        std::fmt::Debug::fmt(self, f)
    }
}

impl DataType {
    /// Type of a variable.
    pub fn of(variable: &Variable) -> DataType {
        match variable.kind {
            VariableKind::Real(_) => DataType::Real,
            VariableKind::Integer { .. } => DataType::Integer,
            VariableKind::Boolean { .. } => DataType::Boolean,
            VariableKind::String { .. } => DataType::String,
            VariableKind::Enumeration { .. } => DataType::Enumeration,
        }
    }
}

/// A start value; items of enumerations are integers here.
#[derive(Debug, Clone, PartialEq)]
pub enum Start {
    /// Real, in the unit of the variable.
    Real(f64),
    /// Integer or Enumeration.
    Integer(i64),
    /// Boolean.
    Boolean(bool),
    /// String.
    String(String),
}

impl std::fmt::Display for Start {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Start::Real(value) => write!(f, "{value}"),
            Start::Integer(value) => write!(f, "{value}"),
            Start::Boolean(value) => write!(f, "{value}"),
            Start::String(value) => f.write_str(value),
        }
    }
}

/// A start value for a variable of a component.
#[derive(Debug, Clone, PartialEq)]
pub struct StartValue {
    /// 0-based index into the FMU's variables.
    pub variable: usize,
    /// Value.
    pub value: Start,
}

/// Source of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Source {
    /// Input of the system.
    Input(usize),
    /// Output variable of a component.
    Output {
        /// Index of the component.
        component: usize,
        /// 0-based index into the FMU's variables.
        variable: usize,
    },
}

/// Value at the end = factor * value at the start + offset (Real only).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conversion {
    /// Factor.
    pub factor: f64,
    /// Offset.
    pub offset: f64,
}

impl Conversion {
    /// The value stays as it is.
    pub const IDENTITY: Conversion = Conversion { factor: 1.0, offset: 0.0 };

    /// This conversion followed by another.
    pub fn then(self, next: Conversion) -> Conversion {
        Conversion { factor: next.factor * self.factor, offset: next.factor * self.offset + next.offset }
    }

    /// The conversion back.
    pub fn inverse(self) -> Conversion {
        Conversion { factor: 1.0 / self.factor, offset: -self.offset / self.factor }
    }

    /// Converted value `factor value + offset`.
    pub fn apply(self, value: f64) -> f64 {
        self.factor * value + self.offset
    }
}

/// An input of the system.
#[derive(Debug, Clone, PartialEq)]
pub struct SystemInput {
    /// Name.
    pub name: String,
    /// Unit, declared or that of the first variable it feeds.
    pub unit: Option<String>,
    /// Type.
    pub data_type: DataType,
}

/// An output of the system.
#[derive(Debug, Clone, PartialEq)]
pub struct SystemOutput {
    /// Name.
    pub name: String,
    /// Unit, declared or that of its source.
    pub unit: Option<String>,
    /// Type.
    pub data_type: DataType,
    /// Source of its value.
    pub source: Source,
    /// From the source to this connector.
    pub conversion: Conversion,
}

/// A value that is passed on to an input of a component.
#[derive(Debug, Clone, PartialEq)]
pub struct Connection {
    /// Source of the value.
    pub source: Source,
    /// Component that takes it.
    pub component: usize,
    /// Its input: 0-based index into the FMU's variables.
    pub variable: usize,
    /// From the source to the input.
    pub conversion: Conversion,
}

/// A component: an instance of an FMU to be.
#[derive(Debug, Clone)]
pub struct Component {
    /// Name.
    pub name: String,
    /// FMU, shared by the components that use the same file.
    pub fmu: Arc<Fmu>,
    /// Start values in the order they are to be set; one per variable.
    pub start_values: Vec<StartValue>,
}

impl Component {
    /// `component.variable` of a variable of this component.
    pub fn path_of(&self, variable: usize) -> String {
        format!("{}.{}", self.name, self.fmu.description.variables[variable].name)
    }

    /// Sets a start value; an earlier one of the same variable is replaced.
    pub fn set_start(&mut self, variable: usize, value: Start) {
        match self.start_values.iter_mut().find(|start| start.variable == variable) {
            Some(start) => start.value = value,
            None => self.start_values.push(StartValue { variable, value }),
        }
    }
}

/// Times that a system suggests \[s\].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Experiment {
    /// Start time \[s\].
    pub start: Option<f64>,
    /// Stop time \[s\].
    pub stop: Option<f64>,
    /// Communication step size \[s\].
    pub step_size: Option<f64>,
    /// Relative tolerance.
    pub tolerance: Option<f64>,
}

/// A system that can be simulated: every name resolved, every rule checked.
#[derive(Debug, Clone)]
pub struct SystemGraph {
    /// Name.
    pub name: String,
    /// File that was read.
    pub file: PathBuf,
    /// Whether this is a single FMU and its connectors are its variables.
    pub single: bool,
    /// Inputs.
    pub inputs: Vec<SystemInput>,
    /// Outputs that have a source.
    pub outputs: Vec<SystemOutput>,
    /// Components in the order of the file.
    pub components: Vec<Component>,
    /// Connections into components.
    pub connections: Vec<Connection>,
    /// Suggested times.
    pub experiment: Experiment,
    /// Components in evaluation order.
    pub order: Vec<usize>,
    /// Variables that depend on each other at the same instant.
    pub loops: Vec<Loop>,
    /// Assumptions and omissions, one sentence each.
    pub notes: Vec<String>,
    /// Units that the description declares, by name.
    pub units: Vec<(String, airloop_series::units::Unit)>,
    /// Unpacked `.ssp` that holds the FMUs; it is removed with the last user.
    pub package: Option<Arc<TempDir>>,
}

impl SystemGraph {
    /// Reads an `.ssd`, `.ssp` or `.fmu` file with all FMUs it refers to, and checks it.
    ///
    /// ```no_run
    /// let graph = airloop_cosim::system::SystemGraph::open("examples/01_run/system.ssd".as_ref())?;
    /// for &index in &graph.order {
    ///     println!("{}", graph.components[index].name);
    /// }
    /// # Ok::<(), airloop_cosim::system::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error`] names file, element and what to do.
    pub fn open(file: &Path) -> Result<SystemGraph, Error> {
        SystemGraph::open_for(file, InterfaceKind::CoSimulation)
    }

    /// Same as [`SystemGraph::open`], for masters that use one interface of the FMUs.
    ///
    /// # Errors
    /// Same as [`SystemGraph::open`].
    pub fn open_for(file: &Path, interface: InterfaceKind) -> Result<SystemGraph, Error> {
        SystemGraph::open_with(file, Some(interface))
    }

    /// Same as [`SystemGraph::open`], to look at or write the system without running it: FMUs may have any interface,
    /// and algebraic loops any variables.
    ///
    /// # Errors
    /// Same as [`SystemGraph::open`].
    pub fn open_to_read(file: &Path) -> Result<SystemGraph, Error> {
        SystemGraph::open_with(file, None)
    }

    fn open_with(file: &Path, interface: Option<InterfaceKind>) -> Result<SystemGraph, Error> {
        let ending = file.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
        match ending.as_deref() {
            Some("fmu") => SystemGraph::from_fmu(file, interface),
            Some("ssd") => SystemGraph::from_structure(ssp::read(file)?, interface),
            Some("ssp") => {
                let folder = ssp::unpack(file)?;
                let structure = ssp::read_unpacked(folder.path(), file)?;
                let mut graph = SystemGraph::from_structure(structure, interface)?;
                graph.file = file.into();
                graph.package = Some(Arc::new(folder));
                Ok(graph)
            }
            _ => Err(Error::Kind { file: file.into() }),
        }
    }

    /// Opens the FMUs of a description and resolves it, for masters that use `interface`, or (`None`) for none.
    ///
    /// # Errors
    /// Same as [`SystemGraph::open`].
    pub fn from_structure(
        structure: Structure,
        interface: Option<InterfaceKind>,
    ) -> Result<SystemGraph, Error> {
        let mut opened: HashMap<PathBuf, Arc<Fmu>> = HashMap::new();
        let mut fmus = Vec::with_capacity(structure.components.len());
        for component in &structure.components {
            if !component.source.exists() {
                return Err(Error::MissingFmu {
                    file: structure.file.clone(),
                    component: component.name.clone(),
                    fmu: component.shown.clone(),
                });
            }
            let fmu = match opened.get(&component.source) {
                Some(fmu) => Arc::clone(fmu),
                None => {
                    let (source, shown) = (&component.source, &component.shown);
                    open_fmu(&structure.file, &component.name, (source, shown), interface)?
                }
            };
            opened.insert(component.source.clone(), Arc::clone(&fmu));
            fmus.push(resize::resized(&structure, fmus.len(), fmu)?);
        }
        validate::resolve(&structure, fmus, interface)
    }

    /// A single FMU as a system: its inputs and outputs are the connectors.
    ///
    /// # Errors
    /// Same as [`SystemGraph::open`].
    pub fn from_fmu(file: &Path, interface: Option<InterfaceKind>) -> Result<SystemGraph, Error> {
        let stem = file.file_stem().map_or("fmu".into(), |stem| stem.to_string_lossy().into_owned());
        let fmu = open_fmu(file, &stem, (file, file), interface)?;
        Ok(SystemGraph::single(file, stem, fmu))
    }

    /// The system of one opened FMU, which is called `stem`.
    pub(super) fn single(file: &Path, stem: String, fmu: Arc<Fmu>) -> SystemGraph {
        let description = &fmu.description;
        let (mut inputs, mut outputs, mut connections) = (Vec::new(), Vec::new(), Vec::new());
        for (index, variable) in description.variables.iter().enumerate() {
            let (name, data_type) = (variable.name.clone(), DataType::of(variable));
            let unit = unit_of(variable).map(str::to_owned);
            match variable.causality {
                Causality::Input => {
                    connections.push(Connection {
                        source: Source::Input(inputs.len()),
                        component: 0,
                        variable: index,
                        conversion: Conversion::IDENTITY,
                    });
                    inputs.push(SystemInput { name, unit, data_type });
                }
                Causality::Output => outputs.push(SystemOutput {
                    name,
                    unit,
                    data_type,
                    source: Source::Output { component: 0, variable: index },
                    conversion: Conversion::IDENTITY,
                }),
                _ => {}
            }
        }
        let default = description.default_experiment;
        SystemGraph {
            name: description.model_name.clone(),
            file: file.into(),
            single: true,
            inputs,
            outputs,
            connections,
            experiment: Experiment {
                start: default.start,
                stop: default.stop,
                step_size: default.step_size,
                tolerance: default.tolerance,
            },
            components: vec![Component { name: stem, fmu, start_values: Vec::new() }],
            order: vec![0],
            loops: Vec::new(),
            notes: Vec::new(),
            units: Vec::new(),
            package: None,
        }
    }

    /// Name of a source, as in results.
    pub fn source_name(&self, source: Source) -> String {
        match source {
            Source::Input(index) => self.inputs[index].name.clone(),
            Source::Output { component, variable } => self.components[component].path_of(variable),
        }
    }

    /// The variables of an algebraic loop by name, each following directly from the one before, the first once more
    /// at the end.
    pub fn loop_names(&self, one: &Loop) -> Vec<String> {
        let closed = one.path.iter().chain(one.path.first());
        closed.map(|&(component, variable)| self.components[component].path_of(variable)).collect()
    }

    /// Whether an output is held between communication points (variability discrete).
    pub fn is_held(&self, component: usize, variable: usize) -> bool {
        self.components[component].fmu.description.variables[variable].variability == Variability::Discrete
    }

    /// Whether an output read after a step belongs to the start of that step: it is discrete and depends directly on
    /// an input, as a sampled y(k) does. A discrete output that depends on events and time only belongs to the
    /// communication point at which it is read.
    pub fn stands_at_step_start(&self, component: usize, variable: usize) -> bool {
        self.is_held(component, variable) && !self.components[component].fmu.feed_through(variable).is_empty()
    }

    /// Whether data for a system input are held between their samples: it is not a Real, or feeds a discrete variable.
    pub fn input_is_held(&self, input: usize) -> bool {
        let feeds_discrete = |connection: &Connection| {
            connection.source == Source::Input(input)
                && self.is_held(connection.component, connection.variable)
        };
        self.inputs[input].data_type != DataType::Real || self.connections.iter().any(feeds_discrete)
    }

    /// Values that the variables behind a system input accept, in words, if `value` is not among them. Reals are not
    /// judged.
    pub fn refused_number(&self, input: usize, value: f64) -> Option<String> {
        start::refused_number(self, input, value)
    }

    /// Whether a name is that of a structural parameter that is the length of arrays, on which the connectors of a
    /// single FMU depend: it is set before anything else.
    pub fn is_length(&self, name: &str) -> bool {
        start::is_length(self, name)
    }

    /// Source of the input `component.variable`, in words, if it is connected: then its start value has no effect on
    /// a run.
    pub fn driver_of(&self, name: &str) -> Option<String> {
        start::driver_of(self, name)
    }

    /// Sets a start value by name and text: `component.variable`, a system input, or (for a single FMU) a variable.
    ///
    /// # Errors
    /// [`Error::UnknownParameter`], [`Error::NotSettable`] or [`Error::StartValue`], which name `place`.
    pub fn set_start(&mut self, name: &str, text: &str, place: &str) -> Result<(), Error> {
        validate::set_start_text(self, name, text, place)
    }
}

fn open_fmu(
    file: &Path,
    component: &str,
    (path, shown): (&Path, &Path),
    interface: Option<InterfaceKind>,
) -> Result<Arc<Fmu>, Error> {
    let fmu = Fmu::open_shown(path, shown).map_err(|source| Error::Fmu {
        file: file.into(),
        component: component.into(),
        source: Box::new(source),
    })?;
    let Some(interface) = interface.filter(|&interface| fmu.interface(interface).is_none()) else {
        return Ok(fmu);
    };
    let (file, component, fmu) = (file.into(), component.into(), shown.into());
    Err(match interface {
        InterfaceKind::CoSimulation => Error::NoCoSimulation { file, component, fmu },
        InterfaceKind::ModelExchange => Error::NoModelExchange { file, component, fmu },
    })
}

/// Unit of a variable, if it is a Real with one.
pub fn unit_of(variable: &Variable) -> Option<&str> {
    match &variable.kind {
        VariableKind::Real(real) => real.unit.as_deref(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conversions_chain_and_invert() {
        let celsius = Conversion { factor: 1.0, offset: 273.15 };
        let milli = Conversion { factor: 1000.0, offset: 0.0 };
        assert_eq!(celsius.then(milli).apply(1.0), 274_150.0);
        assert!((celsius.then(milli).inverse().apply(274_150.0) - 1.0).abs() < 1e-12);
    }
}
