//! Algebraic loops at the communication points of the masters that step, through the library and the binary.
#![cfg(target_os = "linux")]

use std::path::Path;
use std::process::{Command, Output};
use std::sync::atomic::AtomicBool;

use airloop_cosim::master::simulate::{End, Run, Watch, run};
use airloop_cosim::master::{Adaptive, Algorithm, Error, Settings};
use airloop_cosim::system::SystemGraph;
use airloop_series::csv;
use airloop_testing::looped::{ABLE, Abilities, fmu, system};
use tempfile::TempDir;

const STEPPING: [Algorithm; 3] = [Algorithm::GaussSeidel, Algorithm::Jacobi, Algorithm::InterfaceJacobian];

fn simulate(graph: &SystemGraph, settings: &Settings) -> Result<Run, Error> {
    let stop = AtomicBool::new(false);
    run(graph, settings, None, Watch { stop: &stop, progress: &mut |_, _| {} })
}

fn completed(graph: &SystemGraph, settings: &Settings) -> Run {
    let run = simulate(graph, settings).unwrap();
    assert!(matches!(run.end, End::Completed), "{:?}", run.end);
    run
}

fn values<'a>(run: &'a Run, name: &str) -> &'a [f64] {
    &run.result.channel(name).unwrap_or_else(|| panic!("no column {name}")).values
}

fn graph(path: &Path, set: &[(&str, &str)]) -> SystemGraph {
    let mut graph = SystemGraph::open(path).unwrap();
    set.iter().for_each(|(name, value)| graph.set_start(name, value, "test").unwrap());
    graph
}

/// a.u = -0.8 b.y + 0.4, b.u = a.y, with y = tanh(3 u) / 2 replaced by y = gain u + bend tanh(u).
const STATIC: [(&str, &str); 4] = [("a.gain", "0.5"), ("a.bend", "2"), ("b.gain", "1"), ("b.bend", "-0.5")];

fn static_loop(folder: &TempDir, fmus: [&str; 2]) -> SystemGraph {
    let components = [("a", fmus[0]), ("b", fmus[1])];
    let path = system(folder, &components, &[("b.y", "a.u", -0.8, 0.4), ("a.y", "b.u", 1.0, 0.0)]);
    graph(&path, &STATIC)
}

/// a.u of the static loop, by bisection.
fn static_solution() -> f64 {
    let y = |gain: f64, bend: f64, u: f64| gain * u + bend * u.tanh();
    let rest = |u: f64| -0.8 * y(1.0, -0.5, y(0.5, 2.0, u)) + 0.4 - u;
    let (mut low, mut high) = (-1.0, 1.0);
    assert!(rest(low) > 0.0 && rest(high) < 0.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if rest(middle) > 0.0 { low = middle } else { high = middle }
    }
    low
}

fn settings(algorithm: Algorithm) -> Settings {
    Settings { stop_time: 0.5, step_size: 0.1, algorithm, ..Settings::default() }
}

/// Rows in which the loop does not hold: a.y and b.y against each other.
fn check_static(run: &Run, tolerance: f64) {
    let u = static_solution();
    let (a, b) = (0.5 * u + 2.0 * u.tanh(), (u - 0.4) / -0.8);
    for (name, expected) in [("a.y", a), ("b.y", b)] {
        let found = values(run, name);
        assert_eq!(found.len(), 6);
        let error = found.iter().map(|y| (y - expected).abs()).fold(0.0, f64::max);
        assert!(error < tolerance, "{name}: {error:e}");
    }
}

#[test]
fn a_static_loop_holds_in_every_row_of_every_master() {
    let folder = TempDir::new().unwrap();
    fmu(&folder, "able.fmu", ABLE);
    fmu(&folder, "plain.fmu", Abilities { derivatives: false, states: false, model_exchange: false, ..ABLE });
    for fmus in [["able.fmu", "able.fmu"], ["able.fmu", "plain.fmu"]] {
        let graph = static_loop(&folder, fmus);
        for algorithm in STEPPING {
            // Without directional derivatives, a block with a state cannot be coupled by its Jacobian.
            if algorithm == Algorithm::InterfaceJacobian && fmus[1] == "plain.fmu" {
                continue;
            }
            let run = completed(&graph, &settings(algorithm));
            check_static(&run, 1e-12);
            assert_eq!(run.notes[0], "an algebraic loop is solved for a.u, b.u");
            let approximated = run.notes.iter().filter(|note| note.contains("finite differences")).count();
            assert_eq!(approximated, usize::from(fmus[1] == "plain.fmu"));
            let steps = if algorithm == Algorithm::InterfaceJacobian { 10 } else { 5 };
            assert_eq!(run.effort.fmu_steps, [steps, steps], "{algorithm}");
        }
    }
}

