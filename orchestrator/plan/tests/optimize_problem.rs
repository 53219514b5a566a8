//! Problem files against the system they name: names, units, conditions, and what is said where something is wrong.
#![cfg(target_os = "linux")]

use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::time::Instant;

use airloop_plan::file::{Source, parse};
use airloop_plan::prepare::{Prepared, prepare_statement};
use airloop_plan::task::{Signal, Term};
use airloop_plan::{Error, guess};

/// The folder of the example, when its FMUs are built.
fn example() -> Option<PathBuf> {
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    if project.join("target/fmu/cart-pole.fmu").exists() {
        return Some(project.join("examples/03_swing_up"));
    }
    eprintln!("skipped: target/fmu/cart-pole.fmu is not built (make fmu)");
    None
}

fn prepared(folder: &Path, text: &str) -> Result<Prepared, Error> {
    let source = Source { file: folder.join("problem.toml"), text: text.into() };
    prepare_statement(parse(source)?, Instant::now())
}

fn swing_up(folder: &Path) -> String {
    std::fs::read_to_string(folder.join("problem.toml")).unwrap()
}

fn index(names: &[String], name: &str) -> usize {
    names.iter().position(|one| one == name).unwrap_or_else(|| panic!("no {name} in {names:?}"))
}

#[test]
fn the_swing_up_has_six_states_and_its_conditions_in_si_units() {
    let Some(folder) = example() else { return };
    let found = prepared(&folder, &swing_up(&folder)).unwrap();
    let names = found.dynamics[0].names();
    assert_eq!(names.len(), 7, "{names:?}");
    let phase = &found.task.phases[0];
    let at = |name: &str| index(&names, name);
    assert_eq!(phase.duration, (2.0, 2.0));
    assert_eq!(phase.initial[at("x")], (0.0, 0.0));
    assert_eq!(phase.initial[at("actuator.z[1]")], (0.0, 0.0), "the start value of the FMU");
    assert_eq!(phase.terminal[at("theta")], (PI, PI));
    assert_eq!(phase.terminal[at("actuator.z[2]")], (f64::NEG_INFINITY, f64::INFINITY));
    assert_eq!(names[6], "u");
    let stroke = phase.path.iter().find(|path| path.limit.name == "stroke").unwrap();
    assert_eq!(stroke.limit.terms, [(Signal::State(at("x")), 1.0)]);
    assert!((stroke.limit.limits.1 - 0.15).abs() < 1e-15 && stroke.limit.limits.0 == -stroke.limit.limits.1);
    assert_eq!(phase.cost, [Term::Integral { signal: Signal::Input(0), reference: 0.0, weight: 1.0 }]);
    assert_eq!(found.sampled_states, [at("actuator.z[1]"), at("actuator.z[2]")]);
    assert_eq!(found.sampling.as_ref().unwrap().sample_time, 1e-3);
}

#[test]
fn states_come_in_the_order_that_is_asked_for() {
    let Some(folder) = example() else { return };
    let order = r#"["x", "theta", "v", "omega", "actuator.z[1]", "actuator.z[2]"]"#;
    let text = swing_up(&folder);
    assert!(text.contains(order));
    let names = prepared(&folder, &text).unwrap().dynamics[0].names();
    assert_eq!(names, ["x", "theta", "v", "omega", "actuator.z[1]", "actuator.z[2]", "u"]);
}

#[test]
fn guesses_are_lines_given_trajectories_and_earlier_results() {
    let Some(folder) = example() else { return };
    let found = prepared(&folder, &swing_up(&folder)).unwrap();
    let names = found.dynamics[0].names();
    let (x, theta) = (index(&names, "x"), index(&names, "theta"));
    let of = |choice: &guess::Choice| guess::guess(&found.statement, &found.catalog, &found.task, choice);
    let linear = of(&guess::choose(&found.statement, Some("linear")).unwrap()).unwrap();
    assert!((linear.states(0.25)[theta] - 0.25 * PI).abs() < 1e-12);
    let pump = of(&guess::choose(&found.statement, None).unwrap()).unwrap();
    assert!((pump.states(0.13)[theta] + 0.3).abs() < 1e-12 && pump.states(0.3)[x] == 0.0);
    assert!((pump.states(0.415)[theta] + 0.3).abs() < 1e-12, "half-way from 0.7 to -1.3");
    let scratch = tempfile::tempdir().unwrap();
    let file = scratch.path().join("earlier.csv");
    std::fs::write(&file, "time,theta,u\n0,0,0\n2,1,4\n").unwrap();
    let earlier = of(&guess::choose(&found.statement, file.to_str()).unwrap()).unwrap();
    assert!((earlier.states(0.5)[theta] - 0.5).abs() < 1e-12 && (earlier.inputs(0.5)[0] - 2.0).abs() < 1e-12);
    assert!(earlier.notes[0].contains("`x`"), "{:?}", earlier.notes);
    std::fs::write(&file, "time,theta,u\n0,0,0\n1.5,1,4\n").unwrap();
    let message = of(&guess::Choice::File(file)).unwrap_err().to_string();
    assert!(message.contains("1.5 s") && message.contains("2 s"), "{message}");
    let message = guess::choose(&found.statement, Some("pmup")).unwrap_err().to_string();
    assert!(message.contains("did you mean `pump`"), "{message}");
}

/// The message where `from` in the example is replaced by `to`.
fn wrong(folder: &Path, from: &str, to: &str) -> String {
    let text = swing_up(folder);
    assert!(text.contains(from), "{from}");
    match prepared(folder, &text.replacen(from, to, 1)) {
        Ok(_) => panic!("{to} is accepted"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn what_does_not_fit_the_system_is_named_with_its_place_and_what_was_meant() {
    let Some(folder) = example() else { return };
    let cases = [
        ("theta = \"180 deg\"", "tetha = \"180 deg\"", "did you mean `theta`"),
        (
            "\"180 deg\"",
            "\"180 mm\"",
            "`mm` is not a unit for `theta`; `theta` is in `rad`; write it in `rad` or `deg`",
        ),
        ("\"-150 mm\"", "\"-150 furlong\"", "the unit `furlong` is not known"),
        ("\"-150 mm\"", "\"200 mm\"", "lies above the upper bound"),
        ("integral = \"u\"", "integral = \"actuator.F_hatt\"", "F_hat`"),
        ("duration = \"2 s\"", "duration = \"-2 s\"", "longer than 0 s"),
        ("duration = \"2 s\"", "duration = \"2 m\"", "the unit is none of s"),
        ("duration = \"2 s\"", "duration = { min = 2, max = 1, guess = 2 }", "below the shortest"),
        ("../01_run/system.ssd", "../01_run/sytsem.ssd", "there is no file"),
        ("intervals = 100", "intervals = 100\nsampled = [\"actuatr\"]", "did you mean `actuator`"),
        ("[settings]", "[parameters]\n\"cart_pole.mass\" = 1\n[settings]", "there is no variable `mass`"),
        ("[settings]", "[rates]\nx = 1\n[settings]", "only inputs have rates"),
        ("[settings]", "[rates]\nu = \"500 N\"\n[settings]", "500 N/s"),
        ("name = \"swing-up", "inputs = [\"x\"]\nname = \"swing-up", "`x` is not an input"),
        ("states = [\"x\", \"theta\"", "states = [\"theta\"", "add it to the list"),
    ];
    for (from, to, words) in cases {
        let message = wrong(&folder, from, to);
        assert!(message.contains(words), "{to}\n{message}");
        let named = ["column", "line", "add it to the list"];
        assert!(named.iter().any(|word| message.contains(word)), "{message}");
    }
}
