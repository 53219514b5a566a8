//! `TypeDefinitions` of FMI 3.0, and the types of variables.

use super::super::layout::BaseType;
use super::super::{DescriptionError, TypeDefinition, VariableKind, kinds};
use crate::xml::Element;

/// All type definitions of types that are read.
pub(super) fn read(root: &Element) -> Result<Vec<TypeDefinition>, DescriptionError> {
    let Some(definitions) = root.child("TypeDefinitions") else { return Ok(Vec::new()) };
    let read = |element: &Element| {
        let name = element.name.strip_suffix("Type")?;
        BaseType::of(name).map(|base| definition(element, base, name == "Enumeration"))
    };
    definitions.children.iter().filter_map(read).collect()
}

fn definition(
    element: &Element,
    base: BaseType,
    is_enumeration: bool,
) -> Result<TypeDefinition, DescriptionError> {
    let name = element.required("name")?.to_owned();
    let enumeration = is_enumeration.then(|| name.clone());
    Ok(TypeDefinition {
        description: element.text("description"),
        kind: kind(element, base, enumeration, None)?,
        items: kinds::items(element)?,
        name,
    })
}

/// Type with attributes but without a start value; what is not given comes from the declared type.
pub(super) fn kind(
    element: &Element,
    base: BaseType,
    enumeration: Option<String>,
    declared: Option<&TypeDefinition>,
) -> Result<VariableKind, DescriptionError> {
    // A bound beyond 64 bits with a sign bounds nothing here.
    let bound = |name: &str| Ok(element.integer::<i128>(name)?.and_then(|value| i64::try_from(value).ok()));
    Ok(match (base, enumeration) {
        (BaseType::Float32 | BaseType::Float64, _) => VariableKind::Real(kinds::real(element, declared)?),
        (BaseType::Boolean, _) => VariableKind::Boolean { start: None },
        (BaseType::String | BaseType::Binary, _) => VariableKind::String { start: None },
        (_, Some(declared_type)) => {
            let (min, max) = kinds::bounds(declared, bound)?;
            VariableKind::Enumeration { declared_type, start: None, min, max }
        }
        (_, None) => {
            let (min, max) = kinds::bounds(declared, bound)?;
            VariableKind::Integer { start: None, min, max, quantity: kinds::quantity(element, declared) }
        }
    })
}
