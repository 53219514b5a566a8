//! Reading `TypeDefinitions` and `ModelVariables`: attributes with their defaults, unique names, sound aliases.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::attributes::Range;
use super::{
    Causality, DescriptionError, RealAttributes, TypeDefinition, Variability, Variable, VariableKind, kinds,
    roles,
};
use crate::xml::Element;

const KINDS: [&str; 5] = ["Real", "Integer", "Boolean", "String", "Enumeration"];

/// All type definitions.
pub(super) fn types(root: &Element) -> Result<Vec<TypeDefinition>, DescriptionError> {
    let Some(definitions) = root.child("TypeDefinitions") else { return Ok(Vec::new()) };
    definitions.children("SimpleType").map(simple_type).collect()
}

fn simple_type(element: &Element) -> Result<TypeDefinition, DescriptionError> {
    let inner = base_type(element)?;
    Ok(TypeDefinition {
        name: element.required("name")?.to_owned(),
        description: element.text("description"),
        kind: kind(element, inner, None, usize::MAX)?,
        items: kinds::items(inner)?,
    })
}

/// All variables, and their positions by name.
pub(super) fn read(
    root: &Element,
    types: &[TypeDefinition],
) -> Result<(Vec<Variable>, HashMap<String, usize>), DescriptionError> {
    let elements = root
        .child("ModelVariables")
        .ok_or_else(|| root.error("the element ModelVariables is missing"))?
        .children("ScalarVariable");
    let elements: Vec<_> = elements.collect();
    let types: HashMap<&str, &TypeDefinition> = types.iter().map(|t| (t.name.as_str(), t)).collect();
    let mut variables: Vec<Variable> = Vec::with_capacity(elements.len());
    let mut index: HashMap<String, usize> = HashMap::with_capacity(elements.len());
    for element in &elements {
        let variable = variable(element, &types, elements.len())?;
        match index.entry(variable.name.clone()) {
            Entry::Occupied(earlier) => {
                let line = variables[*earlier.get()].line;
                return Err(element.error(format!("a variable of this name stands in line {line} already")));
            }
            Entry::Vacant(place) => place.insert(variables.len()),
        };
        variables.push(variable);
    }
    check_aliases(&variables, &elements)?;
    Ok((variables, index))
}

fn variable(
    element: &Element,
    types: &HashMap<&str, &TypeDefinition>,
    count: usize,
) -> Result<Variable, DescriptionError> {
    let name = element.required("name")?.to_owned();
    let inner = base_type(element)?;
    let declared = kinds::declared(element, inner, &inner.name, types)?;
    let causality = roles::causality(element, false)?;
    let default_variability =
        if inner.name == "Real" { Variability::Continuous } else { Variability::Discrete };
    let variability = roles::variability(element)?.unwrap_or(default_variability);
    let declared_initial = roles::declared_initial(element)?;
    Ok(Variable {
        name,
        value_reference: element.value_reference()?,
        description: element.text("description"),
        causality,
        variability,
        initial: roles::initial(causality, variability, declared_initial),
        declared_initial,
        kind: kind(element, inner, declared, count)?,
        can_handle_multiple_set: element.boolean("canHandleMultipleSetPerTimeInstant")?,
        line: element.line,
    })
}

/// The child that names the base type; annotations next to it are ignored.
fn base_type(element: &Element) -> Result<&Element, DescriptionError> {
    let mut kinds = element.children.iter().filter(|child| KINDS.contains(&child.name.as_str()));
    match (kinds.next(), kinds.next()) {
        (Some(kind), None) => Ok(kind),
        (None, _) => Err(element.error(format!("it has none of the elements {}", KINDS.join(", ")))),
        (Some(first), Some(second)) => {
            Err(element.error(format!("it is both {} and {}; keep one element", first.name, second.name)))
        }
    }
}

