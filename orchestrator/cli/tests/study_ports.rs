//! Ports of a study that are told by name: two joints of one kind, found in the graph or stated, amended and run.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use airloop_refine::amend;
use airloop_refine::answer::{Answer, Effect, Parameter, Verdict, Wiring};
use airloop_refine::study::declaration::File;
use airloop_refine::study::plan::plan;
use airloop_refine::study::ports;
use airloop_refine::study::prepared::prepared;
use airloop_series::csv;
use airloop_testing::joints;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A record of 6 s at 250 Hz of the two joints with dry friction.
fn record(path: &Path, dry: [f64; 2], phase: f64) {
    let torque = |t: f64| {
        [0.7 * (2.1 * t + phase).sin(), 0.3 * (3.7 * t + 2.0 * phase).cos() - 0.3 * (2.0 * phase).cos()]
    };
    let (mut s, step, inner) = ([0.0; 4], 0.004, 20);
    let mut text = "time,tau_1,tau_2,q_1,q_2\n".to_owned();
    for k in 0..1500 {
        let t = f64::from(k) * step;
        let [a, b] = torque(t);
        // Noise of 0.1 mrad that needs no generator: the digits behind those that count.
        let odd = |k: i32, f: f64| 1e-4 * ((f64::from(k) * f).sin() * 43_758.545).fract();
        let _ =
            writeln!(text, "{t:.3},{a:.9},{b:.9},{:.9},{:.9}", s[0] + odd(k, 12.99), s[1] + odd(k, 78.23));
        for _ in 0..inner {
            // Torques are held over the sample.
            s = joints::step(s, torque(t), dry, 0.01, step / f64::from(inner));
        }
    }
    std::fs::write(path, text).unwrap();
}

fn study(folder: &Path, dry: [f64; 2], attachments: &str) -> PathBuf {
    joints::fmu(folder);
    record(&folder.join("one.csv"), dry, 0.3);
    record(&folder.join("two.csv"), dry, 1.1);
    record(&folder.join("three.csv"), dry, 2.3);
    let mut text = "name = \"joints\"\nsystem = \"joints.fmu\"\nstep_s = 0.004\n".to_owned();
    for joint in ["1", "2"] {
        let _ = write!(
            text,
            "[inputs.tau_{joint}]\ncolumn = \"tau_{joint}\"\nunit = \"N.m\"\nhold = true\n[outputs.q_{joint}]\ncolumn = \"q_{joint}\"\nunit = \"rad\"\n"
        );
    }
    for (file, role) in [("one", "estimation"), ("two", "estimation"), ("three", "validation")] {
        let _ = write!(
            text,
            "[[segment]]\nfile = \"{file}.csv\"\nrole = \"{role}\"\ninitial = {{ q_1 = 0.0 }}\n"
        );
    }
    let path = folder.join("study.toml");
    std::fs::write(&path, text + attachments).unwrap();
    path
}

const STATED: &str = "[[attachment]]\ninput = \"tau_1\"\nchannels = [\"cart_friction\"]\nvelocity = \"w_1\"\nvt = 0.01\n[[attachment]]\ninput = \"tau_2\"\nchannels = [\"cart_friction\"]\nvelocity = \"w_2\"\nvt = 0.01\n";

fn airloop(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_airloop")).args(arguments).output().unwrap()
}

#[test]
fn velocity_and_position_of_each_joint_are_found_in_the_equations() {
    let folder = tempfile::tempdir().unwrap();
    let file = File::read(&study(folder.path(), [0.0; 2], "")).unwrap();
    let graph = airloop_refine::study::open::system(&file).unwrap();
    let found = ports::find(&graph, &[], &[]).unwrap();
    let told: Vec<_> = found
        .iter()
        .map(|port| (port.name.as_str(), port.velocity.as_deref(), port.position.as_deref(), port.sign))
        .collect();
    assert_eq!(told, [("tau_1", Some("w_1"), Some("q_1"), 1.0), ("tau_2", Some("w_2"), Some("q_2"), 1.0)]);
    assert!(found.iter().all(|port| port.kind == ports::Kind::Mechanical && port.like.is_none()));
    let found = plan(&file).unwrap();
    let places: Vec<&str> = found.places.iter().map(|place| place.port.as_str()).collect();
    assert_eq!(places, ["tau_1", "tau_2"]);
    for kind in ["viscous", "coulomb", "spring", "cubic_spring", "delay", "lag", "rate_limit"] {
        assert!(found.places.iter().all(|place| place.kinds.iter().any(|own| own == kind)), "{kind}");
    }
    assert_eq!(found.sensors.len(), 2);
}