#[test]
fn slaves_that_compute_in_steps_only_are_solved_over_the_step() {
    let folder = TempDir::new().unwrap();
    fmu(&folder, "able.fmu", ABLE);
    for flag in ["STALE", "STRICT"] {
        fmu(&folder, "deaf.fmu", Abilities { flag, ..ABLE });
        let graph = static_loop(&folder, ["able.fmu", "deaf.fmu"]);
        for algorithm in [Algorithm::GaussSeidel, Algorithm::Jacobi] {
            let run = completed(&graph, &settings(algorithm));
            check_static(&run, 1e-10);
            assert!(
                run.notes[0].contains("over the communication step for a.u, b.u")
                    && run.notes[0].contains("`b`"),
                "{:?}",
                run.notes
            );
            // Nothing changes, so that nothing is repeated.
            assert_eq!(run.effort.fmu_steps, [5, 5]);
        }
    }
}

#[test]
fn what_cannot_be_solved_is_refused_with_component_loop_and_remedy() {
    let folder = TempDir::new().unwrap();
    let deaf = Abilities { flag: "STALE", ..ABLE };
    fmu(&folder, "able.fmu", ABLE);
    fmu(&folder, "deaf.fmu", deaf);
    fmu(&folder, "stuck.fmu", Abilities { states: false, ..deaf });
    fmu(&folder, "alone.fmu", Abilities { states: false, model_exchange: false, ..deaf });
    fmu(&folder, "stateless.fmu", Abilities { states: false, ..ABLE });
    let refused = |fmus: [&str; 2], settings: &Settings, words: &[&str]| {
        let message = simulate(&static_loop(&folder, fmus), settings).unwrap_err().to_string();
        for word in ["the algebraic loop b.y -> a.u -> a.y -> b.u -> b.y;"].iter().chain(words) {
            assert!(message.contains(word), "{word}: {message}");
        }
    };
    let plain = settings(Algorithm::GaussSeidel);
    refused(["able.fmu", "stuck.fmu"], &plain, &["component `b`", "canGetAndSetFMUstate", "monolithic"]);
    refused(["able.fmu", "alone.fmu"], &plain, &["component `b`", "a delay or a filter"]);
    refused(["stateless.fmu", "deaf.fmu"], &plain, &["component `a` cannot save", "`b` only lets"]);
    let coupled = settings(Algorithm::InterfaceJacobian);
    refused(["able.fmu", "deaf.fmu"], &coupled, &["component `b`", "--master gauss-seidel"]);
    let adaptive = Settings { adaptive: Some(Adaptive::default()), ..plain };
    refused(["able.fmu", "deaf.fmu"], &adaptive, &["component `b`", "--adaptive"]);
    let extrapolated = Settings { extrapolation: 1, ..plain };
    refused(["able.fmu", "deaf.fmu"], &extrapolated, &["component `b`", "--extrapolation"]);
}

/// a: y = 0.5 u + x, dx/dt = 2 (u - x); b: y = 0.25 u + x, dx/dt = u - x; a.u = b.y + 1, b.u = -a.y, from rest.
fn dynamic_loop(folder: &TempDir, fmus: [&str; 2]) -> SystemGraph {
    let components = [("a", fmus[0]), ("b", fmus[1])];
    let path = system(folder, &components, &[("b.y", "a.u", 1.0, 1.0), ("a.y", "b.u", -1.0, 0.0)]);
    let set = [
        ("a.gain", "0.5"),
        ("a.share", "1"),
        ("a.rate", "2"),
        ("b.gain", "0.25"),
        ("b.share", "1"),
        ("b.rate", "1"),
    ];
    graph(&path, &set)
}

