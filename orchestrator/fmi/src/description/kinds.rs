//! Attributes of types shared by type definitions and variables in both versions of FMI.

use std::collections::HashMap;

use super::attributes::Range;
use super::{DescriptionError, RealAttributes, TypeDefinition, VariableKind};
use crate::xml::Element;

/// The type that `typed` declares for the variable at `element`, which is of the kind called `own`.
pub(super) fn declared<'a>(
    element: &Element,
    typed: &Element,
    own: &str,
    types: &HashMap<&str, &'a TypeDefinition>,
) -> Result<Option<&'a TypeDefinition>, DescriptionError> {
    let Some(name) = typed.attribute("declaredType").filter(|name| !name.is_empty()) else {
        return Ok(None);
    };
    let definition = *types
        .get(name)
        .ok_or_else(|| element.error(format!("declaredType=\"{name}\" is not among the TypeDefinitions")))?;
    match definition.kind.name() {
        kind if kind == own => Ok(Some(definition)),
        kind => Err(element.error(format!("its declaredType \"{name}\" is {kind}, not {own}"))),
    }
}

/// Name of the declared type of an enumeration.
pub(super) fn enumeration(
    element: &Element,
    declared: Option<&TypeDefinition>,
) -> Result<String, DescriptionError> {
    declared
        .map(|declared| declared.name.clone())
        .ok_or_else(|| element.error("an Enumeration needs the attribute declaredType"))
}

/// Items of an enumeration, as (name, value).
pub(super) fn items(element: &Element) -> Result<Vec<(String, i64)>, DescriptionError> {
    let item = |item: &Element| {
        let value = item.integer("value")?.ok_or_else(|| item.error("the attribute value is missing"))?;
        Ok((item.required("name")?.to_owned(), value))
    };
    element.children("Item").map(item).collect()
}

/// Smallest and largest value of an integer or enumeration; what is not given comes from the declared type.
pub(super) fn bounds(
    declared: Option<&TypeDefinition>,
    bound: impl Fn(&str) -> Result<Option<i64>, DescriptionError>,
) -> Result<(Option<i64>, Option<i64>), DescriptionError> {
    let inherited = match declared.map(|declared| &declared.kind) {
        Some(VariableKind::Integer { min, max, .. } | VariableKind::Enumeration { min, max, .. }) => {
            (*min, *max)
        }
        _ => (None, None),
    };
    Ok((bound("min")?.or(inherited.0), bound("max")?.or(inherited.1)))
}

/// Quantity of an integer, which may come from the declared type.
pub(super) fn quantity(typed: &Element, declared: Option<&TypeDefinition>) -> Option<String> {
    typed.attribute("quantity").map(str::to_owned).or_else(|| match declared.map(|declared| &declared.kind) {
        Some(VariableKind::Integer { quantity, .. }) => quantity.clone(),
        _ => None,
    })
}

/// Attributes of a real number but start value and state; what is not given comes from the declared type.
pub(super) fn real(
    typed: &Element,
    declared: Option<&TypeDefinition>,
) -> Result<RealAttributes, DescriptionError> {
    let parent = match declared.map(|declared| &declared.kind) {
        Some(VariableKind::Real(real)) => real.clone(),
        _ => RealAttributes::default(),
    };
    let text = |name, inherited| typed.attribute(name).map(str::to_owned).or(inherited);
    Ok(RealAttributes {
        unit: text("unit", parent.unit),
        display_unit: text("displayUnit", parent.display_unit),
        quantity: text("quantity", parent.quantity),
        start: None,
        min: typed.real("min", Range::Extended)?.or(parent.min),
        max: typed.real("max", Range::Extended)?.or(parent.max),
        nominal: typed.real("nominal", Range::Finite)?.or(parent.nominal),
        derivative: None,
        reinit: typed.boolean("reinit")?.unwrap_or(false),
        relative_quantity: typed.boolean("relativeQuantity")?.unwrap_or(parent.relative_quantity),
        unbounded: typed.boolean("unbounded")?.unwrap_or(parent.unbounded),
    })
}