/// Base type with attributes; what is not given comes from the declared type.
fn kind(
    element: &Element,
    inner: &Element,
    declared: Option<&TypeDefinition>,
    count: usize,
) -> Result<VariableKind, DescriptionError> {
    // Errors name the variable, not the element of its base type.
    let at = |mut error: DescriptionError| {
        error.element = element.error("").element;
        error
    };
    let whole = |name: &str| Ok(inner.integer::<i32>(name).map_err(at)?.map(i64::from));
    let bounds = || kinds::bounds(declared, whole);
    Ok(match inner.name.as_str() {
        "Real" => VariableKind::Real(real(inner, declared, count).map_err(at)?),
        "Integer" => {
            let (min, max) = bounds()?;
            VariableKind::Integer {
                start: whole("start")?,
                min,
                max,
                quantity: kinds::quantity(inner, declared),
            }
        }
        "Boolean" => VariableKind::Boolean { start: inner.boolean("start").map_err(at)? },
        "String" => VariableKind::String { start: inner.attribute("start").map(str::to_owned) },
        _ => {
            let is_variable = element.name == "ScalarVariable";
            let declared_type =
                if is_variable { kinds::enumeration(element, declared)? } else { element.text("name") };
            let (min, max) = bounds()?;
            VariableKind::Enumeration { declared_type, start: whole("start")?, min, max }
        }
    })
}

fn real(
    inner: &Element,
    declared: Option<&TypeDefinition>,
    count: usize,
) -> Result<RealAttributes, DescriptionError> {
    let derivative = match inner.integer::<usize>("derivative")? {
        Some(number) if number == 0 || number > count => {
            let allowed = format!("the number of a variable, 1 to {count},");
            return Err(inner.bad("derivative", &number.to_string(), allowed));
        }
        number => number.map(|number| number - 1),
    };
    let start = inner.real("start", Range::Finite)?;
    Ok(RealAttributes { start, derivative, ..kinds::real(inner, declared)? })
}

/// Variables with one value reference and one base type are aliases, which FMI 2.0 allows as long as they agree.
fn check_aliases(variables: &[Variable], elements: &[&Element]) -> Result<(), DescriptionError> {
    // Integers and enumerations are read by the same function and share their references.
    let base = |kind: &VariableKind| match kind {
        VariableKind::Enumeration { .. } => "Integer",
        other => other.name(),
    };
    let settable =
        |variable: &Variable| matches!(variable.causality, Causality::Input | Causality::Parameter);
    let mut first: HashMap<(&str, u32), usize> = HashMap::with_capacity(variables.len());
    let mut first_start: HashMap<(&str, u32), usize> = HashMap::new();
    let mut settable_alias: HashMap<(&str, u32), usize> = HashMap::new();
    for (position, variable) in variables.iter().enumerate() {
        let key = (base(&variable.kind), variable.value_reference);
        let refused = |other: &Variable, what: &str| {
            Err(elements[position].error(format!(
                "it shares valueReference {} with \"{}\" (line {}), but {what}; give it a reference of its own",
                variable.value_reference, other.name, other.line
            )))
        };
        if settable(variable)
            && let Some(other) = settable_alias.insert(key, position)
        {
            return refused(&variables[other], "both can be set, which would set one by the other");
        }
        let &mut other = first.entry(key).or_insert(position);
        if other == position {
            // Its start value is the one to compare with below.
            if variable.kind.has_start() {
                first_start.insert(key, position);
            }
            continue;
        }
        let other = &variables[other];
        if other.kind.name() != variable.kind.name() {
            return refused(other, "their types differ");
        }
        if variable.kind.has_start() {
            let other = &variables[*first_start.entry(key).or_insert(position)];
            if !same_start(&other.kind, &variable.kind) {
                return refused(other, "their start values differ");
            }
        }
        let constant = |variable: &Variable| variable.variability == Variability::Constant;
        if constant(other) != constant(variable) {
            return refused(other, "only one of them is constant");
        }
    }
    Ok(())
}

fn same_start(a: &VariableKind, b: &VariableKind) -> bool {
    match (a, b) {
        (VariableKind::Real(a), VariableKind::Real(b)) => a.start == b.start,
        (VariableKind::Integer { start: a, .. }, VariableKind::Integer { start: b, .. })
        | (VariableKind::Enumeration { start: a, .. }, VariableKind::Enumeration { start: b, .. }) => a == b,
        (VariableKind::Boolean { start: a }, VariableKind::Boolean { start: b }) => a == b,
        (VariableKind::String { start: a }, VariableKind::String { start: b }) => a == b,
        _ => false,
    }
}
