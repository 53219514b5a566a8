//! Faults of the machine: disks that are full, folders that go away, signals, readers who leave.
//!
//! Each fault is done to a command, which then ends with the exit code and the message of the table and leaves the
//! files of the table; rows are whole wherever they are.

use std::fs::File;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// One line of the table.
pub struct Fault {
    /// Event during the command.
    pub what: &'static str,
    /// Arguments of the program.
    pub command: &'static str,
    /// Exit code; none: ended by a signal.
    pub code: Option<i32>,
    /// Part of the message; empty: none is needed.
    pub says: &'static str,
    /// Files in the folder `out` afterwards.
    pub left: &'static [&'static str],
    act: fn(&Path, Command) -> Output,
}

/// Another user, to whom the system says no where it says nothing to root.
const NOBODY: u32 = 65534;
/// Time after which a command that should have begun has not.
const MAX_WAIT: Duration = Duration::from_secs(30);

const SHORT_RUN: &str = "run m.fmu --stop 1 --step 1ms --no-plots -o out";
const LONG_RUN: &str = "run m.fmu --stop 1e6 --step 1ms --no-plots -o out";
const RESULT: &[&str] = &["result.csv", "summary.json"];
const KILLED: &[&str] = &["result.partial.csv"];

/// All faults.
pub const FAULTS: &[Fault] = &[
    Fault {
        what: "the disk is full where the rows go",
        command: SHORT_RUN,
        code: Some(1),
        says: "No space left on device",
        left: &[],
        act: rows_on_a_full_disk,
    },
    Fault {
        what: "files may not grow beyond 64 kB (ulimit -f)",
        command: "run m.fmu --stop 100 --step 1ms --no-plots -o out",
        code: Some(1),
        says: "the rows of the result cannot be written: File too large",
        left: RESULT,
        act: short_files,
    },
    Fault {
        what: "the folder is read-only",
        command: SHORT_RUN,
        code: Some(1),
        says: "output folder out: nothing can be written there: Permission denied",
        left: &[],
        act: read_only,
    },
    Fault {
        what: "the parent folder is read-only",
        command: SHORT_RUN,
        code: Some(1),
        says: "output folder out: Permission denied",
        left: &[],
        act: read_only_parent,
    },
    Fault {
        what: "a file has the name of the folder",
        command: SHORT_RUN,
        code: Some(1),
        says: "output folder out: a file of that name is there; choose another folder",
        left: &[],
        act: file_in_the_way,
    },
    Fault {
        what: "the folder is a link to nowhere",
        command: SHORT_RUN,
        code: Some(1),
        says: "output folder out:",
        left: &[],
        act: dangling_link,
    },
    Fault {
        what: "the folder is removed while the run goes on",
        command: LONG_RUN,
        code: Some(1),
        says: "No such file or directory",
        left: &[],
        act: folder_vanishes,
    },
    Fault {
        what: "the FMU is removed while the run goes on, then Ctrl-C",
        command: LONG_RUN,
        code: Some(130),
        says: "interrupted; the result so far is in out/result.csv",
        left: RESULT,
        act: fmu_vanishes,
    },
    Fault {
        what: "another run writes into the folder",
        command: SHORT_RUN,
        code: Some(1),
        says: "another airloop writes into it",
        left: KILLED,
        act: two_runs,
    },
    Fault {
        what: "SIGKILL after 1 to 200 ms, five times (`make study-faults`: 100)",
        command: LONG_RUN,
        code: None,
        says: "",
        left: KILLED,
        act: killed,
    },
    Fault {
        what: "SIGKILL of a run over an earlier result",
        command: LONG_RUN,
        code: None,
        says: "",
        left: &["result.csv", "result.partial.csv", "summary.json"],
        act: killed_over_a_result,
    },
    Fault {
        what: "SIGINT (Ctrl-C)",
        command: LONG_RUN,
        code: Some(130),
        says: "interrupted; the result so far is in out/result.csv",
        left: RESULT,
        act: |folder, command| signaled(folder, command, "-INT"),
    },
    Fault {
        what: "SIGTERM (a batch system)",
        command: LONG_RUN,
        code: Some(130),
        says: "interrupted; the result so far is in out/result.csv",
        left: RESULT,
        act: |folder, command| signaled(folder, command, "-TERM"),
    },
    Fault {
        what: "SIGHUP (the terminal is closed)",
        command: LONG_RUN,
        code: Some(130),
        says: "interrupted; the result so far is in out/result.csv",
        left: RESULT,
        act: |folder, command| signaled(folder, command, "-HUP"),
    },
    Fault {
        what: "SIGINT while a file is written that means nothing before it is complete",
        command: "excite chirp --amplitude 1 --band 1..5 --duration 100000 -o out/chirp.csv",
        code: Some(130),
        says: "interrupted; what was not complete is removed",
        left: &[],
        act: interrupted_while_writing,
    },
    Fault {
        what: "stopped for two seconds, call limit 1 s",
        command: "run m.fmu --stop 1e6 --step 1ms --no-plots -o out --isolate --call-limit 1",
        code: Some(130),
        says: "interrupted; the result so far is in out/result.csv",
        left: RESULT,
        act: stopped_for_a_while,
    },
    Fault {
        what: "who reads the standard output leaves (SIGPIPE)",
        command: SHORT_RUN,
        code: Some(0),
        says: "",
        left: RESULT,
        act: reader_leaves,
    },
    Fault {
        what: "the standard output is a full disk",
        command: SHORT_RUN,
        code: Some(1),
        says: "the standard output cannot be written: No space left on device",
        left: RESULT,
        act: full_output,
    },
    Fault {
        what: "standard input, output and error are closed",
        command: SHORT_RUN,
        code: Some(0),
        says: "",
        left: RESULT,
        act: closed_streams,
    },
    Fault {
        what: "TMPDIR is not there",
        command: SHORT_RUN,
        code: Some(1),
        says: "check free space, or set TMPDIR",
        left: &[],
        act: |_, mut command| command.env("TMPDIR", "/nowhere").output().unwrap(),
    },
    Fault {
        what: "4 file descriptors (ulimit -n 4)",
        command: SHORT_RUN,
        code: Some(1),
        says: "Too many open files",
        left: &[],
        act: few_descriptors,
    },
    Fault {
        what: "no environment",
        command: SHORT_RUN,
        code: Some(0),
        says: "",
        left: RESULT,
        act: |_, mut command| command.env_clear().output().unwrap(),
    },
    Fault {
        what: "the clock is wrong: files of the earlier result are of the years 1970 and 2100",
        command: SHORT_RUN,
        code: Some(0),
        says: "",
        left: RESULT,
        act: wrong_clock,
    },
    Fault {
        what: "an earlier command was killed while it moved its result",
        command: SHORT_RUN,
        code: Some(0),
        says: "",
        left: RESULT,
        act: killed_while_moving,
    },
];

