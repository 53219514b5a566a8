//! The problem files of example 04 against the systems that they name, and what is said about wrong ones.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::time::Instant;

use airloop_plan::file::{Source, parse};
use airloop_plan::prepare::{Prepared, prepare_statement};

fn example() -> Option<PathBuf> {
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    if project.join("target/fmu/compass-gait.fmu").exists() {
        return Some(project.join("examples/04_half_step"));
    }
    eprintln!("skipped: target/fmu/compass-gait.fmu is not built (make fmu)");
    None
}

fn prepared(folder: &Path, text: &str) -> Result<Prepared, airloop_plan::Error> {
    let source = Source { file: folder.join("problem.toml"), text: text.into() };
    prepare_statement(parse(source)?, Instant::now())
}

fn text(folder: &Path, file: &str) -> String {
    std::fs::read_to_string(folder.join(file)).unwrap()
}

#[test]
fn all_variants_have_three_phases_with_an_impact_between_the_first_two() {
    let Some(folder) = example() else { return };
    for (file, states, inputs) in [("problem.toml", 15, 3), ("variant_a.toml", 12, 3), ("joint.toml", 19, 3)]
    {
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
    assert!(state.contains("tau") && state.contains("not a state"), "{state}");
    let mode = message("parameters = { \"contact_mode\" = 3 }", "parameters = { \"contact_mode\" = 7 }");
    assert!(mode.contains("contact_mode") && mode.contains('7'), "{mode}");
    let first = message("[phase.initial]", "[phase.reset]\nstates = { vx = \"after.vx\" }\n[phase.initial]");
    assert!(first.contains("first phase"), "{first}");
}

#[test]
fn a_start_in_the_ground_is_refused_with_phase_foot_and_depth() {
    let Some(folder) = example() else { return };
    let right = text(&folder, "problem.toml");
    airloop_plan::start::check(&prepared(&folder, &right).unwrap().setup).unwrap();
    let wrong = right.replacen("\"walker.y\" = 1.045", "\"walker.y\" = 1.0", 1);
    let refused = airloop_plan::start::check(&prepared(&folder, &wrong).unwrap().setup);
    let message = refused.unwrap_err().to_string();
    for part in ["swing of leg 2", "foot 1", "below the ground", "-0.04499"] {
        assert!(message.contains(part), "{part}: {message}");
    }
}

#[test]
fn a_leg_without_length_makes_a_singular_contact_that_is_named() {
    let Some(folder) = example() else { return };
    let mut found = prepared(&folder, &text(&folder, "problem.toml")).unwrap();
    let size = found.dynamics[1].size();
    let (states, inputs) = (vec![0.0; size.states], vec![0.0; size.inputs]);
    let at = airloop_ocp::transcription::Point { time: 0.0, states: &states, inputs: &inputs };
    let message = found.dynamics[1].evaluate(at, &mut vec![0.0; size.values()]).unwrap_err().to_string();
    assert!(message.contains("both feet") && message.contains("singular"), "{message}");
}

#[test]
fn phases_cannot_be_stabilized_without_their_guards_and_modes() {
    let Some(folder) = example() else { return };
    let settings = text(&folder, "stabilize.toml");
    let message = |from: &str, to: &str| {
        assert!(settings.contains(from), "{from}");
        let source = Source { file: "stabilize.toml".into(), text: settings.replacen(from, to, 1) };
        let settings = match airloop_plan::stabilize::settings::parse(source) {
            Ok(settings) => settings,
            Err(error) => return error.to_string(),
        };
        let mut prepared = prepared(&folder, &text(&folder, "problem.toml")).unwrap();
        let trajectory = plan(&prepared);
        let file = PathBuf::from("trajectory.csv");
        let interpolation = airloop_series::Interpolation::Linear;
        let plan = airloop_plan::stabilize::Plan { trajectory: &trajectory, file: &file, interpolation };
        airloop_plan::stabilize::stabilize(&mut prepared, plan, &settings).unwrap_err().to_string()
    };
    assert!(message("[phases]", "[phase]").contains("phase"));
    let one = message("guards = [\"walker.foot2.y\", \"walker.foot1.fn\"]", "guards = [\"walker.foot2.y\"]");
    assert!(one.contains("1 guards for 3 phases"), "{one}");
    let unknown = message("guards = [\"walker.foot2.y\"", "guards = [\"walker.energy\"");
    assert!(unknown.contains("not an output that the problem names"), "{unknown}");
    let nowhere = message("guards = [\"walker.foot2.y\"", "guards = [\"walker.foot3.y\"");
    assert!(nowhere.contains("walker.foot3.y") && nowhere.contains("walker.foot2.y"), "{nowhere}");
    let modes = message("modes = [2, 4, 3]", "modes = [2, 4]");
    assert!(modes.contains("2 modes for 3 phases"), "{modes}");
    let real = message("mode = \"walker.mode\"", "mode = \"walker.energy\"");
    assert!(real.contains("not an Integer or enumeration"), "{real}");
}

/// Six rows at the initial pose, two per phase: enough for everything that is looked up before the design.
fn plan(prepared: &Prepared) -> airloop_series::TimeSeries {
    let time = (0..6).map(|row| 0.01 * f64::from(row)).collect();
    let mut series = airloop_series::TimeSeries::new(time).unwrap();
    let (signals, variables) = (&prepared.task.signals, prepared.catalog.variables());
    for (&index, (start, _)) in signals.states.iter().zip(&prepared.task.phases[0].initial) {
        series.push(variables[index].name.clone(), None, vec![*start; 6]).unwrap();
    }
    for &index in &signals.inputs {
        series.push(variables[index].name.clone(), None, vec![0.0; 6]).unwrap();
    }
    series.push("phase", None, vec![1.0, 1.0, 2.0, 2.0, 3.0, 3.0]).unwrap();
    series
}
