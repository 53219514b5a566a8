//! `airloop sweep` over FMUs: shards and threads, crashes, inputs that change, commands as tasks.
#![cfg(target_os = "linux")]

use std::process::{Command, Output};

use airloop_testing::c_fmu;
use tempfile::TempDir;

const PLAN: &str = r#"
kind = "simulate"
system = "m.fmu"
[run]
step = 0.01
[[factors]]
name = "x"
from = 1
to = 4
levels = 4
[[factors]]
name = "run.stop"
values = [0.25, 1.0]
[[quantities]]
name = "end"
signal = "y"
of = "final"
[[quantities]]
name = "halved"
signal = "y"
of = "event"
level = 0.5
direction = "falling"
"#;

/// A folder with `m.fmu` (der(x) = u - x, y = x) and `plan.toml`.
struct Place(TempDir);

impl Place {
    fn new(plan: &str) -> Place {
        let folder = TempDir::new().unwrap();
        let library = folder.path().join("m.so");
        c_fmu::compile("hostile.c", &library, &["-pthread"]);
        c_fmu::pack(&folder.path().join("m.fmu"), c_fmu::DESCRIPTION, Some(("m", &library)));
        std::fs::write(folder.path().join("plan.toml"), plan).unwrap();
        Place(folder)
    }

    fn sweep(&self, line: &str, hostile: &str) -> Output {
        Command::new(env!("CARGO_BIN_EXE_airloop"))
            .arg("sweep")
            .args(line.split(' '))
            .env("HOSTILE", hostile)
            .current_dir(self.0.path())
            .output()
            .unwrap()
    }

    fn succeeds(&self, line: &str) -> String {
        let output = self.sweep(line, "");
        assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    fn fails(&self, line: &str, code: i32) -> String {
        let output = self.sweep(line, "");
        assert_eq!(output.status.code(), Some(code), "{line}");
        String::from_utf8_lossy(&output.stderr).into_owned()
    }

    fn read(&self, file: &str) -> String {
        std::fs::read_to_string(self.0.path().join(file)).unwrap()
    }

    fn bytes(&self, file: &str) -> Vec<u8> {
        std::fs::read(self.0.path().join(file)).unwrap()
    }
}

/// A row of `results.csv` as texts.
fn row(line: &str) -> Vec<&str> {
    line.split(',').collect()
}

#[test]
fn a_grid_of_decays_has_the_closed_form_for_any_shards_and_threads() {
    let place = Place::new(PLAN);
    let planned = place.succeeds("plan plan.toml -o a");
    assert!(planned.contains("8 tasks in 1 shards, 1 inputs"), "{planned}");
    place.succeeds("run a --threads 1");
    place.succeeds("merge a");
    place.succeeds("plan plan.toml --shards 3 -o b");
    for shard in ["3/3", "1/3", "2/3"] {
        place.succeeds(&format!("run b --threads 2 --shard {shard}"));
    }
    assert!(place.succeeds("run b").contains("0 tasks run, 8 were there"));
    place.succeeds("merge b");
    for file in ["results.csv", "results.parquet"] {
        assert_eq!(place.bytes(&format!("a/{file}")), place.bytes(&format!("b/{file}")), "{file}");
    }
    let text = place.read("a/results.csv");
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("task,seed,x,run.stop,end,halved [s],status,cause"));
    for (task, line) in lines.enumerate() {
        let cells = row(line);
        let (x, stop): (f64, f64) = (cells[2].parse().unwrap(), cells[3].parse().unwrap());
        assert_eq!((x, stop), (1.0 + (task / 2) as f64, if task % 2 == 0 { 0.25 } else { 1.0 }));
        let end: f64 = cells[4].parse().unwrap();
        // The FMU steps by the explicit Euler method, whose local error is h^2 x / 2.
        let steps = (stop / 0.01_f64).round();
        let error = (end - x * (-stop).exp()).abs();
        assert!(error < 1.01 * steps * 0.01_f64.powi(2) * x / 2.0, "{line}: {error}");
        assert_eq!(cells[5].is_empty(), x * (-stop).exp() > 0.5, "{line}");
        assert_eq!(cells[6..], ["ok", ""], "{line}");
    }
    assert!(place.succeeds("status a").contains("8 of 8 tasks done, 0 of them failed"));
    place.succeeds("report a");
    assert!(place.read("a/index.html").contains("end: influence of the factors"));
}