impl Fault {
    /// Does the fault; what is wrong with the end.
    pub fn check(&self, folder: &Path) -> Result<(), String> {
        let output = (self.act)(folder, airloop(folder, self.command));
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let wrong = |what: String| Err(format!("{} (`{}`): {what}\n{said}", self.what, self.command));
        if output.status.code() != self.code {
            return wrong(output.status.to_string());
        }
        if !said.contains(self.says) || said.contains("panicked") {
            return wrong(format!("it does not say `{}`", self.says));
        }
        let out = folder.join("out");
        let mut left = names(&out);
        left.sort();
        if left != self.left {
            return wrong(format!("it leaves {left:?}"));
        }
        for name in left.iter().filter(|name| name.ends_with(".csv")) {
            whole_rows(&out.join(name))?;
        }
        let temporary = names(&folder.join("tmp"));
        if self.code.is_some() && !temporary.is_empty() {
            return wrong(format!("it leaves {temporary:?} in the temporary folder"));
        }
        Ok(())
    }
}

/// Every row of a file has as many cells as its header, and ends.
pub fn whole_rows(path: &Path) -> Result<(), String> {
    let text = std::fs::read_to_string(path).map_err(|error| error.to_string())?;
    let cells = text.lines().next().unwrap_or_default().split(',').count();
    let broken = text.lines().find(|line| line.split(',').count() != cells);
    match broken {
        None if text.is_empty() || text.ends_with('\n') => Ok(()),
        _ => Err(format!("{}: half a row: {broken:?}", path.display())),
    }
}

