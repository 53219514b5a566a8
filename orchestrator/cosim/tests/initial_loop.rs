//! An algebraic loop that exists in initialization only, between slaves.
#![cfg(target_os = "linux")]

use std::sync::atomic::AtomicBool;

use airloop_cosim::master::simulate::{Watch, run};
use airloop_cosim::master::{Algorithm, Error, Settings};
use airloop_cosim::system::SystemGraph;
use airloop_testing::slave::{component, connection, description, folder, pack, ssd, write};
use tempfile::TempDir;

/// a.u = b.y + 1, b.u = a.y, where y depends on u in initialization only.
fn graph(folder: &TempDir, gain_of_b: &str) -> SystemGraph {
    let text = description()
        .replace("<Unknown index=\"2\" dependencies=\"1\"/>", "<Unknown index=\"2\" dependencies=\"\"/>");
    let initial =
        "<InitialUnknowns><Unknown index=\"2\" dependencies=\"1\"/></InitialUnknowns></ModelStructure>";
    let text = text.replace("</ModelStructure>", initial);
    pack(&folder.path().join("slave.fmu"), &text, Some(&folder.path().join("slave.so")));
    let plus_one = connection("b.y", "a.u")
        .replace("/>", "><ssc:LinearTransformation factor=\"1\" offset=\"1\"/></ssd:Connection>");
    let components = component("a", "") + &component("b", "");
    let file =
        write(folder, "system.ssd", &ssd("", &components, &(connection("a.y", "b.u") + &plus_one), ""));
    let mut graph = SystemGraph::open(&file).unwrap();
    graph.set_start("a.gain", "2", "test").unwrap();
    graph.set_start("b.gain", gain_of_b, "test").unwrap();
    graph
}

fn simulate(graph: &SystemGraph, algorithm: Algorithm) -> Result<Vec<f64>, Error> {
    let stop = AtomicBool::new(false);
    let settings = Settings { stop_time: 0.1, step_size: 0.1, algorithm, ..Settings::default() };
    let run = run(graph, &settings, None, Watch { stop: &stop, progress: &mut |_, _| {} })?;
    Ok(["a.y", "b.y"].iter().map(|name| run.result.channel(name).unwrap().values[0]).collect())
}

#[test]
fn a_loop_of_initialization_is_solved_where_passing_on_diverges() {
    let folder = folder();
    let graph = graph(&folder, "2");
    for algorithm in [Algorithm::GaussSeidel, Algorithm::Jacobi] {
        // u = 4 u + 1
        let values = simulate(&graph, algorithm).unwrap();
        for (value, expected) in values.iter().zip([-2.0 / 3.0, -4.0 / 3.0]) {
            assert!((value - expected).abs() < 1e-12, "{values:?}");
        }
    }
}

#[test]
fn a_loop_of_initialization_without_a_solution_names_its_inputs_and_residuals() {
    let folder = folder();
    // u = u + 1
    let message = simulate(&graph(&folder, "0.5"), Algorithm::GaussSeidel).unwrap_err().to_string();
    assert!(message.contains("algebraic loop at t = 0 s"), "{message}");
    assert!(message.contains("a.u: ") && message.contains("b.u: "), "{message}");
}