#[test]
fn a_crash_of_the_fmu_costs_its_tasks_only() {
    let place = Place::new(PLAN);
    place.succeeds("plan plan.toml -o out");
    let output = place.sweep("run out --isolate --threads 2", "fmi2DoStep:segv:0.5");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    place.succeeds("merge out");
    let text = place.read("out/results.csv");
    for (task, line) in text.lines().skip(1).enumerate() {
        match task % 2 {
            0 => assert!(line.ends_with(",ok,"), "{line}"),
            _ => assert!(line.contains(",,,failed,") && line.contains("SIGSEGV"), "{line}"),
        }
    }
    assert!(place.succeeds("status out").contains("8 of 8 tasks done, 4 of them failed"));
    place.succeeds("report out");
    assert!(place.read("out/index.html").contains("4 tasks failed, first task 1"));
}

#[test]
fn an_input_that_changes_between_shards_is_named_and_nothing_is_lost() {
    let place = Place::new(PLAN);
    place.succeeds("plan plan.toml -o out");
    place.succeeds("run out --shard 1/2");
    let fmu = place.0.path().join("m.fmu");
    let before = std::fs::read(&fmu).unwrap();
    let changed = c_fmu::DESCRIPTION.replace("<Real start=\"1\"/>", "<Real start=\"2\"/>");
    c_fmu::pack(&fmu, &changed, Some(("m", &place.0.path().join("m.so"))));
    let message = place.fails("run out --shard 2/2", 1);
    assert!(
        message.contains("m.fmu") && message.contains("has changed since the plan was made"),
        "{message}"
    );
    assert!(place.fails("merge out", 1).contains("4 of 8 tasks are missing, the first is task 4"));
    std::fs::write(&fmu, before).unwrap();
    place.succeeds("run out --shard 2/2");
    place.succeeds("merge out");
    assert_eq!(place.read("out/results.csv").lines().count(), 9);
}

#[test]
fn wrong_words_are_named() {
    let place = Place::new(PLAN);
    assert!(place.fails("run out", 1).contains("there is no manifest.json"));
    place.succeeds("plan plan.toml -o out");
    assert!(place.fails("run out --shard 3/2", 2).contains("--shard 3/2: write i/n"));
    assert!(place.fails("report out", 1).contains("airloop sweep merge out"));
    for (from, to, words) in [
        ("signal = \"y\"\nof = \"final\"", "signal = \"z\"\nof = \"final\"", "there is no signal `z`"),
        ("name = \"x\"", "name = \"w\"", "`w` = 1"),
        ("name = \"run.stop\"", "name = \"run.end\"", "run.stop and run.tolerance"),
        ("level = 0.5", "", "an event needs `level`"),
        ("of = \"final\"", "of = \"fit\"", "there is nothing to compare with"),
        ("m.fmu", "n.fmu", "n.fmu"),
    ] {
        std::fs::write(place.0.path().join("wrong.toml"), PLAN.replacen(from, to, 1)).unwrap();
        let message = place.fails("plan wrong.toml -o wrong", 1);
        assert!(message.contains(words), "{to}: {message}");
    }
}

#[test]
fn commands_are_tasks_with_a_folder_each() {
    let place = Place::new(
        r#"
kind = "command"
command = ["run", "m.fmu", "--step", "10ms", "--stop", "{stop}", "--no-plots", "-o", "{output}"]
[[factors]]
name = "stop"
values = ["0.5", "-1", "1"]
[[quantities]]
name = "end_time"
file = "summary.json"
pointer = "/outcome/end_time"
[[quantities]]
name = "outcome"
file = "summary.json"
pointer = "/outcome/status"
text = true
"#,
    );
    place.succeeds("plan plan.toml --shards 2 -o out");
    place.succeeds("submit out --engine local --threads 2");
    place.succeeds("merge out");
    let text = place.read("out/results.csv");
    let rows: Vec<Vec<&str>> = text.lines().map(row).collect();
    assert_eq!(rows[0][2..], ["stop", "folder", "end_time", "outcome", "status", "cause"]);
    assert_eq!(rows[1][2..], ["0.5", "tasks/000000/result", "0.5", "completed", "ok", ""]);
    assert_eq!(rows[2][2..7], ["-1", "", "", "", "failed"]);
    assert_eq!(rows[3][2..5], ["1", "tasks/000002/result", "1"]);
    assert!(place.read("out/tasks/000000/result/summary.json").contains("\"status\": \"completed\""));
    place.succeeds("report out");
    assert!(place.read("out/index.html").contains("href=\"tasks/000000/result\""));
}
