//! Exchange of values by the masters, its order, and how a run ends; on systems of small slaves (`slave/slave.c`).
#![cfg(target_os = "linux")]

use airloop_testing::slave;
use std::sync::atomic::{AtomicBool, Ordering};

use airloop_cosim::master::simulate::{End, Run, Stimulus, Watch, run};
use airloop_cosim::master::{Algorithm, Error, Settings};
use airloop_cosim::system::SystemGraph;
use airloop_series::{Interpolation, TimeSeries};
use airloop_testing::slave::{component, connection, folder, ssd, write};
use tempfile::TempDir;

const U: &str = "<ssd:Connector name=\"u\" kind=\"input\"><ssc:Real unit=\"N\"/></ssd:Connector>\n";
const NO_UNITS: [&str; 2] = ["endConnector=\"u\"/>", "endConnector=\"u\" suppressUnitConversion=\"true\"/>"];

fn open(folder: &TempDir, text: &str) -> SystemGraph {
    SystemGraph::open(&write(folder, "system.ssd", text)).unwrap()
}

fn settings(stop_time: f64, step_size: f64) -> Settings {
    Settings { stop_time, step_size, ..Settings::default() }
}

fn simulate(graph: &SystemGraph, settings: &Settings, stimulus: Option<&Stimulus>) -> Result<Run, Error> {
    let stop = AtomicBool::new(false);
    run(graph, settings, stimulus, Watch { stop: &stop, progress: &mut |_, _| {} })
}

fn ramp() -> TimeSeries {
    let mut series = TimeSeries::new(vec![0.0, 1.0, 2.0, 3.0, 4.0]).unwrap();
    series.push("u", None, vec![1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
    series
}

fn ramp_into_first(series: &TimeSeries, interpolation: Interpolation) -> Stimulus<'_> {
    Stimulus { series, links: vec![(0, 0, 1.0, 0.0)], interpolation }
}

fn values<'a>(run: &'a Run, name: &str) -> &'a [f64] {
    &run.result.channel(name).unwrap_or_else(|| panic!("no column {name}")).values
}

/// u -> a -> b, with the file in the wrong order.
fn chain(folder: &TempDir) -> SystemGraph {
    let components = [component("b", ""), component("a", "")].concat();
    open(folder, &ssd(U, &components, &[connection("u", "a.u"), connection("a.y", "b.u")].concat(), ""))
}

#[test]
fn gauss_seidel_passes_new_outputs_on_within_the_step() {
    let (folder, series) = (folder(), ramp());
    let stimulus = ramp_into_first(&series, Interpolation::Linear);
    let run = simulate(&chain(&folder), &settings(3.0, 1.0), Some(&stimulus)).unwrap();
    assert_eq!(values(&run, "u"), [1.0, 2.0, 3.0, 4.0]);
    // Row k + 1 holds what the step from t_k gave, with the input at t_k; row 0 is the initialization.
    assert_eq!(values(&run, "b.y"), [1.0, 1.0, 2.0, 3.0]);
    assert_eq!(values(&run, "b.x"), [0.0, 1.0, 3.0, 6.0]);
}

#[test]
fn jacobi_delays_every_connection_by_one_step() {
    let (folder, series) = (folder(), ramp());
    let stimulus = ramp_into_first(&series, Interpolation::Linear);
    let settings = Settings { algorithm: Algorithm::Jacobi, ..settings(3.0, 1.0) };
    let run = simulate(&chain(&folder), &settings, Some(&stimulus)).unwrap();
    assert_eq!(values(&run, "a.y"), [1.0, 1.0, 2.0, 3.0]);
    assert_eq!(values(&run, "b.y"), [1.0, 1.0, 1.0, 2.0]);
}

#[test]
fn a_discrete_output_stands_at_the_start_of_its_interval() {
    let (folder, series) = (folder(), ramp());
    let stimulus = ramp_into_first(&series, Interpolation::Linear);
    let run = simulate(&chain(&folder), &settings(3.0, 1.0), Some(&stimulus)).unwrap();
    // The slave samples u at the start of the step.
    assert_eq!(values(&run, "a.held"), [1.0, 2.0, 3.0, 3.0]);
}

