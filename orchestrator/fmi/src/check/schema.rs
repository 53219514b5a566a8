//! `modelDescription.xml` against the XML schema of its version: elements in their order, attributes known and
//! well-formed.
//!
//! The schema stands in two tables of text, `schema_fmi2.txt` and `schema_fmi3.txt`, with one line for each type of
//! element: `type: attributes ; children`. An attribute is `name`, `name!` if it must be there, and `=` with what its
//! value is: `b`oolean, `i`nteger of 32 bits, `u`nsigned, `l`ong, `d`ouble, `t`ime stamp, `U`nsigned numbers in a list,
//! or words in brackets; `*` allows others. A child is `name` or `name:type`, several in brackets for any of them, with
//! `?`, `*` or `+` as in regular expressions; `...` allows anything.

use std::collections::HashMap;

use super::{Findings, Severity};
use crate::xml::Element;

const FMI2: &str = include_str!("schema_fmi2.txt");
const FMI3: &str = include_str!("schema_fmi3.txt");

/// Judges the root element of a description.
pub(super) fn check(root: &Element, is_fmi3: bool, findings: &mut Findings) {
    let minor_version = root.attribute("fmiVersion").is_some_and(|version| is_fmi3 && version != "3.0");
    // Minor versions may add elements and attributes (FMI 3.0 section 2.6).
    let severity = if minor_version { Severity::Note } else { Severity::Error };
    let schema = Schema::new(if is_fmi3 { FMI3 } else { FMI2 });
    schema.judge(root, "fmiModelDescription", severity, findings);
}

/// A type of element.
struct Kind<'a> {
    attributes: Vec<Attribute<'a>>,
    other_attributes: bool,
    children: Option<Vec<Part<'a>>>,
}

struct Attribute<'a> {
    name: &'a str,
    required: bool,
    value: &'a str,
}

/// A place in the sequence of children.
struct Part<'a> {
    /// Names with their types.
    elements: Vec<(&'a str, &'a str)>,
    required: bool,
    repeated: bool,
}

struct Schema<'a>(HashMap<&'a str, Kind<'a>>);

impl<'a> Schema<'a> {
    fn new(table: &'a str) -> Self {
        let lines = table.lines().filter(|line| !line.starts_with('#'));
        Schema(
            lines.filter_map(|line| line.split_once(": ")).map(|(name, rest)| (name, kind(rest))).collect(),
        )
    }

    fn judge(&self, element: &Element, name: &str, severity: Severity, findings: &mut Findings) {
        let Some(kind) = self.0.get(name) else { return };
        let mut add = |message: String| findings.add(severity, "schema", place(element), message);
        judge_attributes(element, kind, &mut add);
        let Some(parts) = &kind.children else { return };
        if element.has_text {
            add("it holds text, which the schema does not allow here".to_owned());
        }
        judge_order(element, parts, &mut add);
        for child in &element.children {
            let known = parts.iter().flat_map(|part| &part.elements).find(|(name, _)| *name == child.name);
            if let Some((_, kind)) = known {
                self.judge(child, kind, severity, findings);
            }
        }
    }
}

/// An element in findings, by its name or number where it has one.
fn place(element: &Element) -> String {
    let named = ["name", "index", "valueReference", "type"];
    let label = named.iter().find_map(|key| element.attribute(key).map(|value| (key, value)));
    match label {
        Some((key, value)) => format!("{} {key}=\"{value}\" (line {})", element.name, element.line),
        None => format!("{} (line {})", element.name, element.line),
    }
}

fn judge_attributes(element: &Element, kind: &Kind, add: &mut impl FnMut(String)) {
    for (name, value) in &element.attributes {
        match kind.attributes.iter().find(|attribute| attribute.name == name) {
            Some(attribute) if !is_valid(value, attribute.value) => {
                add(format!("{name}=\"{value}\" where {} is needed", expected(attribute.value)));
            }
            Some(_) => {}
            None if kind.other_attributes || is_of_xml(name) => {}
            None => {
                let names: Vec<_> = kind.attributes.iter().map(|attribute| attribute.name).collect();
                let allowed = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
                add(format!("the schema knows no attribute {name} here; allowed: {allowed}"));
            }
        }
    }
    for attribute in kind.attributes.iter().filter(|attribute| attribute.required) {
        if element.attribute(attribute.name).is_none() {
            add(format!("the attribute {} is missing", attribute.name));
        }
    }
}

/// Attributes that every element of any schema may have.
fn is_of_xml(name: &str) -> bool {
    name.starts_with("xsi:") || name.starts_with("xml:")
}

