//! Writing of systems: what is written reads back to the same graph, runs bit for bit, and is the same file.
#![cfg(target_os = "linux")]

use std::path::Path;
use std::process::{Command, Output};

use airloop_cosim::system::graph::{Source, Start};
use airloop_cosim::system::write::{Tool, Version, write as write_system, write_for};
use airloop_cosim::system::{Error, SystemGraph};
use airloop_fmi::VariableKind;
use airloop_series::csv;
use airloop_testing::slave::{
    component, connection, description, folder, folder_without_library, pack, ssd, write,
};
use tempfile::TempDir;

/// Content that has to survive a file: everything but notes, unused units and the places of files.
fn contents(graph: &SystemGraph) -> String {
    let components: Vec<_> = graph
        .components
        .iter()
        .map(|component| {
            let description = &component.fmu.description;
            (&component.name, &description.units, &description.types, &component.start_values)
        })
        .collect();
    let (inputs, outputs, connections) = (&graph.inputs, &graph.outputs, &graph.connections);
    format!(
        "{} {inputs:?} {outputs:?} {connections:?} {:?} {:?} {components:?}",
        graph.name, graph.experiment, graph.order
    )
}

/// A system with every type, units that need conversion, a transformation and suppressed conversions.
fn rich(folder: &TempDir) -> SystemGraph {
    // An FMU whose newton is half of that of the others.
    let other = description().replace(
        "<BaseUnit kg=\"1\" m=\"1\" s=\"-2\"/>",
        "<BaseUnit kg=\"1\" m=\"1\" s=\"-2\" factor=\"0.5\"/>",
    );
    let other = other.replace("name=\"discard\" value=\"1\"", "name=\"dismiss\" value=\"1\"");
    pack(&folder.path().join("other one.fmu"), &other, None);
    let connectors = [
        ("u", "input", "<ssc:Real unit=\"mN\"/>"),
        ("i", "input", "<ssc:Integer/>"),
        ("b", "input", "<ssc:Boolean/>"),
        ("s", "input", "<ssc:String/>"),
        ("free", "input", "<ssc:Real/>"),
        ("y", "output", "<ssc:Real unit=\"kN\"/>"),
        ("x", "output", "<ssc:Real unit=\"smoot\"/>"),
        ("again", "output", "<ssc:Real unit=\"N\"/>"),
        ("j", "output", ""),
        ("c", "output", ""),
        ("t", "output", ""),
    ]
    .map(|(name, kind, typed)| {
        format!("<ssd:Connector name=\"{name}\" kind=\"{kind}\">{typed}</ssd:Connector>\n")
    })
    .concat();
    let other = component("c", "").replace("slave.fmu", "other%20one.fmu");
    let transformed = connection("a.y", "c.u")
        .replace("/>", "><ssc:LinearTransformation factor=\"3\" offset=\"0.1\"/></ssd:Connection>");
    let suppressed = |from, to| connection(from, to).replace("/>", " suppressUnitConversion=\"true\"/>");
    let connections = [
        connection("u", "a.u"),
        connection("a.y", "b.u"),
        transformed,
        connection("i", "a.i"),
        connection("i", "c.i"),
        connection("b", "b.b"),
        connection("s", "a.s"),
        connection("a.t", "b.s"),
        connection("c.y", "y"),
        suppressed("b.x", "x"),
        connection("u", "again"),
        connection("a.j", "j"),
        connection("b.c", "c"),
        connection("b.t", "t"),
    ]
    .concat();
    let text = ssd(&connectors, &[component("b", ""), other, component("a", "")].concat(), &connections, "");
    let units = "<ssd:Units><ssc:Unit name=\"smoot\"><ssc:BaseUnit m=\"1\" factor=\"1.7018\" offset=\"1e-3\"/></ssc:Unit>";
    let text = text
        .replace("<ssd:Units>", units)
        .replace("</ssd:Units>", "</ssd:Units><ssd:DefaultExperiment startTime=\"0.25\" stopTime=\"1.75\"/>");
    let mut graph = SystemGraph::open(&write(folder, "system.ssd", &text)).unwrap();
    for (name, value) in [
        ("a.gain", "0.1"),
        ("c.gain", "-1e-7"),
        ("a.when", "1e300"),
        ("a.how", "nan"),
        ("c.how", "dismiss"),
        ("b.i", "-5"),
        ("c.b", "true"),
        ("c.u", "0.7"),
        ("c.s", "\"tabs\t\" & <lines>\n \u{e4}"),
        ("u", "1500"),
    ] {
        graph.set_start(name, value, "test").unwrap();
    }
    graph
}