/// States of the dynamic loop at `t`, by Heun's method with Richardson extrapolation after the loop was solved by hand.
fn dynamic_states(t: f64) -> [f64; 2] {
    // a.u = u, b.u = w: u = w / 4 + xb + 1, w = -(u / 2 + xa).
    let rates = |[xa, xb]: [f64; 2]| {
        let u = (xb + 1.0 - 0.25 * xa) / 1.125;
        let w = -(0.5 * u + xa);
        [2.0 * (u - xa), w - xb]
    };
    let heun = |count: u32| {
        let h = t / f64::from(count);
        (0..count).fold([0.0; 2], |x, _| {
            let k = rates(x);
            let l = rates([x[0] + h * k[0], x[1] + h * k[1]]);
            [0, 1].map(|i| x[i] + 0.5 * h * (k[i] + l[i]))
        })
    };
    let (coarse, fine) = (heun(4000), heun(8000));
    [0, 1].map(|i| (4.0 * fine[i] - coarse[i]) / 3.0)
}

fn state_error(run: &Run) -> f64 {
    let expected = dynamic_states(1.0);
    let found = ["a.x", "b.x"].map(|name| *values(run, name).last().unwrap());
    (found[0] - expected[0]).abs().max((found[1] - expected[1]).abs())
}

/// Largest violation of the loop in any row.
fn violation(run: &Run) -> f64 {
    let [ya, xa, yb, xb] = ["a.y", "a.x", "b.y", "b.x"].map(|name| values(run, name));
    let rest = |row: usize| {
        let (u, w) = (yb[row] + 1.0, -ya[row]);
        (ya[row] - (0.5 * u + xa[row])).abs().max((yb[row] - (0.25 * w + xb[row])).abs())
    };
    (0..ya.len()).map(rest).fold(0.0, f64::max)
}

#[test]
fn loops_through_states_converge_with_the_order_of_their_master_and_hold_in_every_row() {
    let folder = TempDir::new().unwrap();
    fmu(&folder, "able.fmu", ABLE);
    fmu(&folder, "deaf.fmu", Abilities { flag: "STRICT", ..ABLE });
    let errors = |graph: &SystemGraph, algorithm: Algorithm| {
        [0.02, 0.01].map(|step_size| {
            let settings = Settings { stop_time: 1.0, step_size, algorithm, ..Settings::default() };
            let run = completed(graph, &settings);
            assert!(violation(&run) < 1e-10, "{algorithm}: {:e}", violation(&run));
            state_error(&run)
        })
    };
    let able = dynamic_loop(&folder, ["able.fmu", "able.fmu"]);
    for (algorithm, most, order) in [
        (Algorithm::GaussSeidel, 0.01, 1.0),
        (Algorithm::Jacobi, 0.01, 1.0),
        (Algorithm::InterfaceJacobian, 2e-5, 2.0),
    ] {
        let [coarse, fine] = errors(&able, algorithm);
        let found = (coarse / fine).log2();
        assert!(coarse < most && (found - order).abs() < 0.2, "{algorithm}: {coarse:e}, order {found}");
    }
    let deaf = dynamic_loop(&folder, ["able.fmu", "deaf.fmu"]);
    let [coarse, fine] = errors(&deaf, Algorithm::GaussSeidel);
    let coarse_settings = Settings { stop_time: 1.0, step_size: 0.02, ..Settings::default() };
    let steps: u64 = completed(&deaf, &coarse_settings).effort.fmu_steps.iter().sum();
    assert!((201..=400).contains(&steps), "2 to 4 steps of both slaves per communication step: {steps}");
    assert!(coarse < 0.01 && (coarse / fine).log2() > 0.8, "{coarse:e} {fine:e}");
}

#[test]
fn the_monolithic_master_agrees_with_the_solution_by_hand() {
    let folder = TempDir::new().unwrap();
    fmu(&folder, "able.fmu", ABLE);
    let graph = dynamic_loop(&folder, ["able.fmu", "able.fmu"]);
    let settings =
        Settings { stop_time: 1.0, step_size: 0.1, algorithm: Algorithm::Monolithic, ..Settings::default() };
    assert!(state_error(&completed(&graph, &settings)) < 1e-8);
}