fn judge_order(element: &Element, parts: &[Part], add: &mut impl FnMut(String)) {
    let has = |part: &Part, name: &str| part.elements.iter().any(|(known, _)| *known == name);
    let mut counts = vec![0_usize; parts.len()];
    let mut reached = 0;
    for child in &element.children {
        let Some(at) = parts.iter().position(|part| has(part, &child.name)) else {
            let names = parts.iter().flat_map(|part| &part.elements).map(|(name, _)| *name);
            let names = names.collect::<Vec<_>>().join(", ");
            let allowed = if names.is_empty() { "none" } else { &names };
            add(format!(
                "the schema knows no element {} (line {}) here; allowed: {allowed}",
                child.name, child.line
            ));
            continue;
        };
        counts[at] += 1;
        if at < reached {
            let after = parts[reached].elements.first().map_or("", |(name, _)| *name);
            add(format!(
                "the element {} (line {}) stands behind {after}, but must stand before it",
                child.name, child.line
            ));
        }
        if counts[at] == 2 && !parts[at].repeated {
            add(format!("the element {} (line {}) is one too many; one is allowed", child.name, child.line));
        }
        reached = reached.max(at);
    }
    for (part, count) in parts.iter().zip(counts) {
        if part.required && count == 0 {
            let names: Vec<_> = part.elements.iter().map(|(name, _)| *name).collect();
            add(format!("it holds no element {}, which it must", names.join(" or ")));
        }
    }
}

fn kind(text: &str) -> Kind<'_> {
    let (attributes, children) = text.split_once(';').unwrap_or((text, ""));
    let (mut known, mut other_attributes) = (Vec::new(), false);
    for word in attributes.split_whitespace() {
        if word == "*" {
            other_attributes = true;
            continue;
        }
        let (name, value) = word.split_once('=').unwrap_or((word, ""));
        let (name, required) = name.strip_suffix('!').map_or((name, false), |name| (name, true));
        known.push(Attribute { name, required, value });
    }
    let is_open = children.trim() == "...";
    Kind { attributes: known, other_attributes, children: (!is_open).then(|| parts(children)) }
}

/// The places of a sequence such as `A? (B C:Type)+ D`.
fn parts(text: &str) -> Vec<Part<'_>> {
    let mut parts = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        let (names, after) = match rest.strip_prefix('(') {
            Some(inside) => inside.split_once(')').unwrap_or((inside, "")),
            None => rest.split_at(rest.find([' ', '?', '*', '+']).unwrap_or(rest.len())),
        };
        let mark = after.chars().next().filter(|mark| "?*+".contains(*mark));
        rest = after.trim_start_matches(['?', '*', '+']).trim_start();
        parts.push(Part {
            elements: names
                .split_whitespace()
                .map(|word| word.split_once(':').unwrap_or((word, word)))
                .collect(),
            required: !matches!(mark, Some('?' | '*')),
            repeated: matches!(mark, Some('*' | '+')),
        });
    }
    parts
}

fn is_valid(value: &str, kind: &str) -> bool {
    let trimmed = value.trim();
    match kind {
        "" => true,
        "b" => matches!(trimmed, "true" | "false" | "1" | "0"),
        "i" => trimmed.parse::<i32>().is_ok(),
        "u" => trimmed.parse::<u32>().is_ok(),
        "l" => trimmed.parse::<i64>().is_ok(),
        "L" => trimmed.parse::<u64>().is_ok(),
        "d" => is_double(trimmed),
        "D" => value.split_whitespace().all(is_double),
        "U" => value.split_whitespace().all(|word| word.parse::<u32>().is_ok()),
        "t" => is_time_stamp(trimmed),
        words => words.trim_matches(['[', ']']).split('|').any(|word| word == value),
    }
}

/// Values expected of a kind, in words.
fn expected(kind: &str) -> String {
    match kind {
        "b" => "true or false".to_owned(),
        "i" => "an integer of 32 bits".to_owned(),
        "u" => "an unsigned integer of 32 bits".to_owned(),
        "l" | "L" => "an integer of 64 bits".to_owned(),
        "d" => "a number such as 1.5e-3".to_owned(),
        "D" => "numbers such as 1.5e-3, separated by spaces,".to_owned(),
        "U" => "a list of unsigned integers, separated by spaces,".to_owned(),
        "t" => "a time such as 2026-01-31T12:00:00Z".to_owned(),
        words => format!("one of {}", words.trim_matches(['[', ']']).replace('|', ", ")),
    }
}

/// A number as XML schema writes it; `inf` and `infinity`, which Rust reads, are none.
fn is_double(text: &str) -> bool {
    let digits = text.bytes().all(|byte| byte.is_ascii_digit() || b"+-.eE".contains(&byte));
    matches!(text, "INF" | "-INF" | "NaN") || (digits && text.parse::<f64>().is_ok())
}

