//! Files and settings that nobody should have to fear: each ends with a message and an exit code, and leaves nothing
//! behind. `docs/hostile.md` is the table of them, made by this test.
#![cfg(target_os = "linux")]

mod hostile;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use hostile::{Case, machine};

const UPDATE: &str = "UPDATE_REFERENCE=1 cargo test -p airloop-cli --test hostile_files";

/// All files below a folder with their sizes.
fn files(folder: &Path) -> BTreeMap<String, u64> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in std::fs::read_dir(&next).unwrap().map(Result::unwrap) {
            match entry.file_type().unwrap().is_dir() {
                true => open.push(entry.path()),
                false => {
                    let name = entry.path().strip_prefix(folder).unwrap().to_string_lossy().into_owned();
                    found.insert(name, entry.metadata().unwrap().len());
                }
            }
        }
    }
    found
}

/// Exit code and message of a case, or what is wrong with its end.
fn run(case: &Case, folder: &Path) -> Result<(i32, String), String> {
    case.write(folder);
    let before = files(folder);
    let began = Instant::now();
    let output = Command::new(env!("CARGO_BIN_EXE_airloop"))
        .args(case.command.split_whitespace())
        .env("TMPDIR", folder.join("tmp"))
        .env("AIRLOOP_FMUS", folder)
        .current_dir(folder)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let wrong = |what: &str| Err(format!("{} (`{}`): {what}\n{said}", case.what, case.command));
    if began.elapsed() > Duration::from_secs(10) {
        return wrong("it takes too long");
    }
    let Some(code @ 1..=2) = output.status.code() else { return wrong(&output.status.to_string()) };
    if said.contains("panicked") || said.contains('\u{1b}') {
        return wrong("its message is none");
    }
    if files(folder) != before {
        return wrong(&format!("it leaves {:?}", files(folder).keys().collect::<Vec<_>>()));
    }
    match said.lines().find_map(|line| line.strip_prefix("error: ")) {
        Some(message) => Ok((code, lasting(&message.replace(&format!("{}/", folder.display()), "")))),
        None => wrong("it says nothing"),
    }
}

/// The message without what differs from machine to machine.
fn lasting(message: &str) -> String {
    let free = message.split_once(" GiB are free").and_then(|(before, _)| before.rsplit_once(' '));
    free.map_or_else(
        || message.to_owned(),
        |(_, number)| message.replace(&format!("{number} GiB are free"), "N GiB are free"),
    )
}

/// Text that a cell of a table can hold, with what is too long for one left out in the middle.
fn cell(text: &str) -> String {
    let text = text.replace('|', "\\|").replace('<', "&lt;").replace('*', "\\*").replace('`', "'");
    let letters: Vec<char> = text.chars().collect();
    if letters.len() <= 300 {
        return text;
    }
    let part = |letters: &[char]| letters.iter().collect::<String>();
    format!("{} ... {}", part(&letters[..180]), part(&letters[letters.len() - 100..]))
}

#[test]
fn faults_of_the_machine_end_as_the_table_says() {
    let check = |fault: &machine::Fault| fault.check(hostile::folder_with_fmu().path()).err();
    let wrong: Vec<String> = machine::FAULTS.iter().filter_map(check).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The long form of the fault of this name: `make study-faults`.
#[test]
#[ignore = "half a minute"]
fn a_run_killed_a_hundred_times_has_whole_rows_and_never_loses_the_earlier_result() {
    let folder = hostile::folder_with_fmu();
    let folder = folder.path();
    let long = "run m.fmu --stop 20 --step 1ms --no-plots -q -o out";
    let (mut partial, mut complete) = (0, 0);
    let mut seed = 1_u64;
    for _ in 0..100 {
        // Between nothing and somewhat more than a whole run.
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let wait = Duration::from_micros((seed >> 33) % 150_000);
        let earlier = std::fs::read(folder.join("out/result.csv")).ok();
        let mut child = machine::airloop(folder, long).spawn().unwrap();
        std::thread::sleep(wait);
        let _ = child.kill();
        child.wait().unwrap();
        for name in machine::names(&folder.join("out")).iter().filter(|name| name.ends_with(".csv")) {
            machine::whole_rows(&folder.join("out").join(name)).unwrap();
        }
        let there = folder.join("out/result.partial.csv").exists();
        partial += u32::from(there);
        match std::fs::read(folder.join("out/result.csv")) {
            Ok(rows) => {
                assert_eq!(
                    rows.iter().filter(|&&byte| byte == b'\n').count(),
                    20_002,
                    "a result is complete"
                );
                complete += 1;
            }
            Err(_) => {
                let staged =
                    machine::names(&folder.join("out")).iter().any(|name| name.starts_with(".airloop-new-"));
                assert!(earlier.is_none() || staged, "the earlier result is lost");
            }
        }
    }
    println!("100 kills: partial rows were there {partial} times, a complete result {complete} times");
    // The next command tidies up.
    assert!(machine::airloop(folder, long).status().unwrap().success());
    let mut left = machine::names(&folder.join("out"));
    left.sort();
    assert_eq!(left, ["result.csv", "summary.json"]);
}

#[test]
fn hostile_files_and_settings_end_as_the_table_says() {
    let mut page = format!("<!-- generated by: {UPDATE}; do not edit -->\n\n");
    page += "# Hostile files and settings\n\nEach line is run by a test, which also sees that no file stays behind. Exit code 1: the input is refused; \
             2: the command line is.\n";
    let mut wrong = Vec::new();
    for (title, cases) in hostile::all() {
        let _ =
            write!(page, "\n## {title}\n\n| input | command | exit code | message |\n|---|---|---|---|\n");
        for case in cases {
            let folder = tempfile::tempdir().unwrap();
            std::fs::create_dir(folder.path().join("tmp")).unwrap();
            let (code, message) = match run(&case, folder.path()) {
                Ok(end) => end,
                Err(problem) => {
                    wrong.push(problem);
                    continue;
                }
            };
            let _ =
                writeln!(page, "| {} | `{}` | {code} | {} |", cell(&case.what), case.command, cell(&message));
        }
    }
    page += "\n## Faults of the machine\n\nA run is complete, absent, or marked as partial (`result.partial.csv`, or a status other than `completed` in \
             `summary.json`), and its rows are whole, but for rows longer than 4096 bytes after SIGKILL. `left` are the files in its folder afterwards; the next command into the folder completes or removes what \
             is hidden.\n\n| fault | command | exit code | message | left |\n|---|---|---|---|---|\n";
    for fault in machine::FAULTS {
        let code = fault.code.map_or("signal".to_owned(), |code| code.to_string());
        let (what, says, left) = (fault.what, cell(fault.says), fault.left.join(", "));
        let _ = writeln!(page, "| {what} | `{}` | {code} | {says} | {left} |", fault.command);
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/hostile.md");
    if std::env::var_os("UPDATE_REFERENCE").is_some() {
        std::fs::write(&file, &page).unwrap();
    }
    let written = std::fs::read_to_string(&file).unwrap_or_default();
    let different = written.lines().zip(page.lines()).find(|(written, page)| written != page);
    assert!(written == page, "docs/hostile.md is stale; run `{UPDATE}`\n{different:?}");
}