#[test]
fn a_system_comes_back_equal_from_every_kind_of_file() {
    let folder = folder_without_library();
    let graph = rich(&folder);
    let place = TempDir::new().unwrap();
    for version in [Version::V1_0, Version::V2_0] {
        for name in ["deep/down/a b.ssd", "system.ssp"] {
            let file = place.path().join(name);
            write_system(&graph, &file, version).unwrap();
            let again = SystemGraph::open(&file).unwrap();
            assert_eq!(contents(&again), contents(&graph), "{version} {name}");
        }
        // A package from a package, whose FMUs are in a temporary folder.
        let second = place.path().join("second.ssp");
        let package = SystemGraph::open(&place.path().join("system.ssp")).unwrap();
        write_system(&package, &second, version).unwrap();
        assert_eq!(std::fs::read(&second).unwrap(), std::fs::read(place.path().join("system.ssp")).unwrap());
        let text = std::fs::read_to_string(place.path().join("deep/down/a b.ssd")).unwrap();
        assert!(
            text.contains(&format!(" version=\"{version}\" name=\"s\" generationTool=\"airloop ")),
            "{text}"
        );
    }
    assert_eq!(std::fs::read_dir(place.path()).unwrap().count(), 3, "something temporary was left");
}

#[test]
fn a_package_holds_each_fmu_once_and_a_set_per_component_with_start_values() {
    let folder = folder_without_library();
    let graph = rich(&folder);
    let file = folder.path().join("system.ssp");
    write_system(&graph, &file, Version::default()).unwrap();
    let mut zip = zip::ZipArchive::new(std::fs::File::open(&file).unwrap()).unwrap();
    let mut names: Vec<String> = zip.file_names().map(str::to_owned).collect();
    names.sort();
    let expected = ["SystemStructure.ssd", "resources/a.ssv", "resources/b.ssv", "resources/c.ssv"];
    assert_eq!(names[..4], expected);
    assert_eq!(names[4..], ["resources/other one.fmu", "resources/slave.fmu"]);
    let mut fmu = Vec::new();
    std::io::Read::read_to_end(&mut zip.by_name("resources/slave.fmu").unwrap(), &mut fmu).unwrap();
    assert_eq!(fmu, std::fs::read(folder.path().join("slave.fmu")).unwrap());
    for name in &expected[1..] {
        let mut set = String::new();
        std::io::Read::read_to_string(&mut zip.by_name(name).unwrap(), &mut set).unwrap();
        assert!(set.contains(" version=\"1.0\" name=\"initialValues\""), "{set}");
    }
}

#[test]
fn tools_without_connectors_of_the_system_get_constant_inputs_and_every_conversion() {
    let folder = folder_without_library();
    let graph = rich(&folder);
    let file = folder.path().join("closed.ssp");
    write_for(&graph, &file, Version::default(), Tool::Ecos).unwrap();
    let closed = SystemGraph::open(&file).unwrap();
    assert!(closed.inputs.is_empty() && closed.outputs.is_empty());
    let inner: Vec<_> = graph
        .connections
        .iter()
        .filter(|connection| !matches!(connection.source, Source::Input(_)))
        .cloned()
        .collect();
    assert_eq!(closed.connections, inner);
    for (one, other) in closed.components.iter().zip(&graph.components) {
        assert_eq!(one.start_values, other.start_values);
    }
    let mut zip = zip::ZipArchive::new(std::fs::File::open(&file).unwrap()).unwrap();
    let mut text = String::new();
    std::io::Read::read_to_string(&mut zip.by_name("SystemStructure.ssd").unwrap(), &mut text).unwrap();
    let connections = text.split_once("<ssd:Connections>").unwrap().1;
    let starts = connections.matches("startElement=").count();
    assert_eq!((starts, connections.matches("endElement=").count()), (inner.len(), inner.len()));
    let notes = Tool::Ecos.notes(&graph);
    assert!(notes.iter().any(|note| note.contains("`u` became constant start values")), "{notes:?}");
}

