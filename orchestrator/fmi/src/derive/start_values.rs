//! Start values of a derived FMU: checked against the template, and as the text that its library reads.

use std::fmt::Write;
use std::path::Path;

use super::{DeriveError, Start, Value, has_start};
use crate::{ModelDescription, Variable, VariableKind};

/// GUID of the library and start values out of the resource of a template that is derived itself.
pub(super) fn read(text: &[u8], template: &Path) -> Result<(String, Vec<(String, Value)>), DeriveError> {
    let refuse = |problem: String| DeriveError::StartValues { path: template.to_owned(), problem };
    let text = std::str::from_utf8(text).map_err(|error| refuse(error.to_string()))?;
    let table: toml::Table = text.parse().map_err(|error: toml::de::Error| refuse(error.to_string()))?;
    let base = table.get("base").and_then(toml::Value::as_str);
    let base = base.ok_or_else(|| refuse("it has no `base`, the GUID of the library".into()))?;
    let mut start = Vec::new();
    for (name, value) in table.get("start").and_then(toml::Value::as_table).into_iter().flatten() {
        let value = match value {
            toml::Value::Float(x) => Value::Real(*x),
            toml::Value::Integer(x) => Value::Integer(*x),
            toml::Value::Boolean(x) => Value::Boolean(*x),
            toml::Value::String(x) => Value::String(x.clone()),
            other => {
                return Err(refuse(format!("`{name}` = {other} is not a number, true, false or string")));
            }
        };
        start.push((name.clone(), value));
    }
    Ok((base.to_owned(), start))
}

impl Value {
    /// The value that `text` means for the variable `name`; a String where it fits neither type nor variable, which
    /// [`super::derive`] refuses then with what is allowed. Items of an Enumeration may be given by name.
    pub fn parse(text: &str, name: &str, description: &ModelDescription) -> Value {
        let kind = description.variable(name).map(|variable| &variable.kind);
        let item = |declared_type: &str| {
            let declared = description.types.iter().find(|t| t.name == *declared_type)?;
            declared.items.iter().find(|(item, _)| item == text).map(|(_, value)| *value)
        };
        let value = match kind {
            Some(VariableKind::Real(_)) => text.parse().ok().map(Value::Real),
            Some(VariableKind::Integer { .. }) => text.parse().ok().map(Value::Integer),
            Some(VariableKind::Enumeration { declared_type, .. }) => {
                text.parse().ok().or_else(|| item(declared_type)).map(Value::Integer)
            }
            Some(VariableKind::Boolean { .. }) => text.parse().ok().map(Value::Boolean),
            Some(VariableKind::String { .. }) | None => None,
        };
        value.unwrap_or_else(|| Value::String(text.to_owned()))
    }
}

/// Positions and values in the order of the model description. The last `own` of the values must differ in name and
/// win over those before them.
pub(super) fn check(
    start: &[(String, Value)],
    own: usize,
    description: &ModelDescription,
    template: &Path,
) -> Result<Vec<Start>, DeriveError> {
    let mut checked: Vec<Start> = Vec::with_capacity(start.len());
    let inherited = start.len() - own;
    for (index, (name, value)) in start.iter().enumerate() {
        let own_before = start.get(inherited..index).unwrap_or_default();
        if own_before.iter().any(|(other, _)| other == name) {
            return Err(DeriveError::Twice { variable: name.clone() });
        }
        let Some(position) = description.index_of(name) else {
            let same = |v: &&Variable| v.name.to_lowercase() == name.to_lowercase();
            let other = description.variables.iter().find(same);
            let hint = other.map_or_else(String::new, |v| format!("; there is `{}`", v.name));
            return Err(DeriveError::Unknown { path: template.to_owned(), variable: name.clone(), hint });
        };
        let variable = &description.variables[position];
        if !has_start(variable) {
            return Err(DeriveError::Computed { path: template.to_owned(), variable: name.clone() });
        }
        let value = fitting(variable, value, description).map_err(|allowed| DeriveError::Value {
            path: template.to_owned(),
            variable: name.clone(),
            value: value.to_string(),
            allowed,
        })?;
        checked.retain(|(other, _)| *other != position);
        checked.push((position, value));
    }
    checked.sort_by_key(|(position, _)| *position);
    Ok(checked)
}

/// The value in the type of the variable, or what the variable takes.
fn fitting(variable: &Variable, value: &Value, description: &ModelDescription) -> Result<Value, String> {
    match (&variable.kind, value) {
        (VariableKind::Real(real), Value::Real(_) | Value::Integer(_)) => {
            let x = match value {
                Value::Real(x) => *x,
                Value::Integer(x) => *x as f64,
                _ => f64::NAN,
            };
            let (low, high) = (real.min.unwrap_or(f64::MIN), real.max.unwrap_or(f64::MAX));
            if !(low.max(f64::MIN)..=high.min(f64::MAX)).contains(&x) {
                return Err(match (real.min, real.max) {
                    (None, None) => "a finite number".into(),
                    (Some(low), None) => format!("a finite number, at least {low:?}"),
                    (None, Some(high)) => format!("a finite number, at most {high:?}"),
                    (Some(low), Some(high)) => format!("a number from {low:?} to {high:?}"),
                });
            }
            Ok(Value::Real(x))
        }
        (VariableKind::Integer { min, max, .. }, Value::Integer(x)) => {
            let (low, high) = description.integer_range(variable);
            let (low, high) = (min.unwrap_or(low), max.unwrap_or(high));
            let fits = (low..=high).contains(x);
            fits.then(|| value.clone()).ok_or_else(|| format!("a whole number from {low} to {high}"))
        }
        (VariableKind::Enumeration { declared_type, .. }, _) => {
            let declared = description.types.iter().find(|t| t.name == *declared_type);
            let items = declared.map_or(&[][..], |t| &t.items);
            let list =
                || items.iter().map(|(name, i)| format!("{i} ({name})")).collect::<Vec<_>>().join(", ");
            let fits = items.iter().any(|(_, i)| *value == Value::Integer(*i));
            fits.then(|| value.clone()).ok_or_else(list)
        }
        (VariableKind::Boolean { .. }, Value::Boolean(_)) => Ok(value.clone()),
        (VariableKind::String { .. }, Value::String(text)) => {
            let fits = !text.chars().any(|c| c.is_control() && !matches!(c, '\n' | '\t' | '\r'));
            fits.then(|| value.clone()).ok_or_else(|| "a text without control characters".into())
        }
        (VariableKind::Real(_), _) => Err("a number".into()),
        (VariableKind::Integer { .. }, _) => Err("a whole number".into()),
        (VariableKind::Boolean { .. }, _) => Err("true or false".into()),
        (VariableKind::String { .. }, _) => Err("a text".into()),
    }
}

/// Content of `resources/start_values.toml`.
pub(super) fn text(base: &str, guid: &str, start: &[Start], description: &ModelDescription) -> String {
    let mut text = String::from("# Start values of a derived FMU; its library reads them.\n");
    // Writing into a String cannot fail.
    let _ = write!(text, "base = {}\nguid = {}\n\n[start]\n", quoted(base), quoted(guid));
    for (position, value) in start {
        let name = quoted(&description.variables[*position].name);
        let _ = match value {
            Value::String(value) => writeln!(text, "{name} = {}", quoted(value)),
            value => writeln!(text, "{name} = {value}"),
        };
    }
    text
}

/// A TOML string in double quotes.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            '\n' => quoted.push_str("\\n"),
            '\t' => quoted.push_str("\\t"),
            '\r' => quoted.push_str("\\r"),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}