#[test]
fn adaptive_steps_solve_the_loop_in_every_pass() {
    let folder = TempDir::new().unwrap();
    fmu(&folder, "able.fmu", ABLE);
    let graph = dynamic_loop(&folder, ["able.fmu", "able.fmu"]);
    for algorithm in STEPPING {
        let error = |tolerance: f64| {
            let adaptive = Some(Adaptive { tolerance, ..Adaptive::default() });
            let settings =
                Settings { stop_time: 1.0, step_size: 0.01, algorithm, adaptive, ..Settings::default() };
            let run = completed(&graph, &settings);
            assert!(violation(&run) < 1e-10, "{algorithm}: {:e}", violation(&run));
            state_error(&run)
        };
        let (loose, tight) = (error(1e-3), error(1e-5));
        assert!(loose < 2e-2 && tight < 1e-3 && tight < loose, "{algorithm}: {loose:e} {tight:e}");
    }
}

#[test]
fn a_loop_inside_a_chain_sees_what_comes_before_and_feeds_what_comes_after() {
    let folder = TempDir::new().unwrap();
    fmu(&folder, "able.fmu", ABLE);
    // The file names them against the flow; u = 0.5 w + 0.25 u.
    let components = [("after", "able.fmu"), ("a", "able.fmu"), ("before", "able.fmu"), ("b", "able.fmu")];
    let connections = [
        ("a.y", "after.u", 2.0, 0.0),
        ("before.y", "a.v", 1.0, 0.0),
        ("b.y", "a.u", 1.0, 1.0),
        ("a.y", "b.u", 0.5, 0.0),
    ];
    let path = system(&folder, &components, &connections);
    let set = [("a.gain", "1"), ("b.gain", "1"), ("after.gain", "1"), ("before.offset", "3")];
    let graph = graph(&path, &set);
    let order: Vec<&str> = graph.order.iter().map(|&index| graph.components[index].name.as_str()).collect();
    assert_eq!(order, ["before", "a", "b", "after"]);
    let run = completed(&graph, &settings(Algorithm::GaussSeidel));
    // u = u / 2 + 1
    for (name, expected) in [("a.y", 2.0), ("b.y", 1.0), ("after.y", 4.0), ("before.y", 3.0)] {
        assert!(values(&run, name).iter().all(|y| (y - expected).abs() < 1e-12), "{name}");
    }
}

#[test]
fn a_component_fed_by_itself_is_a_loop_of_its_own() {
    let folder = TempDir::new().unwrap();
    fmu(&folder, "able.fmu", ABLE);
    // A loop of a and b feeds another input of c.
    let components = [("c", "able.fmu"), ("a", "able.fmu"), ("b", "able.fmu")];
    let connections = [
        ("b.y", "a.u", 1.0, 1.0),
        ("a.y", "b.u", 0.5, 0.0),
        ("c.y", "c.u", 0.5, 2.0),
        ("a.y", "c.v", 1.0, 0.0),
    ];
    let path = system(&folder, &components, &connections);
    let graph = graph(&path, &[("a.gain", "1"), ("b.gain", "1"), ("c.gain", "1")]);
    assert_eq!(graph.loops.len(), 2);
    for algorithm in STEPPING {
        let run = completed(&graph, &settings(algorithm));
        // c.u = c.u / 2 + 2
        for (name, expected) in [("a.y", 2.0), ("b.y", 1.0), ("c.y", 4.0)] {
            assert!(values(&run, name).iter().all(|y| (y - expected).abs() < 1e-12), "{algorithm} {name}");
        }
    }
}

