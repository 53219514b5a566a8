//! `airloop refine` as a user meets it: exit codes, report.json, messages.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// A case of the shared records; `None`, with a line that says so, where they are not there.
fn case(name: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/rig").join(name);
    if !folder.is_dir() {
        eprintln!("skipped: {} is not there", folder.display());
        return None;
    }
    Some(folder)
}

fn refine(case: &Path, output: &Path) -> Output {
    let program = env!("CARGO_BIN_EXE_airloop");
    Command::new(program).arg("refine").arg(case).arg("-o").arg(output).output().unwrap()
}

fn report(folder: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join("report.json")).unwrap()).unwrap()
}

#[test]
fn names_the_dead_band_of_the_rod_fixed_case_and_writes_all_fields() {
    let Some(case) = case("v02") else { return };
    let folder = tempfile::tempdir().unwrap();
    let output = refine(&case, folder.path());
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let report = report(folder.path());
    assert_eq!(report["verdict"], "effect");
    let effect = &report["effects"][0];
    assert_eq!(
        (&effect["id"], &effect["channel"], &effect["selected"]),
        (&"act.deadband".into(), &"actuator".into(), &true.into())
    );
    let width = &effect["params"]["width"];
    let [low, high] = [0, 1].map(|i| width["ci95"][i].as_f64().unwrap());
    // truth.toml: 1.373845
    assert!(low < 1.373845 && 1.373845 < high && high - low < 0.02, "{width}");
    assert_eq!(width["unit"], "N");
    assert!(report["effects"].as_array().unwrap().iter().skip(1).all(|e| e["selected"] == false));
    for set in ["estimation", "validation"] {
        let residual = &report["residual"][set];
        for field in ["rms_before", "rms_after", "nrmse_before", "nrmse_after"] {
            assert!(residual[field]["F_hat"].as_f64().unwrap() > 0.0, "{set} {field}");
        }
        assert!(residual["rms_after"]["F_hat"].as_f64().unwrap() < 0.31);
        assert!(residual["rms_before"]["F_hat"].as_f64().unwrap() > 1.0);
    }
    assert_eq!(report["unexplained"], Value::Null);
    for file in ["report.md", "report.html"] {
        assert!(fs::read_to_string(folder.path().join(file)).unwrap().contains("act.deadband"), "{file}");
    }
}

#[test]
fn finds_what_the_pole_lacks_behind_an_actuator_that_does_not_hold_in_motion() {
    let Some(whole) = case("v09") else { return };
    let folder = tempfile::tempdir().unwrap();
    let [case, out] = ["case", "out"].map(|name| folder.path().join(name));
    fs::create_dir(&case).unwrap();
    beginning_of(&whole, 1200, &case);
    let output = refine(&case, &out);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let report = report(&out);
    let selected: Vec<&Value> =
        report["effects"].as_array().unwrap().iter().filter(|e| e["selected"] == true).collect();
    assert_eq!(selected.iter().map(|e| &e["id"]).collect::<Vec<_>>(), ["pole.coulomb"]);
    let [low, high] = [0, 1].map(|i| selected[0]["params"]["torque"]["ci95"][i].as_f64().unwrap());
    // truth.toml: 0.003895016
    assert!(low < 0.003895016 && 0.003895016 < high && high - low < 1e-4, "{low} {high}");
    assert_eq!(report["unexplained"]["channel"], "actuator");
    assert!(
        report["notes"].as_array().unwrap().iter().any(|note| note.as_str().unwrap().contains("cylinder"))
    );
    let rms = |when: &str, signal: &str| report["residual"]["validation"][when][signal].as_f64().unwrap();
    // Noise: 0.3 N and 0.44 mrad.
    assert!(rms("rms_before", "F_hat") > 3.0 && rms("rms_after", "F_hat") < 0.31);
    assert!(rms("rms_before", "theta") > 5e-3 && rms("rms_after", "theta") < 5e-4);
}

