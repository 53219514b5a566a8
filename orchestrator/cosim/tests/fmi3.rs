//! Components of FMI 3.0 under every master, on `vector.c`: arrays, lengths from parameter sets, events.
#![cfg(target_os = "linux")]

use std::sync::atomic::AtomicBool;

use airloop_cosim::master::simulate::{End, Run, Watch, run};
use airloop_cosim::master::{Algorithm, Settings};
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::write::{Version, write as write_system};
use airloop_fmi::InterfaceKind;
use airloop_testing::slave::{connection, ssd, write};
use airloop_testing::vector;
use tempfile::TempDir;

const MASTERS: [Algorithm; 4] =
    [Algorithm::GaussSeidel, Algorithm::Jacobi, Algorithm::InterfaceJacobian, Algorithm::Monolithic];

fn simulate(graph: &SystemGraph, algorithm: Algorithm) -> Run {
    let settings = Settings { stop_time: 1.0, step_size: 0.01, algorithm, ..Settings::default() };
    let settings = match algorithm {
        Algorithm::Monolithic => Settings { tolerance: Some(1e-9), ..settings },
        _ => settings,
    };
    let stop = AtomicBool::new(false);
    run(graph, &settings, None, Watch { stop: &stop, progress: &mut |_, _| {} }).unwrap()
}

fn interface(algorithm: Algorithm) -> InterfaceKind {
    match algorithm {
        Algorithm::Monolithic => InterfaceKind::ModelExchange,
        _ => InterfaceKind::CoSimulation,
    }
}

fn values<'a>(run: &'a Run, name: &str) -> &'a [f64] {
    &run.result.channel(name).unwrap_or_else(|| panic!("no column {name}")).values
}

/// A component whose matrix is diagonal: -1, -2 and so on.
fn component(name: &str, n: usize) -> String {
    let mut connectors = String::new();
    let mut parameters = format!("<ssv:Parameter name=\"n\"><ssv:Integer value=\"{n}\"/></ssv:Parameter>");
    for i in 1..=n {
        connectors += &format!(
            "<ssd:Connector name=\"u[{i}]\" kind=\"input\"/><ssd:Connector name=\"y[{i}]\" kind=\"output\"/>"
        );
        for j in 1..=n {
            let value = if i == j { -(i as f64) } else { 0.0 };
            parameters +=
                &format!("<ssv:Parameter name=\"A[{i},{j}]\"><ssv:Real value=\"{value}\"/></ssv:Parameter>");
        }
    }
    format!(
        "<ssd:Component name=\"{name}\" source=\"vector.fmu\"><ssd:Connectors>{connectors}</ssd:Connectors>\
         <ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version=\"1.0\" name=\"p\">\
         <ssv:Parameters>{parameters}</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding>\
         </ssd:ParameterBindings></ssd:Component>\n"
    )
}

#[test]
fn a_coupled_system_follows_its_closed_form_under_every_master() {
    let folder = vector::folder();
    // Arrays of different lengths from one file.
    let components = [component("a", 2), component("b", 3)].concat();
    let text = ssd("", &components, &connection("a.y[1]", "b.u[3]"), "");
    let file = write(&folder, "system.ssd", &text);
    for algorithm in MASTERS {
        let graph = SystemGraph::open_for(&file, interface(algorithm)).unwrap();
        let run = simulate(&graph, algorithm);
        // The slaves take Euler steps of 1 ms (3e-3 at most here), and under Jacobi u, whose slope is 2 at most, enters
        // y up to two steps of 10 ms late.
        let tolerance = if algorithm == Algorithm::Monolithic { 1e-7 } else { 4.3e-2 };
        for (row, &t) in run.result.time().iter().enumerate() {
            // a: x1' = -x1. b: x3' = -3 x3 + 2 exp(-t) from 1, hence x3 = exp(-t); y = 2 x + u.
            let expected = [
                ("a.y[1]", 2.0 * (-t).exp()),
                ("a.y[2]", -2.0 * (-2.0 * t).exp()),
                ("b.y[2]", -2.0 * (-2.0 * t).exp()),
                ("b.y[3]", 4.0 * (-t).exp()),
            ];
            for (name, expected) in expected {
                let value = values(&run, name)[row];
                assert!(
                    (value - expected).abs() < tolerance,
                    "{algorithm:?}: {name} = {value} at {t}, not {expected}"
                );
            }
        }
        let count = values(&run, "a.count");
        assert_eq!((count[0], count[52], *count.last().unwrap() >= 3.0), (0.0, 2.0, true), "{algorithm:?}");
        // exp(-t) < 0.5 from ln 2 = 0.693 s on.
        let below = values(&run, "a.below");
        assert_eq!((below[66], below[73]), (0.0, 1.0), "{algorithm:?}");
    }
}

