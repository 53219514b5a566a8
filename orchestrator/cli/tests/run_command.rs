//! `airloop run` and its kin through the binary: files, exit codes, messages.
#![cfg(target_os = "linux")]

use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use airloop_cosim::results::summary;
use airloop_series::csv;
use airloop_testing::slave::{component, connection, folder, ssd, write};
use tempfile::TempDir;

fn airloop(folder: &TempDir, words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_airloop")).args(words).current_dir(folder.path()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// u -> a -> b with system outputs y = b.y and x = b.x.
fn system(folder: &TempDir) {
    let connectors = ["u input N", "y output N", "x output N.s"]
        .map(|line| {
            let [name, kind, unit] = line.split(' ').collect::<Vec<_>>()[..] else { panic!("{line}") };
            format!(
                "<ssd:Connector name=\"{name}\" kind=\"{kind}\"><ssc:Real unit=\"{unit}\"/></ssd:Connector>\n"
            )
        })
        .concat();
    let connections = [("u", "a.u"), ("a.y", "b.u"), ("b.y", "y"), ("b.x", "x")];
    let connections = connections.map(|(from, to)| connection(from, to)).concat();
    write(
        folder,
        "system.ssd",
        &ssd(&connectors, &(component("a", "") + &component("b", "")), &connections, ""),
    );
}

fn summary_of(folder: &TempDir, output: &str) -> summary::Summary {
    summary::read(&folder.path().join(output).join("summary.json")).unwrap()
}

#[test]
fn progress_is_told_in_lines_where_a_program_asks_for_it() {
    let folder = folder();
    system(&folder);
    write(&folder, "in.csv", "time,u\n0,1\n1,3\n");
    let words = [
        "run",
        "system.ssd",
        "--input",
        "in.csv",
        "--step",
        "2us",
        "--output-step",
        "10ms",
        "--no-plots",
        "-o",
        "out",
    ];
    let told = |asked: Option<&str>, more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_airloop"));
        command.args(words).args(more).current_dir(folder.path());
        command.envs(asked.map(|value| ("AIRLOOP_PROGRESS", value)));
        text(&command.output().unwrap().stderr)
    };
    let lines = told(Some("lines"), &[]);
    let all = |line: &str| line.starts_with("progress: ") && line.contains("/500000 steps");
    assert!(!lines.is_empty() && lines.lines().all(all), "{lines}");
    assert_eq!(told(None, &[]) + &told(Some("lines"), &["--quiet"]), "");
}

#[test]
fn a_run_writes_result_summary_and_figures() {
    let folder = folder();
    system(&folder);
    write(&folder, "in.csv", "time,u\n0,1\n1,3\n");
    let words =
        ["run", "system.ssd", "--input", "in.csv", "--step", "250ms", "--set", "a.gain=2", "-o", "out/one"];
    let output = airloop(&folder, &words);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("4 steps of 0.25 s (gauss-seidel)"), "{}", text(&output.stdout));
    let header = std::fs::read_to_string(folder.path().join("out/one/result.csv")).unwrap();
    assert!(header.starts_with("time,u,y,x,a.y,a.x,a.held,a.j,a.c,b.y,b.x,b.held,b.j,b.c\n"), "{header}");
    let result = csv::read(&folder.path().join("out/one/result.csv")).unwrap();
    assert_eq!(result.channel("u").unwrap().values, [1.0, 1.5, 2.0, 2.5, 3.0]);
    assert_eq!(result.channel("y").unwrap().values, [2.0, 2.0, 3.0, 4.0, 5.0]);
    let summary = summary_of(&folder, "out/one");
    assert_eq!(summary.outcome.status, "completed");
    assert_eq!((summary.outcome.steps, summary.settings.stop_time), (4, 1.0));
    assert_eq!(summary.settings.set, ["a.gain=2"]);
    assert_eq!(summary.fmus.iter().map(|fmu| fmu.component.as_str()).collect::<Vec<_>>(), ["a", "b"]);
    for file in ["index.html", "u.svg", "y.svg", "x.svg"] {
        let written = std::fs::read_to_string(folder.path().join("out/one").join(file)).unwrap();
        assert!(written.contains("</svg>"), "{file}");
    }
}

