//! The layers of the library: a module uses modules of lower lines only, those of one line do not use each other.

use std::fs;
use std::path::{Path, PathBuf};

/// The house plan, lowest line first; modules that do not exist yet have their place already.
const LAYERS: [&[&str]; 9] = [
    &["series", "linalg", "units", "xml"],
    &["fmu", "optim", "results", "excite"],
    &["system", "ident", "transcription"],
    &["master", "coupled", "control"],
    &["plan", "discrepancy", "refine", "rig"],
    &["plot"],
    &["report"],
    &["error"],
    &["cli"],
];

fn layer(module: &str) -> Option<usize> {
    LAYERS.iter().position(|line| line.contains(&module))
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
}

/// Modules named in `crate::name`, `crate::{a, b}` and grouped uses, outside comments and test modules.
fn used(text: &str) -> Vec<String> {
    let code: String = text
        .lines()
        .take_while(|line| line.trim() != "#[cfg(test)]")
        .map(|line| line.split("//").next().unwrap_or("").to_owned() + "\n")
        .collect();
    let identifier = |text: &str| -> String {
        text.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
    };
    code.split("crate::")
        .skip(1)
        .flat_map(|part| match part.strip_prefix('{') {
            Some(group) => entries(group).iter().map(|entry| identifier(entry)).collect(),
            None => vec![identifier(part)],
        })
        .filter(|name| !name.is_empty())
        .collect()
}

/// Entries of a group up to its closing brace: `a, b::{c, d}}` gives `a` and `b::{c, d}`.
fn entries(group: &str) -> Vec<String> {
    let (mut depth, mut found) = (0, vec![String::new()]);
    for c in group.chars() {
        match c {
            '}' if depth == 0 => break,
            ',' if depth == 0 => {
                found.push(String::new());
                continue;
            }
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        found.last_mut().unwrap().push(c);
    }
    found
}

/// What is wrong with the uses of a module, one sentence each.
fn violations(module: &str, text: &str) -> Vec<String> {
    let Some(own) = layer(module) else { return vec![format!("`{module}` has no place in the layers")] };
    let mut found = Vec::new();
    for name in used(text) {
        if name == module {
            continue;
        }
        // The crate root re-exports the error of layer 6.
        let name = if name == "Error" { "error".to_owned() } else { name };
        match layer(&name) {
            Some(other) if other >= own => {
                found.push(format!("`{module}` (layer {own}) uses `{name}` (layer {other})"));
            }
            _ => {}
        }
    }
    if text.contains("super::super::") {
        found.push(format!("`{module}` uses super::super::, which this test cannot follow"));
    }
    found
}

#[test]
fn modules_use_lower_layers_only() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    assert!(files.len() > 20, "the sources were not found");
    let mut found = Vec::new();
    for file in files {
        let inside = file.strip_prefix(&root).unwrap();
        let first = inside.components().next().unwrap().as_os_str().to_string_lossy();
        let module = first.trim_end_matches(".rs");
        if matches!(module, "lib" | "main") {
            continue;
        }
        let text = fs::read_to_string(&file).unwrap();
        found.extend(
            violations(module, &text).into_iter().map(|what| format!("{}: {what}", inside.display())),
        );
    }
    assert!(found.is_empty(), "\n{}", found.join("\n"));
}

#[test]
fn an_upward_use_is_found() {
    let upward = "`fmu` (layer 1) uses `system` (layer 2)";
    assert_eq!(violations("fmu", "use crate::system::SystemGraph;\n"), [upward]);
    assert_eq!(violations("fmu", "fn f(x: &crate::system::Error) {}\n"), [upward]);
    assert_eq!(violations("fmu", "use crate::{units, system::graph};\n"), [upward]);
    assert_eq!(violations("fmu", "use crate::{series::{csv, Error}, system};\n"), [upward]);
    assert_eq!(violations("results", "use crate::fmu::Fmu;\n"), ["`results` (layer 1) uses `fmu` (layer 1)"]);
    assert_eq!(violations("plot", "use crate::Error;\n"), ["`plot` (layer 5) uses `error` (layer 7)"]);
    assert!(violations("fmu", "use crate::units::Unit;\n// crate::system is above\n").is_empty());
    assert!(violations("fmu", "use super::archive;\nuse crate::fmu::Fmu;\n").is_empty());
    assert_eq!(violations("helpers", ""), ["`helpers` has no place in the layers"]);
}
