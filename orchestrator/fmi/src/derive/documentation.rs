//! `documentation/index.html` of a derived FMU: the page of its template, under a section on what the derived one has
//! of its own.

use super::{Derivation, Start};
use crate::{ModelDescription, VariableKind};

const OPEN: &str = "<section id=\"derived\">";
const CLOSE: &str = "</section>";

/// The page; `template` is that of the template, where it has one.
pub(super) fn page(
    derivation: &Derivation,
    start: &[Start],
    description: &ModelDescription,
    template: Option<&str>,
) -> String {
    let name = escape(&derivation.name);
    let template = template.map_or_else(
        || format!("<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{name}</title></head>\n<body></body></html>\n"),
        without_section,
    );
    // Behind the opening tag of the body, whatever attributes it has.
    let place = template.find("<body").and_then(|at| Some(at + template[at..].find('>')? + 1)).unwrap_or(0);
    let section = section(derivation, start, description);
    format!("{}\n{section}{}", &template[..place], &template[place..])
}

/// The page of a template that is derived itself, without the section about that.
fn without_section(page: &str) -> String {
    let Some((before, rest)) = page.split_once(OPEN) else { return page.to_owned() };
    let after = rest.split_once(CLOSE).map_or("", |(_, after)| after);
    format!("{}{}", before.trim_end_matches('\n'), after.strip_prefix('\n').unwrap_or(after))
}

fn section(derivation: &Derivation, start: &[Start], description: &ModelDescription) -> String {
    let rows: String = start
        .iter()
        .map(|(position, value)| {
            let variable = &description.variables[*position];
            let unit = match &variable.kind {
                VariableKind::Real(real) => real.unit.as_deref().unwrap_or_default(),
                _ => "",
            };
            format!(
                "<tr><td><code>{}</code></td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                escape(&variable.name),
                escape(&value.to_string()),
                escape(unit),
                escape(&variable.description)
            )
        })
        .collect();
    let (name, about) = (escape(&derivation.name), escape(&derivation.description));
    format!(
        "{OPEN}\n<h1>{name}</h1>\n<p>{about}</p>\n<p>A derived FMU: the model below with these start values instead of \
         those below.</p>\n<table>\n<tr><th>variable</th><th>start</th><th>unit</th><th>meaning</th></tr>\n{rows}\
         </table>\n{CLOSE}\n"
    )
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
