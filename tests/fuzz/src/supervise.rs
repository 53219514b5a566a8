//! The parent: children with limits, what ended them, and the inputs that did.

use std::fmt;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

use crate::targets::Target;

/// Longest time that one input may take.
const MAX_TIME: Duration = Duration::from_secs(10);
/// Most memory (address space) of a child \[KiB\].
const MAX_MEMORY_KIB: u64 = 2 << 20;
/// Inputs of one child.
const BATCH: u64 = 2000;
/// Faults after which a target is left: they are mostly the same.
const MAX_FAULTS: usize = 20;
/// Lines of what a child said that are kept.
const SAID: usize = 12;

/// When a target is done.
pub enum Budget {
    /// After this many inputs.
    Inputs(u64),
    /// After this time.
    Time(Duration),
}

/// An input that a reader did not survive.
pub struct Fault {
    /// End of the child, and its last words.
    pub what: String,
    /// Where the input is kept.
    pub kept: PathBuf,
}

/// Outcome of a target.
pub struct Outcome {
    target: Target,
    inputs: u64,
    time: Duration,
    /// Faults, one for each input.
    pub faults: Vec<Fault>,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, faults) = (self.target.name, self.faults.len());
        write!(
            f,
            "{name:12} {:>9} inputs {:>8.1} s {faults:>3} faults",
            self.inputs,
            self.time.as_secs_f64()
        )?;
        for fault in &self.faults {
            write!(f, "\n  {}: {}", fault.kept.display(), fault.what.replace('\n', "\n    "))?;
        }
        Ok(())
    }
}

/// How a child ended.
struct End {
    /// Number of the last input that was begun.
    last: Option<u64>,
    /// Fault found, if any.
    fault: Option<String>,
}

/// Mutates and reads until the budget is used up.
pub fn run(target: Target, seed: u64, budget: &Budget, keep: &Path) -> Result<Outcome, String> {
    let began = Instant::now();
    let mut outcome = Outcome { target, inputs: 0, time: Duration::ZERO, faults: Vec::new() };
    loop {
        let (count, until) = match budget {
            Budget::Inputs(all) => (all.saturating_sub(outcome.inputs).min(BATCH), None),
            Budget::Time(all) if began.elapsed() >= *all => (0, None),
            Budget::Time(all) => (BATCH, Some(began + *all)),
        };
        if count == 0 || outcome.faults.len() >= MAX_FAULTS {
            break;
        }
        let place = place()?;
        let numbers = [seed, outcome.inputs, count].map(|number| number.to_string());
        let mut words = vec!["batch".into(), target.name.into(), place.path().display().to_string()];
        words.extend(numbers);
        let end = watch(&words, place.path(), until)?;
        let Some(last) = end.last else {
            return Err(format!(
                "the target {} did not begin: {}",
                target.name,
                end.fault.unwrap_or_default()
            ));
        };
        outcome.inputs = last + 1;
        if let Some(what) = end.fault {
            let input = place.path().join(target.file);
            let kept = keep.join(target.name).join(format!("{seed}-{last}-{}", target.file));
            let folder = kept.parent().unwrap_or(keep);
            std::fs::create_dir_all(folder)
                .and_then(|()| std::fs::copy(&input, &kept))
                .map_err(|error| format!("{}: {error}", kept.display()))?;
            outcome.faults.push(Fault { what: format!("input {last}: {what}"), kept });
        }
    }
    outcome.time = began.elapsed();
    Ok(outcome)
}

/// Reads one file; what was wrong, if anything.
pub fn replay(target: Target, file: &Path) -> Result<Option<String>, String> {
    let place = tempfile::tempdir().map_err(|error| error.to_string())?;
    let words =
        ["one".into(), target.name.into(), place.path().display().to_string(), file.display().to_string()];
    let end = watch(&words, place.path(), None)?;
    match end.last {
        None => Err(format!("{}: {}", file.display(), end.fault.unwrap_or_default())),
        Some(_) => Ok(end.fault),
    }
}

/// A folder for a child, in memory where there is such a file system.
fn place() -> Result<tempfile::TempDir, String> {
    let memory = tempfile::tempdir_in("/dev/shm");
    memory.or_else(|_| tempfile::tempdir()).map_err(|error| format!("no temporary folder: {error}"))
}

/// Runs a child with limits until it ends, or until a time.
fn watch(words: &[String], place: &Path, until: Option<Instant>) -> Result<End, String> {
    let said = |error: std::io::Error| format!("no child can be started: {error}");
    let program = std::env::current_exe().map_err(said)?;
    let mut child = Command::new("sh")
        .arg("-c")
        .arg(format!("ulimit -v {MAX_MEMORY_KIB} && ulimit -c 0 && exec \"$0\" \"$@\""))
        .arg(program)
        .args(words)
        // What it leaves behind goes with its place.
        .env("TMPDIR", place)
        .env("RAYON_NUM_THREADS", "1")
        .env("RUST_BACKTRACE", "0")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(said)?;
    let (send, numbers) = mpsc::channel();
    let out = child.stdout.take();
    std::thread::spawn(move || {
        for line in out.into_iter().flat_map(|out| BufReader::new(out).lines()).map_while(Result::ok) {
            if line.parse::<u64>().is_ok_and(|number| send.send(number).is_err()) {
                break;
            }
        }
    });
    let err = child.stderr.take();
    let words = std::thread::spawn(move || last_lines(err));
    let mut last = None;
    let mut hangs = false;
    let is_over = loop {
        match numbers.recv_timeout(MAX_TIME) {
            Ok(number) => last = Some(number),
            Err(RecvTimeoutError::Disconnected) => break false,
            Err(RecvTimeoutError::Timeout) => {
                hangs = true;
                break true;
            }
        }
        if until.is_some_and(|until| Instant::now() >= until) {
            break true;
        }
    };
    if is_over {
        end(&mut child);
    }
    let status = child.wait().map_err(said)?;
    let words = words.join().unwrap_or_default();
    let fault = match (hangs, is_over) {
        (true, _) => Some(format!("no end within {} s", MAX_TIME.as_secs())),
        (false, false) if !status.success() => Some(format!("{status}\n{words}")),
        _ => None,
    };
    Ok(End { last, fault })
}

/// Ends the child, which this process started.
fn end(child: &mut Child) {
    // It may have ended by itself.
    let _ = child.kill();
}

fn last_lines(from: Option<impl Read>) -> String {
    let mut lines: Vec<String> = Vec::new();
    for line in from.into_iter().flat_map(|from| BufReader::new(from).lines()).map_while(Result::ok) {
        if lines.len() == SAID {
            lines.remove(0);
        }
        lines.push(line.chars().take(300).collect());
    }
    lines.join("\n")
}