#[test]
fn a_discrete_output_without_feed_through_stands_where_it_is_read() {
    let folder = folder();
    // As a counter of events: `held` depends on no input any more.
    let lists = slave::description();
    for (dependencies, expected) in [("dependencies=\"\"", [0.0, 1.0, 2.0, 3.0]), ("", [1.0, 2.0, 3.0, 3.0])]
    {
        let text = lists.replace("index=\"5\" dependencies=\"1\"", &format!("index=\"5\" {dependencies}"));
        assert_ne!(text, lists);
        slave::pack(&folder.path().join("counter.fmu"), &text, Some(&folder.path().join("slave.so")));
        let graph = SystemGraph::open(&folder.path().join("counter.fmu")).unwrap();
        let series = ramp();
        let stimulus = ramp_into_first(&series, Interpolation::Linear);
        let run = simulate(&graph, &settings(3.0, 1.0), Some(&stimulus)).unwrap();
        assert_eq!(values(&run, "held"), expected, "{dependencies:?}");
    }
}

#[test]
fn discrete_inputs_are_held_whatever_the_interpolation() {
    let folder = folder();
    let text = slave::description();
    let discrete = text.replacen(
        "causality=\"input\" variability=\"continuous\"",
        "causality=\"input\" variability=\"discrete\"",
        1,
    );
    assert_ne!(discrete, text);
    slave::pack(&folder.path().join("discrete.fmu"), &discrete, Some(&folder.path().join("slave.so")));
    let graph = SystemGraph::open(&folder.path().join("discrete.fmu")).unwrap();
    let mut series = TimeSeries::new(vec![0.0, 1.0]).unwrap();
    for (name, values) in [("u", [1.0, 3.0]), ("i", [1.0, 3.0]), ("b", [0.0, 1.0])] {
        series.push(name, None, values.into()).unwrap();
    }
    let links = vec![(0, 0, 1.0, 0.0), (1, 1, 1.0, 0.0), (2, 2, 1.0, 0.0)];
    let stimulus = Stimulus { series: &series, links, interpolation: Interpolation::Linear };
    let run = simulate(&graph, &settings(1.0, 0.25), Some(&stimulus)).unwrap();
    assert_eq!(values(&run, "u"), [1.0, 1.0, 1.0, 1.0, 3.0]);
    assert_eq!(values(&run, "i"), [1.0, 1.0, 1.0, 1.0, 3.0]);
    assert_eq!(values(&run, "b"), [0.0, 0.0, 0.0, 0.0, 1.0]);
}

#[test]
fn inputs_are_interpolated_as_stated() {
    let (folder, series) = (folder(), ramp());
    let graph = chain(&folder);
    let linear = ramp_into_first(&series, Interpolation::Linear);
    let run = simulate(&graph, &settings(1.5, 0.5), Some(&linear)).unwrap();
    assert_eq!(values(&run, "u"), [1.0, 1.5, 2.0, 2.5]);
    let hold = ramp_into_first(&series, Interpolation::Hold);
    let run = simulate(&graph, &settings(1.5, 0.5), Some(&hold)).unwrap();
    assert_eq!(values(&run, "u"), [1.0, 1.0, 2.0, 2.0]);
}

#[test]
fn the_last_step_meets_the_stop_time_exactly() {
    let folder = folder();
    let graph = SystemGraph::open(&folder.path().join("slave.fmu")).unwrap();
    let run = simulate(&graph, &settings(1.0, 0.3), None).unwrap();
    assert_eq!(run.result.time(), [0.0, 0.3, 0.6, 3.0 * 0.3, 1.0]);
    assert_eq!(run.steps, 4);
}

