//! `TypeDefinitions` of FMI 3.0, and the attributes that types and variables share.

use super::super::attributes::Range;
use super::super::layout::BaseType;
use super::super::{DescriptionError, RealAttributes, TypeDefinition, VariableKind};
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
    let item = |item: &Element| {
        let value = item.integer("value")?.ok_or_else(|| item.error("the attribute value is missing"))?;
        Ok((item.required("name")?.to_owned(), value))
    };
    let enumeration = is_enumeration.then(|| name.clone());
    Ok(TypeDefinition {
        description: element.text("description"),
        kind: kind(element, base, enumeration, None)?,
        items: element.children("Item").map(item).collect::<Result<_, _>>()?,
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
    let inherited = declared.map(|declared| &declared.kind);
    if base.is_float() {
        let parent = match inherited {
            Some(VariableKind::Real(real)) => real.clone(),
            _ => RealAttributes::default(),
        };
        return Ok(VariableKind::Real(real(element, parent)?));
    }
    Ok(match base {
        BaseType::Boolean => VariableKind::Boolean { start: None },
        BaseType::String => VariableKind::String { start: None },
        _ => {
            let parent = match inherited {
                Some(VariableKind::Integer { min, max, .. } | VariableKind::Enumeration { min, max, .. }) => {
                    (*min, *max)
                }
                _ => (None, None),
            };
            let min = bound(element, "min")?.or(parent.0);
            let max = bound(element, "max")?.or(parent.1);
            match enumeration {
                Some(declared_type) => VariableKind::Enumeration { declared_type, start: None, min, max },
                None => {
                    let quantity = element.attribute("quantity").map(str::to_owned);
                    let quantity = quantity.or_else(|| match inherited {
                        Some(VariableKind::Integer { quantity, .. }) => quantity.clone(),
                        _ => None,
                    });
                    VariableKind::Integer { start: None, min, max, quantity }
                }
            }
        }
    })
}

/// A bound of an integer. One beyond 32 bits bounds nothing here.
fn bound(element: &Element, name: &str) -> Result<Option<i32>, DescriptionError> {
    Ok(element.integer::<i128>(name)?.and_then(|value| i32::try_from(value).ok()))
}

fn real(element: &Element, parent: RealAttributes) -> Result<RealAttributes, DescriptionError> {
    let text = |name, inherited| element.attribute(name).map(str::to_owned).or(inherited);
    Ok(RealAttributes {
        unit: text("unit", parent.unit),
        display_unit: text("displayUnit", parent.display_unit),
        quantity: text("quantity", parent.quantity),
        start: None,
        min: element.real("min", Range::Extended)?.or(parent.min),
        max: element.real("max", Range::Extended)?.or(parent.max),
        nominal: element.real("nominal", Range::Finite)?.or(parent.nominal),
        derivative: None,
        reinit: element.boolean("reinit")?.unwrap_or(false),
        relative_quantity: element.boolean("relativeQuantity")?.unwrap_or(parent.relative_quantity),
        unbounded: element.boolean("unbounded")?.unwrap_or(parent.unbounded),
    })
}