#[test]
fn a_loop_that_only_missing_dependencies_make_is_run_all_the_same() {
    let folder = TempDir::new().unwrap();
    let silent = Abilities { dependencies: false, model_exchange: false, ..ABLE };
    let cases = [
        ("derivatives.fmu", silent, "an algebraic loop is solved for a.u, b.u"),
        (
            "states.fmu",
            Abilities { derivatives: false, ..silent },
            "over the communication step for a.u, b.u",
        ),
    ];
    for (name, able, note) in cases {
        fmu(&folder, name, able);
        // The states approach each other: x' = 1 (w - x), w' = 1 (x - w), from 1 and 0.
        let path = system(
            &folder,
            &[("a", name), ("b", name)],
            &[("b.x", "a.u", 1.0, 0.0), ("a.x", "b.u", 1.0, 0.0)],
        );
        let graph = graph(&path, &[("a.rate", "1"), ("b.rate", "1"), ("a.x", "1")]);
        let error = |step_size: f64| {
            let run = completed(&graph, &Settings { stop_time: 1.0, step_size, ..Settings::default() });
            assert!(run.notes[0].contains(note), "{:?}", run.notes);
            (values(&run, "a.x").last().unwrap() - 0.5 * (1.0 + (-2.0f64).exp())).abs()
        };
        let (coarse, fine) = (error(0.02), error(0.01));
        assert!(coarse < 0.01 && ((coarse / fine).log2() - 1.0).abs() < 0.1, "{name}: {coarse:e} {fine:e}");
    }
    fmu(&folder, "neither.fmu", Abilities { derivatives: false, states: false, ..silent });
    let connections = [("b.x", "a.u", 1.0, 0.0), ("a.x", "b.u", 1.0, 0.0)];
    let path = system(&folder, &[("a", "neither.fmu"), ("b", "neither.fmu")], &connections);
    let message = simulate(&graph(&path, &[]), &Settings::default()).unwrap_err().to_string();
    assert!(message.contains("component `a`") && message.contains("true `dependencies`"), "{message}");
}

fn airloop(folder: &Path, words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_airloop")).args(words).current_dir(folder).output().unwrap()
}

#[test]
fn a_loop_that_loses_its_solution_names_inputs_residuals_and_time_and_keeps_the_result() {
    let folder = TempDir::new().unwrap();
    fmu(&folder, "able.fmu", ABLE);
    fmu(&folder, "deaf.fmu", Abilities { flag: "STALE", ..ABLE });
    // a.u = b.y = a.y + x + 0.7 = a.u - tanh(a.u) + x + 0.7, so that tanh(a.u) = x + 0.7, and x grows.
    let set = ["a.gain=1", "a.bend=-1", "b.gain=1", "b.share=1", "b.offset=0.7", "b.rate=1"];
    for (name, fmu) in [("point", "able.fmu"), ("step", "deaf.fmu")] {
        let connections = [("b.y", "a.u", 1.0, 0.0), ("a.y", "b.u", 1.0, 0.0)];
        let path = system(&folder, &[("a", "able.fmu"), ("b", fmu)], &connections);
        let mut words =
            vec!["run", path.to_str().unwrap(), "--stop", "9", "--step", "0.01", "--no-plots", "-o", name];
        set.iter().for_each(|value| words.extend(["--set", value]));
        let output = airloop(folder.path(), &words);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{message}");
        for word in ["algebraic loop at t = ", "a.u: ", "b.u: ", "iterations", "the result so far is in"] {
            assert!(message.contains(word), "{message}");
        }
        let result = csv::read(&folder.path().join(name).join("result.csv")).unwrap();
        let [x, y] = ["b.x", "a.y"].map(|name| &result.channel(name).unwrap().values);
        assert!(result.len() > 50 && x.last().unwrap() + 0.7 < 1.0, "{} rows", result.len());
        for (x, y) in x.iter().zip(y) {
            let u = (x + 0.7).atanh();
            assert!((y - (u - u.tanh())).abs() < 1e-8 * u.max(1.0).exp(), "{name}: {y} at x = {x}");
        }
    }
}

#[test]
fn a_system_with_a_loop_is_inspected_and_exported() {
    let folder = TempDir::new().unwrap();
    fmu(&folder, "able.fmu", ABLE);
    static_loop(&folder, ["able.fmu", "able.fmu"]);
    let output = airloop(folder.path(), &["inspect", "system.ssd"]);
    assert_eq!(output.status.code(), Some(0));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("Algebraic loop: b.y -> a.u -> a.y -> b.u -> b.y"), "{text}");
    let output = airloop(folder.path(), &["export", "system.ssd", "-q", "-o", "again.ssp"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let again = graph(&folder.path().join("again.ssp"), &STATIC);
    check_static(&completed(&again, &settings(Algorithm::GaussSeidel)), 1e-12);
}
