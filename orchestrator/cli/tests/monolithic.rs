//! `airloop run --master monolithic` against closed forms and an independent reference, through the binary.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::AtomicBool;

use airloop_cosim::master::Settings;
use airloop_cosim::master::simulate::{Curves, Watch, run_along};
use airloop_cosim::results::summary::{self, Summary};
use airloop_cosim::system::SystemGraph;
use airloop_fmi::InterfaceKind;
use airloop_series::{TimeSeries, csv};
use airloop_testing::model::{folder, system};
use tempfile::TempDir;

fn airloop(folder: &Path, system: &Path, words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_airloop"))
        .arg("run")
        .arg(system)
        .args(["--no-plots", "-o", "out"])
        .args(if words.contains(&"--master") { &[][..] } else { &["--master", "monolithic"] })
        .args(words)
        .current_dir(folder)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn written(folder: &Path) -> (TimeSeries, Summary) {
    let result = csv::read(&folder.join("out/result.csv")).unwrap();
    (result, summary::read(&folder.join("out/summary.json")).unwrap())
}

/// Result and summary of a run that must succeed.
fn run(folder: &Path, system: &Path, words: &[&str]) -> (TimeSeries, Summary) {
    let output = airloop(folder, system, words);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    written(folder)
}

fn values<'a>(result: &'a TimeSeries, name: &str) -> &'a [f64] {
    &result.channel(name).unwrap_or_else(|| panic!("no column {name}")).values
}

/// Largest difference of a column from a function of time.
fn error(result: &TimeSeries, name: &str, expected: impl Fn(f64) -> f64) -> f64 {
    let pairs = result.time().iter().zip(values(result, name));
    pairs.map(|(t, value)| (value - expected(*t)).abs()).fold(0.0, f64::max)
}

fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A file of the project that another build step makes.
fn built(path: &str) -> Option<PathBuf> {
    let path = project().join(path);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: {} is not there; run `make fmu`", path.display());
    None
}

/// A Reference FMU, from the folder in AIRLOOP_REFERENCE_FMUS.
fn reference(name: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("AIRLOOP_REFERENCE_FMUS") else {
        println!("skipped: AIRLOOP_REFERENCE_FMUS does not name a folder with the Reference FMUs");
        return None;
    };
    Some(PathBuf::from(folder).join(format!("{name}.fmu")))
}

#[test]
fn the_pneumatic_cart_pole_agrees_with_radau_to_1e_8() {
    let Some(_) = built("target/fmu/arx-actuator.fmu") else { return };
    let folder = TempDir::new().unwrap();
    let mut command = String::from("time,u\n");
    for k in 0..=3000 {
        let u = 20.0 * (2.0 * std::f64::consts::PI * f64::from(k) * 1e-3).sin();
        command += &format!("{},{u}\n", f64::from(k) / 1000.0);
    }
    std::fs::write(folder.path().join("u.csv"), command).unwrap();
    let words = ["--input", "u.csv", "--interpolation", "hold", "--step", "10ms"];
    let (result, summary) = run(folder.path(), &project().join("examples/01_run/system.ssd"), &words);
    let reference = csv::read(&project().join("tests/data/reference_cart_pole.csv")).unwrap();
    for name in ["x", "v", "theta", "omega"] {
        let (found, expected) = (values(&result, name), values(&reference, name));
        assert_eq!(found.len(), expected.len());
        let square = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>();
        let error = square(&mut found.iter().zip(expected).map(|(a, b)| a - b));
        let relative = (error / square(&mut expected.iter().copied())).sqrt();
        assert!(relative < 1e-8, "{name}: {relative:e}");
    }
    let integration = summary.integration.unwrap();
    assert_eq!((integration.time_events, integration.input_events), (2999, 2999));
    assert_eq!(integration.relative_tolerance, 1e-10);
}

