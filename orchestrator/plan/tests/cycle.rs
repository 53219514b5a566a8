//! The problem file of example 10, whose motion repeats itself, and what is said about wrong ones.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::time::Instant;

use airloop_ocp::transcription::Reset;
use airloop_plan::file::{Source, parse};
use airloop_plan::prepare::{Prepared, prepare_statement};

fn example() -> Option<PathBuf> {
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    if project.join("target/fmu/compass-gait.fmu").exists() {
        return Some(project.join("examples/10_cycle"));
    }
    eprintln!("skipped: target/fmu/compass-gait.fmu is not built (make fmu)");
    None
}

fn prepared(folder: &Path, text: &str) -> Result<Prepared, airloop_plan::Error> {
    let source = Source { file: folder.join("problem.toml"), text: text.into() };
    prepare_statement(parse(source)?, Instant::now())
}

#[test]
fn the_return_is_an_impact_with_the_legs_exchanged() {
    let Some(folder) = example() else { return };
    let text = std::fs::read_to_string(folder.join("problem.toml")).unwrap();
    let found = prepared(&folder, &text).unwrap();
    let cycle = found.cycle.as_ref().unwrap();
    let names: Vec<&str> =
        found.task.signals.states.iter().map(|&i| found.catalog.variables()[i].name.as_str()).collect();
    let at = |name: &str| names.iter().position(|own| *own == name).unwrap();
    assert_eq!(cycle.states[at("forces.x[1]")], (at("forces.x[1]"), -1.0));
    assert_eq!(cycle.states[at("walker.th1")], (at("walker.th2"), 1.0));
    assert_eq!(
        (&cycle.free[..], &cycle.inputs[..]),
        (&[at("walker.x")][..], &[(0, -1.0), (2, 1.0), (1, 1.0)][..])
    );
    // The first phase has no state of the start values: they return.
    assert!(found.task.phases[0].initial.iter().all(|(low, high)| low.is_infinite() && high.is_infinite()));
    let mut reset = cycle.reset().unwrap();
    let size = reset.size();
    let mut before = vec![0.0; size.before];
    (before[at("walker.y")], before[at("walker.l1")], before[at("walker.l2")]) = (1.0, 1.0, 1.01);
    let mut after = vec![0.0; size.after + size.outputs];
    reset.evaluate(&before, &mut after).unwrap();
    assert_eq!((after[at("walker.l1")], after[at("walker.l2")]), (1.01, 1.0));
}

#[test]
fn wrong_cycles_are_named_with_their_place() {
    let Some(folder) = example() else { return };
    let right = std::fs::read_to_string(folder.join("problem.toml")).unwrap();
    let message = |from: &str, to: &str| {
        assert!(right.contains(from), "{from}");
        prepared(&folder, &right.replacen(from, to, 1)).err().expect("refused").to_string()
    };
    let unknown = message("\"walker.th1\" = \"walker.th2\"", "\"walker.th1\" = \"walker.th3\"");
    assert!(unknown.contains("walker.th3") && unknown.contains("line"), "{unknown}");
    let twice = message("\"walker.th1\" = \"walker.th2\"", "\"walker.th1\" = \"walker.l1\"");
    assert!(twice.contains("two states of the next turn"), "{twice}");
    let input = message("\"walker.th1\" = \"walker.th2\"", "\"walker.th1\" = \"tau_rate\"");
    assert!(input.contains("`tau_rate` is no state"), "{input}");
    let free = message("free = [\"walker.x\"]", "free = [\"walker.th1\"]");
    assert!(free.contains("`walker.th1` is free and has a new place"), "{free}");
    let output = message("free = [\"walker.x\"]", "free = [\"walker.foot1.x\"]");
    assert!(output.contains("only states return"), "{output}");
    let without = right.replace("[cycle", "[elcyc");
    assert!(prepared(&folder, &without).err().expect("refused").to_string().contains("elcyc"));
}
