//! `docs/files.md`: the keys of the TOML files that users write, made from the schemas that `--schema` prints.

use std::collections::BTreeSet;
use std::fmt::Write;

use serde_json::Value;

/// A schema as tables: one for each table of the file, with meaning, kind, range and default of its keys.
pub fn tables(schema: &str) -> String {
    let schema: Value = serde_json::from_str(schema).expect("a schema of ours");
    let mut tables = Tables { root: &schema, text: String::new(), seen: BTreeSet::new() };
    tables.table("", &schema);
    tables.text
}

struct Tables<'a> {
    root: &'a Value,
    text: String,
    /// Tables that were written: one that may stand in several places is explained once.
    seen: BTreeSet<*const Value>,
}

/// Kind of a value, and the tables that it may be.
struct Kind<'a> {
    words: String,
    tables: Vec<(&'static str, &'a Value)>,
}

impl<'a> Tables<'a> {
    /// Target of a reference.
    fn resolved(&self, node: &'a Value) -> &'a Value {
        let Some(reference) = node["$ref"].as_str() else { return node };
        self.root.pointer(reference.trim_start_matches('#')).expect("a definition of the schema")
    }

    /// The table at `path`, then those inside of it.
    fn table(&mut self, path: &str, node: &'a Value) {
        let node = self.resolved(node);
        let Some(keys) = node["properties"].as_object() else { return };
        if !self.seen.insert(std::ptr::from_ref(node)) {
            return;
        }
        if !path.is_empty() {
            let _ = write!(self.text, "\n### `{path}`\n");
        }
        if let Some(description) = node["description"].as_str() {
            let _ = write!(self.text, "\n{}\n", sentence(description));
        }
        self.text.push_str("\n| key | value | meaning |\n|---|---|---|\n");
        let required: Vec<&str> =
            node["required"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        let mut inner = Vec::new();
        for (key, value) in keys {
            let kind = self.kind(value);
            let needed = if required.contains(&key.as_str()) { " (required)" } else { "" };
            let mut meaning = sentence(
                value["description"]
                    .as_str()
                    .unwrap_or_else(|| self.resolved(value)["description"].as_str().unwrap_or_default()),
            );
            let says_so = meaning.contains("default:");
            let said = |default: &&Value| !says_so && !default.is_null() && default.as_str() != Some("");
            if let Some(default) = value.get("default").filter(said) {
                let _ = write!(meaning, " Default: `{default}`.");
            }
            let row = [format!("`{key}`{needed}"), kind.words, meaning].map(|cell| cell.replace('|', "\\|"));
            let _ = writeln!(self.text, "| {} |", row.join(" | "));
            inner.extend(kind.tables.into_iter().map(|(form, table)| (form.replace("KEY", key), table)));
        }
        let prefix = path.trim_matches(['[', ']']);
        for (form, table) in inner {
            let name = form.trim_matches(['[', ']']);
            let whole = if prefix.is_empty() { name.to_owned() } else { format!("{prefix}.{name}") };
            self.table(&form.replace(name, &whole), table);
        }
    }

    fn kind(&self, node: &'a Value) -> Kind<'a> {
        let plain = |words: String| Kind { words, tables: Vec::new() };
        let node = self.resolved(node);
        if let Some(value) = node.get("const") {
            return plain(format!("`{value}`"));
        }
        if let Some(values) = node["enum"].as_array() {
            return plain(values.iter().map(|value| format!("`{value}`")).collect::<Vec<_>>().join(", "));
        }
        if let Some(all) = node["allOf"].as_array() {
            return self.kind(&all[0]);
        }
        if let Some(any) = node["anyOf"].as_array().or(node["oneOf"].as_array())
            && node["properties"].is_null()
        {
            let kinds: Vec<Kind> = any.iter().map(|one| self.kind(one)).collect();
            let mut words: Vec<String> = Vec::new();
            for kind in &kinds {
                if !words.contains(&kind.words) && kind.words != "null" {
                    words.push(kind.words.clone());
                }
            }
            return Kind {
                words: words.join(" or "),
                tables: kinds.into_iter().flat_map(|kind| kind.tables).collect(),
            };
        }
        let types: Vec<&str> = match &node["type"] {
            Value::String(one) => vec![one],
            Value::Array(several) => several.iter().filter_map(Value::as_str).collect(),
            _ => Vec::new(),
        };
        let has_keys = node["properties"].is_object();
        if types.contains(&"object") && has_keys {
            return Kind { words: "table".into(), tables: vec![("[KEY]", node)] };
        }
        if types.contains(&"object") {
            if !node["additionalProperties"].is_object() {
                return plain("table".into());
            }
            let of = self.kind(&node["additionalProperties"]);
            let tables = of.tables.into_iter().map(|(_, table)| ("[KEY.NAME]", table)).collect();
            return Kind { words: format!("table: NAME = {}", of.words), tables };
        }
        if types.contains(&"array") {
            let of = self.kind(&node["items"]);
            let count = match (node["minItems"].as_u64(), node["maxItems"].as_u64()) {
                (Some(least), Some(most)) if least == most => format!(" of {least}"),
                (Some(least), _) if least > 0 => format!(" of at least {least}"),
                _ => String::new(),
            };
            let tables = of.tables.into_iter().map(|(_, table)| ("[[KEY]]", table)).collect();
            let words =
                if of.words.is_empty() { "list".into() } else { format!("list{count}: {}", of.words) };
            return Kind { words, tables };
        }
        plain(types.into_iter().filter(|one| *one != "null").collect::<Vec<_>>().join(" or ") + &range(node))
    }
}

/// Range of a number, as `>= 0`.
fn range(node: &Value) -> String {
    let limits = [("minimum", ">="), ("exclusiveMinimum", ">"), ("maximum", "<="), ("exclusiveMaximum", "<")];
    let found: Vec<String> = limits
        .iter()
        // The widths of integers say nothing to a user.
        .filter(|(key, _)| {
            !(node["format"].as_str().is_some_and(|f| f.starts_with("uint")) && *key == "maximum")
        })
        .filter_map(|(key, sign)| Some(format!("{sign} {}", node[key].as_f64()?)))
        .collect();
    if found.is_empty() { String::new() } else { format!(" {}", found.join(", ")) }
}

/// A description as one line that ends with a period.
fn sentence(text: &str) -> String {
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if line.is_empty() || line.ends_with(['.', '!', '?']) { line } else { line + "." }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_inside_of_tables_have_their_paths_ranges_and_defaults() {
        let schema = r##"{
            "type": "object", "required": ["step"],
            "properties": {
                "step": {"type": "number", "exclusiveMinimum": 0, "description": "Step [s]"},
                "part": {"type": "array", "items": {"$ref": "#/$defs/part"}},
                "signals": {"type": "object", "additionalProperties": {"$ref": "#/$defs/signal"}}
            },
            "$defs": {
                "part": {"type": "object", "properties": {"kind": {"enum": ["a", "b"], "default": "a"}}},
                "signal": {"type": "object", "properties": {"unit": {"type": "string"}}}
            }
        }"##;
        let text = tables(schema);
        assert!(text.contains("| `step` (required) | number > 0 | Step [s]. |"), "{text}");
        assert!(text.contains("### `[[part]]`") && text.contains("### `[signals.NAME]`"), "{text}");
        assert!(text.contains("| `kind` | `\"a\"`, `\"b\"` |  Default: `\"a\"`. |"), "{text}");
    }
}