#[test]
fn finds_what_the_guide_lacks_behind_a_cylinder_whose_dimensions_nobody_states() {
    let case = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/rig/other_cylinder");
    let folder = tempfile::tempdir().unwrap();
    let output = refine(&case, folder.path());
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let report = report(folder.path());
    let effects = report["effects"].as_array().unwrap();
    let selected: Vec<&Value> = effects.iter().filter(|e| e["selected"] == true).collect();
    assert_eq!(selected.iter().map(|e| &e["id"]).collect::<Vec<_>>(), ["cart.tilt"]);
    let [low, high] = [0, 1].map(|i| selected[0]["params"]["angle"]["ci95"][i].as_f64().unwrap());
    // Truth of the generator.
    assert!(low < -0.027269 && -0.027269 < high && high - low < 2e-4, "{low} {high}");
    let corrections = report["corrections"].as_array().unwrap();
    let truth = [
        ("bore", 0.025664),
        ("rod", 0.010082),
        ("stroke", 0.28666),
        ("psup", 568_750.0),
        ("Avmax", 3.6404e-6),
        ("Kp", 8.0182e-6),
        ("vhys", 1249.1),
        ("Vt", 1.148e-5),
        ("At", 1.5713e-6),
        ("eta", 0.96887),
    ];
    for (name, value) in truth {
        let of = |own: &&Value| own["component"] == "cylinder" && own["parameter"] == name;
        let found = corrections.iter().find(of).unwrap_or_else(|| panic!("{name}: {corrections:?}"));
        let error = found["value"].as_f64().unwrap() / value - 1.0;
        assert!(error.abs() < 0.05, "{name} is off by {error}");
    }
    let rms = |signal: &str| report["residual"]["validation"]["rms_after"][signal].as_f64().unwrap();
    // Noise: 0.3 N, 0.1 mm and 0.44 mrad.
    assert!(rms("F_hat") < 0.32 && rms("x") < 1.1e-4 && rms("theta") < 4.8e-4);
}

#[test]
fn a_cylinder_that_makes_no_sense_is_refused_with_its_parameter() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case");
    fs::create_dir(&case).unwrap();
    beginning("v05", 500, &case);
    let file = case.join("case.toml");
    let text = fs::read_to_string(&file).unwrap();
    fs::write(
        &file,
        text.replace("[model.actuator]", "[model.cylinder]\nbore = 0.02\nrod = 0.025\n[model.actuator]"),
    )
    .unwrap();
    let output = refine(&case, &folder.path().join("out"));
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("case.toml") && message.contains("rod = 0.025 m is not thinner"), "{message}");
    assert!(!folder.path().join("out").exists());
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let Some(case) = case("v07") else { return };
    let folder = tempfile::tempdir().unwrap();
    let [one, two] = ["one", "two"].map(|name| folder.path().join(name));
    assert_eq!(refine(&case, &one).status.code(), Some(0));
    refine(&case, &two);
    let bytes = |folder: &Path| fs::read(folder.join("report.json")).unwrap();
    assert!(bytes(&one) == bytes(&two));
    assert_eq!(report(&one)["effects"][0]["id"], "cf.stribeck");
}