#[test]
fn a_measurement_gives_inputs_start_and_fit() {
    let folder = folder();
    system(&folder);
    // x' = u = 1 from the measured start 5; the record is 0.5 off in x at the end, y is exact but constant.
    write(&folder, "record.csv", "time,u,y,pos,extra\n0,1,1,5,0\n0.5,1,1,5.5,0\n1,1,1,6.5,0\n");
    write(&folder, "map.toml", "[signals]\nx = \"pos\"\n");
    let words = [
        "run",
        "system.ssd",
        "--measured",
        "record.csv",
        "--signals",
        "map.toml",
        "--step",
        "0.1",
        "-o",
        "out",
    ];
    let output = airloop(&folder, &words);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let summary = summary_of(&folder, "out");
    let signal = |name: &str| summary.signals.iter().find(|signal| signal.name == name).unwrap().clone();
    assert_eq!((signal("y").fit_percent, signal("y").rms_error), (None, 0.0));
    // The only error is 0.5; the measurement deviates from its mean 17/3 by -2/3, -1/6 and 5/6.
    let spread = (4.0f64 / 9.0 + 1.0 / 36.0 + 25.0 / 36.0).sqrt();
    let fit = signal("x").fit_percent.unwrap();
    assert!((fit - 100.0 * (1.0 - 0.5 / spread)).abs() < 1e-9, "{fit}");
    assert!((signal("x").rms_error - 0.5 / 3f64.sqrt()).abs() < 1e-12);
    let printed = text(&output.stdout);
    assert!(printed.contains("constant") && printed.contains(&format!("{fit:.2}")), "{printed}");
    assert!(printed.contains("measured columns without a connector: extra"), "{printed}");
    let figure = std::fs::read_to_string(folder.path().join("out/x.svg")).unwrap();
    assert!(
        figure.contains(">x [N.s]<") && figure.contains(">residual [N.s]<") && figure.contains("measured")
    );

    let words = [&words[..9], &["zero", "--initial", "zero"]].concat();
    assert_eq!(airloop(&folder, &words).status.code(), Some(0));
    let result = csv::read(&folder.path().join("zero/result.csv")).unwrap();
    assert_eq!(result.channel("x").unwrap().values[0], 0.0);
}

#[test]
fn a_failed_step_keeps_the_result_and_exits_with_1() {
    let folder = folder();
    system(&folder);
    let set = ["--set", "b.how=nan", "--set", "b.when=0.35"];
    let words = [&["run", "system.ssd", "--stop", "1", "--step", "0.1", "-o", "out"][..], &set].concat();
    let output = airloop(&folder, &words);
    assert_eq!(output.status.code(), Some(1));
    let message = text(&output.stderr);
    assert!(message.contains("component `b`: output `y` is NaN at t = 0.4 s"), "{message}");
    assert!(message.contains("the result so far is in out/result.csv"), "{message}");
    assert_eq!(csv::read(&folder.path().join("out/result.csv")).unwrap().len(), 4);
    let summary = summary_of(&folder, "out");
    assert_eq!((summary.outcome.status.as_str(), summary.outcome.end_time), ("failed", 0.3));
}

#[test]
fn a_component_that_ends_the_simulation_is_no_failure() {
    let folder = folder();
    system(&folder);
    let set = ["--set", "b.how=terminate", "--set", "b.when=0.35"];
    let words = [&["run", "system.ssd", "--stop", "1", "--step", "0.1", "-o", "out"][..], &set].concat();
    let output = airloop(&folder, &words);
    assert_eq!(output.status.code(), Some(0));
    let expected = "component b ended the simulation at t = 0.35 s; the result ends at 0.3 s, the last point";
    assert!(text(&output.stdout).contains(expected), "{}", text(&output.stdout));
    assert_eq!(summary_of(&folder, "out").outcome.status, "terminated");
}

