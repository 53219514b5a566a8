//! Start values: from parameter sets and from the command line, to variables of FMUs, with units and ranges.

use super::Error;
use super::graph::{Connection, Conversion, DataType, Source, Start, SystemGraph, unit_of};
use super::ssv::{Parameter, Value};
use super::validate::{Aliases, UnitTable, conversion};
use airloop_fmi::{Causality, Initial, ModelDescription, Variability, Variable, VariableKind};
use airloop_series::units::Unit;

/// Largest magnitude up to which every integer is a number of 64 bits (IEEE 754), as values of system inputs are.
const MAX_EXACT_INTEGER: f64 = 9_007_199_254_740_992.0;

/// Applies a parameter bound at a component: its name is that of a variable.
pub(super) fn bind_component(
    graph: &mut SystemGraph,
    component: usize,
    parameter: &Parameter,
    units: &[(String, Unit)],
) -> Result<(), Error> {
    let variable = find(graph, component, &parameter.name, &place(parameter))?;
    bind(graph, (component, variable, Conversion::IDENTITY), parameter, units)
}

/// Applies a parameter bound at the system: `component.variable`, or a connector of the system.
pub(super) fn bind_system(
    graph: &mut SystemGraph,
    parameter: &Parameter,
    units: &[(String, Unit)],
    aliases: &Aliases,
) -> Result<(), Error> {
    if let Some(targets) = aliases.get(&parameter.name) {
        for &target in targets {
            bind(graph, target, parameter, units)?;
        }
        return Ok(());
    }
    let (component, variable) = find_path(graph, &parameter.name, &place(parameter))?;
    bind(graph, (component, variable, Conversion::IDENTITY), parameter, units)
}

fn place(parameter: &Parameter) -> String {
    format!("{}: line {}", parameter.file.display(), parameter.line)
}

fn bind(
    graph: &mut SystemGraph,
    (component, variable, to_variable): (usize, usize, Conversion),
    parameter: &Parameter,
    units: &[(String, Unit)],
) -> Result<(), Error> {
    let description = &graph.components[component].fmu.description;
    let target = &description.variables[variable];
    let place = place(parameter);
    check_settable(target, &place)?;
    let refused = |value: &dyn std::fmt::Display| {
        start_error(&place, &target.name, value.to_string(), allowed(target, description))
    };
    let value = match (&parameter.value, DataType::of(target)) {
        (Value::Real(value), DataType::Real) => {
            let unit = parameter_conversion(parameter, target, description, units, &place)?;
            Start::Real(to_variable.apply(unit.apply(*value)))
        }
        (Value::Integer(value), DataType::Real) => Start::Real(to_variable.apply(*value as f64)),
        (Value::Integer(value), DataType::Integer | DataType::Enumeration) => Start::Integer(*value),
        (Value::Boolean(value), DataType::Boolean) => Start::Boolean(*value),
        (Value::String(value), DataType::String) => Start::String(value.clone()),
        (Value::Enumeration(item), DataType::Enumeration) => {
            Start::Integer(item_value(item, target, description).ok_or_else(|| refused(item))?)
        }
        (value, _) => return Err(refused(&format!("{value:?}"))),
    };
    check_range(&value, target, description, &place)?;
    graph.components[component].set_start(variable, value);
    Ok(())
}

fn parameter_conversion(
    parameter: &Parameter,
    target: &Variable,
    description: &ModelDescription,
    units: &[(String, Unit)],
    place: &str,
) -> Result<Conversion, Error> {
    let (Some(given), Some(own)) = (parameter.unit.as_deref(), unit_of(target)) else {
        return Ok(Conversion::IDENTITY);
    };
    let table = UnitTable { declared: units };
    // The set itself first: the same name may mean something else elsewhere.
    let meant = parameter.definition.or_else(|| table.find(given, description));
    conversion((given, meant), (own, table.of_variable(own, description))).map_err(|problem| {
        Error::UnitMismatch {
            file: parameter.file.clone(),
            line: parameter.line,
            place: format!("start value of `{}` ({place})", target.name),
            from_unit: given.into(),
            to_unit: own.into(),
            problem,
        }
    })
}