#[test]
fn every_type_travels_through_connections() {
    let folder = folder();
    let components = [component("a", ""), component("b", ""), component("c", "")].concat();
    let connections: String = ["a b", "b c"]
        .iter()
        .flat_map(|pair| {
            let (from, to) = pair.split_once(' ').unwrap();
            [("y", "u"), ("j", "i"), ("c", "b"), ("t", "s")]
                .map(|(out, into)| connection(&format!("{from}.{out}"), &format!("{to}.{into}")))
        })
        .collect();
    let outputs =
        "<ssd:Connector name=\"count\" kind=\"output\"/>\n<ssd:Connector name=\"text\" kind=\"output\"/>\n";
    let connections = connections + &connection("c.j", "count") + &connection("c.t", "text");
    let mut graph = open(&folder, &ssd(outputs, &components, &connections, ""));
    graph.set_start("a.u", "2.5", "test").unwrap();
    graph.set_start("a.i", "40", "test").unwrap();
    graph.set_start("a.b", "true", "test").unwrap();
    graph.set_start("a.s", "words", "test").unwrap();
    let run = simulate(&graph, &settings(0.2, 0.1), None).unwrap();
    assert_eq!(values(&run, "c.y"), [2.5, 2.5, 2.5]);
    assert_eq!(values(&run, "count"), [43.0, 43.0, 43.0]);
    // Three negations of true.
    assert_eq!(values(&run, "c.c"), [0.0, 0.0, 0.0]);
    assert!(run.result.channel("text").is_none(), "a text has no column");
    let mut master = airloop_cosim::master::Master::new(&graph, &settings(0.2, 0.1), &[]).unwrap();
    master.step().unwrap();
    assert!(master.values().strings.iter().all(|text| text == "words"), "{:?}", master.values().strings);
}

#[test]
fn units_are_converted_on_the_way_in_and_out() {
    let (folder, series) = (folder(), ramp());
    let connectors = "<ssd:Connector name=\"u\" kind=\"input\"><ssc:Real unit=\"kN\"/></ssd:Connector>\n<ssd:Connector name=\"out\" kind=\"output\"><ssc:Real unit=\"mN\"/></ssd:Connector>\n";
    let text = ssd(
        connectors,
        &component("a", ""),
        &[connection("u", "a.u"), connection("a.y", "out")].concat(),
        "",
    );
    let text = text.replace(
        "<ssd:Units>",
        "<ssd:Units><ssc:Unit name=\"kN\"><ssc:BaseUnit kg=\"1\" m=\"1\" s=\"-2\" factor=\"1000\"/></ssc:Unit>",
    );
    let stimulus = ramp_into_first(&series, Interpolation::Linear);
    let run = simulate(&open(&folder, &text), &settings(2.0, 1.0), Some(&stimulus)).unwrap();
    assert_eq!(values(&run, "u"), [1.0, 2.0, 3.0]);
    assert_eq!(values(&run, "a.y"), [1000.0, 1000.0, 2000.0]);
    assert_eq!(values(&run, "out"), [1e6, 1e6, 2e6]);
}

#[test]
fn initialization_is_consistent_through_a_chain_in_any_order_of_the_file() {
    let folder = folder();
    let names = ["e", "c", "a", "d", "b"];
    let components = names.map(|name| component(name, "")).concat();
    let mut connections: String = ["a b", "b c", "c d", "d e"]
        .map(|pair| pair.split_once(' ').unwrap())
        .map(|(from, to)| connection(&format!("{from}.y"), &format!("{to}.u")))
        .concat();
    // A loop through the state of the last slave.
    connections += &connection("e.x", "a.u");
    let text = ssd("", &components, &connections, "").replace(NO_UNITS[0], NO_UNITS[1]);
    let mut graph = open(&folder, &text);
    graph.set_start("e.x", "0.25", "test").unwrap();
    graph.set_start("b.gain", "2", "test").unwrap();
    for algorithm in [Algorithm::GaussSeidel, Algorithm::Jacobi] {
        let run = simulate(&graph, &Settings { algorithm, ..settings(0.1, 0.1) }, None).unwrap();
        assert_eq!(values(&run, "a.y")[0], 0.25);
        assert_eq!(values(&run, "e.y")[0], 0.5);
    }
}