#[test]
fn bad_words_and_files_are_refused_by_name() {
    let folder = folder();
    system(&folder);
    write(&folder, "typo.csv", "time,uu\n0,1\n");
    write(&folder, "nan.csv", "time,u\n0,1\n1,nan\n");
    write(&folder, "other.csv", "time,q\n0,1\n");
    write(&folder, "moment.csv", "time,u [N.m]\n0,1\n");
    write(&folder, "map.toml", "[signals]\nz = \"q\"\n");
    write(&folder, "file", "");
    let cases: [(&[&str], i32, &str); 24] = [
        (&["--stop", "1", "--step", "-1ms"], 2, "'-1ms' is not a duration: it is negative"),
        (&["--stop", "1", "--step", "nan"], 2, "'nan' is not a duration"),
        (
            &["--stop", "1", "--tolerance", "2"],
            2,
            "tolerance = 2 is not possible: it must be between 0 and 1",
        ),
        (&["--stop", "1", "--tolerance", "-2"], 2, "tolerance = -2 is not possible"),
        (&["--stop", "1", "--start", "2"], 2, "stop time = 1 is not possible"),
        (&["--stop", "1", "-o", "file"], 1, "output folder file: a file of that name is there"),
        (&["--stop", "1", "-o", "file/x"], 1, "output folder file/x: "),
        (
            &["--stop", "1", "--set", "b.u=1"],
            1,
            "--set b.u=1: it would have no effect: `b.u` is driven by the connection from `a.y`",
        ),
        (&["--stop", "1", "--set", "a.u=1"], 1, "`a.u` is driven by the system input `u`: set `u`"),
        (&["--input", "moment.csv", "--set", "u=1"], 1, "cannot be converted"),
        (&["--input", "typo.csv"], 1, "typo.csv: line 1, column `uu`: no such signal; known are: u"),
        (&["--input", "nan.csv"], 1, "nan.csv: line 3, column `u`: `nan` is not finite"),
        (&["--input", "gone.csv"], 1, "gone.csv: "),
        (&["--input", "moment.csv"], 1, "column `u`: its unit [N.m] cannot be converted to [N]"),
        (&["--measured", "other.csv"], 1, "none of its columns (q) is an output of the system (y, x)"),
        (&["--measured", "other.csv", "--signals", "map.toml"], 1, "no connector `z`; it has: u, y, x"),
        (&[], 2, "given with --stop"),
        (&["--stop", "1", "--step", "0"], 2, "step = 0 is not possible: it must be positive"),
        (&["--stop", "1", "--set", "a.nope=1"], 1, "--set a.nope=1: there is no variable `nope`"),
        (&["--stop", "1", "--set", "nope"], 2, "write component.variable=value"),
        (&["--stop", "soon"], 2, "soon"),
        (&["--stop", "1", "--initial", "zero"], 2, "--measured"),
        (&["--stop", "1", "--adaptive"], 1, "component `a` cannot save and restore its state"),
        (&["--stop", "1", "--step-tolerance", "1e-3"], 2, "--adaptive"),
    ];
    for (words, code, expected) in cases {
        let output = airloop(&folder, &[&["run", "system.ssd"], words].concat());
        let message = text(&output.stderr);
        assert!(message.contains(expected), "{words:?}: {message}");
        assert_eq!(output.status.code(), Some(code), "{words:?}: {message}");
    }
}

#[test]
fn a_system_without_components_is_refused() {
    let folder = folder();
    write(&folder, "empty.ssd", &ssd("", "", "", ""));
    for master in ["gauss-seidel", "monolithic"] {
        let words = ["run", "empty.ssd", "--stop", "1", "--step", "1ms", "--master", master, "-o", "out"];
        let output = airloop(&folder, &words);
        let message = text(&output.stderr);
        assert!(message.contains("empty.ssd: the system has no components"), "{message}");
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(!folder.path().join("out").exists());
    }
}

#[test]
fn quiet_prints_nothing() {
    let folder = folder();
    system(&folder);
    let output =
        airloop(&folder, &["run", "system.ssd", "--stop", "1", "--quiet", "--no-plots", "-o", "out"]);
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stdout.is_empty() && output.stderr.is_empty());
    assert!(!Path::new(&folder.path().join("out/index.html")).exists());
}

#[test]
fn ctrl_c_keeps_the_result_so_far_and_exits_with_130() {
    let folder = folder();
    system(&folder);
    let mut child = Command::new(env!("CARGO_BIN_EXE_airloop"))
        .args(["run", "system.ssd", "--stop", "1e6", "--no-plots", "-o", "out"])
        .current_dir(folder.path())
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    // The folder is made just before the run begins; the handler is there a moment later.
    let began = Instant::now();
    while !folder.path().join("out").exists() && began.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(150));
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let summary = summary_of(&folder, "out");
    assert_eq!(summary.outcome.status, "interrupted");
    let result = csv::read(&folder.path().join("out/result.csv")).unwrap();
    assert_eq!(result.len() as u64, summary.outcome.steps + 1);
}

#[test]
fn a_system_can_be_inspected_and_shells_get_completions() {
    let folder = folder();
    system(&folder);
    let output = airloop(&folder, &["inspect", "system.ssd"]);
    let printed = text(&output.stdout);
    for part in ["System s", "Components in evaluation order", "a.y   -> b.u", "y     output  Real  N"] {
        assert!(printed.contains(part), "{printed}");
    }
    let output = airloop(&folder, &["completions", "bash"]);
    assert!(text(&output.stdout).contains("complete -F _airloop"));
    let output = airloop(&folder, &["--version"]);
    assert!(text(&output.stdout).starts_with("airloop 0."));
}