#[test]
fn a_single_fmu_takes_lengths_and_elements_by_name() {
    let folder = vector::folder();
    let file = folder.path().join("vector.fmu");
    for algorithm in MASTERS {
        let mut graph = SystemGraph::open_for(&file, interface(algorithm)).unwrap();
        graph.set_start("n", "1", "--set").unwrap();
        graph.set_start("A[1,1]", "-4", "--set").unwrap();
        graph.set_start("u[1]", "2", "--set").unwrap();
        assert_eq!(graph.outputs.iter().filter(|output| output.name.starts_with("y[")).count(), 1);
        let run = simulate(&graph, algorithm);
        assert!(matches!(run.end, End::Completed));
        let expected = |t: f64| 2.0 * (0.5 + 0.5 * (-4.0 * t).exp()) + 2.0;
        let tolerance = if algorithm == Algorithm::Monolithic { 1e-7 } else { 1e-2 };
        for (&t, y) in run.result.time().iter().zip(values(&run, "y[1]")) {
            assert!((y - expected(t)).abs() < tolerance, "{algorithm:?}: {y} at {t}");
        }
        // Now that values stand, the length does too.
        let error = graph.set_start("n", "2", "--set").unwrap_err().to_string();
        assert!(error.contains("before all others"), "{error}");
    }
}

#[test]
fn a_length_that_is_none_is_refused_with_its_place() {
    let folder: TempDir = vector::folder();
    let text = ssd(
        "",
        &component("a", 2).replace("<ssv:Integer value=\"2\"/>", "<ssv:Integer value=\"7\"/>"),
        "",
        "",
    );
    let error = SystemGraph::open(&write(&folder, "system.ssd", &text)).unwrap_err().to_string();
    assert!(error.contains("system.ssd: line") && error.contains("an integer from 1 to 4"), "{error}");
    let text = ssd("", &component("a", 2).replace("u[2]", "u[3]"), "", "");
    let error = SystemGraph::open(&write(&folder, "system.ssd", &text)).unwrap_err().to_string();
    assert!(error.contains("u[3]"), "{error}");
}

#[test]
fn components_in_unpacked_folders_are_packed_for_a_package() {
    let folder = vector::folder();
    unpack(&folder.path().join("vector.fmu"), &folder.path().join("unpacked"));
    let text = ssd("", &component("a", 2), "", "").replace("vector.fmu", "unpacked");
    let graph = SystemGraph::open(&write(&folder, "system.ssd", &text)).unwrap();
    let package = folder.path().join("system.ssp");
    write_system(&graph, &package, Version::default()).unwrap();
    let again = SystemGraph::open(&package).unwrap();
    let (one, other) = (simulate(&graph, Algorithm::GaussSeidel), simulate(&again, Algorithm::GaussSeidel));
    assert_eq!(values(&one, "a.y[2]"), values(&other, "a.y[2]"));
}

/// Unpacks an archive into a folder that is made for it.
fn unpack(archive: &std::path::Path, folder: &std::path::Path) {
    let mut zip = zip::ZipArchive::new(std::fs::File::open(archive).unwrap()).unwrap();
    zip.extract(folder).unwrap();
}
