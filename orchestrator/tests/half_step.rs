//! The problem files of example 04 against the systems that they name, and what is said about wrong ones.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::time::Instant;

use airloop::plan::file::{Source, parse};
use airloop::plan::prepare::{Prepared, prepare_statement};

fn example() -> Option<PathBuf> {
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    if project.join("target/fmu/compass-gait.fmu").exists() {
        return Some(project.join("examples/04_half_step"));
    }
    eprintln!("skipped: target/fmu/compass-gait.fmu is not built (make fmu)");
    None
}

fn prepared(folder: &Path, text: &str) -> Result<Prepared, airloop::plan::Error> {
    let source = Source { file: folder.join("problem.toml"), text: text.into() };
    prepare_statement(parse(source)?, Instant::now())
}

fn text(folder: &Path, file: &str) -> String {
    std::fs::read_to_string(folder.join(file)).unwrap()
}

#[test]
fn both_variants_have_three_phases_with_an_impact_between_the_first_two() {
    let Some(folder) = example() else { return };
    for (file, states, inputs) in [("problem.toml", 15, 3), ("variant_a.toml", 12, 3)] {
        let found = prepared(&folder, &text(&folder, file)).unwrap();
        assert_eq!(found.dynamics.len(), 3);
        assert!(found.resets[0].is_some() && found.resets[1].is_none());
        let size = found.dynamics[0].size();
        assert_eq!((size.states, size.inputs), (states, inputs), "{file}");
    }
}

#[test]
fn wrong_resets_are_named_with_their_place() {
    let Some(folder) = example() else { return };
    let right = text(&folder, "variant_a.toml");
    let message = |from: &str, to: &str| {
        assert!(right.contains(from), "{from}");
        let found = prepared(&folder, &right.replacen(from, to, 1));
        found.err().expect("refused").to_string()
    };
    let unknown = message("\"after.vx\"", "\"after.vxx\"");
    assert!(unknown.contains("after.vxx") && unknown.contains("after.vx"), "{unknown}");
    let input = message("\"vx\" = \"after.vx\"", "\"vx\" = \"tau\"");
    assert!(input.contains("tau") && input.contains("input"), "{input}");
    let state = message("\"vx\" = \"after.vx\"", "\"tau\" = \"after.vx\"");
    assert!(state.contains("tau") && state.contains("no state"), "{state}");
    let mode = message("parameters = { \"contact_mode\" = 3 }", "parameters = { \"contact_mode\" = 7 }");
    assert!(mode.contains("contact_mode") && mode.contains('7'), "{mode}");
    let first = message("[phase.initial]", "[phase.reset]\nstates = { vx = \"after.vx\" }\n[phase.initial]");
    assert!(first.contains("first phase"), "{first}");
}
