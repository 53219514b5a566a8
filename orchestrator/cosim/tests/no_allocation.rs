//! A macro step allocates nothing once the run is going.
#![cfg(target_os = "linux")]

use airloop_testing::{allocations, looped};

airloop_testing::count_allocations!();
use std::path::Path;

use airloop_cosim::master::{Algorithm, Master, Settings};
use airloop_cosim::results::Recorder;
use airloop_cosim::system::SystemGraph;
use airloop_testing::slave::{component, connection, folder, ssd, write};

/// One test only: other tests in this process would be counted too.
#[test]
fn a_macro_step_with_recording_allocates_nothing() {
    let before = allocations::count();
    drop(std::hint::black_box(Box::new(1)));
    assert!(allocations::count() > before, "the allocator does not count");

    let folder = folder();
    let components: String = (0..10).map(|index| component(&format!("c{index}"), "")).collect();
    // Reals with and without conversion, integers and booleans.
    let connections: String = (1..10)
        .flat_map(|index| {
            [("y", "u"), ("j", "i"), ("c", "b")]
                .map(|(from, to)| connection(&format!("c{}.{from}", index - 1), &format!("c{index}.{to}")))
        })
        .collect();
    let input = "<ssd:Connector name=\"u\" kind=\"input\"><ssc:Real unit=\"mN\"/></ssd:Connector>\n";
    let text = ssd(input, &components, &(connections + &connection("u", "c0.u")), "");
    let graph = SystemGraph::open(&write(&folder, "system.ssd", &text)).unwrap();
    for algorithm in [Algorithm::GaussSeidel, Algorithm::Jacobi, Algorithm::InterfaceJacobian] {
        steps_allocate_nothing(&graph, algorithm, 0);
    }

    // Loops that move with a state, at the communication points and over the steps.
    let loops = tempfile::TempDir::new().unwrap();
    looped::fmu(&loops, "able.fmu", looped::ABLE);
    looped::fmu(&loops, "deaf.fmu", looped::Abilities { flag: "STALE", ..looped::ABLE });
    for fmu in ["able.fmu", "deaf.fmu"] {
        let connections = [("in", "a.v", 1.0, 0.0), ("b.y", "a.u", -0.5, 1.0), ("a.y", "b.u", 1.0, 0.0)];
        let path = looped::system(&loops, &[("a", "able.fmu"), ("b", fmu)], &connections);
        let mut graph = SystemGraph::open(&path).unwrap();
        for name in ["a.gain", "a.share", "a.rate", "b.bend"] {
            graph.set_start(name, "1", "test").unwrap();
        }
        steps_allocate_nothing(&graph, Algorithm::GaussSeidel, 0);
        steps_allocate_nothing(&graph, Algorithm::Jacobi, 0);
        if fmu == "able.fmu" {
            steps_allocate_nothing(&graph, Algorithm::GaussSeidel, 2);
            steps_allocate_nothing(&graph, Algorithm::InterfaceJacobian, 0);
        }
    }

    // Rollback, local models and the solver of the interface-Jacobian master, and input derivatives, need FMUs that can
    // do more.
    let example = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/01_run/system.ssd"));
    match SystemGraph::open(example) {
        Ok(graph) => {
            steps_allocate_nothing(&graph, Algorithm::InterfaceJacobian, 0);
            steps_allocate_nothing(&graph, Algorithm::GaussSeidel, 2);
        }
        Err(error) => println!("skipped the coupled component: {error}"),
    }
}

fn steps_allocate_nothing(graph: &SystemGraph, algorithm: Algorithm, extrapolation: u32) {
    let settings = Settings { stop_time: 10.0, algorithm, extrapolation, ..Settings::default() };
    let mut master = Master::new(graph, &settings, &[]).unwrap();
    let values = master.values();
    let width = [values.reals.len(), values.integers.len(), values.booleans.len()];
    let mut recorder = Recorder::new(master.columns(graph), width, 1_100);
    for _ in 0..100 {
        master.step().unwrap();
    }
    let before = allocations::count();
    for k in 0..1_000 {
        master.set_input(0, f64::from(k));
        master.step().unwrap();
        let values = master.values();
        recorder.record(master.time(), &values.reals, &values.integers, &values.booleans);
    }
    assert_eq!(allocations::count() - before, 0, "{algorithm}");
}
