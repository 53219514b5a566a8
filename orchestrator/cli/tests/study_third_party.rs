//! Studies of systems that are not of this project: an FMU with a force input, alone and behind a connection.

use airloop_testing::carriage;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

const SYSTEM: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" version="1.0" name="rail">
<ssd:System name="rail"><ssd:Connectors><ssd:Connector name="force" kind="input"><ssc:Real xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" unit="N"/></ssd:Connector></ssd:Connectors>
<ssd:Elements><ssd:Component name="wagon" source="carriage.fmu"><ssd:Connectors><ssd:Connector name="drive" kind="input"/>
<ssd:Connector name="place" kind="output"/><ssd:Connector name="speed" kind="output"/></ssd:Connectors></ssd:Component></ssd:Elements>
<ssd:Connections><ssd:Connection startConnector="force" endElement="wagon" endConnector="drive"/></ssd:Connections>
</ssd:System></ssd:SystemStructureDescription>
"#;

/// A study of the carriage; names of the system behind `prefix`.
fn study(folder: &Path, system: &str, input: &str, prefix: &str, attachment: &str, dry: f64) {
    carriage::fmu(folder);
    std::fs::write(folder.join("rail.ssd"), SYSTEM).unwrap();
    carriage::record(&folder.join("one.csv"), dry, 0.3);
    carriage::record(&folder.join("two.csv"), dry, 1.1);
    let text = format!(
        r#"system = "{system}"
[parameters]
"{prefix}weight" = 4.2
[inputs]
{input} = {{ column = "force", unit = "N", hold = true }}
[states]
"{prefix}place" = {{ column = "position", unit = "m" }}
"{prefix}speed" = {{ column = "speed", unit = "m/s" }}
[outputs]
"{prefix}place" = {{ column = "position", unit = "m" }}
[[free]]
parameter = "{prefix}weight"
min = 0.1
[[free]]
parameter = "{prefix}drag"
min = 0.0
[[segment]]
file = "one.csv"
role = "estimation"
[[segment]]
file = "two.csv"
role = "validation"
[error]
windows_s = 0.5
[[attachment]]
input = "{attachment}"
channels = ["cart_friction", "cart"]
velocity = "{prefix}speed"
position = "{prefix}place"
viscous = "{prefix}drag"
"#
    );
    std::fs::write(folder.join("study.toml"), text).unwrap();
}

fn airloop(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_airloop")).args(arguments).output().unwrap()
}

fn refined(folder: &Path, code: i32) -> Value {
    let out = folder.join("out");
    let output = airloop(&["refine", folder.to_str().unwrap(), "-o", out.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(code), "{output:?}");
    serde_json::from_str(&std::fs::read_to_string(out.join("report.json")).unwrap()).unwrap()
}

fn names(report: &Value) -> Vec<&str> {
    let effects = report["effects"].as_array().unwrap().iter();
    effects.filter(|e| e["selected"] == true).map(|e| e["id"].as_str().unwrap()).collect()
}

#[test]
fn dry_friction_of_a_foreign_carriage_is_found_with_its_size() {
    let folder = tempfile::tempdir().unwrap();
    study(folder.path(), "carriage.fmu", "drive", "", "drive", carriage::TRUTH.2);
    let report = refined(folder.path(), 0);
    assert_eq!(names(&report), ["cf.coulomb"]);
    let force = report["effects"][0]["params"]["force"]["value"].as_f64().unwrap();
    // Speeds of 0.2 mm/s noise at the restarts: some percent.
    assert!((force - carriage::TRUTH.2).abs() < 0.1 * carriage::TRUTH.2, "{force}");
}

#[test]
fn a_foreign_carriage_behind_a_connection_is_amended_and_runs() {
    let folder = tempfile::tempdir().unwrap();
    study(folder.path(), "rail.ssd", "force", "wagon.", "wagon.drive", carriage::TRUTH.2);
    let report = refined(folder.path(), 0);
    assert_eq!(names(&report), ["cf.coulomb"]);
    if report["amended_system"].is_null() {
        // The blocks of effects are FMUs of this project, which a build of the library alone does not make.
        let notes = report["notes"].to_string();
        assert!(notes.contains("make fmu"), "{notes}");
        eprintln!("skipped the run of the amended system: the FMUs of effects are not built");
        return;
    }
    let system = folder.path().join("out/system/system.ssd");
    let run = folder.path().join("run");
    let arguments = ["run", system.to_str().unwrap(), "--master", "monolithic", "--stop", "0.5", "-o"];
    let output = airloop(&[&arguments[..], &[run.to_str().unwrap()]].concat());
    assert!(output.status.success(), "{output:?}");
}

#[test]
fn a_carriage_without_dry_friction_lacks_nothing() {
    let folder = tempfile::tempdir().unwrap();
    study(folder.path(), "carriage.fmu", "drive", "", "drive", 0.0);
    let report = refined(folder.path(), 10);
    assert_eq!((&report["verdict"], names(&report).len()), (&"none".into(), 0));
}
