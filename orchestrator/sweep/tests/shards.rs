//! A plan of empty tasks in shards of any number: the same bytes, and every kind of trouble by its name.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use airloop_sweep::Error;
use airloop_sweep::manifest::Manifest;
use airloop_sweep::merge::{self, PARQUET, RESULTS};
use airloop_sweep::shard::{self, Done, Runner, Shard};
use tempfile::TempDir;

const PLAN: &str = r#"
kind = "empty"
seed = 7
inputs = []
[sample]
method = "latin-hypercube"
count = 1000
[[factors]]
name = "mass"
from = 1
to = 100
scale = "log"
[[factors]]
name = "run.master"
values = ["jacobi", "gauss, \"seidel\""]
"#;

/// A folder with a plan, and a sweep of it.
fn planned(place: &TempDir, name: &str) -> PathBuf {
    let plan = place.path().join("plan.toml");
    std::fs::write(&plan, PLAN).unwrap();
    let folder = place.path().join(name);
    Manifest::plan(&plan).unwrap().write(&folder).unwrap();
    folder
}

fn run(folder: &Path, shard: &str, threads: usize) -> Result<Done, Error> {
    let runner = Runner::open(folder, threads)?;
    runner.run(shard.parse()?, &AtomicBool::new(false), &|_| {})
}

fn merged(folder: &Path) -> [Vec<u8>; 2] {
    merge::merge(folder).unwrap();
    [RESULTS, PARQUET].map(|name| std::fs::read(folder.join(name)).unwrap())
}

#[test]
fn merged_bytes_depend_on_neither_shards_nor_threads() {
    let place = TempDir::new().unwrap();
    let whole = planned(&place, "whole");
    run(&whole, "1/1", 1).unwrap();
    let truth = merged(&whole);
    for (of, threads) in [(2, 1), (3, 2), (7, 2), (99, 1)] {
        let folder = planned(&place, &format!("{of}"));
        // The last shard first: the order does not matter either.
        for index in (1..=of).rev() {
            run(&folder, &format!("{index}/{of}"), threads).unwrap();
        }
        assert_eq!(merged(&folder), truth, "{of} shards");
    }
    // Shards of two numbers that overlap.
    let mixed = planned(&place, "mixed");
    for shard in ["1/2", "2/3", "3/3"] {
        run(&mixed, shard, 2).unwrap();
    }
    assert_eq!(merged(&mixed), truth);
    let rows = String::from_utf8(truth[0].clone()).unwrap();
    let tasks: Vec<&str> = rows.lines().skip(1).map(|line| line.split_once(',').unwrap().0).collect();
    assert_eq!(tasks, (0..1000).map(|task| task.to_string()).collect::<Vec<_>>());
}

#[test]
fn a_finished_shard_is_skipped_and_missing_tasks_are_counted() {
    let place = TempDir::new().unwrap();
    let folder = planned(&place, "sweep");
    assert!(matches!(run(&folder, "2/4", 1).unwrap(), Done::Ran(foot) if foot.rows == 250));
    assert!(matches!(run(&folder, "2/4", 1).unwrap(), Done::Skipped(foot) if foot.rows == 250));
    match merge::merge(&folder) {
        Err(Error::Incomplete { missing: 750, all: 1000, first: 0, .. }) => {}
        other => panic!("{other:?}"),
    }
    let status = merge::status(&folder).unwrap();
    assert_eq!((status.done, status.first_missing), (250, Some(0)));
    assert!(matches!(run(&folder, "0/4", 1), Err(Error::Shard { .. })));
}

#[test]
fn a_shard_that_another_process_runs_is_left_to_it() {
    let place = TempDir::new().unwrap();
    let folder = planned(&place, "sweep");
    let tasks = Shard { index: 1, of: 1 }.tasks(1000);
    let lock = shard::path(&folder, &tasks).with_extension("lock");
    std::fs::create_dir_all(lock.parent().unwrap()).unwrap();
    let held = std::fs::File::create(&lock).unwrap();
    held.lock().unwrap();
    assert!(matches!(run(&folder, "1/1", 1), Err(Error::Busy { .. })));
    drop(held);
    assert!(matches!(run(&folder, "1/1", 1), Ok(Done::Ran(_))));
}

#[test]
fn clocks_that_differ_between_computers_change_nothing() {
    let place = TempDir::new().unwrap();
    let whole = planned(&place, "whole");
    run(&whole, "1/1", 1).unwrap();
    let truth = merged(&whole);
    let folder = planned(&place, "sweep");
    run(&folder, "1/2", 1).unwrap();
    // What a computer wrote whose clock is years off, with the locks that it left when it was switched off.
    let years = |count: u64| std::time::Duration::from_secs(count * 365 * 86_400);
    let now = std::time::SystemTime::now();
    for (when, shard) in [(now + years(20), "2/4"), (now - years(20), "3/4")] {
        for file in [folder.join("manifest.json"), place.path().join("plan.toml")] {
            std::fs::File::options().append(true).open(file).unwrap().set_modified(when).unwrap();
        }
        for entry in std::fs::read_dir(folder.join("shards")).unwrap() {
            let file = std::fs::File::options().append(true).open(entry.unwrap().path()).unwrap();
            file.set_modified(when).unwrap();
        }
        assert!(matches!(run(&folder, "1/2", 1), Ok(Done::Skipped(_))));
        assert!(matches!(run(&folder, shard, 1), Ok(Done::Ran(_))));
    }
    run(&folder, "4/4", 1).unwrap();
    assert_eq!(merged(&folder), truth);
}