#[test]
fn a_chain_of_lags_follows_its_closed_form() {
    let folder = folder();
    let components = [("c", "model.fmu"), ("b", "model.fmu"), ("a", "model.fmu")];
    let system = system(&folder, &components, &[("a.x", "b.u"), ("b.x", "c.u")]);
    let set = ["--set", "a.rate=1", "--set", "b.rate=1", "--set", "c.rate=1", "--set", "a.u=1"];
    let (result, _) = run(folder.path(), &system, &[&["--stop", "5", "--step", "0.5"][..], &set].concat());
    assert!(error(&result, "a.x", |t| 1.0 - (-t).exp()) < 1e-9);
    assert!(error(&result, "b.x", |t| 1.0 - (-t).exp() * (1.0 + t)) < 1e-9);
    assert!(error(&result, "c.x", |t| 1.0 - (-t).exp() * (1.0 + t + t * t / 2.0)) < 1e-9);
    // Outputs with feed-through are those of the same instant.
    assert_eq!(values(&result, "b.y"), values(&result, "a.x"));
}

#[test]
fn a_smaller_tolerance_gives_a_smaller_error() {
    let folder = folder();
    let system = system(&folder, &[("a", "model.fmu")], &[]);
    let set = ["--stop", "5", "--step", "5", "--set", "a.rate=3", "--set", "a.u=1"];
    let error_at = |tolerance: &str| {
        let (result, _) = run(folder.path(), &system, &[&["--tolerance", tolerance][..], &set].concat());
        error(&result, "a.x", |t| 1.0 - (-3.0 * t).exp())
    };
    let (rough, fine) = (error_at("1e-4"), error_at("1e-10"));
    assert!(rough < 1e-3 && fine < 1e-9 && fine < 0.1 * rough, "{rough:e} {fine:e}");
}

#[test]
fn inputs_are_held_or_follow_a_line_between_samples() {
    let folder = folder();
    let system = system(&folder, &[("a", "model.fmu")], &[("u", "a.u")]);
    std::fs::write(folder.path().join("in.csv"), "time,u\n0,0\n1,1\n2,0\n").unwrap();
    let words = ["--stop", "2", "--step", "0.25", "--set", "a.rate=1", "--input", "in.csv"];
    let (result, summary) =
        run(folder.path(), &system, &[&words[..], &["--interpolation", "linear"]].concat());
    let rise = |t: f64| t - 1.0 + (-t).exp();
    let linear = |t: f64| if t <= 1.0 { rise(t) } else { rise(t) - 2.0 * rise(t - 1.0) };
    assert!(error(&result, "a.x", linear) < 1e-9);
    assert_eq!(summary.integration.unwrap().input_events, 0, "a kink is not an event");

    let (result, summary) = run(folder.path(), &system, &[&words[..], &["--interpolation", "hold"]].concat());
    let hold = |t: f64| if t <= 1.0 { 0.0 } else { 1.0 - (1.0 - t).exp() };
    assert!(error(&result, "a.x", hold) < 1e-9);
    assert_eq!(summary.integration.unwrap().input_events, 1);
    // Held from the start of its interval on; the input itself is shown with its sample.
    assert_eq!(values(&result, "a.held"), [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0]);
    assert_eq!(values(&result, "u"), [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0]);
}

#[test]
fn curves_are_followed_exactly_through_jumps_and_held_beyond_their_ends() {
    let folder = folder();
    let mut graph = SystemGraph::open_for(
        &system(&folder, &[("a", "model.fmu")], &[("u", "a.u")]),
        InterfaceKind::ModelExchange,
    )
    .unwrap();
    graph.set_start("a.rate", "1", "test").unwrap();
    // t^3 up to 1, then from 2 down as 2 - (t - 1)^2 up to 2.
    let pieces = vec![vec![[0.0, 0.0, 0.0, 1.0]], vec![[2.0, 0.0, -1.0, 0.0]]];
    let curves = Curves { knots: vec![0.0, 1.0, 2.0], inputs: vec![0], pieces };
    let settings = Settings { stop_time: 3.0, step_size: 0.3, ..Settings::default() };
    let stop = AtomicBool::new(false);
    let watch = Watch { stop: &stop, progress: &mut |_, _| {} };
    let run = run_along(&graph, &settings, &curves, watch).unwrap();
    // x' = u - x: a polynomial p is followed by p - p' + p'' - ..., and the rest dies out.
    let first = |t: f64| t.powi(3) - 3.0 * t * t + 6.0 * t - 6.0 + 6.0 * (-t).exp();
    let answer = |s: f64| 2.0 - s * s + 2.0 * s - 2.0;
    let second = |s: f64| answer(s) + (first(1.0) - answer(0.0)) * (-s).exp();
    let expected = |t: f64| match t {
        t if t <= 1.0 => first(t),
        t if t <= 2.0 => second(t - 1.0),
        t => 1.0 + (second(1.0) - 1.0) * (2.0 - t).exp(),
    };
    assert!(error(&run.result, "a.x", expected) < 1e-9);
    assert_eq!(run.integration.unwrap().input_events, 1, "the jump at 1 alone");
    let wrong = Curves { knots: vec![0.0, 1.0, 1.0], ..curves };
    let watch = Watch { stop: &stop, progress: &mut |_, _| {} };
    let message = run_along(&graph, &settings, &wrong, watch).unwrap_err().to_string();
    assert!(message.contains("knots rise"), "{message}");
}

