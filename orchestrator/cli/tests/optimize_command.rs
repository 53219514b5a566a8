//! `airloop optimize` through the binary: objectives of the benchmark, files, exit codes, messages.
#![cfg(target_os = "linux")]

use airloop_testing::c_fmu;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use airloop_plan::record::{self, Summary};
use airloop_series::{TimeSeries, csv};
use tempfile::TempDir;

fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The folder of the example, when its FMUs are built.
fn example() -> Option<PathBuf> {
    if project().join("target/fmu/cart-pole.fmu").exists() {
        return Some(project().join("examples/03_swing_up"));
    }
    eprintln!("skipped: target/fmu/cart-pole.fmu is not built (make fmu)");
    None
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn optimize(folder: &TempDir, problem: &Path, words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_airloop"))
        .arg("optimize")
        .arg(problem)
        .args(["-o", "out", "--no-plots"])
        .args(words)
        .current_dir(folder.path())
        .output()
        .unwrap()
}

fn summary(folder: &TempDir) -> Summary {
    record::read(&folder.path().join("out/summary.json")).unwrap()
}

fn series(folder: &TempDir, name: &str) -> TimeSeries {
    csv::read(&folder.path().join("out").join(name)).unwrap()
}

/// Summary and trajectory of a run that must succeed.
fn solved(problem: &Path, words: &[&str]) -> (TempDir, Summary) {
    let folder = TempDir::new().unwrap();
    let output = optimize(&folder, problem, words);
    assert_eq!(output.status.code(), Some(0), "{}{}", text(&output.stdout), text(&output.stderr));
    let summary = summary(&folder);
    (folder, summary)
}

/// The problem of the example with `from` replaced by `to`, and absolute paths.
fn changed(folder: &TempDir, changes: &[(&str, &str)]) -> PathBuf {
    let example = example().unwrap();
    let mut text = std::fs::read_to_string(example.join("problem.toml")).unwrap();
    let system = example.join("../01_run/system.ssd").canonicalize().unwrap();
    text = text.replace("../01_run/system.ssd", system.to_str().unwrap());
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    let path = folder.path().join("problem.toml");
    std::fs::write(&path, text).unwrap();
    path
}

fn close(value: f64, expected: f64, relative: f64) -> bool {
    (value - expected).abs() <= relative * expected.abs()
}

/// Objectives at 100 intervals from the guess `pump`: reference solutions by CasADi with IPOPT.
const OBJECTIVES: [(&str, &[f64]); 4] = [
    ("hermite-simpson", &[1085.5801989546, 1088.8114515]),
    ("trapezoidal", &[1086.0637278, 1086.4606893559]),
    ("multiple-shooting", &[1094.6922941665]),
    ("shooting-collocation", &[1091.4577017]),
];

#[test]
fn every_transcription_reaches_a_reference_minimum_and_keeps_the_constraints() {
    let Some(example) = example() else { return };
    for (transcription, references) in OBJECTIVES {
        let (folder, summary) =
            solved(&example.join("problem.toml"), &["--transcription", transcription, "--no-verification"]);
        let objective = summary.objective.unwrap();
        assert!(references.iter().any(|one| close(objective, *one, 1e-6)), "{transcription}: {objective}");
        assert!(summary.max_defect <= 1e-8 && summary.max_bound_violation <= 1e-8, "{summary:?}");
        assert_eq!((summary.status.as_str(), &summary.intervals[..]), ("solved", &[100][..]));
        let plan = series(&folder, "trajectory.csv");
        let column = |name: &str| &plan.channel(name).unwrap().values;
        for (name, end) in [("x", 0.0), ("theta", PI), ("v", 0.0), ("omega", 0.0)] {
            let values = column(name);
            assert!(values[0].abs() <= 1e-9 && (values[values.len() - 1] - end).abs() <= 1e-9, "{name}");
        }
        assert!(
            column("u").iter().all(|u| u.abs() <= 157.0797) && column("x").iter().all(|x| x.abs() <= 0.15)
        );
        let rows = if transcription == "hermite-simpson" { 201 } else { 101 };
        assert_eq!(plan.len(), rows);
        assert_eq!(series(&folder, "command.csv").len(), 2001);
    }
}

#[test]
fn the_command_moves_the_system_as_planned_where_the_transcription_is_the_system() {
    let Some(example) = example() else { return };
    // Shooting through the samples with one Runge-Kutta step each is the sampled system but for that step's error.
    let (_folder, summary) = solved(&example.join("problem.toml"), &["--transcription", "multiple-shooting"]);
    let errors = summary.open_loop_final_state_error.unwrap();
    let (sampled, continuous) = (errors.sampled.unwrap(), errors.continuous.unwrap());
    assert!(sampled["theta"].abs() < 1e-4 && sampled["x"].abs() < 1e-5, "{sampled:?}");
    // The actuator in continuous time gives another force between the samples.
    assert!(continuous["theta"].abs() > 10.0 * sampled["theta"].abs(), "{continuous:?}");
}

#[test]
fn the_error_of_the_continuous_roll_out_shrinks_with_the_mesh() {
    let Some(example) = example() else { return };
    let theta = |intervals: &str| {
        let (_folder, summary) = solved(&example.join("problem.toml"), &["--intervals", intervals]);
        summary.open_loop_final_state_error.unwrap().continuous.unwrap()["theta"].abs()
    };
    // The benchmark states about 6e-3 rad at 100 intervals and 1e-4 rad at 400.
    let (coarse, fine) = (theta("100"), theta("400"));
    assert!((2e-3..2e-2).contains(&coarse), "{coarse}");
    assert!(fine < 5e-4, "{fine}");
}

#[test]
fn the_written_command_can_be_played_as_it_stands() {
    let Some(example) = example() else { return };
    let (folder, summary) = solved(&example.join("problem.toml"), &["--transcription", "multiple-shooting"]);
    let played = Command::new(env!("CARGO_BIN_EXE_airloop"))
        .arg("run")
        .arg(example.join("../01_run/system.ssd"))
        .args([
            "--input",
            "out/command.csv",
            "--step",
            "1ms",
            "--master",
            "monolithic",
            "--no-plots",
            "-o",
            "played",
        ])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert_eq!(played.status.code(), Some(0), "{}", text(&played.stderr));
    let result = csv::read(&folder.path().join("played/result.csv")).unwrap();
    let theta = *result.channel("theta").unwrap().values.last().unwrap();
    let gap = summary.open_loop_final_state_error.unwrap().sampled.unwrap()["theta"];
    assert!((theta - PI - gap).abs() < 1e-6, "{theta} {gap}");
}

#[test]
fn the_frictionless_cart_pole_is_one_fmu() {
    let Some(example) = example() else { return };
    // Objectives at 50 intervals by CasADi with IPOPT (tests/reference/kelly_cart_pole.py).
    let cases = [
        ("problem.toml", "hermite-simpson", 20.0, 58.807642165913),
        ("problem.toml", "trapezoidal", 20.0, 59.147757323374),
        ("demo.toml", "hermite-simpson", 100.0, 225.553915646653),
        ("demo.toml", "trapezoidal", 100.0, 226.892001098172),
    ];
    for (file, transcription, bound, objective) in cases {
        let words = ["--transcription", transcription, "--intervals", "50", "--no-verification"];
        let (folder, summary) = solved(&example.join("generic").join(file), &words);
        assert!(
            summary.max_defect <= 1e-8 && close(summary.objective.unwrap(), objective, 1e-7),
            "{summary:?}"
        );
        let plan = series(&folder, "trajectory.csv");
        assert!(plan.channel("F").unwrap().values.iter().all(|force| force.abs() <= bound + 1e-8));
        assert_eq!(plan.channels().iter().filter(|channel| channel.name.starts_with("costate.")).count(), 4);
    }
}

/// The third-party FMU of the example with lines of its source changed, and the problem next to it.
fn third_party(folder: &TempDir, changes: &[(&str, &str)]) {
    let source = project().join("examples/03_swing_up/third_party");
    let mut code = std::fs::read_to_string(source.join("van_der_pol.c")).unwrap();
    for (from, to) in changes {
        assert!(code.contains(from), "{from}");
        code = code.replacen(from, to, 1);
    }
    let (changed, library) = (folder.path().join("van_der_pol.c"), folder.path().join("van_der_pol.so"));
    std::fs::write(&changed, code).unwrap();
    c_fmu::compile(&changed, &library, &[]);
    let description = std::fs::read_to_string(source.join("modelDescription.xml")).unwrap();
    c_fmu::pack(&folder.path().join("van_der_pol.fmu"), &description, Some(("van_der_pol", &library)));
    let problem = std::fs::read_to_string(source.join("problem.toml")).unwrap();
    let problem = problem.replace("../../../out/third_party/", "");
    std::fs::write(folder.path().join("problem.toml"), problem).unwrap();
}

#[test]
fn an_fmu_of_another_tool_without_derivatives_is_optimized() {
    let folder = TempDir::new().unwrap();
    third_party(&folder, &[]);
    let output = optimize(&folder, Path::new("problem.toml"), &["--intervals", "50"]);
    assert_eq!(output.status.code(), Some(0), "{}{}", text(&output.stdout), text(&output.stderr));
    let summary = summary(&folder);
    // tests/reference/van_der_pol_ipopt.py
    assert!(close(summary.objective.unwrap(), 3.614994456984, 1e-7), "{:?}", summary.objective);
    assert!(summary.notes.iter().any(|note| note.contains("difference")), "{:?}", summary.notes);
}

#[test]
fn an_fmu_that_fails_beyond_a_point_is_stepped_back_from() {
    // The oscillator swings through x2 = 1 in the plan; a failure beyond 1.2 only stands in the way of long steps.
    let folder = TempDir::new().unwrap();
    third_party(
        &folder,
        &[(
            "    rates(model, dx);\n    return 0;",
            "    rates(model, dx);\n    return model->x[1] > 1.2 ? 3 : 0;",
        )],
    );
    let output = optimize(&folder, Path::new("problem.toml"), &["--no-verification"]);
    assert_eq!(output.status.code(), Some(0), "{}{}", text(&output.stdout), text(&output.stderr));
    assert!(close(summary(&folder).objective.unwrap(), 3.614994456984, 1e-7));
}

#[test]
fn an_fmu_that_fails_where_the_search_begins_is_named() {
    for failure in ["    rates(model, dx);\n    return 3;", "    dx[0] = dx[1] = 0.0 / 0.0;\n    return 0;"] {
        let folder = TempDir::new().unwrap();
        third_party(&folder, &[("    rates(model, dx);\n    return 0;", failure)]);
        let output = optimize(&folder, Path::new("problem.toml"), &[]);
        assert_eq!(output.status.code(), Some(22), "{}", text(&output.stderr));
        assert!(text(&output.stderr).contains("van_der_pol"), "{}", text(&output.stderr));
    }
}

#[test]
fn an_infeasible_task_names_the_constraint_that_stands_in_the_way() {
    if example().is_none() {
        return;
    }
    let cases: [&[(&str, &str)]; 2] = [
        &[("\"-150 mm\"", "\"-5 mm\""), ("\"150 mm\"", "\"5 mm\"")],
        &[("min = -157.07963267948966, max = 157.07963267948966", "min = -5, max = 5")],
    ];
    for changes in cases {
        let folder = TempDir::new().unwrap();
        let problem = changed(&folder, changes);
        let output = optimize(&folder, &problem, &["--intervals", "50", "--max-iterations", "300"]);
        assert_eq!(output.status.code(), Some(20), "{}", text(&output.stderr));
        assert!(text(&output.stderr).contains("infeasible"), "{}", text(&output.stderr));
        assert!(text(&output.stderr).contains("violated by"), "{}", text(&output.stderr));
        assert!(!text(&output.stdout).contains("violated by"), "{}", text(&output.stdout));
        let summary = summary(&folder);
        assert_eq!(summary.status, "infeasible");
        assert!(summary.worst.is_some());
    }
}

#[test]
fn the_table_of_a_sweep_says_what_the_verdict_says() {
    if example().is_none() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let problem = changed(&folder, &[("\"-150 mm\"", "\"-5 mm\""), ("\"150 mm\"", "\"5 mm\"")]);
    let words = ["--sweep", "T=2..1.9:2", "--intervals", "50", "--max-iterations", "300"];
    let output = optimize(&folder, &problem, &words);
    assert_eq!(output.status.code(), Some(20), "{}", text(&output.stderr));
    let table = std::fs::read_to_string(folder.path().join("out/sweep.csv")).unwrap();
    assert!(table.lines().nth(1).unwrap().starts_with("2,infeasible,"), "{table}");
}

#[test]
fn what_cannot_begin_says_why() {
    if example().is_none() {
        return;
    }
    type Case<'a> = (&'a [(&'a str, &'a str)], &'a [&'a str], &'a str);
    let cases: [Case; 7] = [
        (&[], &["--sweep", "Q=1..2"], "--sweep Q: value 2: there is no variable `Q`"),
        (
            &[],
            &["--transcription", "multiple-shooting", "--intervals", "300"],
            "choose 200, 250, 400, 500 intervals",
        ),
        (
            &[("\"2 s\"", "\"2.0005 s\"")],
            &["--transcription", "multiple-shooting"],
            "not a whole number of samples",
        ),
        (&[], &["--guess", "pumps"], "did you mean `pump`"),
        (&[], &["--guess", "nothing.csv"], "nothing.csv"),
        (&[("\"150 mm\"", "\"-160 mm\"")], &[], "lies above the upper bound"),
        (&[], &["--intervals", "10,20"], "give one number"),
    ];
    for (changes, words, expected) in cases {
        let folder = TempDir::new().unwrap();
        let problem = changed(&folder, changes);
        let output = optimize(&folder, &problem, words);
        assert_eq!(output.status.code(), Some(1), "{words:?}");
        assert!(text(&output.stderr).contains(expected), "{expected}\n{}", text(&output.stderr));
        assert!(!folder.path().join("out").exists(), "nothing is left behind");
    }
    let folder = TempDir::new().unwrap();
    let problem = changed(&folder, &[]);
    for words in [&["--intervals", "0"][..], &["--sweep", "T=1"], &["--transcription", "hs"]] {
        assert_eq!(optimize(&folder, &problem, words).status.code(), Some(2), "{words:?}");
    }
}