/// Values that a system input accepts, if `value` is not among them; numbers for Reals are not judged.
pub(super) fn refused_number(graph: &SystemGraph, input: usize, value: f64) -> Option<String> {
    graph.connections.iter().filter(|connection| connection.source == Source::Input(input)).find_map(|fed| {
        let description = &graph.components[fed.component].fmu.description;
        let target = &description.variables[fed.variable];
        let whole = value.fract() == 0.0 && value.abs() <= MAX_EXACT_INTEGER;
        let fits = match DataType::of(target) {
            DataType::Real | DataType::String => true,
            DataType::Boolean => value == 0.0 || value == 1.0,
            DataType::Integer | DataType::Enumeration => {
                whole && in_range(&Start::Integer(value as i64), target, description)
            }
        };
        (!fits).then(|| allowed(target, description))
    })
}

/// Source of the input `name`, in words, if it is connected; see [`SystemGraph::driver_of`].
pub(super) fn driver_of(graph: &SystemGraph, name: &str) -> Option<String> {
    if graph.inputs.iter().any(|input| input.name == name) {
        return None;
    }
    let (component, variable) = find_path(graph, name, "").ok()?;
    let into = |fed: &&Connection| fed.component == component && fed.variable == variable;
    let source = graph.connections.iter().find(into)?.source;
    let by = graph.source_name(source);
    Some(match source {
        Source::Output { .. } => format!("the connection from `{by}`"),
        Source::Input(_) => format!("the system input `{by}`: set `{by}`"),
    })
}

/// Sets a start value given as text; see [`SystemGraph::set_start`].
///
/// # Errors
/// Same as [`SystemGraph::set_start`].
pub fn set_start_text(graph: &mut SystemGraph, name: &str, text: &str, place: &str) -> Result<(), Error> {
    if let Some(index) = graph.inputs.iter().position(|input| input.name == name) {
        let targets: Vec<(usize, usize, Conversion)> = graph
            .connections
            .iter()
            .filter(|connection| connection.source == Source::Input(index))
            .map(|connection| (connection.component, connection.variable, connection.conversion))
            .collect();
        for target in targets {
            set_text(graph, target, text, place)?;
        }
        return Ok(());
    }
    let (component, variable) = find_by_name(graph, name, place)?;
    if graph.components[component].fmu.description.sizes_arrays(variable) {
        return set_length(graph, (component, variable), text, place);
    }
    set_text(graph, (component, variable, Conversion::IDENTITY), text, place)
}

/// The variable that is meant by `component.variable`, or by the name alone in a single FMU.
fn find_by_name(graph: &SystemGraph, name: &str, place: &str) -> Result<(usize, usize), Error> {
    match graph.single {
        true if graph.components[0].fmu.description.variable(name).is_some() => {
            Ok((0, find(graph, 0, name, place)?))
        }
        _ => find_path(graph, name, place),
    }
}

/// Whether the name is that of a length of arrays; see [`SystemGraph::is_length`].
pub(super) fn is_length(graph: &SystemGraph, name: &str) -> bool {
    find_by_name(graph, name, "")
        .is_ok_and(|(component, variable)| graph.components[component].fmu.description.sizes_arrays(variable))
}

/// Gives the arrays of a single FMU another length, before other values are set; in a larger system, whose connections
/// stand, only the value that the parameter has is accepted.
fn set_length(
    graph: &mut SystemGraph,
    (component, variable): (usize, usize),
    text: &str,
    place: &str,
) -> Result<(), Error> {
    let fmu = std::sync::Arc::clone(&graph.components[component].fmu);
    let description = &fmu.description;
    let target = &description.variables[variable];
    let value = length(target, description, text.parse().ok(), place)?;
    let lengths = description.lengths_with(variable, value);
    if lengths == description.lengths() {
        return Ok(());
    }
    if !graph.single || !graph.components[component].start_values.is_empty() {
        let allowed = if graph.single {
            "a value that is given before all others, since it is the length of an array"
        } else {
            "the value that it has, since it is the length of an array; write another one into a parameter set of the system"
        };
        return Err(start_error(place, &target.name, text.to_owned(), allowed.into()));
    }
    let failed = |source| Error::Fmu {
        file: graph.file.clone(),
        component: graph.components[component].name.clone(),
        source: Box::new(source),
    };
    let resized = fmu.resized(&lengths).map_err(failed)?;
    let (file, name) = (graph.file.clone(), graph.components[component].name.clone());
    *graph = SystemGraph::single(&file, name, resized);
    Ok(())
}