#[test]
fn an_algebraic_loop_is_solved_with_and_without_directional_derivatives() {
    let folder = folder();
    // a.u = b.y = a.c = cos(a.u)
    const FIXED_POINT: f64 = 0.739_085_133_215_160_6;
    for fmu in ["model.fmu", "plain.fmu"] {
        let system = system(&folder, &[("a", fmu), ("b", fmu)], &[("a.c", "b.u"), ("b.y", "a.u")]);
        let words = ["--stop", "2", "--step", "0.5", "--set", "a.rate=1"];
        let (result, summary) = run(folder.path(), &system, &words);
        assert!(summary.fallbacks.contains(&"an algebraic loop is solved for a.u, b.u".to_owned()));
        let approximated =
            summary.fallbacks.iter().filter(|note| note.contains("finite differences")).count();
        assert_eq!(approximated, if fmu == "plain.fmu" { 2 } else { 0 });
        assert!(error(&result, "b.y", |_| FIXED_POINT) < 1e-12, "{fmu}");
        assert!(error(&result, "a.x", |t| FIXED_POINT * (1.0 - (-t).exp())) < 1e-9, "{fmu}");
    }
}

#[test]
fn a_loop_is_solved_before_what_it_feeds() {
    let folder = folder();
    let components = [("c", "model.fmu"), ("a", "model.fmu"), ("b", "plain.fmu")];
    let system = system(&folder, &components, &[("a.c", "b.u"), ("b.y", "a.u"), ("b.y", "c.u")]);
    let words = ["--stop", "1", "--step", "0.1", "--set", "b.gain=0.5", "--set", "c.rate=2"];
    let (result, _) = run(folder.path(), &system, &words);
    // w = 0.5 cos(w), a contraction
    let w = (0..100).fold(0.4, |w: f64, _| 0.5 * w.cos());
    assert!(error(&result, "c.y", |_| w) < 1e-12);
    assert!(error(&result, "c.x", |t| w * (1.0 - (-2.0 * t).exp())) < 1e-9);
}

#[test]
fn a_loop_without_a_solution_names_variables_and_residuals() {
    let folder = folder();
    let components = [("a", "model.fmu"), ("b", "model.fmu")];
    let system = system(&folder, &components, &[("a.y", "b.u"), ("b.y", "a.u")]);
    let output = airloop(folder.path(), &system, &["--stop", "1", "--set", "a.offset=1"]);
    assert_eq!(output.status.code(), Some(1));
    let message = text(&output.stderr);
    assert!(message.contains("algebraic loop at t = 0 s"), "{message}");
    assert!(
        message.contains("a.u: ") && message.contains("b.u: ") && message.contains("singular"),
        "{message}"
    );
}