#[test]
fn jacobi_and_gauss_seidel_agree_as_the_step_shrinks() {
    let folder = folder();
    // x' = -x as a loop of an inverting gain and an integrator; the solution is exp(-t).
    let components = [component("a", ""), component("b", "")].concat();
    let connections = [connection("b.x", "a.u"), connection("a.y", "b.u")].concat();
    let text = ssd("", &components, &connections, "").replace(NO_UNITS[0], NO_UNITS[1]);
    let mut graph = open(&folder, &text);
    graph.set_start("b.x", "1", "test").unwrap();
    graph.set_start("a.gain", "-1", "test").unwrap();
    let error = |algorithm, step| {
        let run = simulate(&graph, &Settings { algorithm, ..settings(1.0, step) }, None).unwrap();
        (values(&run, "b.x").last().unwrap() - (-1.0f64).exp()).abs()
    };
    for algorithm in [Algorithm::GaussSeidel, Algorithm::Jacobi] {
        let (coarse, fine) = (error(algorithm, 0.01), error(algorithm, 0.001));
        // First order: a tenth of the step gives a tenth of the error.
        assert!((coarse / fine - 10.0).abs() < 1.0, "{algorithm}: {coarse} {fine}");
    }
    assert!(error(Algorithm::Jacobi, 0.01) > 2.0 * error(Algorithm::GaussSeidel, 0.01));
}

/// A chain whose second slave misbehaves in the step after t = 0.3.
fn misbehaving(folder: &TempDir, how: &str) -> SystemGraph {
    let mut graph = chain(folder);
    graph.set_start("b.how", how, "test").unwrap();
    graph.set_start("b.when", "0.35", "test").unwrap();
    graph
}

#[test]
fn a_value_that_is_not_finite_stops_the_run_and_keeps_what_came_before() {
    let folder = folder();
    let run = simulate(&misbehaving(&folder, "nan"), &settings(1.0, 0.1), None).unwrap();
    let End::Failed(error) = &run.end else { panic!("{:?}", run.end) };
    let message = error.to_string();
    assert!(message.starts_with("component `b`: output `y` is NaN at t = 0.4 s"), "{message}");
    assert_eq!(run.result.time(), [0.0, 0.1, 0.2, 0.3]);
    assert!(run.result.channels().iter().all(|channel| channel.values.iter().all(|value| value.is_finite())));
}

#[test]
fn a_status_that_is_not_ok_is_told_with_component_time_and_step() {
    let folder = folder();
    let cases = [
        ("discard", ["component `b`", "fmi2Discard", "try a smaller `--step`"]),
        ("error", ["b: fmi2DoStep", "fmi2Error", "check parameters"]),
        ("fatal", ["b: fmi2DoStep", "fmi2Fatal", "start again"]),
        ("pending", ["b: fmi2DoStep", "fmi2Pending", "canRunAsynchronuously"]),
    ];
    for (how, expected) in cases {
        let run = simulate(&misbehaving(&folder, how), &settings(1.0, 0.1), None).unwrap();
        let End::Failed(error) = &run.end else { panic!("{how}: {:?}", run.end) };
        let message = error.to_string();
        for text in expected.into_iter().chain(["t = 0.3", "with step 0.1"]) {
            assert!(message.contains(text), "{how}: {message}");
        }
        assert_eq!(run.result.len(), 4, "{how}");
    }
}