/// The first `rows` of the records of a case of this project, in a folder of their own.
fn beginning(name: &str, rows: usize, folder: &Path) {
    beginning_of(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/rig").join(name), rows, folder);
}

/// The same of any case.
fn beginning_of(case: &Path, rows: usize, folder: &Path) {
    for entry in fs::read_dir(case).unwrap() {
        let path = entry.unwrap().path();
        let text = fs::read_to_string(&path).unwrap();
        let whole = path.extension().is_none_or(|extension| extension != "csv");
        let lines: Vec<&str> = text.lines().take(if whole { usize::MAX } else { rows + 1 }).collect();
        fs::write(folder.join(path.file_name().unwrap()), lines.join("\n") + "\n").unwrap();
    }
}

#[test]
fn the_report_is_the_same_to_the_byte_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case");
    fs::create_dir(&case).unwrap();
    beginning("v01", 400, &case);
    let reports = ["1", "2", "3"].map(|threads| {
        let out = folder.path().join(threads);
        let program = env!("CARGO_BIN_EXE_airloop");
        let args =
            [Path::new("refine"), &case, Path::new("-o"), &out, "--threads".as_ref(), threads.as_ref()];
        let output = Command::new(program).args(args).output().unwrap();
        assert!(matches!(output.status.code(), Some(0 | 10 | 11 | 12)), "{output:?}");
        fs::read(out.join("report.json")).unwrap()
    });
    assert!(reports[0] == reports[1] && reports[0] == reports[2]);
    let report: Value = serde_json::from_slice(&reports[0]).unwrap();
    assert_eq!(selected(&report)[0]["id"], "cart.spring", "{report}");
}

const ACTUATOR: &str = "id = \"t\"\nkind = \"actuator\"\nsample_rate_hz = 1000\n[model.actuator]\nsample_time = 0.001\nA1 = [[-0.9, 0.0], [0.0, -0.9]]\nB0 = [0.1, 0.1]\nB1 = [0.0, 0.0]\n[sensors.u]\nunit = \"N\"\nnoise_rms = 0.0\n[sensors.F_hat]\nunit = \"N\"\nnoise_rms = 0.3\n[sensors.F_p]\nunit = \"N\"\nnoise_rms = 0.3\n";

fn file(name: &str, role: &str) -> String {
    format!("[[files]]\nname = \"{name}\"\nrole = \"{role}\"\nexperiment = \"rod_fixed\"\n")
}

#[test]
fn a_case_without_validation_records_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("case.toml"), ACTUATOR.to_owned() + &file("a.csv", "estimation")).unwrap();
    let output = refine(folder.path(), &folder.path().join("out"));
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1));
    assert!(
        message.contains("no file has the role `validation`") && message.contains("has not seen"),
        "{message}"
    );
}

#[test]
fn a_time_gap_is_named_with_file_and_line() {
    let folder = tempfile::tempdir().unwrap();
    let declaration = ACTUATOR.to_owned() + &file("a.csv", "estimation") + &file("a.csv", "validation");
    fs::write(folder.path().join("case.toml"), declaration).unwrap();
    fs::write(folder.path().join("a.csv"), "time,u,F_hat,F_p\n0,1,0,0\n0.001,1,0,0\n0.005,1,0,0\n").unwrap();
    let output = refine(folder.path(), &folder.path().join("out"));
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1));
    assert!(
        message.contains("a.csv") && message.contains("line 4") && message.contains("0.004"),
        "{message}"
    );
}

/// Uniform numbers in -1..1 from a linear congruential generator.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// About normal, of unit variance: twelve uniform numbers.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.next()).sum::<f64>() / 2.0
    }
}

/// Records of a rod-fixed actuator whose command path is `path(time, command)`; a first-order lag, typed here anew.
fn bench(folder: &Path, path: impl Fn(f64, f64) -> f64) {
    let mut random = Random(7);
    let mut files = String::new();
    for (index, role) in ["estimation", "estimation", "validation"].into_iter().enumerate() {
        let mut lines = String::from("time,u,F_hat,F_p\n");
        let [mut hat, mut act, mut level] = [0.0f64; 3];
        for k in 0..2000 {
            let t = f64::from(k) * 1e-3;
            if k % 150 == 0 {
                level = 25.0 * random.next();
            }
            let u = ((level + 10.0 * (9.0 * t * (1.0 + index as f64)).sin()) * 1e3).round() / 1e3;
            let sent = path(t, u);
            hat = 0.9 * hat + 0.1 * sent;
            act = 0.95 * act + 0.05 * sent;
            let [a, b] = [hat, act].map(|force| force + 0.3 * random.normal());
            lines += &format!("{t:.3},{u:.3},{a:.2},{b:.2}\n");
        }
        let name = format!("record_{index}.csv");
        fs::write(folder.join(&name), lines).unwrap();
        files += &file(&name, role);
    }
    let declared = ACTUATOR
        .replace("A1 = [[-0.9, 0.0], [0.0, -0.9]]", "A1 = [[-0.9, 0.0], [0.0, -0.95]]")
        .replace("B0 = [0.1, 0.1]", "B0 = [0.1, 0.05]");
    fs::write(folder.join("case.toml"), declared + &files).unwrap();
}