/// Names in a folder; none where there is no folder.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect()
}

/// The program with these arguments.
pub fn airloop(folder: &Path, words: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_airloop"));
    command.args(words.split_whitespace()).current_dir(folder).env("TMPDIR", folder.join("tmp"));
    command
}

/// The command by way of a shell that does something first.
fn after(first: &str, command: &Command) -> Command {
    let mut shell = Command::new("sh");
    shell.args(["-c", &format!("{first}; exec \"$0\" \"$@\"")]).arg(command.get_program());
    shell.args(command.get_args()).current_dir(command.get_current_dir().unwrap());
    shell.envs(command.get_envs().filter_map(|(name, value)| Some((name, value?))));
    shell
}

/// The command as a user whom the system refuses things.
fn as_nobody(command: &mut Command) -> Output {
    // Only root may do this; everybody else is refused things already.
    let is_root =
        std::fs::metadata("/proc/self").is_ok_and(|own| std::os::unix::fs::MetadataExt::uid(&own) == 0);
    if is_root { command.uid(NOBODY).gid(NOBODY).output().unwrap() } else { command.output().unwrap() }
}

fn mode(path: &Path, mode: u32) {
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
}

/// A command that has begun to write rows.
pub fn begun(folder: &Path, command: &mut Command) -> Child {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let began = Instant::now();
    let rows = folder.join("out/result.partial.csv");
    while rows.metadata().map_or(0, |file| file.len()) < 100 && began.elapsed() < MAX_WAIT {
        assert!(child.try_wait().unwrap().is_none(), "it ends before it writes");
        std::thread::sleep(Duration::from_millis(2));
    }
    child
}

fn send(child: &Child, signal: &str) {
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
}

fn rows_on_a_full_disk(folder: &Path, mut command: Command) -> Output {
    std::fs::create_dir(folder.join("out")).unwrap();
    std::os::unix::fs::symlink("/dev/full", folder.join("out/result.partial.csv")).unwrap();
    command.output().unwrap()
}

fn short_files(_: &Path, command: Command) -> Output {
    after("ulimit -f 128", &command).output().unwrap()
}

fn read_only(folder: &Path, mut command: Command) -> Output {
    std::fs::create_dir(folder.join("out")).unwrap();
    [(folder, 0o755), (&folder.join("tmp"), 0o777), (&folder.join("out"), 0o555)]
        .into_iter()
        .for_each(|(path, bits)| mode(path, bits));
    as_nobody(&mut command)
}

fn read_only_parent(folder: &Path, mut command: Command) -> Output {
    mode(folder, 0o555);
    mode(&folder.join("tmp"), 0o777);
    let output = as_nobody(&mut command);
    mode(folder, 0o755);
    output
}

fn file_in_the_way(folder: &Path, mut command: Command) -> Output {
    std::fs::write(folder.join("out"), "mine").unwrap();
    let output = command.output().unwrap();
    assert_eq!(std::fs::read_to_string(folder.join("out")).unwrap(), "mine");
    std::fs::remove_file(folder.join("out")).unwrap();
    output
}

fn dangling_link(folder: &Path, mut command: Command) -> Output {
    std::os::unix::fs::symlink("nowhere/at/all", folder.join("out")).unwrap();
    command.output().unwrap()
}

fn folder_vanishes(folder: &Path, mut command: Command) -> Output {
    let child = begun(folder, &mut command);
    std::fs::remove_dir_all(folder.join("out")).unwrap();
    send(&child, "-INT");
    child.wait_with_output().unwrap()
}

fn fmu_vanishes(folder: &Path, mut command: Command) -> Output {
    let child = begun(folder, &mut command);
    std::fs::remove_file(folder.join("m.fmu")).unwrap();
    send(&child, "-INT");
    child.wait_with_output().unwrap()
}

fn two_runs(folder: &Path, mut command: Command) -> Output {
    let mut first = begun(folder, &mut airloop(folder, LONG_RUN));
    let output = command.output().unwrap();
    first.kill().unwrap();
    first.wait().unwrap();
    remove_stages(folder);
    // What the first unpacked; the next command removes it.
    std::fs::remove_dir_all(folder.join("tmp")).unwrap();
    output
}