#[test]
fn damage_and_other_plans_are_named() {
    let place = TempDir::new().unwrap();
    let folder = planned(&place, "sweep");
    run(&folder, "1/1", 1).unwrap();
    let path = shard::path(&folder, &(0..1000));
    let text = std::fs::read_to_string(&path).unwrap();
    let without_a_row = text.lines().enumerate().filter(|(line, _)| *line != 500);
    let without_a_row: String = without_a_row.map(|(_, line)| format!("{line}\n")).collect();
    for (damaged, words) in [
        (without_a_row, "the row of task 498 is missing"),
        (text.replacen(",ok,", ",no,", 1), "not those that were written"),
        (text[..text.len() / 2].to_owned(), "cannot be read"),
        (text[..text.rfind("# ").unwrap()].to_owned(), "ends before its last line"),
        (text.replacen("\"digest\":\"", "\"digest\":\"0", 1), "belongs to the plan"),
        (String::new(), "no head of a shard"),
    ] {
        std::fs::write(&path, damaged).unwrap();
        let message = merge::merge(&folder).unwrap_err().to_string();
        assert!(message.contains(words) && message.contains("0000000000-0000001000"), "{message}");
        assert_eq!(merge::status(&folder).unwrap().damaged.len(), 1);
    }
    let other = place.path().join("other.toml");
    std::fs::write(&other, PLAN.replace("seed = 7", "seed = 8")).unwrap();
    let refused = Manifest::plan(&other).unwrap().write(&folder);
    assert!(matches!(refused, Err(Error::OtherSweep { .. })), "{refused:?}");
}

#[test]
fn wrong_plans_name_the_place() {
    let place = TempDir::new().unwrap();
    let file = place.path().join("plan.toml");
    for (text, words) in [
        ("kind = \"nothing\"", "line 1"),
        ("kind = \"empty\"\nshard = 3", "line 2, column 1: the file has no key `shard`"),
        ("kind = \"empty\"\n[[factors]]\nname = \"m\"", "factor `m`: give either"),
        (
            "kind = \"empty\"\n[[factors]]\nname = \"m\"\nfrom = 0\nto = 1\nscale = \"log\"",
            "both limits are positive",
        ),
        ("kind = \"empty\"\n[[factors]]\nname = \"m\"\nvalues = [1, \"a\"]", "numbers and texts"),
        (
            "kind = \"empty\"\n[[factors]]\nname = \"seed\"\nvalues = [1]",
            "column `seed`: this name is taken twice",
        ),
        ("kind = \"simulate\"", "name the system"),
        ("kind = \"trials\"", "[trials]: add the table"),
        ("kind = \"command\"\ncommand = [\"rm\", \"{output}\"]", "`rm`; it begins with one of"),
        ("kind = \"command\"\ncommand = [\"refine\"]", "{output}"),
        (
            "kind = \"command\"\ncommand = [\"refine\", \"{case}\", \"{output}\"]",
            "`{case}`: the name in braces",
        ),
        ("kind = \"empty\"\ntime_limit = -1", "time_limit: -1"),
    ] {
        std::fs::write(&file, text).unwrap();
        let message = Manifest::plan(&file).unwrap_err().to_string();
        assert!(message.contains(words), "{text}: {message}");
    }
}

#[test]
fn a_merge_writes_both_tables_or_none() {
    let place = TempDir::new().unwrap();
    let folder = planned(&place, "sweep");
    run(&folder, "1/2", 1).unwrap();
    run(&folder, "2/2", 1).unwrap();
    // The last row of the second half is damaged: all rows before it are good.
    let path = shard::path(&folder, &(500..1000));
    let text = std::fs::read_to_string(&path).unwrap();
    let at = text.rfind(",ok,").unwrap();
    std::fs::write(&path, format!("{}{}", &text[..at], text[at..].replacen(",ok,", ",no,", 1))).unwrap();
    assert!(matches!(merge::merge(&folder), Err(Error::Damaged { .. })));
    assert!(!folder.join(RESULTS).exists() && !folder.join(PARQUET).exists());
    std::fs::write(&path, &text).unwrap();
    // A name that cannot be replaced: a folder.
    std::fs::create_dir_all(folder.join(PARQUET).join("inside")).unwrap();
    assert!(merge::merge(&folder).is_err());
    assert!(!folder.join(RESULTS).exists());
    std::fs::remove_dir_all(folder.join(PARQUET)).unwrap();
    merged(&folder);
    let left = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().file_name());
    assert!(left.into_iter().all(|name| !name.to_string_lossy().starts_with(".writing-")));
}