#[test]
fn a_slave_may_end_the_simulation() {
    let folder = folder();
    let run = simulate(&misbehaving(&folder, "terminate"), &settings(1.0, 0.1), None).unwrap();
    assert!(
        matches!(&run.end, End::Terminated { component, time: Some(0.35) } if component == "b"),
        "{:?}",
        run.end
    );
    assert_eq!(run.result.time().last(), Some(&0.3));
    // Alone, its values at the time it came to are part of the result.
    let mut graph = SystemGraph::open(&folder.path().join("slave.fmu")).unwrap();
    graph.set_start("how", "terminate", "test").unwrap();
    graph.set_start("when", "0.35", "test").unwrap();
    let run = simulate(&graph, &settings(1.0, 0.1), None).unwrap();
    assert_eq!(run.result.time().last(), Some(&0.35));
}

#[test]
fn an_end_at_the_end_of_a_step_lets_the_others_finish_it() {
    let folder = folder();
    for algorithm in [Algorithm::GaussSeidel, Algorithm::Jacobi, Algorithm::InterfaceJacobian] {
        // The slave that ends is neither the first nor the last one to step.
        let components = [component("a", ""), component("b", ""), component("c", "")].concat();
        let connections = [connection("u", "a.u"), connection("a.y", "b.u"), connection("u", "c.u")].concat();
        let mut graph = open(&folder, &ssd(U, &components, &connections, ""));
        graph.set_start("b.how", "terminate", "test").unwrap();
        graph.set_start("b.when", "3.9999999999", "test").unwrap();
        let series = ramp();
        let stimulus = ramp_into_first(&series, Interpolation::Linear);
        let run = simulate(&graph, &Settings { algorithm, ..settings(9.0, 1.0) }, Some(&stimulus)).unwrap();
        assert!(
            matches!(&run.end, End::Terminated { time: Some(time), .. } if *time == 4.0),
            "{:?}",
            run.end
        );
        assert_eq!((run.steps, run.result.time().last()), (4, Some(&4.0)), "{algorithm}");
        assert_eq!(values(&run, "u"), [1.0, 2.0, 3.0, 4.0, 5.0], "{algorithm}");
        assert_eq!(values(&run, "a.x"), [0.0, 1.0, 3.0, 6.0, 10.0], "{algorithm}");
        assert_eq!(values(&run, "c.x"), values(&run, "a.x"), "{algorithm}");
    }
}

#[test]
fn a_run_can_be_interrupted_and_keeps_what_came_before() {
    let folder = folder();
    let stop = AtomicBool::new(false);
    let mut reported = 0;
    let mut progress = |done, all| {
        assert!(done <= all);
        reported = done;
        stop.store(true, Ordering::Relaxed);
    };
    let watch = Watch { stop: &stop, progress: &mut progress };
    let run = run(&chain(&folder), &settings(1e4, 1e-3), None, watch).unwrap();
    assert!(matches!(run.end, End::Interrupted));
    assert_eq!(run.steps, reported + 1);
    assert_eq!(run.result.len() as u64, run.steps + 1);
}

#[test]
fn impossible_settings_are_refused_before_anything_runs() {
    let folder = folder();
    let graph = chain(&folder);
    for settings in [
        settings(1.0, 0.0),
        settings(-1.0, 0.1),
        settings(f64::NAN, 0.1),
        Settings { tolerance: Some(0.0), ..settings(1.0, 0.1) },
        Settings { tolerance: Some(2.0), ..settings(1.0, 0.1) },
    ] {
        assert!(matches!(simulate(&graph, &settings, None), Err(Error::Setting { .. })), "{settings:?}");
    }
}

#[test]
fn a_slave_with_fixed_steps_refuses_a_shortened_last_step() {
    let folder = folder();
    let text = slave::description().replace("canHandleVariableCommunicationStepSize=\"true\"", "");
    let library = folder.path().join("slave.so");
    slave::pack(&folder.path().join("fixed.fmu"), &text, Some(&library));
    let graph = SystemGraph::open(&folder.path().join("fixed.fmu")).unwrap();
    let message = simulate(&graph, &settings(1.0, 0.3), None).unwrap_err().to_string();
    assert!(message.contains("component `fixed` cannot handle steps of different length"), "{message}");
    assert!(simulate(&graph, &settings(0.9, 0.3), None).is_ok());
}