#[test]
fn a_search_that_was_cut_short_goes_on_from_where_it_was() {
    let Some(example) = example() else { return };
    let folder = TempDir::new().unwrap();
    let problem = example.join("problem.toml");
    let output = optimize(&folder, &problem, &["--max-iterations", "20"]);
    assert_eq!(output.status.code(), Some(21), "{}", text(&output.stderr));
    let first = summary(&folder);
    assert_eq!((first.status.as_str(), first.iterations), ("iteration_limit", 20));
    assert!(first.open_loop_final_error.is_none());
    let settings = example.join("stabilize.toml");
    let words = ["stabilize", "out", settings.to_str().unwrap(), "-o", "stabilized"];
    let refused =
        Command::new(env!("CARGO_BIN_EXE_airloop")).args(words).current_dir(folder.path()).output().unwrap();
    assert_eq!(refused.status.code(), Some(1), "{}", text(&refused.stderr));
    assert!(text(&refused.stderr).contains("iteration_limit"), "{}", text(&refused.stderr));
    assert!(!folder.path().join("stabilized").exists());
    let output = optimize(&folder, &problem, &["--resume", "out", "--no-verification"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(summary(&folder).status, "solved");
}

#[test]
fn an_interrupted_search_keeps_its_point_and_can_be_resumed() {
    if example().is_none() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let problem = changed(&folder, &[]);
    // The command listens to signals before it reads its problem: from a pipe it reads when we say so.
    let pipe = folder.path().join("pipe.toml");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    // Pipes are read under /dev/stdin and /proc only.
    let own = Path::new("/proc/self/root").join(pipe.strip_prefix("/").unwrap());
    let child = Command::new(env!("CARGO_BIN_EXE_airloop"))
        .arg("optimize")
        .arg(&own)
        .args(["-o", "out", "--no-plots"])
        .current_dir(folder.path())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut writer = std::fs::OpenOptions::new().write(true).open(&pipe).unwrap();
    let signal = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(signal.success());
    std::io::Write::write_all(&mut writer, &std::fs::read(&problem).unwrap()).unwrap();
    drop(writer);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("--resume out"), "{}", text(&output.stderr));
    assert_eq!(summary(&folder).status, "interrupted");
    let output = optimize(&folder, &problem, &["--resume", "out", "--no-verification"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}

#[test]
fn a_mesh_is_refined_until_the_errors_between_its_knots_are_small() {
    if example().is_none() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let mesh = "intervals = 40\nmesh = { tolerance = 1e-5 }";
    let problem = changed(&folder, &[("intervals = 100", mesh)]);
    let output = optimize(&folder, &problem, &[]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let summary = summary(&folder);
    assert!(summary.max_interval_error.unwrap() <= 1e-5 && summary.passes.len() > 1, "{summary:?}");
    // Fewer knots than the even mesh that follows the dynamics as well (about 400).
    assert!(summary.intervals[0] < 350, "{:?}", summary.intervals);
    let theta = summary.open_loop_final_state_error.unwrap().continuous.unwrap()["theta"];
    assert!(theta.abs() < 1e-3, "{theta}");
}

#[test]
fn a_coarse_solve_leads_to_a_fine_one() {
    if example().is_none() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let chain =
        "intervals = 200\nstart_with = [{ transcription = \"shooting-collocation\", intervals = 100 }]";
    let problem =
        changed(&folder, &[("intervals = 100", chain), ("\"hermite-simpson\"", "\"multiple-shooting\"")]);
    let output = optimize(&folder, &problem, &["--no-verification"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let chained = summary(&folder);
    let [first, second] = &chained.passes[..] else { panic!("{:?}", chained.passes) };
    assert_eq!(
        (first.transcription.as_str(), second.transcription.as_str()),
        ("shooting-collocation", "multiple-shooting")
    );
    assert!(second.iterations < first.iterations, "{first:?} {second:?}");
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let Some(example) = example() else { return };
    let plan = |threads: &str| {
        let words = ["--threads", threads, "--intervals", "50", "--no-verification"];
        let (folder, _) = solved(&example.join("problem.toml"), &words);
        std::fs::read(folder.path().join("out/trajectory.csv")).unwrap()
    };
    assert!(plan("1") == plan("3"));
}

#[test]
fn many_starts_list_their_minima_and_a_sweep_its_values() {
    let Some(example) = example() else { return };
    let problem = example.join("generic/problem.toml");
    let words = ["--multistart", "4", "--seed", "1", "--intervals", "20", "--no-verification"];
    let (folder, summary) = solved(&problem, &words);
    let table = std::fs::read_to_string(folder.path().join("out/multistart.csv")).unwrap();
    assert_eq!(table.lines().count(), 6, "{table}");
    let objectives: Vec<f64> =
        table.lines().skip(1).filter_map(|line| line.split(',').nth(2)?.parse().ok()).collect();
    let best = objectives.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(close(summary.objective.unwrap(), best, 1e-9), "{table}");
    let (folder, _) =
        solved(&problem, &["--sweep", "T=1.8..2.2:3", "--intervals", "20", "--no-verification"]);
    let table = std::fs::read_to_string(folder.path().join("out/sweep.csv")).unwrap();
    let objectives: Vec<f64> =
        table.lines().skip(1).map(|line| line.split(',').nth(2).unwrap().parse().unwrap()).collect();
    // More time costs less force.
    assert!(objectives.len() == 3 && objectives.is_sorted_by(|a, b| a > b), "{table}");
}

#[test]
fn the_schema_is_printed_for_editors() {
    let output = Command::new(env!("CARGO_BIN_EXE_airloop")).args(["optimize", "--schema"]).output().unwrap();
    let schema: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(schema["properties"]["system"].is_object());
}
