//! `.ssp` packages: what they may refer to, and how messages name what is inside.
#![cfg(target_os = "linux")]

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use airloop_cosim::system::SystemGraph;
use airloop_testing::fmu_library::{FIRST_ORDER, compiled};
use airloop_testing::slave::{component, folder, folder_without_library, ssd};
use tempfile::TempDir;
use zip::write::SimpleFileOptions;

/// Name and contents of a file in a package.
type Entry<'a> = (&'a str, &'a [u8]);

/// Writes `name` with these entries.
fn package(folder: &TempDir, name: &str, entries: &[Entry]) -> PathBuf {
    let path = folder.path().join(name);
    let mut writer = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
    for (name, bytes) in entries {
        writer.start_file(*name, SimpleFileOptions::default()).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap();
    path
}

/// A description whose component has this source and, if given, this parameter set.
fn description(source: &str, set: Option<&str>) -> String {
    let binding = |set| {
        format!("<ssd:ParameterBindings><ssd:ParameterBinding source=\"{set}\"/></ssd:ParameterBindings>")
    };
    let inside = set.map_or_else(String::new, binding);
    ssd("", &component("a", "@").replace("slave.fmu", source).replace("@", &inside), "", "")
}

fn message(path: &Path) -> String {
    SystemGraph::open(path).unwrap_err().to_string()
}

#[test]
fn sources_that_leave_the_package_are_refused() {
    let folder = folder_without_library();
    let fmu = std::fs::read(folder.path().join("slave.fmu")).unwrap();
    let outside = folder.path().join("slave.fmu");
    let absolute = outside.to_str().unwrap();
    let uri = format!("file://{absolute}");
    let short = format!("file:{absolute}");
    let inner = "resources/slave.fmu";
    let coded = "resources/%2E%2E/%2E%2E/slave.fmu";
    let mut cases = vec![];
    for source in ["../slave.fmu", "resources/../../slave.fmu", coded, absolute, &uri, &short] {
        cases.push((description(source, None), source.to_owned()));
        cases.push((description(inner, Some(source)), source.to_owned()));
    }
    for (text, source) in cases {
        let path = package(&folder, "p.ssp", &[("SystemStructure.ssd", text.as_bytes()), (inner, &fmu)]);
        let message = message(&path);
        let expected =
            format!("p.ssp:SystemStructure.ssd: line 7: the source {source}, which leads out of the package");
        assert!(message.contains(&expected), "{message}");
    }
    for source in [inner, "./resources/slave.fmu"] {
        let text = description(source, None);
        let path = package(&folder, "p.ssp", &[("SystemStructure.ssd", text.as_bytes()), (inner, &fmu)]);
        let graph = SystemGraph::open(&path).unwrap();
        assert!(graph.components[0].fmu.shown.ends_with("p.ssp:resources/slave.fmu"));
    }
}

#[test]
fn messages_name_the_package_and_the_place_inside() {
    let folder = folder_without_library();
    let fmu = std::fs::read(folder.path().join("slave.fmu")).unwrap();
    let inner = "resources/slave.fmu";
    let text = description(inner, None);
    let set = description(inner, Some("resources/set.ssv"));
    let cases: [(&[Entry], &str); 5] = [
        (
            &[("system.ssd", text.as_bytes()), (inner, &fmu)],
            "no SystemStructure.ssd at its root; it has: resources, system.ssd",
        ),
        (
            &[("SystemStructure.ssd", text.as_bytes())],
            "component `a`: there is no file @:resources/slave.fmu",
        ),
        (&[("SystemStructure.ssd", text.as_bytes()), (inner, b"PK")], "@:resources/slave.fmu"),
        (
            &[("SystemStructure.ssd", set.as_bytes()), (inner, &fmu)],
            "line 7: there is no file @:resources/set.ssv",
        ),
        (
            &[("SystemStructure.ssd", set.as_bytes()), (inner, &fmu), ("resources/set.ssv", b"<a/>")],
            "@:resources/set.ssv: line 1: expected <ParameterSet>",
        ),
    ];
    for (entries, expected) in cases {
        let path = package(&folder, "p.ssp", entries);
        let message = message(&path);
        let shown = path.to_str().unwrap();
        assert!(message.starts_with(shown), "{message}");
        assert!(message.contains(&expected.replace('@', shown)), "{message}");
        assert!(!message.contains("/airloop-"), "{message}");
    }
}

#[test]
fn inspect_and_run_show_places_inside_of_the_package() {
    let folder = folder();
    let fmu = std::fs::read(folder.path().join("slave.fmu")).unwrap();
    let inner = "resources/slave.fmu";
    let text = description(inner, None);
    package(&folder, "p.ssp", &[("SystemStructure.ssd", text.as_bytes()), (inner, &fmu)]);
    let airloop = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_airloop"));
        let output = command.args(words).current_dir(folder.path()).output().unwrap();
        assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let json: serde_json::Value = serde_json::from_str(&airloop(&["inspect", "--json", "p.ssp"])).unwrap();
    assert_eq!(json["components"][0]["fmu"], "p.ssp:resources/slave.fmu");
    assert!(airloop(&["inspect", "p.ssp"]).contains("p.ssp:resources/slave.fmu"));
    assert!(airloop(&["inspect", "--check", "--no-run", "p.ssp"]).contains("p.ssp:resources/slave.fmu"));
    airloop(&["run", "p.ssp", "--stop", "1", "-o", "out"]);
    let summary = std::fs::read_to_string(folder.path().join("out/summary.json")).unwrap();
    assert!(summary.contains("\"path\": \"p.ssp:resources/slave.fmu\""), "{summary}");
}

#[test]
fn the_checker_runs_the_fmus_of_a_package() {
    let folder = TempDir::new().unwrap();
    compiled(&folder, "first_order.c", FIRST_ORDER, &[]);
    let fmu = std::fs::read(folder.path().join("m.fmu")).unwrap();
    let one = "<ssd:Component name=\"a\" source=\"resources/m.fmu\"/>";
    let text = ssd("", one, "", "");
    let entries = [("SystemStructure.ssd", text.as_bytes()), ("resources/m.fmu", &fmu[..])];
    let path = package(&folder, "p.ssp", &entries);
    let output =
        Command::new(env!("CARGO_BIN_EXE_airloop")).args(["inspect", "--check"]).arg(path).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && text.contains("0 errors"), "{text}");
}
