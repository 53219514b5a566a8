//! `airloop refine` on rigs that no model fits to the noise: the dominant effect, its share, and what is left.

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// Exit code and report of a case of data/rig_messy.
fn answer(case: &str) -> (Option<i32>, Value) {
    let case = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/rig_messy").join(case);
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_airloop"))
        .args(["refine", "--quiet"])
        .args([&case, Path::new("-o"), folder.path()])
        .output()
        .unwrap();
    let text = fs::read_to_string(folder.path().join("report.json")).unwrap();
    (output.status.code(), serde_json::from_str(&text).unwrap())
}

/// Checks the first selected effect, its main parameter within 10 % and its share within 10 points.
fn check(case: &str, id: &str, (name, truth): (&str, f64), share: f64) {
    let (code, report) = answer(case);
    assert_eq!((code, &report["verdict"], &report["complete"]), (Some(0), &"effect".into(), &false.into()));
    let first =
        report["effects"].as_array().unwrap().iter().find(|effect| effect["selected"] == true).unwrap();
    assert_eq!(first["id"], id);
    let value = first["params"][name]["value"].as_f64().unwrap();
    assert!((value / truth - 1.0).abs() < 0.1, "{value}");
    assert!((first["share"].as_f64().unwrap() - share).abs() < 0.1, "{}", first["share"]);
    assert!(!report["corrections"].as_array().unwrap().is_empty());
    assert_eq!(report["steps"][0]["candidates"][0]["id"], id);
    let left = report["remaining"]["signals"]["F_p"]["ratio"].as_f64().unwrap();
    assert!(left > 0.0 && left < 1.0, "{left}");
}

#[test]
fn a_friction_peak_is_named_on_sweeps_that_nothing_fits() {
    // Truth and share as in truth.toml and README.md.
    check("w06", "cf.stribeck", ("force", 2.4378), 0.90);
}

#[test]
#[ignore = "a minute; run by `make study-refine-messy`"]
fn a_spring_is_named_on_a_coupled_rig_that_nothing_fits() {
    check("w01", "cart.spring", ("stiffness", 28.14), 0.87);
}

#[test]
#[ignore = "a minute; run by `make study-refine-messy`"]
fn small_deviations_are_corrections_and_no_effect() {
    let (code, report) = answer("w07");
    assert_eq!((code, &report["verdict"]), (Some(11), &"unexplained".into()));
    assert!(report["effects"].as_array().unwrap().iter().all(|effect| effect["selected"] == false));
    assert!(!report["corrections"].as_array().unwrap().is_empty());
}