#[test]
fn slaves_refuse_a_loop_and_name_the_master_that_works() {
    let folder = folder();
    let system = system(&folder, &[("a", "model.fmu")], &[]);
    let output = Command::new(env!("CARGO_BIN_EXE_airloop"))
        .args(["run", system.to_str().unwrap(), "--stop", "1"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let message = text(&output.stderr);
    assert!(message.contains("component `a`") && message.contains("--master monolithic"), "{message}");
}

#[test]
fn a_system_of_models_without_co_simulation_is_inspected_and_exported() {
    let folder = folder();
    let system =
        system(&folder, &[("a", "model.fmu"), ("b", "plain.fmu")], &[("a.c", "b.u"), ("b.y", "a.u")]);
    let command = |words: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_airloop"))
            .args(words)
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        text(&output.stdout)
    };
    let system = system.to_str().unwrap();
    assert!(command(&["inspect", system]).contains("Algebraic loop: "));
    let value: serde_json::Value = serde_json::from_str(&command(&["inspect", "--json", system])).unwrap();
    assert_eq!(value["algebraic_loops"][0].as_array().map(Vec::len), Some(5));
    command(&["export", system, "-o", "again.ssp"]);
    let (result, _) = run(folder.path(), Path::new("again.ssp"), &["--stop", "1"]);
    assert!(error(&result, "b.y", |_| 0.739_085_133_215_160_6) < 1e-12);
}

#[test]
fn chattering_is_reported_with_its_indicator_and_keeps_the_result() {
    let folder = folder();
    let system = system(&folder, &[("a", "model.fmu")], &[]);
    let words = ["--stop", "1", "--step", "0.1", "--set", "a.relay=1", "--set", "a.x=0.25"];
    let output = airloop(folder.path(), &system, &words);
    assert_eq!(output.status.code(), Some(1));
    let message = text(&output.stderr);
    assert!(
        message.contains("event indicator 1 of component `a`") && message.contains("t = 0.25"),
        "{message}"
    );
    let (result, summary) = written(folder.path());
    assert_eq!(result.time(), [0.0, 0.1, 0.2]);
    assert_eq!(summary.outcome.status, "failed");
}

#[test]
fn a_solution_without_end_underflows_with_component_variable_and_time() {
    let folder = folder();
    let system = system(&folder, &[("a", "model.fmu")], &[]);
    let words = ["--stop", "2", "--step", "0.3", "--set", "a.growth=1", "--set", "a.x=1"];
    let output = airloop(folder.path(), &system, &words);
    assert_eq!(output.status.code(), Some(1));
    let message = text(&output.stderr);
    // x = 1 / (1 - t)
    assert!(message.contains("component `a`: the error of `x`"), "{message}");
    assert!(message.contains("t = 0.99") || message.contains("t = 1"), "{message}");
    let (result, summary) = written(folder.path());
    assert_eq!((result.len(), summary.outcome.status.as_str()), (4, "failed"));
    assert!(error(&result, "a.x", |t| 1.0 / (1.0 - t)) < 1e-7);
}

#[test]
fn a_system_too_stiff_for_an_explicit_method_is_refused_by_name() {
    let folder = folder();
    let system = system(&folder, &[("a", "model.fmu")], &[]);
    let words = ["--stop", "2", "--step", "1", "--set", "a.rate=1e7", "--set", "a.u=1"];
    let output = airloop(folder.path(), &system, &words);
    assert_eq!(output.status.code(), Some(1));
    let message = text(&output.stderr);
    assert!(message.contains("component `a`") && message.contains("too stiff"), "{message}");
    assert_eq!(written(folder.path()).0.len(), 1);
}

/// Two sampled components in series, with samples at the same times.
const SAMPLED_IN_SERIES: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>
<ssd:SystemStructureDescription version=\"1.0\" name=\"s\" xmlns:ssd=\"http://ssp-standard.org/SSP1/SystemStructureDescription\">
<ssd:System name=\"s\"><ssd:Connectors><ssd:Connector name=\"u\" kind=\"input\"/></ssd:Connectors><ssd:Elements>
<ssd:Component name=\"second\" source=\"arx-actuator.fmu\"><ssd:Connectors><ssd:Connector name=\"u\" kind=\"input\"/><ssd:Connector name=\"F_act\" kind=\"output\"/></ssd:Connectors></ssd:Component>
<ssd:Component name=\"first\" source=\"arx-actuator.fmu\"><ssd:Connectors><ssd:Connector name=\"u\" kind=\"input\"/><ssd:Connector name=\"F_act\" kind=\"output\"/></ssd:Connectors></ssd:Component>
</ssd:Elements><ssd:Connections><ssd:Connection startConnector=\"u\" endElement=\"first\" endConnector=\"u\"/>
<ssd:Connection startElement=\"first\" startConnector=\"F_act\" endElement=\"second\" endConnector=\"u\"/></ssd:Connections>
</ssd:System></ssd:SystemStructureDescription>";

#[test]
fn samples_at_the_same_time_pass_on_new_values_as_the_slaves_do() {
    let Some(actuator) = built("target/fmu/arx-actuator.fmu") else { return };
    let folder = TempDir::new().unwrap();
    std::fs::copy(actuator, folder.path().join("arx-actuator.fmu")).unwrap();
    let system = folder.path().join("system.ssd");
    std::fs::write(&system, SAMPLED_IN_SERIES).unwrap();
    std::fs::write(folder.path().join("in.csv"), "time,u\n0,3\n0.01,10\n0.02,-5\n").unwrap();
    let words = ["--input", "in.csv", "--interpolation", "hold", "--stop", "0.03", "--step", "1ms"];
    let (result, _) = run(folder.path(), &system, &words);
    let (slaves, _) = run(folder.path(), &system, &[&words[..], &["--master", "gauss-seidel"]].concat());
    for name in ["first.F_act", "second.F_act"] {
        let (found, expected) = (values(&result, name), values(&slaves, name));
        assert_eq!(found, expected, "{name}");
        assert!(expected[20].abs() > 0.1, "{expected:?}");
    }
}

/// Height of a ball dropped from 1 m.
fn height(t: f64, restitution: f64) -> f64 {
    let g = 9.81;
    let (mut begin, mut speed) = (0.0, 0.0);
    let mut height = 1.0f64;
    loop {
        let flight = (speed + (speed * speed + 2.0 * g * height).sqrt()) / g;
        if t <= begin + flight {
            let t = t - begin;
            return height + speed * t - 0.5 * g * t * t;
        }
        speed = restitution * (g * flight - speed);
        begin += flight;
        height = 0.0;
    }
}

#[test]
fn a_bouncing_ball_keeps_to_its_closed_form_and_rests_at_its_time() {
    let Some(ball) = built("target/fmu/test/test-bouncing-ball.fmu") else { return };
    let folder = TempDir::new().unwrap();
    let words = ["--step", "10ms", "--stop", "10", "--set", "stop_at_rest=true"];
    let (result, summary) = run(folder.path(), &ball, &words);
    assert_eq!(summary.outcome.status, "terminated");
    let (mut rest, mut speed) = ((2.0f64 / 9.81).sqrt(), (2.0f64 * 9.81).sqrt() * 0.7);
    let mut bounces = 1;
    while speed >= 0.1 {
        rest += 2.0 * speed / 9.81;
        speed *= 0.7;
        bounces += 1;
    }
    assert!((summary.outcome.end_time - rest).abs() < 1e-8, "{} {rest}", summary.outcome.end_time);
    assert_eq!(summary.integration.unwrap().state_events, bounces);
    assert!(error(&result, "h", |t| height(t.min(rest), 0.7)) < 1e-8);
}

#[test]
fn the_bouncing_ball_of_the_reference_fmus_keeps_to_its_closed_form() {
    let Some(ball) = reference("BouncingBall") else { return };
    let folder = TempDir::new().unwrap();
    let (result, _) = run(folder.path(), &ball, &["--step", "10ms", "--stop", "1.5"]);
    // An event late by d s moves the height by (1 + e) v d, v = 4.4 m/s at the first.
    let error = error(&result, "h", |t| height(t, 0.7));
    assert!(error < 1e-8, "{error:e}");
}

#[test]
fn other_reference_fmus_run_in_model_exchange() {
    let folder = TempDir::new().unwrap();
    let Some(dahlquist) = reference("Dahlquist") else { return };
    let (result, _) = run(folder.path(), &dahlquist, &[]);
    assert!(error(&result, "x", |t| (-t).exp()) < 1e-9);
    let (result, summary) = run(folder.path(), &reference("Stair").unwrap(), &[]);
    assert_eq!(summary.outcome.status, "terminated");
    assert!(error(&result, "counter", |t| (t + 1e-9).floor() + 1.0) <= 1.0);
    let words =
        ["--set", "Float64_continuous_input=2.5", "--set", "Int32_input=-7", "--set", "Boolean_input=true"];
    let (result, _) = run(folder.path(), &reference("Feedthrough").unwrap(), &words);
    let last = |name: &str| *values(&result, name).last().unwrap();
    assert_eq!(last("Float64_continuous_output"), 2.5);
    assert_eq!((last("Int32_output"), last("Boolean_output")), (-7.0, 1.0));
}