#[test]
fn start_values_are_put_into_fmus_that_can_hold_them() {
    let folder = folder_without_library();
    let ours = description().replacen(
        "<fmiModelDescription",
        "<fmiModelDescription generationTool=\"fmi-export\"",
        1,
    );
    pack(&folder.path().join("slave.fmu"), &ours, None);
    let text = ssd("", &[component("a", ""), component("b", "")].concat(), "", "");
    let mut graph = SystemGraph::open(&write(&folder, "system.ssd", &text)).unwrap();
    graph.set_start("b.gain", "0.1", "test").unwrap();
    let file = folder.path().join("system.ssp");
    write_system(&graph, &file, Version::default()).unwrap();
    let again = SystemGraph::open(&file).unwrap();
    let start = |component: usize| match &again.components[component]
        .fmu
        .description
        .variable("gain")
        .unwrap()
        .kind
    {
        VariableKind::Real(real) => real.start,
        _ => None,
    };
    assert_eq!((start(0), start(1)), (Some(1.0), Some(0.1)));
    assert_eq!(again.components[1].start_values, graph.components[1].start_values);
    assert!(Tool::Any.notes(&again).is_empty(), "{:?}", Tool::Any.notes(&again));
    // A package of that package is the same file.
    let second = folder.path().join("second.ssp");
    write_system(&again, &second, Version::default()).unwrap();
    assert_eq!(std::fs::read(&second).unwrap(), std::fs::read(&file).unwrap());
}

#[test]
fn a_conversion_that_the_units_give_is_left_to_them() {
    let folder = folder_without_library();
    let file = folder.path().join("out.ssd");
    write_system(&rich(&folder), &file, Version::default()).unwrap();
    let text = std::fs::read_to_string(&file).unwrap();
    let line = |part: &str| text.lines().find(|line| line.contains(part)).unwrap().trim().to_owned();
    assert_eq!(
        line("endElement=\"a\" endConnector=\"u\""),
        "<ssd:Connection startConnector=\"u\" endElement=\"a\" endConnector=\"u\"/>"
    );
    assert!(line("endElement=\"c\" endConnector=\"u\"").ends_with("suppressUnitConversion=\"true\">"));
    // 3 (N of a to N of c, factor 2) + 0.1.
    assert_eq!(line("LinearTransformation"), "<ssc:LinearTransformation factor=\"6.0\" offset=\"0.1\"/>");
    assert!(line("endConnector=\"x\"").contains("suppressUnitConversion=\"true\"/>"));
    assert!(line("name=\"smoot\"").contains("ssc:Unit"));
    assert!(text.contains("<ssc:BaseUnit m=\"1\" factor=\"1.7018\" offset=\"0.001\"/>"));
}

#[test]
fn a_single_fmu_becomes_a_system_of_one_component() {
    let folder = folder_without_library();
    std::fs::copy(folder.path().join("slave.fmu"), folder.path().join("slave.v2.fmu")).unwrap();
    let mut graph = SystemGraph::open(&folder.path().join("slave.v2.fmu")).unwrap();
    graph.set_start("gain", "2", "test").unwrap();
    let file = folder.path().join("one.ssd");
    write_system(&graph, &file, Version::default()).unwrap();
    let again = SystemGraph::open(&file).unwrap();
    assert_eq!((&again.inputs, &again.outputs), (&graph.inputs, &graph.outputs));
    assert_eq!(again.connections, graph.connections);
    assert_eq!(again.components[0].name, "slave_v2");
    assert_eq!(again.components[0].start_values, graph.components[0].start_values);
}

#[test]
fn what_cannot_be_written_is_refused_and_leaves_the_old_file() {
    let folder = folder_without_library();
    let mut graph = rich(&folder);
    let file = folder.path().join("kept.ssd");
    std::fs::write(&file, "old").unwrap();
    let message = |error: Error| error.to_string();
    graph.components[0].set_start(11, Start::String("bell \u{7}".into()));
    let error = message(write_system(&graph, &file, Version::default()).unwrap_err());
    assert!(error.contains("kept.ssd: ") && error.contains("control character"), "{error}");
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "old");
    let error = message(write_system(&graph, Path::new("system.xml"), Version::default()).unwrap_err());
    assert!(error.contains("system.xml: a system is written as .ssd or .ssp"), "{error}");
    let package = folder.path().join("system.ssp");
    write_system(&rich(&folder), &package, Version::default()).unwrap();
    let inside = SystemGraph::open(&package).unwrap();
    let error = message(write_system(&inside, &file, Version::default()).unwrap_err());
    assert!(error.contains("component `b`") && error.contains("write an .ssp"), "{error}");
}

