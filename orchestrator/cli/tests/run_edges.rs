//! `airloop run` at its edges: data of other kinds than expected, folders used twice, readers who leave.
#![cfg(target_os = "linux")]

use airloop_testing::slave;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use airloop_cosim::results::summary;
use airloop_series::csv;
use airloop_testing::slave::{component, connection, folder, ssd, write};
use tempfile::TempDir;

fn command(folder: &TempDir, words: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_airloop"));
    command.args(words).current_dir(folder.path());
    command
}

fn airloop(folder: &TempDir, words: &[&str]) -> Output {
    command(folder, words).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Standard output of a run that must succeed.
fn succeeds(folder: &TempDir, words: &[&str]) -> String {
    let output = airloop(folder, words);
    assert_eq!(output.status.code(), Some(0), "{words:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

/// Standard error of a run that must fail with this exit code.
fn fails(folder: &TempDir, words: &[&str], code: i32) -> String {
    let output = airloop(folder, words);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{words:?}: {message}");
    message
}

/// Names of the files in a folder, sorted.
fn files(folder: &TempDir, inside: &str) -> Vec<String> {
    let entries = std::fs::read_dir(folder.path().join(inside)).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// u -> a with system outputs y = a.y, x = a.x and h = a.held.
fn system(folder: &TempDir) {
    let connectors = ["u input", "y output", "x output", "h output"]
        .map(|line| {
            let (name, kind) = line.split_once(' ').unwrap();
            format!("<ssd:Connector name=\"{name}\" kind=\"{kind}\"/>\n")
        })
        .concat();
    let connections = [("u", "a.u"), ("a.y", "y"), ("a.x", "x"), ("a.held", "h")];
    let connections = connections.map(|(from, to)| connection(from, to)).concat();
    write(folder, "system.ssd", &ssd(&connectors, &component("a", ""), &connections, ""));
}

#[test]
fn milliseconds_in_the_time_column_are_seconds_in_the_run() {
    let folder = folder();
    write(&folder, "in.csv", "time [ms],u\n0,1\n500,2\n1000,3\n");
    succeeds(&folder, &["run", "slave.fmu", "--input", "in.csv", "--step", "250ms", "-o", "out"]);
    let result = csv::read(&folder.path().join("out/result.csv")).unwrap();
    assert_eq!(result.time(), [0.0, 0.25, 0.5, 0.75, 1.0]);
    assert_eq!(result.channel("u").unwrap().values, [1.0, 1.5, 2.0, 2.5, 3.0]);
    write(&folder, "bad.csv", "time [mm],u\n0,1\n1,2\n");
    let message = fails(&folder, &["run", "slave.fmu", "--input", "bad.csv"], 1);
    assert!(message.contains("bad.csv: line 1, column `time`: [mm] is not a unit of time"), "{message}");
}

#[test]
fn values_outside_of_their_type_are_refused_with_line_and_column() {
    let folder = folder();
    let cases = [
        ("i", "1\n\n1,1.4", "line 4, column `i`: `1.4` is not allowed for `i`; allowed is an integer"),
        ("i", "1\n1,1e12", "line 3, column `i`: `1e12` is not allowed"),
        ("i", "true\n1,2", "line 2, column `i`: `true` is not allowed for `i`; allowed is a number"),
        ("b", "0\n1,0.3", "line 3, column `b`: `0.3` is not allowed for `b`; allowed is true or false"),
        ("b", "2\n1,0", "line 2, column `b`: `2` is not allowed"),
        ("u", "false\n1,0", "line 2, column `u`: `false` is not allowed for `u`; allowed is a number"),
    ];
    for (name, rows, expected) in cases {
        write(&folder, "in.csv", &format!("time,{name}\n0,{rows}\n"));
        let message = fails(&folder, &["run", "slave.fmu", "--input", "in.csv"], 1);
        assert!(message.contains(&format!("in.csv: {expected}")), "{message}");
    }
    write(&folder, "in.csv", "time,i,b\n0,-3,true\n1,4,false\n");
    let words = ["run", "slave.fmu", "--input", "in.csv", "--step", "0.5", "-o", "out"];
    succeeds(&folder, &words);
    let result = csv::read(&folder.path().join("out/result.csv")).unwrap();
    assert_eq!(result.channel("i").unwrap().values, [-3.0, -3.0, 4.0]);
    assert_eq!(result.channel("b").unwrap().values, [1.0, 1.0, 0.0]);
    succeeds(&folder, &["run", "slave.fmu", "--stop", "1", "--set", "b=1", "-o", "set"]);
    let result = csv::read(&folder.path().join("set/result.csv")).unwrap();
    assert_eq!(result.channel("b").unwrap().values[0], 1.0);
}

#[test]
fn a_start_value_for_an_input_with_data_is_refused() {
    let folder = folder();
    write(&folder, "in.csv", "time,u\n0,1\n1,2\n");
    let message = fails(&folder, &["run", "slave.fmu", "--input", "in.csv", "--set", "u=5"], 1);
    assert!(message.contains("`u` is driven by the data of in.csv"), "{message}");
    // Without data the start value is what drives it.
    let words = ["run", "slave.fmu", "--stop", "1", "--set", "u=4", "--set", "u=5", "-o", "out"];
    let printed = succeeds(&folder, &words);
    assert!(printed.contains("note: `--set u` is given more than once: the last value holds"), "{printed}");
    let result = csv::read(&folder.path().join("out/result.csv")).unwrap();
    assert_eq!(result.channel("y").unwrap().values[0], 5.0);
}

#[test]
fn inputs_that_nothing_drives_are_noted() {
    let folder = folder();
    system(&folder);
    let printed = succeeds(&folder, &["run", "system.ssd", "--stop", "1", "-o", "out"]);
    let notes = summary::read(&folder.path().join("out/summary.json")).unwrap().fallbacks;
    for input in ["i", "b", "s"] {
        let note = format!("nothing is connected to the input `a.{input}`: it keeps its start value");
        assert!(printed.contains(&format!("note: {note}")) && notes.contains(&note), "{printed}");
    }
    assert!(!printed.contains("`a.u`"), "{printed}");
}

#[test]
fn a_folder_never_holds_files_of_two_runs() {
    let folder = folder();
    system(&folder);
    write(&folder, "record.csv", "time,u,y\n0,1,1\n1,1,1.5\n");
    succeeds(&folder, &["run", "system.ssd", "--measured", "record.csv", "--step", "0.5", "-o", "out"]);
    write(&folder, "out/mine.svg", "");
    let all = ["h.svg", "index.html", "mine.svg", "result.csv", "summary.json", "u.svg", "x.svg", "y.svg"];
    assert_eq!(files(&folder, "out"), all);
    // A run that does not begin leaves the results of the one before as they are.
    let words = ["run", "system.ssd", "--measured", "record.csv", "-o", "out"];
    fails(&folder, &[&words[..], &["--start", "2", "--stop", "3"]].concat(), 1);
    assert_eq!(files(&folder, "out"), all);
    succeeds(&folder, &["run", "system.ssd", "--stop", "1", "--step", "0.5", "-o", "out"]);
    let without = ["index.html", "mine.svg", "result.csv", "summary.json", "u.svg", "x.svg", "y_h.svg"];
    assert_eq!(files(&folder, "out"), without);
    succeeds(&folder, &["run", "system.ssd", "--stop", "1", "--no-plots", "-o", "out"]);
    assert_eq!(files(&folder, "out"), ["mine.svg", "result.csv", "summary.json"]);
}

#[test]
fn a_summary_cannot_make_the_program_remove_files_elsewhere() {
    let folder = folder();
    system(&folder);
    write(&folder, "precious.svg", "");
    succeeds(&folder, &["run", "system.ssd", "--stop", "1", "-o", "out"]);
    let path = folder.path().join("out/summary.json");
    let mut old = summary::read(&path).unwrap();
    old.figures = vec!["../precious.svg".into(), "..".into(), "summary.txt".into()];
    summary::write(&old, &path).unwrap();
    succeeds(&folder, &["run", "system.ssd", "--stop", "1", "-o", "out"]);
    assert!(folder.path().join("precious.svg").exists());
}

#[test]
fn a_span_outside_of_the_record_is_refused_before_anything_is_simulated() {
    let folder = folder();
    system(&folder);
    write(&folder, "record.csv", "time,u,x\n1,1,0\n2,1,1\n");
    for (start, stop) in [("10", "12"), ("-1", "0.5"), ("1.2", "1.8")] {
        let words = ["run", "system.ssd", "--measured", "record.csv", "--start", start, "--stop", stop];
        let message = fails(&folder, &[&words[..], &["-o", "out"]].concat(), 1);
        let expected =
            format!("record.csv: the record goes from 1 s to 2 s, but the run from {start} s to {stop} s");
        assert!(message.contains(&expected), "{message}");
        assert!(!folder.path().join("out").exists());
    }
    let message = fails(&folder, &["run", "system.ssd", "--measured", "record.csv", "--start", "10"], 1);
    assert!(message.contains("the record goes from 1 s to 2 s"), "{message}");
}

#[test]
fn one_table_of_signals_serves_record_and_command() {
    let folder = folder();
    system(&folder);
    write(&folder, "record.csv", "time,yy\n0,1\n1,1\n");
    write(&folder, "in.csv", "time,uu\n0,1\n1,1\n");
    write(&folder, "map.toml", "[signals]\nu = \"uu\"\ny = \"yy\"\n");
    let words = ["run", "system.ssd", "--signals", "map.toml", "-o", "out"];
    succeeds(&folder, &[&words[..], &["--input", "in.csv"]].concat());
    succeeds(&folder, &[&words[..], &["--input", "in.csv", "--measured", "record.csv"]].concat());
    assert_eq!(summary::read(&folder.path().join("out/summary.json")).unwrap().signals.len(), 1);
    let message = fails(&folder, &[&words[..], &["--measured", "record.csv"]].concat(), 1);
    assert!(message.contains("there is no column `uu`"), "{message}");
    let message = fails(&folder, &[&words[..], &["--stop", "1"]].concat(), 2);
    assert!(message.contains("--input"), "{message}");
}

#[test]
fn a_start_inside_of_the_record_names_the_states_that_are_not_measured() {
    let folder = folder();
    system(&folder);
    write(&folder, "record.csv", "time,u,y\n0,1,1\n1,1,1\n2,1,1\n");
    let words = ["run", "system.ssd", "--measured", "record.csv", "-o", "out"];
    let note = "these states begin at the start values of their models: a.x";
    assert!(!succeeds(&folder, &words).contains(note));
    assert!(succeeds(&folder, &[&words[..], &["--start", "1"]].concat()).contains(note));
    let set = succeeds(&folder, &[&words[..], &["--start", "1", "--set", "a.x=2"]].concat());
    assert!(!set.contains(note), "{set}");
}

#[test]
fn a_fit_far_below_zero_is_told_in_few_digits() {
    let folder = folder();
    system(&folder);
    write(&folder, "record.csv", "time,u,y\n0,1,1\n1,1,1.0000000001\n");
    let words = ["run", "system.ssd", "--measured", "record.csv", "--set", "a.gain=9", "-o", "out"];
    let printed = succeeds(&folder, &words);
    assert!(printed.contains("< -1e6"), "{printed}");
}

#[test]
fn a_record_of_one_row_is_no_time_span() {
    let folder = folder();
    system(&folder);
    write(&folder, "in.csv", "time,u\n0,1\n");
    let printed = succeeds(&folder, &["run", "system.ssd", "--input", "in.csv", "-o", "out"]);
    assert!(printed.contains("note: start and stop time are the same: there is no step"), "{printed}");
}

#[test]
fn a_run_may_begin_before_zero() {
    let folder = folder();
    system(&folder);
    succeeds(
        &folder,
        &["run", "system.ssd", "--start", "-1", "--stop", "-500ms", "--step", "0.25", "-o", "out"],
    );
    assert_eq!(csv::read(&folder.path().join("out/result.csv")).unwrap().time(), [-1.0, -0.75, -0.5]);
}

#[test]
fn a_step_longer_than_the_span_is_told() {
    let folder = folder();
    system(&folder);
    let printed = succeeds(&folder, &["run", "system.ssd", "--stop", "2", "--step", "1h", "-o", "out"]);
    assert!(printed.contains("0 s to 2 s, 1 step of 2 s"), "{printed}");
    assert!(printed.contains("note: the step of 3600 s is longer than the time span"), "{printed}");
}

#[test]
fn a_run_that_cannot_begin_leaves_no_folder() {
    let folder = folder();
    slave::pack(&folder.path().join("empty.fmu"), &slave::description(), None);
    fails(&folder, &["run", "empty.fmu", "--stop", "1", "-o", "out"], 1);
    assert!(!folder.path().join("out").exists());
}

#[test]
fn readers_who_leave_are_no_error_but_a_full_device_is() {
    let folder = folder();
    system(&folder);
    let run = ["run", "system.ssd", "--stop", "1", "-o", "out"];
    let commands: [&[&str]; 7] = [
        &run,
        &["inspect", "system.ssd"],
        &["inspect", "slave.fmu", "--json"],
        &["inspect", "slave.fmu", "--check", "--no-run"],
        &["completions", "bash"],
        &["--help"],
        &["run", "--help"],
    ];
    for words in commands {
        // The read end is closed before anything can be written.
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let output = command(&folder, words).stdout(writer).stderr(Stdio::piped()).output().unwrap();
        let message = text(&output.stderr);
        assert!(
            output.status.code().is_some_and(|code| code < 2),
            "{words:?}: {:?} {message}",
            output.status
        );
        assert!(message.is_empty(), "{words:?}: {message}");
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = command(&folder, words).stdout(full).stderr(Stdio::piped()).output().unwrap();
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{words:?}: {message}");
        assert!(message.contains("the standard output cannot be written"), "{words:?}: {message}");
    }
    assert!(folder.path().join("out/result.csv").exists());
}

#[test]
fn a_request_to_terminate_keeps_the_result_and_leaves_no_temporary_folder() {
    let folder = folder();
    system(&folder);
    for signal in ["-TERM", "-HUP"] {
        let temporary = TempDir::new().unwrap();
        let output = format!("out{signal}");
        let mut child =
            command(&folder, &["run", "system.ssd", "--stop", "1e6", "--no-plots", "-o", &output])
                .env("TMPDIR", temporary.path())
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
        let began = Instant::now();
        while !folder.path().join(&output).exists() && began.elapsed() < Duration::from_secs(20) {
            std::thread::sleep(Duration::from_millis(5));
        }
        std::thread::sleep(Duration::from_millis(100));
        assert!(std::fs::read_dir(temporary.path()).unwrap().count() > 0, "FMUs are unpacked here");
        let id = child.id().to_string();
        assert!(Command::new("kill").args([signal, &id]).status().unwrap().success());
        assert_eq!(child.wait().unwrap().code(), Some(130), "{signal}");
        let path = folder.path().join(&output).join("summary.json");
        assert_eq!(summary::read(&path).unwrap().outcome.status, "interrupted");
        assert_eq!(std::fs::read_dir(temporary.path()).unwrap().count(), 0, "{signal}");
    }
}

#[test]
fn a_file_of_the_user_is_not_replaced_by_results() {
    let folder = folder();
    system(&folder);
    std::fs::create_dir(folder.path().join("mine")).unwrap();
    write(&folder, "mine/result.csv", "time,u\n0,1\n");
    let message = fails(&folder, &["run", "system.ssd", "--stop", "1", "-o", "mine", "--quiet"], 1);
    assert!(message.contains("result.csv") && message.contains("choose another folder"), "{message}");
    assert_eq!(files(&folder, "mine"), ["result.csv"]);
    let kept = std::fs::read_to_string(folder.path().join("mine/result.csv")).unwrap();
    assert_eq!(kept, "time,u\n0,1\n");
}

#[test]
fn a_path_that_is_not_there_is_called_missing() {
    let folder = folder();
    system(&folder);
    for words in [
        &["stabilize", "gone", "settings.toml"][..],
        &["trials", "gone"],
        &["run", "system.ssd", "--study", "gone"],
    ] {
        let message = fails(&folder, words, 1);
        assert!(message.contains("gone: there is no such file or folder"), "{message}");
    }
    write(&folder, "map.toml", "[signals]\nxx = \"a\"\n");
    write(&folder, "u.csv", "time,a\n0,1\n1,2\n");
    let run = |signals| fails(&folder, &["run", "system.ssd", "--input", "u.csv", "--signals", signals], 1);
    let message = run("gone.toml");
    assert!(message.contains("gone.toml") && !message.contains("write for example"), "{message}");
    let message = run("map.toml");
    assert!(message.contains("map.toml: the system has no connector `xx`"), "{message}");
}

#[test]
fn names_of_other_kinds_of_files_are_refused_and_temporary_names_are_not_told() {
    let folder = folder();
    system(&folder);
    let message = fails(&folder, &["export-fmu", "system.ssd", "-o", "m.ssp"], 1);
    assert!(message.contains("m.ssp: give it a name that ends in .fmu"), "{message}");
    assert!(!folder.path().join("m.ssp").exists());
    for words in [
        &["export", "system.ssd", "-o", "/proc/m.ssp"][..],
        &["inspect", "slave.fmu", "--check", "--no-run", "--report", "/proc/r.xml"],
    ] {
        let message = fails(&folder, words, 1);
        assert!(message.contains("cannot be written") && !message.contains(".writing"), "{message}");
    }
}

#[test]
fn resample_replaces_its_own_result_only() {
    let folder = TempDir::new().unwrap();
    let record = |shift: f64| {
        let row = |k: i32| format!("{},{}\n", f64::from(k) * 0.01, (f64::from(k) * 0.05 + shift).sin());
        "time,u\n".to_owned() + &(0..200).map(row).collect::<String>()
    };
    write(&folder, "a.csv", &record(0.0));
    write(&folder, "b.csv", &record(1.0));
    let words = |name, method| ["resample", name, "--step", "20ms", "--method", method, "-o", "o.csv"];
    let text = succeeds(&folder, &words("a.csv", "linear"));
    assert!(text.contains("200 samples, 0.01 s apart, give 100 samples"), "{text}");
    succeeds(&folder, &words("a.csv", "filter"));
    let message = fails(&folder, &words("b.csv", "filter"), 1);
    assert!(message.contains("is not this record on this grid"), "{message}");
    let message = fails(&folder, &["resample", "a.csv", "--step", "1e-12", "-o", "p.csv"], 1);
    assert!(message.contains("makes 2.0e12 samples"), "{message}");
}

#[test]
fn negative_numbers_of_trials_are_explained() {
    let folder = TempDir::new().unwrap();
    for (words, expected) in [
        (["trials", "x", "--count", "-1"], "write a whole number from 1 to 1000000"),
        (["trials", "x", "--count", "1e9"], "write a whole number from 1 to 1000000"),
        (["trials", "x", "--seed", "-1"], "write a whole number from 0"),
    ] {
        let message = fails(&folder, &words, 2);
        assert!(message.contains(expected), "{message}");
    }
    let message = fails(&folder, &["trials", "x", "--scale", "-1"], 1);
    assert!(message.contains("--scale"), "{message}");
}

#[test]
fn a_broken_fmu_is_named_once() {
    let folder = TempDir::new().unwrap();
    write(&folder, "trunc.fmu", "PK");
    let message = fails(&folder, &["run", "trunc.fmu", "--stop", "1"], 1);
    assert_eq!(message.matches("trunc.fmu").count(), 1, "{message}");
}