fn set_text(
    graph: &mut SystemGraph,
    (component, variable, conversion): (usize, usize, Conversion),
    text: &str,
    place: &str,
) -> Result<(), Error> {
    let description = &graph.components[component].fmu.description;
    let target = &description.variables[variable];
    check_settable(target, place)?;
    let value = match DataType::of(target) {
        DataType::Real => text.parse().ok().filter(|value: &f64| value.is_finite()).map(|value| {
            // A value without unit is in the unit of the variable, or of the system input it is given for.
            Start::Real(conversion.apply(value))
        }),
        DataType::Integer => text.parse().ok().map(Start::Integer),
        DataType::Boolean => match text {
            "true" | "1" => Some(Start::Boolean(true)),
            "false" | "0" => Some(Start::Boolean(false)),
            _ => None,
        },
        DataType::String => Some(Start::String(text.to_owned())),
        DataType::Enumeration => item_value(text, target, description).map(Start::Integer),
    };
    let value = value
        .ok_or_else(|| start_error(place, &target.name, text.to_owned(), allowed(target, description)))?;
    check_range(&value, target, description, place)?;
    graph.components[component].set_start(variable, value);
    Ok(())
}

/// Splits `component.variable`; component names have no dot.
fn find_path(graph: &SystemGraph, path: &str, place: &str) -> Result<(usize, usize), Error> {
    let unknown = |hint: String| Error::UnknownParameter { place: place.into(), name: path.into(), hint };
    let components = || {
        let names: Vec<&str> = graph.components.iter().map(|component| component.name.as_str()).collect();
        format!("; write component.variable, the components are: {}", names.join(", "))
    };
    if graph.single && !path.contains('.') {
        return Ok((0, find(graph, 0, path, place)?));
    }
    let (component, name) = path.split_once('.').ok_or_else(|| unknown(components()))?;
    let index = graph.components.iter().position(|known| known.name == component);
    let index = index.ok_or_else(|| unknown(components()))?;
    Ok((index, find(graph, index, name, place)?))
}

fn find(graph: &SystemGraph, component: usize, name: &str, place: &str) -> Result<usize, Error> {
    let owner = &graph.components[component];
    owner.fmu.description.index_of(name).ok_or_else(|| {
        let settable: Vec<&str> = owner
            .fmu
            .description
            .variables
            .iter()
            .filter(|variable| variable.causality == Causality::Parameter)
            .map(|variable| variable.name.as_str())
            .take(12)
            .collect();
        let hint = match settable.is_empty() {
            true => format!(" in component `{}`, which has no parameters", owner.name),
            false => format!(" in component `{}`; its parameters are: {}", owner.name, settable.join(", ")),
        };
        Error::UnknownParameter { place: place.into(), name: name.into(), hint }
    })
}

/// Variables that may be set before initialization (FMI 2.0.5 section 4.2.4).
fn check_settable(variable: &Variable, place: &str) -> Result<(), Error> {
    let why = match (variable.causality, variable.initial) {
        (_, _) if variable.variability == Variability::Constant => "constant",
        (Causality::Parameter | Causality::Input, _) => return Ok(()),
        (_, Some(Initial::Exact | Initial::Approx)) => return Ok(()),
        (Causality::CalculatedParameter, _) => "calculated from other parameters",
        (Causality::Independent, _) => "the independent variable",
        _ => "calculated by the FMU",
    };
    Err(Error::NotSettable { place: place.into(), name: variable.name.clone(), why: why.into() })
}