/// `2026-01-31T12:00:00`, with fraction and zone or without.
fn is_time_stamp(text: &str) -> bool {
    let Some((date, time)) = text.split_once('T') else { return false };
    let within = |text: &str, length: usize, from: u32, to: u32| {
        let digits = text.len() >= length && text.bytes().all(|byte| byte.is_ascii_digit());
        digits && text.parse::<u32>().is_ok_and(|number| (from..=to).contains(&number))
    };
    let date: Vec<&str> = date.strip_prefix('-').unwrap_or(date).split('-').collect();
    let (clock, zone) = time.split_at(time.find(['Z', '+', '-']).unwrap_or(time.len()));
    let (clock, fraction) = clock.split_once('.').map_or((clock, "0"), |(clock, fraction)| (clock, fraction));
    let clock: Vec<&str> = clock.split(':').collect();
    let zone: Vec<&str> = zone.trim_start_matches(['+', '-']).split(':').collect();
    matches!(date[..], [year, month, day] if within(year, 4, 0, u32::MAX) && within(month, 2, 1, 12) && within(day, 2, 1, 31))
        && matches!(clock[..], [hour, minute, second]
            if within(hour, 2, 0, 24) && within(minute, 2, 0, 59) && within(second, 2, 0, 59))
        && !fraction.is_empty()
        && fraction.bytes().all(|byte| byte.is_ascii_digit())
        && (matches!(zone[..], ["" | "Z"])
            || matches!(zone[..], [hour, minute] if within(hour, 2, 0, 14) && within(minute, 2, 0, 59)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn messages(text: &str, is_fmi3: bool) -> Vec<String> {
        let mut findings = Findings::default();
        check(&crate::xml::parse(text.as_bytes()).unwrap(), is_fmi3, &mut findings);
        findings.0.into_iter().map(|finding| format!("{}: {}", finding.element, finding.message)).collect()
    }

    #[test]
    fn every_type_that_the_tables_name_is_defined() {
        for table in [FMI2, FMI3] {
            let schema = Schema::new(table);
            assert!(schema.0.contains_key("fmiModelDescription"));
            for kind in schema.0.values() {
                for (_, inner) in kind.children.iter().flatten().flat_map(|part| &part.elements) {
                    assert!(schema.0.contains_key(inner), "{inner}");
                }
            }
        }
    }

    #[test]
    fn values_are_those_of_xml_schema() {
        for (kind, good, bad) in [
            ("d", &["1", "-1.5E+3", ".5", "INF", " 2 "][..], &["inf", "infinity", "1,5", "0x1", ""][..]),
            ("b", &["true", "0"], &["True", "yes", ""]),
            ("u", &["0", "4294967295"], &["-1", "4294967296", "1.0"]),
            ("U", &["", "1 2"], &["1,2", "1 -2"]),
            (
                "t",
                &["2026-01-31T12:00:00Z", "2026-01-31T12:00:00.5+01:00", "2026-01-31T12:00:00"],
                &[
                    "2026-01-31",
                    "31.1.2026",
                    "2026-13-01T00:00:00Z",
                    "2026-01-31 12:00:00",
                    "2026-01-31T12:00Z",
                ],
            ),
            ("[flat|structured]", &["flat"], &["Flat", "flat "]),
        ] {
            good.iter().for_each(|value| assert!(is_valid(value, kind), "{kind} {value}"));
            bad.iter().for_each(|value| assert!(!is_valid(value, kind), "{kind} {value}"));
        }
    }

    #[test]
    fn order_number_and_names_of_elements_are_judged() {
        let text = |inside: &str| {
            format!(
                "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"m\" guid=\"g\">{inside}</fmiModelDescription>"
            )
        };
        let sound = "<CoSimulation modelIdentifier=\"m\"/><ModelVariables><ScalarVariable name=\"a\" valueReference=\"0\"><Real/>\
                     </ScalarVariable></ModelVariables><ModelStructure/>";
        assert_eq!(messages(&text(sound), false), Vec::<String>::new());
        for (from, to, expected) in [
            ("<ModelStructure/>", "<ModelStructure/><DefaultExperiment/>", "stands behind ModelStructure"),
            ("<ModelStructure/>", "<ModelStructure/><ModelStructure/>", "one too many"),
            ("<ModelStructure/>", "", "no element ModelStructure"),
            ("<ModelStructure/>", "<ModelStructure><Outputs/></ModelStructure>", "no element Unknown"),
            ("<Real/>", "<Real colour=\"red\"/>", "no attribute colour"),
            ("<Real/>", "<Float64/>", "no element Float64"),
            ("<Real/>", "<Real/>text", "holds text"),
            (" valueReference=\"0\"", "", "valueReference is missing"),
        ] {
            let found = messages(&text(&sound.replace(from, to)), false);
            assert!(found.iter().any(|message| message.contains(expected)), "{expected}: {found:?}");
        }
    }
}