fn answer_of(path: impl Fn(f64, f64) -> f64) -> (Option<i32>, Value) {
    let folder = tempfile::tempdir().unwrap();
    bench(folder.path(), path);
    let output = refine(folder.path(), &folder.path().join("out"));
    (output.status.code(), report(&folder.path().join("out")))
}

fn selected(report: &Value) -> Vec<&Value> {
    report["effects"].as_array().unwrap().iter().filter(|effect| effect["selected"] == true).collect()
}

#[test]
fn nothing_is_missing_where_the_records_follow_the_declared_model() {
    let (code, report) = answer_of(|_, u| u);
    assert_eq!((code, &report["verdict"]), (Some(10), &"none".into()));
    assert!(selected(&report).is_empty());
}

#[test]
fn what_the_command_path_does_is_named_with_an_interval_that_holds_the_truth() {
    let play = std::cell::Cell::new(0.0f64);
    let with_play = |t: f64, u: f64| {
        let before = if t == 0.0 { 0.0 } else { play.get() };
        play.set(before.max(u - 0.9).min(u + 0.9));
        play.get()
    };
    let saturated = |_: f64, u: f64| u.clamp(-18.0, 18.0);
    type Path<'a> = (&'a str, &'a str, f64, &'a dyn Fn(f64, f64) -> f64);
    let paths: [Path; 3] = [
        ("act.gain", "gain", -0.04, &|_, u| 0.96 * u),
        ("act.hysteresis", "width", 0.9, &with_play),
        ("act.saturation", "limit", 18.0, &saturated),
    ];
    for (id, name, truth, path) in paths {
        let (code, report) = answer_of(path);
        let [effect] = selected(&report)[..] else { panic!("{id}: {report}") };
        assert_eq!((code, &effect["id"]), (Some(0), &id.into()));
        let parameter = &effect["params"][name];
        let [low, high] = [0, 1].map(|i| parameter["ci95"][i].as_f64().unwrap());
        // Twice the 95 % interval: some four standard deviations.
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        assert!((middle - truth).abs() < 2.0 * half && half < 0.1 * truth.abs(), "{id}: {parameter}");
    }
}

#[test]
fn what_no_candidate_explains_is_told_with_its_channel() {
    let (code, report) = answer_of(|t, u| u + 3.0 * (5.0 * t).sin());
    assert_eq!((code, &report["verdict"]), (Some(11), &"unexplained".into()));
    assert_eq!(report["unexplained"]["channel"], "actuator");
    assert!(selected(&report).is_empty());
}

#[test]
#[cfg(unix)]
fn an_interrupted_search_keeps_its_best_answer_and_says_that_it_is_partial() {
    let case = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/rig/v01");
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("out");
    let child = Command::new(env!("CARGO_BIN_EXE_airloop"))
        .arg("refine")
        .args([&case, Path::new("-o"), &folder])
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    // The folder is made right before the search begins, which takes seconds.
    while !folder.is_dir() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    std::thread::sleep(std::time::Duration::from_millis(200));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(130), "{message}");
    assert!(message.contains("interrupted during the search; the best answer so far"), "{message}");
    assert_eq!(report(&folder)["partial"], true);
}