fn killed(folder: &Path, mut command: Command) -> Output {
    let mut last = None;
    for wait in [1, 9, 30, 80, 200] {
        let mut child = begun(folder, &mut command);
        std::thread::sleep(Duration::from_millis(wait));
        child.kill().unwrap();
        last = Some(child.wait_with_output().unwrap());
        assert!(whole_rows(&folder.join("out/result.partial.csv")).is_ok());
        // The begin of the next run waits for its own rows.
        if wait < 200 {
            std::fs::remove_file(folder.join("out/result.partial.csv")).unwrap();
        }
    }
    remove_stages(folder);
    last.unwrap()
}

/// Hidden folders of killed commands; the next command removes them.
fn remove_stages(folder: &Path) {
    for name in names(&folder.join("out")).iter().filter(|name| name.starts_with(".airloop-new-")) {
        std::fs::remove_dir_all(folder.join("out").join(name)).unwrap();
    }
}

fn killed_over_a_result(folder: &Path, mut command: Command) -> Output {
    assert!(airloop(folder, SHORT_RUN).output().unwrap().status.success());
    let before = std::fs::read(folder.join("out/result.csv")).unwrap();
    let mut child = begun(folder, &mut command);
    child.kill().unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(std::fs::read(folder.join("out/result.csv")).unwrap() == before, "the earlier result changed");
    remove_stages(folder);
    output
}

fn signaled(folder: &Path, mut command: Command, signal: &str) -> Output {
    let child = begun(folder, &mut command);
    send(&child, signal);
    child.wait_with_output().unwrap()
}

fn interrupted_while_writing(folder: &Path, mut command: Command) -> Output {
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let began = Instant::now();
    while names(&folder.join("out")).is_empty() && began.elapsed() < MAX_WAIT {
        std::thread::sleep(Duration::from_millis(2));
    }
    send(&child, "-INT");
    child.wait_with_output().unwrap()
}

fn stopped_for_a_while(folder: &Path, mut command: Command) -> Output {
    let child = begun(folder, &mut command);
    send(&child, "-STOP");
    std::thread::sleep(Duration::from_secs(2));
    send(&child, "-CONT");
    std::thread::sleep(Duration::from_millis(200));
    send(&child, "-INT");
    child.wait_with_output().unwrap()
}

fn reader_leaves(_: &Path, mut command: Command) -> Output {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    child.wait_with_output().unwrap()
}

fn full_output(_: &Path, mut command: Command) -> Output {
    let full = File::options().write(true).open("/dev/full").unwrap();
    command.stdout(full).stderr(Stdio::piped()).spawn().unwrap().wait_with_output().unwrap()
}

fn closed_streams(_: &Path, command: Command) -> Output {
    after("exec <&- >&- 2>&-", &command).output().unwrap()
}

fn few_descriptors(_: &Path, command: Command) -> Output {
    after("ulimit -n 4", &command).output().unwrap()
}

fn wrong_clock(folder: &Path, mut command: Command) -> Output {
    assert!(airloop(folder, SHORT_RUN).output().unwrap().status.success());
    let set = |name: &str, seconds: u64| {
        let file = File::options().write(true).open(folder.join("out").join(name)).unwrap();
        file.set_modified(std::time::UNIX_EPOCH + Duration::from_secs(seconds)).unwrap();
    };
    set("result.csv", 0);
    set("summary.json", 4_102_444_800);
    command.output().unwrap()
}

fn killed_while_moving(folder: &Path, mut command: Command) -> Output {
    // As a command leaves it that wrote the list of what it moves, and moved nothing.
    let stage = folder.join("out/.airloop-new-killed");
    std::fs::create_dir_all(&stage).unwrap();
    std::fs::write(stage.join("result.csv"), "time,y\n0,1\n").unwrap();
    std::fs::write(stage.join("summary.json"), "{\"airloop_version\":\"0\"}").unwrap();
    let list = r#"{"files":["result.csv","summary.json"],"earlier":[]}"#;
    std::fs::write(stage.join(".complete.json"), list).unwrap();
    command.output().unwrap()
}