fn check_range(
    value: &Start,
    variable: &Variable,
    description: &ModelDescription,
    place: &str,
) -> Result<(), Error> {
    match in_range(value, variable, description) {
        true => Ok(()),
        false => Err(start_error(place, &variable.name, value.to_string(), allowed(variable, description))),
    }
}

fn in_range(value: &Start, variable: &Variable, description: &ModelDescription) -> bool {
    match (value, &variable.kind) {
        (Start::Real(value), VariableKind::Real(real)) => {
            value.is_finite()
                && real.min.is_none_or(|min| *value >= min)
                && real.max.is_none_or(|max| *value <= max)
        }
        (Start::Integer(value), VariableKind::Integer { min, max, .. }) => {
            let (low, high) = description.integer_range(variable);
            (min.unwrap_or(low)..=max.unwrap_or(high)).contains(value)
        }
        (Start::Integer(value), VariableKind::Enumeration { declared_type, .. }) => {
            let items = items(declared_type, description);
            items.is_empty() || items.iter().any(|(_, item)| item == value)
        }
        (Start::String(text), VariableKind::String { .. }) if description.is_binary(variable) => {
            text.len().is_multiple_of(2) && text.bytes().all(|digit| digit.is_ascii_hexdigit())
        }
        _ => true,
    }
}

/// A length of arrays, checked against the range of its parameter.
pub(super) fn length(
    variable: &Variable,
    description: &ModelDescription,
    value: Option<i64>,
    place: &str,
) -> Result<i64, Error> {
    let refuse = |value: String| start_error(place, &variable.name, value, allowed(variable, description));
    let value = value.ok_or_else(|| refuse("this value".to_owned()))?;
    check_range(&Start::Integer(value), variable, description, place)?;
    if value < 0 { Err(refuse(value.to_string())) } else { Ok(value) }
}

fn start_error(place: &str, name: &str, value: String, allowed: String) -> Error {
    Error::StartValue { place: place.into(), name: name.into(), value, allowed }
}

fn items<'a>(declared_type: &str, description: &'a ModelDescription) -> &'a [(String, i64)] {
    description.types.iter().find(|known| known.name == declared_type).map_or(&[], |known| &known.items)
}

/// Value of an item given by name or number.
fn item_value(text: &str, variable: &Variable, description: &ModelDescription) -> Option<i64> {
    let VariableKind::Enumeration { declared_type, .. } = &variable.kind else { return None };
    let named = items(declared_type, description).iter().find(|(name, _)| name == text);
    named.map(|(_, value)| *value).or_else(|| text.parse().ok())
}

/// Allowed values of a variable, in words.
fn allowed(variable: &Variable, description: &ModelDescription) -> String {
    fn range<T: std::fmt::Display>(kind: &str, min: Option<T>, max: Option<T>) -> String {
        match (min, max) {
            (Some(min), Some(max)) => format!("{kind} from {min} to {max}"),
            (Some(min), None) => format!("{kind} of at least {min}"),
            (None, Some(max)) => format!("{kind} of at most {max}"),
            (None, None) => kind.to_owned(),
        }
    }
    match &variable.kind {
        VariableKind::Real(real) => {
            let unit = real.unit.as_deref().map_or(String::new(), |unit| format!(" [{unit}]"));
            range("a number", real.min, real.max) + &unit
        }
        VariableKind::Integer { min, max, .. } => {
            let (low, high) = description.integer_range(variable);
            range("an integer", Some(min.unwrap_or(low)), Some(max.unwrap_or(high)))
        }
        VariableKind::Boolean { .. } => "true or false (or 1, 0)".into(),
        VariableKind::String { .. } if description.is_binary(variable) => {
            "bytes as pairs of hexadecimal digits, such as 00ff".into()
        }
        VariableKind::String { .. } => "a text".into(),
        VariableKind::Enumeration { declared_type, .. } => {
            let names: Vec<String> = items(declared_type, description)
                .iter()
                .map(|(name, value)| format!("{name} ({value})"))
                .collect();
            format!("one of {}", names.join(", "))
        }
    }
}
