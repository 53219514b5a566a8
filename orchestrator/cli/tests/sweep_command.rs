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
    // In the process of the shard a crash is the end of all; nothing half-written is left.
    let output = place.sweep("run out --isolate=none --threads 1", "fmi2DoStep:segv:0.5");
    assert!(!output.status.success());
    assert!(place.fails("merge out", 1).contains("8 of 8 tasks are missing"));
    // FMUs of other tools have processes of their own.
    let output = place.sweep("run out --threads 2", "fmi2DoStep:segv:0.5");
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
    // Shards of another number over the same tasks are no more failures.
    let output = place.sweep("run out --shard 2/3", "fmi2DoStep:segv:0.5");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
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
fn files_behind_the_words_of_commands_are_inputs() {
    let place = Place::new(
        r#"
kind = "command"
command = ["run", "{system}", "--step", "10ms", "--stop", "0.1", "--no-plots", "-o", "{output}"]
[[factors]]
name = "system"
entries_of = "systems"
"#,
    );
    let write = |file: &str, text: &str| {
        let path = place.0.path().join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    let system = r#"<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" version="1.0" name="s">
  <ssd:System name="s"><ssd:Elements>
    <ssd:Component name="a" source="../m.fmu">
      <ssd:ParameterBindings><ssd:ParameterBinding source="../far/set.ssv"/></ssd:ParameterBindings>
    </ssd:Component>
  </ssd:Elements></ssd:System>
</ssd:SystemStructureDescription>
"#;
    let set = |x: u8| {
        format!(
            r#"<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0" name="p"><ssv:Parameters><ssv:Parameter name="x"><ssv:Real value="{x}"/></ssv:Parameter></ssv:Parameters></ssv:ParameterSet>"#
        )
    };
    write("systems/one.ssd", system);
    write("systems/two.ssd", system);
    write("far/set.ssv", &set(1));
    place.succeeds("plan plan.toml -o out");
    place.succeeds("run out --shard 1/2");
    let fmu = place.bytes("m.fmu");
    let changed = c_fmu::DESCRIPTION.replace("<Real start=\"1\"/>", "<Real start=\"2\"/>");
    let library = place.0.path().join("m.so");
    c_fmu::pack(&place.0.path().join("m.fmu"), &changed, Some(("m", &library)));
    let refused = |file: &str| {
        let message = place.fails("run out --shard 2/2", 1);
        assert!(message.contains(file) && message.contains("has changed since"), "{message}");
    };
    refused("m.fmu");
    std::fs::write(place.0.path().join("m.fmu"), fmu).unwrap();
    write("far/set.ssv", &set(3));
    refused("far/set.ssv");
    write("far/set.ssv", &set(1));
    write("systems/three.ssd", system);
    refused("systems");
    std::fs::remove_file(place.0.path().join("systems/three.ssd")).unwrap();
    place.succeeds("run out --shard 2/2");
    place.succeeds("merge out");
    assert_eq!(place.read("out/results.csv").matches(",ok,").count(), 2);
}

#[test]
fn signals_have_the_same_bytes_for_any_shards_and_threads() {
    let place = Place::new(&format!("{PLAN}[signals]\nnames = [\"y\"]\nevery = 10\n"));
    for (folder, shards) in
        [("a", &["1/1"][..]), ("b", &["3/3", "1/3", "2/3"]), ("c", &["1/2", "2/3", "3/3"])]
    {
        place.succeeds(&format!("plan plan.toml -o {folder}"));
        for shard in shards {
            place.succeeds(&format!("run {folder} --threads {} --shard {shard}", shards.len().min(2)));
        }
        place.succeeds(&format!("merge {folder}"));
        for file in ["results.csv", "signals.parquet"] {
            assert_eq!(
                place.bytes(&format!("a/{file}")),
                place.bytes(&format!("{folder}/{file}")),
                "{folder}/{file}"
            );
        }
    }
    assert!(place.read("a/summary.json").contains("signals.parquet"));
    // Four tasks of 25 steps keep rows 0, 10, 20 and 25, four of 100 steps 11 rows: task, time and y, 8 bytes each.
    let bytes = place.bytes("a/signals.parquet");
    assert!((60 * 24..60 * 24 + 4000).contains(&bytes.len()), "{} bytes", bytes.len());
    // What another shard wrote is named, and its rows are told to be run again.
    std::fs::copy(
        place.0.path().join("b/shards/0000000000-0000000002.signals.parquet"),
        place.0.path().join("b/shards/0000000002-0000000005.signals.parquet"),
    )
    .unwrap();
    let message = place.fails("merge b", 1);
    assert!(message.contains("0000000002-0000000005.csv") && message.contains("are not those"), "{message}");
    let wrong = PLAN.to_owned() + "[signals]\nnames = [\"z\"]\n";
    std::fs::write(place.0.path().join("wrong.toml"), wrong).unwrap();
    assert!(place.fails("plan wrong.toml -o wrong", 1).contains("[signals] names: there is no signal `z`"));
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
    let page = place.read("out/index.html");
    assert!(page.contains("href=\"tasks/000000/result\""));
    // Factors that are texts: figures of the kinds of outcomes and of every task.
    assert!(page.contains("outcome: number of tasks") && page.contains("end_time of every task"), "{page}");
}

#[test]
fn identifications_over_a_folder_of_records_are_tasks() {
    let place = Place::new(
        r#"
kind = "command"
command = ["identify", "arx", "{record}", "--inputs", "u", "--outputs", "y", "--na", "1", "--nb", "1", "--nk", "1", "-o", "{output}"]
[[factors]]
name = "record"
entries_of = "records"
[[quantities]]
name = "fit"
file = "summary.json"
pointer = "/estimation/mean_fit_simulated"
"#,
    );
    std::fs::create_dir(place.0.path().join("records")).unwrap();
    // y(k) = a y(k-1) + u(k-1), which ARX fits without rest.
    for (name, a) in [("slow.csv", 0.9), ("fast.csv", 0.5)] {
        let (mut text, mut y) = ("time,u,y\n".to_owned(), 0.0);
        for k in 0..200_u32 {
            let u = f64::from(k * 7919 % 13) - 6.0;
            text += &format!("{},{u},{y}\n", f64::from(k) / 100.0);
            y = a * y + u;
        }
        std::fs::write(place.0.path().join("records").join(name), text).unwrap();
    }
    std::fs::write(place.0.path().join("records/text.csv"), "no record").unwrap();
    place.succeeds("plan plan.toml -o out");
    place.succeeds("run out --threads 2");
    place.succeeds("merge out");
    let text = place.read("out/results.csv");
    let rows: Vec<Vec<&str>> = text.lines().skip(1).map(row).collect();
    assert_eq!(
        rows.iter().map(|row| row[2]).collect::<Vec<_>>(),
        ["records/fast.csv", "records/slow.csv", "records/text.csv"]
    );
    for fitted in &rows[..2] {
        assert!(place.read(&format!("out/{}/model.toml", fitted[3])).contains("A = [[["), "{fitted:?}");
        assert!(fitted[4].parse::<f64>().unwrap() > 99.999, "{fitted:?}");
        assert_eq!(fitted[5], "ok", "{fitted:?}");
    }
    assert!(rows[2][5] == "failed" && text.contains("text.csv"), "{:?}", rows[2]);
}

#[test]
fn a_multistart_is_tasks_with_seeds_of_their_own() {
    let example = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/03_swing_up");
    if !example.join("../../target/fmu/cart-pole.fmu").exists() {
        eprintln!("skipped: target/fmu/cart-pole.fmu is not built (make fmu)");
        return;
    }
    let problem = example.join("problem.toml").canonicalize().unwrap();
    let place = Place::new(&format!(
        r#"
kind = "command"
command = ["optimize", "{}", "--multistart", "1", "--seed", "{{seed}}", "--no-plots", "-o", "{{output}}"]
[sample]
count = 2
[[quantities]]
name = "objective"
file = "summary.json"
pointer = "/objective"
[[quantities]]
name = "outcome"
file = "summary.json"
pointer = "/status"
text = true
"#,
        problem.display()
    ));
    place.succeeds("plan plan.toml -o out");
    place.succeeds("run out --threads 2");
    place.succeeds("merge out");
    let text = place.read("out/results.csv");
    let rows: Vec<Vec<&str>> = text.lines().skip(1).map(row).collect();
    assert_eq!(rows.len(), 2);
    assert_ne!(rows[0][1], rows[1][1], "seeds are the same");
    for own in &rows {
        assert_eq!((own[4], own[5]), ("solved", "ok"), "{own:?}");
        assert!(own[3].parse::<f64>().unwrap() > 0.0, "{own:?}");
    }
}

#[test]
fn two_submissions_of_one_plan_into_one_folder_run_every_task_once() {
    let place = Place::new(PLAN);
    place.succeeds("plan plan.toml --shards 4 -o out");
    let begin = || {
        Command::new(env!("CARGO_BIN_EXE_airloop"))
            .args(["sweep", "submit", "out", "--engine", "local", "--threads", "1"])
            .current_dir(place.0.path())
            .stderr(std::process::Stdio::piped())
            .stdout(std::process::Stdio::piped())
            .spawn()
            .unwrap()
    };
    let both = [begin(), begin()].map(|child| child.wait_with_output().unwrap());
    let printed = both.each_ref().map(|output| String::from_utf8_lossy(&output.stdout).into_owned());
    let ran = printed.iter().map(|text| text.split(' ').next().unwrap().parse::<u32>().unwrap());
    assert_eq!(ran.sum::<u32>(), 8, "{printed:?}");
    for output in &both {
        let left = String::from_utf8_lossy(&output.stderr).contains("another process runs these tasks");
        assert_eq!(output.status.success(), !left, "{output:?}");
    }
    place.succeeds("merge out");
    assert_eq!(place.read("out/results.csv").lines().count(), 9);
}

#[test]
fn of_two_submissions_to_a_cluster_one_is_refused() {
    let place = Place::new(PLAN);
    place.succeeds("plan plan.toml -o out");
    // A cluster whose job waits for ever.
    let programs = place.0.path().join("bin");
    std::fs::create_dir(&programs).unwrap();
    for (name, text) in
        [("sbatch", "sleep 0.5; echo 17"), ("squeue", "echo RUNNING; echo PENDING; echo PENDING")]
    {
        let path = programs.join(name);
        std::fs::write(&path, format!("#!/bin/sh\n{text}\n")).unwrap();
        std::fs::set_permissions(&path, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    }
    let begin = || {
        Command::new(env!("CARGO_BIN_EXE_airloop"))
            .args(["sweep", "submit", "out", "--engine", "slurm"])
            .env("PATH", format!("{}:/usr/bin:/bin", programs.display()))
            .current_dir(place.0.path())
            .stderr(std::process::Stdio::piped())
            .stdout(std::process::Stdio::null())
            .spawn()
            .unwrap()
    };
    let refused = |output: &Output| String::from_utf8_lossy(&output.stderr).into_owned();
    // At one moment, and later.
    let both = [begin(), begin()].map(|child| child.wait_with_output().unwrap());
    assert_eq!(both.iter().filter(|output| output.status.success()).count(), 1, "{both:?}");
    let late = begin().wait_with_output().unwrap();
    assert!(refused(&late).contains("job 17 runs this folder already"), "{late:?}");
    let status = |path: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_airloop"))
            .args(["sweep", "status", "out"])
            .env("PATH", path)
            .current_dir(place.0.path())
            .output();
        String::from_utf8(output.unwrap().stdout).unwrap()
    };
    let asked = status(&format!("{}:/usr/bin:/bin", programs.display()));
    assert!(asked.contains("Slurm job 17 with 1 shards; 2 pending, 1 running"), "{asked}");
    let elsewhere = status("/nowhere");
    assert!(
        elsewhere.contains("0 of 8 tasks done") && elsewhere.contains("`squeue` cannot be started"),
        "{elsewhere}"
    );
}

#[test]
fn files_of_the_user_are_not_replaced_by_results() {
    let place = Place::new(PLAN);
    place.succeeds("plan plan.toml -o out");
    place.succeeds("run out");
    for name in ["results.csv", "results.parquet", "summary.json"] {
        let path = place.0.path().join("out").join(name);
        std::fs::write(&path, "theirs").unwrap();
        let message = place.fails("merge out", 1);
        assert!(message.contains(name) && message.contains("would be replaced"), "{message}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "theirs");
        std::fs::remove_file(path).unwrap();
    }
    place.succeeds("merge out");
    place.succeeds("merge out");
    let page = place.0.path().join("out/index.html");
    std::fs::write(&page, "theirs").unwrap();
    let message = place.fails("report out", 1);
    assert!(message.contains("index.html") && message.contains("would be replaced"), "{message}");
    std::fs::remove_file(page).unwrap();
    place.succeeds("report out");
    place.succeeds("report out");
}

#[test]
fn shards_are_as_many_as_their_time_makes() {
    let place = Place::new(PLAN);
    let short = place.succeeds("plan plan.toml --shard-time 1us -o short");
    assert!(short.contains("8 tasks in 8 shards"), "{short}");
    let long = place.succeeds("plan plan.toml --shard-time 10min -o long");
    assert!(long.contains("8 tasks in 1 shards"), "{long}");
    assert!(place.fails("plan plan.toml --shard-time 0 -o zero", 2).contains("longer than 0 s"));
}

#[test]
fn a_saltelli_sample_has_indices_in_its_report() {
    let plan = PLAN.replace(
        "[[factors]]\nname = \"x\"",
        "[sample]\nmethod = \"saltelli\"\ncount = 8\n[[factors]]\nname = \"x\"",
    );
    let place = Place::new(&plan);
    // Eight points of two factors.
    let planned = place.succeeds("plan plan.toml -o out");
    assert!(planned.contains("32 tasks"), "{planned}");
    place.succeeds("run out");
    place.succeeds("merge out");
    place.succeeds("report out");
    let page = place.read("out/index.html");
    assert!(page.contains("indices of end, from 8 points"), "{page}");
}

#[test]
fn a_full_disk_leaves_nothing_half_written_and_the_same_command_goes_on() {
    let place = Place::new("kind = \"empty\"\n[sample]\ncount = 60000\n");
    // A file system of 1 MB in a name space of its own; three shards of 600 kB do not fit.
    let script = r#"
        mkdir small && mount -t tmpfs -o size=1m small small || exit 77
        "$0" sweep plan plan.toml --shards 3 -o small/out -q || exit 1
        "$0" sweep run small/out --threads 1 -q 2> said && exit 2
        ls -A small/out/shards | grep -v lock > left
        mount -o remount,size=20m small || exit 77
        "$0" sweep run small/out --threads 1 -q && "$0" sweep merge small/out -q || exit 3
        cp small/out/results.csv full.csv
    "#;
    let output = Command::new("unshare")
        .args(["--map-root-user", "--mount", "sh", "-c", script, env!("CARGO_BIN_EXE_airloop")])
        .current_dir(place.0.path())
        .output();
    let allowed = output.as_ref().is_ok_and(|output| {
        output.status.code() != Some(77) && !String::from_utf8_lossy(&output.stderr).contains("unshare")
    });
    if !allowed {
        eprintln!("skipped: no name space of one's own is allowed here: {output:?}");
        return;
    }
    let output = output.unwrap();
    assert!(output.status.success(), "{output:?}");
    let said = place.read("said");
    assert!(said.contains("make room and run again"), "{said}");
    assert_eq!(place.read("left"), "0000000000-0000020000.csv\n");
    place.succeeds("plan plan.toml -o whole");
    place.succeeds("run whole");
    place.succeeds("merge whole");
    assert_eq!(place.bytes("full.csv"), place.bytes("whole/results.csv"));
}
