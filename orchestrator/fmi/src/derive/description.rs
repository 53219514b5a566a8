//! `modelDescription.xml` of a derived FMU: that of the template with other names, GUID and start values.
//!
//! Only the tags that change are written anew; all else keeps its bytes.

use std::path::Path;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::{Derivation, DeriveError, Start, Value};

/// The text with `derivation`, `guid` and start values put in.
pub(super) fn rewrite(
    xml: &[u8],
    derivation: &Derivation,
    guid: &str,
    start: &[Start],
    template: &Path,
) -> Result<Vec<u8>, DeriveError> {
    let refuse = |problem: String| DeriveError::Xml { path: template.to_owned(), problem };
    let xml = std::str::from_utf8(xml).map_err(|error| refuse(error.to_string()))?;
    let mut reader = Reader::from_str(xml);
    let mut text = String::with_capacity(xml.len() + 1000);
    // Position of the variable whose element is open, and elements that are open in all.
    let (mut variable, mut next, mut depth) = (None, 0, 0);
    loop {
        let from = usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX);
        let event = reader.read_event().map_err(|error| refuse(error.to_string()))?;
        let to = usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX);
        let (tag, end) = match &event {
            Event::Start(tag) => (tag, ">"),
            Event::Empty(tag) => (tag, "/>"),
            Event::Eof => break,
            Event::End(_) => {
                depth -= 1;
                variable = variable.filter(|_| depth > 2);
                text.push_str(xml.get(from..to).unwrap_or_default());
                continue;
            }
            Event::Comment(_) if depth == 0 => {
                text.push_str("<!-- a derived FMU; do not edit -->");
                continue;
            }
            _ => {
                text.push_str(xml.get(from..to).unwrap_or_default());
                continue;
            }
        };
        let name = tag.local_name().as_ref().to_owned();
        if name == "ScalarVariable" && depth == 2 {
            variable = Some(next);
            next += 1;
        }
        let changes = match (depth, variable) {
            (0, _) => vec![
                ("modelName", derivation.name.clone()),
                ("guid", guid.to_owned()),
                ("description", derivation.description.clone()),
            ]
            .into_iter()
            .filter(|(_, value)| !value.is_empty())
            .collect(),
            // The type element; an annotation next to it has no start value.
            (3, Some(variable)) if name != "Annotations" => start
                .iter()
                .find(|(position, _)| *position == variable)
                .map(|(_, value)| ("start", attribute(value)))
                .into_iter()
                .collect(),
            _ => Vec::new(),
        };
        if changes.is_empty() {
            text.push_str(xml.get(from..to).unwrap_or_default());
        } else {
            text.push_str(&with_attributes(tag, &changes, end).map_err(refuse)?);
        }
        if end == ">" {
            depth += 1;
        }
    }
    Ok(text.into_bytes())
}

/// The tag with some attributes replaced where they stand, or added at the end.
pub(super) fn with_attributes(
    tag: &BytesStart<'_>,
    changes: &[(&str, String)],
    end: &str,
) -> Result<String, String> {
    let mut text = format!("<{}", tag.name().as_ref());
    let mut open: Vec<&(&str, String)> = changes.iter().collect();
    for attribute in tag.attributes() {
        let attribute = attribute.map_err(|error| error.to_string())?;
        let key = attribute.key.as_ref();
        match open.iter().position(|(name, _)| *name == key) {
            Some(at) => {
                let (name, value) = open.remove(at);
                text.push_str(&format!(" {name}=\"{}\"", escape(value)));
            }
            None => {
                let value = attribute.value.replace('"', "&quot;");
                text.push_str(&format!(" {key}=\"{value}\""));
            }
        }
    }
    for (name, value) in open {
        text.push_str(&format!(" {name}=\"{}\"", escape(value)));
    }
    text.push_str(end);
    Ok(text)
}

/// A start value as the schema spells it.
fn attribute(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Real(_) => {
            let text = value.to_string();
            text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
        }
        value => value.to_string(),
    }
}

/// Text as it may stand in an attribute, line breaks included.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\n' => escaped.push_str("&#10;"),
            '\t' => escaped.push_str("&#9;"),
            '\r' => escaped.push_str("&#13;"),
            c => escaped.push(c),
        }
    }
    escaped
}