fn airloop(folder: &TempDir, words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_airloop")).args(words).current_dir(folder.path()).output().unwrap()
}

/// u [mN] -> a.u [N]; b.u [N] = 3 a.y + 0.5; b.y [N] -> y [kN].
fn converting(folder: &TempDir) {
    let connectors = "<ssd:Connector name=\"u\" kind=\"input\"><ssc:Real unit=\"mN\"/></ssd:Connector>\n\
         <ssd:Connector name=\"y\" kind=\"output\"><ssc:Real unit=\"kN\"/></ssd:Connector>\n";
    let linear = connection("a.y", "b.u")
        .replace("/>", "><ssc:LinearTransformation factor=\"3\" offset=\"0.5\"/></ssd:Connection>");
    let connections = [connection("u", "a.u"), linear, connection("b.y", "y")].concat();
    write(
        folder,
        "system.ssd",
        &ssd(connectors, &(component("a", "") + &component("b", "")), &connections, ""),
    );
    write(folder, "in.csv", "time,u\n0,2000\n1,4000\n");
}

const RUN: [&str; 7] = ["--input", "in.csv", "--step", "250ms", "--no-plots", "-q", "-o"];

#[test]
fn units_and_transformations_change_the_numbers_of_a_run() {
    let folder = folder();
    converting(&folder);
    let output = airloop(&folder, &[&["run", "system.ssd"], &RUN[..], &["out"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let result = csv::read(&folder.path().join("out/result.csv")).unwrap();
    let values = |name: &str| result.channel(name).unwrap().values.clone();
    let close = |found: Vec<f64>, expected: [f64; 5]| {
        let worst = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-12, "{found:?}");
    };
    close(values("u"), [2000.0, 2500.0, 3000.0, 3500.0, 4000.0]);
    // Read after the step: a.y(k) is the u that was set at k - 1; 1000 mN are 1 N.
    close(values("a.y"), [2.0, 2.0, 2.5, 3.0, 3.5]);
    close(values("b.y"), [6.5, 6.5, 8.0, 9.5, 11.0]);
    close(values("y"), [6.5e-3, 6.5e-3, 8e-3, 9.5e-3, 11e-3]);
}

#[test]
fn a_written_system_runs_to_the_same_bits() {
    let folder = folder();
    converting(&folder);
    let set = ["--set", "a.gain=1.1"];
    let run = |system: &str, set: &[&str], output: &str| {
        let outcome = airloop(&folder, &[&["run", system], &RUN[..], &[output], set].concat());
        assert_eq!(outcome.status.code(), Some(0), "{}", String::from_utf8_lossy(&outcome.stderr));
        std::fs::read_to_string(folder.path().join(output).join("result.csv")).unwrap()
    };
    let expected = run("system.ssd", &set, "direct");
    for (file, version) in
        [("a/out.ssd", "2.0"), ("b/out.ssd", "1.0"), ("out.ssp", "2.0"), ("old.ssp", "1.0")]
    {
        let words = [&["export", "system.ssd", "-o", file, "--ssp-version", version], &set[..]].concat();
        let outcome = airloop(&folder, &words);
        assert_eq!(outcome.status.code(), Some(0), "{}", String::from_utf8_lossy(&outcome.stderr));
        let printed = String::from_utf8_lossy(&outcome.stdout).into_owned();
        assert!(
            printed.contains(&format!("{file}: SSP {version}, system s, components: 2, start values: 1")),
            "{printed}"
        );
        assert_eq!(run(file, &[], "again"), expected, "{file}");
    }
}

#[test]
fn the_command_refuses_what_it_cannot_write() {
    let folder = folder();
    converting(&folder);
    let cases: [(&[&str], i32, &str); 4] = [
        (&["-o", "x.ssd", "--ssp-version", "3.0"], 2, "possible values: 1.0, 2.0"),
        (&["-o", "x.txt"], 1, "choose one of these endings"),
        (&["-o", "x.ssd", "--set", "a.nope=1"], 1, "--set a.nope=1: there is no variable `nope`"),
        (&["-o", "x.ssd", "--set", "u"], 2, "write component.variable=value"),
    ];
    for (words, code, expected) in cases {
        let output = airloop(&folder, &[&["export", "system.ssd"], words].concat());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(code) && message.contains(expected), "{message}");
    }
    assert!(!folder.path().join("x.ssd").exists() && !folder.path().join("x.txt").exists());
}