#[test]
fn a_study_is_integrated_as_finely_as_its_sensors_can_tell() {
    let folder = tempfile::tempdir().unwrap();
    let path = study(folder.path(), [0.0; 2], STATED);
    let substeps = || prepared(&File::read(&path).unwrap(), 1, &|_| ()).unwrap().study.substeps;
    // At 4 ms a step is off by less than 1e-7 rad.
    assert_eq!(substeps(), 1);
    for name in ["one", "two", "three"] {
        let path = folder.path().join(name).with_extension("csv");
        let text = std::fs::read_to_string(&path).unwrap();
        let (head, rows) = text.split_once('\n').unwrap();
        let rows: Vec<&str> = rows.lines().step_by(25).collect();
        std::fs::write(&path, format!("{head}\n{}\n", rows.join("\n"))).unwrap();
    }
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replace("step_s = 0.004", "step_s = 0.1")).unwrap();
    // At 0.1 s by some milliradians over a record.
    assert!(substeps() > 1);
}

fn effect(id: &str, port: &str, parameters: &[f64]) -> Effect {
    let one =
        |&value: &f64| Parameter { name: "p".into(), unit: String::new(), value, interval: (value, value) };
    let joint = port.trim_start_matches("tau_");
    Effect {
        id: id.into(),
        port: Some(port.into()),
        selected: true,
        parameters: parameters.iter().map(one).collect(),
        wiring: Some(Wiring {
            velocity: Some(format!("w_{joint}")),
            position: Some(format!("q_{joint}")),
            vt: 0.01,
            sign: 1.0,
            ..Wiring::default()
        }),
        ..Effect::default()
    }
}

#[test]
fn the_amended_system_moves_with_dry_friction_in_both_joints() {
    let folder = tempfile::tempdir().unwrap();
    let file = File::read(&study(folder.path(), [0.04, 0.015], STATED)).unwrap();
    let effects = vec![effect("coulomb@tau_1", "tau_1", &[0.04]), effect("coulomb@tau_2", "tau_2", &[0.015])];
    let answer = Answer { verdict: Verdict::Effect, effects, ..Answer::default() };
    let network = amend::study::network(&file, &answer, folder.path()).unwrap();
    match amend::write(&network, folder.path(), Some(&root().join("target/fmu"))) {
        Err(amend::Error::Template(missing)) => {
            eprintln!("skipped: {missing}");
            return;
        }
        written => written.unwrap(),
    }
    let (system, out) = (folder.path().join("system/system.ssd"), folder.path().join("run"));
    let record = folder.path().join("three.csv");
    let arguments = ["run", system.to_str().unwrap(), "--master", "monolithic", "--no-plots", "--quiet"];
    let further = [
        "--step",
        "0.004",
        "--interpolation",
        "hold",
        "--measured",
        record.to_str().unwrap(),
        "-o",
        out.to_str().unwrap(),
    ];
    let output = airloop(&[&arguments[..], &further[..]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let (result, measured) = (csv::read(&out.join("result.csv")).unwrap(), csv::read(&record).unwrap());
    for name in ["q_1", "q_2"] {
        let [found, expected] = [&result, &measured].map(|own| &own.channel(name).unwrap().values);
        let largest = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let moved = expected.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        // The noise of the record is 0.1 mrad, also that of its first sample, from which the run starts.
        assert!(largest < 5e-3 * moved, "{name}: {largest} of {moved}");
    }
}

#[test]
fn dry_friction_in_both_joints_is_told_by_joint() {
    for (attachments, ids) in
        [(STATED, ["cf.coulomb", "cf.coulomb"]), ("", ["coulomb@tau_1", "coulomb@tau_2"])]
    {
        let folder = tempfile::tempdir().unwrap();
        study(folder.path(), [0.04, 0.015], attachments);
        let out = folder.path().join("out");
        let output = airloop(&["refine", folder.path().to_str().unwrap(), "-o", out.to_str().unwrap()]);
        assert!(matches!(output.status.code(), Some(0 | 12)), "{output:?}");
        let text = std::fs::read_to_string(out.join("report.json")).unwrap();
        let report: serde_json::Value = serde_json::from_str(&text).unwrap();
        let mut found: Vec<(String, String, f64)> = report["effects"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|effect| effect["selected"] == true && effect["kind"] == "coulomb")
            .map(|effect| {
                let text = |name: &str| effect[name].as_str().unwrap().to_owned();
                (text("port"), text("id"), effect["params"]["force"]["value"].as_f64().unwrap())
            })
            .collect();
        found.sort_by(|a, b| a.0.cmp(&b.0));
        let places: Vec<(&str, &str)> = found.iter().map(|own| (own.0.as_str(), own.1.as_str())).collect();
        assert_eq!(places, [("tau_1", ids[0]), ("tau_2", ids[1])]);
        assert!(
            (found[0].2 / 0.04 - 1.0).abs() < 0.05 && (found[1].2 / 0.015 - 1.0).abs() < 0.05,
            "{found:?}"
        );
        let page = std::fs::read_to_string(out.join("report.md")).unwrap();
        assert!(page.contains("friction at tau_2") && !page.contains("cart "), "{page}");
    }
}
