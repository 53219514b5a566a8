//! Names: the naming convention, and definitions that occur twice.

use std::collections::HashSet;

use super::{Findings, element};
use crate::{ModelDescription, NamingConvention, Variable};

pub(super) fn check(description: &ModelDescription, findings: &mut Findings) {
    if description.model_name.is_empty() {
        findings.error("model-name", "fmiModelDescription", "the attribute modelName is missing or empty");
    }
    if description.variable_naming_convention == NamingConvention::Structured {
        // Indices of elements of arrays are ours in FMI 3.0.
        let is_fmi3 = description.is_fmi3();
        let unstructured = |variable: &&Variable| {
            !is_structured(if is_fmi3 { without_index(&variable.name) } else { &variable.name })
        };
        for variable in description.variables.iter().filter(unstructured) {
            findings.error(
                "naming-convention",
                element(variable),
                "the name does not follow variableNamingConvention=\"structured\" (like a.b[1].c or der(a.b)); \
                 change the name, or the convention to \"flat\"",
            );
        }
    }
    let units = description.units.iter().map(|unit| ("Unit", unit.name.as_str()));
    let types = description.types.iter().map(|declared| ("SimpleType", declared.name.as_str()));
    let categories = description.log_categories.iter().map(|category| ("Category", category.name.as_str()));
    for unread in &description.unread {
        findings.note(
            "unread-type",
            format!("variable {}", unread.name),
            format!("variables of type {} are not carried; it keeps its start value", unread.kind),
        );
    }
    let mut seen = HashSet::new();
    for (kind, name) in units.chain(types).chain(categories) {
        if !seen.insert((kind, name)) {
            findings.error("duplicate-definition", format!("{kind} {name}"), "it is defined twice");
        }
    }
}

/// A name without the indices at its end.
fn without_index(name: &str) -> &str {
    match name.rsplit_once('[') {
        Some((before, indices)) if indices.ends_with(']') => before,
        _ => name,
    }
}

/// Whether a name follows the grammar of FMI 2.0.5 section 2.2.9.
fn is_structured(name: &str) -> bool {
    let identifier = match name.strip_prefix("der(").map(|rest| rest.strip_suffix(')')) {
        None => name,
        Some(None) => return false,
        // The order of the derivative follows a comma outside of the brackets of array indices.
        Some(Some(inner)) => match inner.rsplit_once(',') {
            Some((identifier, order)) if !order.contains(']') => {
                if !is_number(order) {
                    return false;
                }
                identifier
            }
            _ => inner,
        },
    };
    let mut rest = identifier;
    loop {
        let Some(after) = strip_part(rest) else { return false };
        match after.strip_prefix('.') {
            Some(next) => rest = next,
            None => return after.is_empty(),
        }
    }
}

/// Rest of the text after a plain or quoted name with array indices.
fn strip_part(text: &str) -> Option<&str> {
    let after = match text.strip_prefix('\'') {
        Some(quoted) => {
            let mut escaped = false;
            let end = quoted.char_indices().find(|&(_, c)| {
                let ends = c == '\'' && !escaped;
                escaped = c == '\\' && !escaped;
                ends
            });
            &quoted[end.filter(|&(at, _)| at > 0)?.0 + 1..]
        }
        None => {
            text.chars().next().filter(|c| c.is_ascii_alphabetic() || *c == '_')?;
            text.trim_start_matches(|c: char| c.is_ascii_alphanumeric() || c == '_')
        }
    };
    match after.strip_prefix('[') {
        Some(indices) => {
            let (indices, after) = indices.split_once(']')?;
            indices.split(',').map(str::trim).all(is_number).then_some(after)
        }
        None => Some(after),
    }
}

fn is_number(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::is_structured;

    #[test]
    fn structured_names_follow_the_grammar() {
        for name in [
            "a",
            "_b1.c",
            "a.b[1].c[2,3]",
            "der(x)",
            "der(a.x[2])",
            "der(x,2)",
            "der(x[1,2])",
            "'q \\' \"'.b",
        ] {
            assert!(is_structured(name), "{name}");
        }
        for name in [
            "", "1a", "a.", "a..b", "a b", "a[0", "a[x]", "a[]", "der(x", "der(x,y)", "''", "'a", "ä",
            "a[1]b",
        ] {
            assert!(!is_structured(name), "{name}");
        }
    }
}