#[test]
fn a_search_out_of_time_gives_its_best_answer_so_far() {
    let case = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/rig/v01");
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_airloop"))
        .args(["refine", "--quiet", "--budget", "0.1 s"])
        .args([&case, Path::new("-o"), folder.path()])
        .output()
        .unwrap();
    assert!(matches!(output.status.code(), Some(0 | 10 | 11 | 12)), "{output:?}");
    assert_eq!(report(folder.path())["partial"], true);
}

#[test]
fn an_amended_system_that_is_no_earlier_result_is_not_replaced() {
    let case = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/rig/v01");
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("system")).unwrap();
    fs::write(folder.path().join("system/mine.txt"), "mine").unwrap();
    let output = refine(&case, folder.path());
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1));
    assert!(message.contains("`system` is there"), "{message}");
    assert_eq!(fs::read_to_string(folder.path().join("system/mine.txt")).unwrap(), "mine");
}

/// A study of ten records over four FMUs, which would take minutes.
#[cfg(unix)]
fn long_study(folder: &Path) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let signals = ["F_hat", "F_p", "x", "theta"].map(|name| {
        let unit = if name.starts_with('F') {
            "N"
        } else if name == "x" {
            "m"
        } else {
            "rad"
        };
        format!("{name} = {{ column = \"{name}\", unit = \"{unit}\" }}\n")
    });
    let mut text = format!(
        "name = \"rig\"\nsystem = \"{}\"\n[outputs]\n{}[inputs]\nu = {{ column = \"u\", unit = \"N\" }}\n[states]\n{}{}",
        root.join("examples/01_run/system.ssd").display(),
        signals.concat(),
        signals[2..].concat(),
        "v = { derivative_of = \"x\", savitzky_golay_points = 9 }\nomega = { derivative_of = \"theta\", savitzky_golay_points = 9 }\n",
    );
    for trial in 1..=10 {
        let role = if trial <= 7 { "estimation" } else { "validation" };
        let file = root.join(format!("data/rig/v01/trial_{trial:02}.csv"));
        text +=
            &format!("[[segment]]\nfile = \"{}\"\nrole = \"{role}\"\ninitial = \"fit\"\n", file.display());
    }
    fs::write(folder.join("study.toml"), text).unwrap();
}

/// Processor time of a process \[s\], its children left out.
#[cfg(target_os = "linux")]
fn processor_time(id: u32) -> Option<f64> {
    let text = fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
    let mut fields = text.rsplit_once(')')?.1.split_whitespace().skip(11);
    let ticks: f64 = fields.next()?.parse::<f64>().ok()? + fields.next()?.parse::<f64>().ok()?;
    Some(ticks / 100.0)
}

#[test]
#[cfg(target_os = "linux")]
fn an_interrupted_study_ends_within_seconds_wherever_its_search_is() {
    /// Processor time that the end may take \[s\]: five seconds on two processors.
    const MAX_TIME_TO_END: f64 = 10.0;
    let place = tempfile::tempdir().unwrap();
    long_study(place.path());
    // In the fit of the declared model, and among its candidates.
    for begin in [2.0, 15.0] {
        let folder = place.path().join(format!("out-{begin}"));
        let mut child = Command::new(env!("CARGO_BIN_EXE_airloop"))
            .arg("refine")
            .args([place.path(), Path::new("-o"), &folder])
            .stderr(std::process::Stdio::null())
            .spawn()
            .unwrap();
        let time = |child: &std::process::Child| processor_time(child.id()).unwrap_or(0.0);
        while time(&child) < begin {
            assert!(child.try_wait().unwrap().is_none(), "the search is through before it is interrupted");
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        let asked = time(&child);
        assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
        let mut last = asked;
        while child.try_wait().unwrap().is_none() {
            last = last.max(time(&child));
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        println!("interrupted after {asked:.1} s of processor time, ended {:.1} s later", last - asked);
        assert!(last - asked < MAX_TIME_TO_END, "{:.1} s", last - asked);
        assert_eq!(child.wait().unwrap().code(), Some(130));
        assert_eq!(report(&folder)["partial"], true);
    }
}
