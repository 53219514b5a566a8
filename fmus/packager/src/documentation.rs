//! `documentation/index.html`: the README of the FMU and the table of its variables.

use airloop_models::registry::Entry;
use fmi_export::description::{causality, escape, number, variability};
use fmi_export::{Kind, Table, Variable};
use pulldown_cmark::{Options, Parser, html};

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222}\
table{border-collapse:collapse;margin:1rem 0}th,td{border:1px solid #ccc;padding:.2rem .6rem;text-align:left}\
th{background:#f3f5f7}pre{background:#f3f5f7;padding:.8rem 1rem;overflow-x:auto}img{float:right;width:8rem}";

/// The page as HTML.
pub fn page(entry: &Entry, table: &Table) -> String {
    let mut readme = String::new();
    html::push_html(&mut readme, Parser::new_ext(entry.readme, Options::ENABLE_TABLES));
    let rows: String = table.variables().iter().map(|v| row(v, table)).collect();
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{name}</title>\n\
         <style>{STYLE}</style>\n</head>\n<body>\n<img src=\"../model.png\" alt=\"\">\n{readme}\
         <h2>All variables</h2>\n<table>\n<tr><th>name</th><th>type</th><th>causality</th><th>variability</th>\
         <th>unit</th><th>start</th><th>range</th><th>description</th></tr>\n{rows}</table>\n\
         <p>Version {version}. Licenses: <a href=\"licenses/LICENSE-MIT.txt\">MIT</a> or \
         <a href=\"licenses/LICENSE-APACHE.txt\">Apache 2.0</a>.</p>\n</body>\n</html>\n",
        name = escape(entry.identity.model_name),
        version = escape(entry.identity.version),
    )
}

fn row(v: &Variable, table: &Table) -> String {
    let range = |min: Option<String>, max: Option<String>| match (min, max) {
        (None, None) => String::new(),
        (min, max) => format!("{} .. {}", min.unwrap_or_default(), max.unwrap_or_default()),
    };
    let (kind, start, range) = match &v.kind {
        Kind::Real { start, min, max, .. } => {
            ("Real", start.map(number), range(min.map(number), max.map(number)))
        }
        Kind::Integer { start, min, max, .. } => (
            "Integer",
            start.map(|x| x.to_string()),
            range(min.map(|x| x.to_string()), max.map(|x| x.to_string())),
        ),
        Kind::Boolean { start, .. } => ("Boolean", start.map(|x| x.to_string()), String::new()),
        Kind::Text { start, .. } => ("String", start.clone(), String::new()),
        Kind::Enumeration { start, enumeration, .. } => {
            let items = table.enumerations()[*enumeration].items.iter().enumerate();
            let items: Vec<String> = items.map(|(i, (name, _))| format!("{} {name}", i + 1)).collect();
            ("Enumeration", start.map(|x| x.to_string()), items.join(", "))
        }
    };
    let cells = [
        format!("<code>{}</code>", escape(&v.name)),
        kind.to_owned(),
        causality(v.causality).to_owned(),
        variability(v.variability).to_owned(),
        escape(v.unit.unwrap_or_default()),
        escape(&start.unwrap_or_default()),
        escape(&range),
        escape(&v.description),
    ];
    let cells: String = cells.iter().map(|c| format!("<td>{c}</td>")).collect();
    format!("<tr>{cells}</tr>\n")
}

#[cfg(test)]
mod tests {
    use airloop_models::registry;

    #[test]
    fn page_has_equations_and_every_variable() {
        for entry in registry::all() {
            let table = (entry.table)();
            let page = super::page(&entry, &table);
            assert!(page.contains("<pre><code>"), "{}: no equation", entry.identity.model_name);
            assert!(page.matches("<table>").count() >= 2, "{}", entry.identity.model_name);
            for variable in table.variables() {
                let cell = format!("<code>{}</code></td>", variable.name);
                assert!(page.contains(&cell), "{}", variable.name);
            }
        }
    }

    #[test]
    fn readme_names_every_variable_of_a_shipped_fmu() {
        for entry in registry::all().iter().filter(|e| e.shipped) {
            let table = (entry.table)();
            for variable in table.variables() {
                // Vectors and matrices are named by their first element.
                let name = variable.name.trim_start_matches("der(").split(['[', ')']).next().expect("a name");
                let family = name.trim_end_matches(|c: char| c.is_ascii_digit());
                let named = [name, family].iter().any(|n| entry.readme.contains(&format!("`{n}")));
                assert!(named, "{}: README does not name {name}", entry.identity.model_name);
            }
        }
    }
}
