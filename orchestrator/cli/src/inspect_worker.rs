//! The checker's runs of an FMU in a process of its own: what the library prints stays out of our output, and a crash,
//! an `exit` and an endless call become findings, next to those of the checks that had ended before.

use std::io::Write;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use airloop::Error;
use airloop_fmi::check::{self, Finding, Severity};
use airloop_fmi::isolate::{Process, cause};
use airloop_fmi::{Fmu, trace};

/// Files in the folder that both processes share: findings, one in a line, the last call, and the number of findings
/// once all checks ended.
const FINDINGS: &str = "findings.jsonl";
const CALL: &str = "call";
const DONE: &str = "done";
/// Rule of the finding that says where the user ended a check.
const INTERRUPTED: &str = "interrupted";
/// Most memory (address space) of the process \[bytes\].
const MEMORY: u64 = 4 << 30;
/// Time between two looks at the process.
const POLL_INTERVAL: Duration = Duration::from_millis(5);

/// The worker: runs the library of the FMU at `file` and writes its findings into `folder`.
///
/// # Errors
/// The FMU cannot be opened, or the folder not be written.
pub fn work(file: &Path, folder: &Path) -> Result<(), Error> {
    let io = |path: &Path| {
        let file = path.to_owned();
        move |source| airloop_cosim::system::Error::Io { file, source }
    };
    let (call, result) = (folder.join(CALL), folder.join(FINDINGS));
    airloop_fmi::last_words::end_copies();
    trace::write_calls_to(&call).map_err(io(&call))?;
    let mut output = std::fs::File::create(&result).map_err(io(&result))?;
    let (mut outcome, mut count) = (Ok(()), 0_usize);
    check::dynamic_findings_in_parts(&Fmu::open(file)?, &mut |findings| {
        for finding in findings {
            let line = serde_json::to_string(&finding).unwrap_or_default();
            let written = writeln!(output, "{line}");
            count += 1;
            outcome = std::mem::replace(&mut outcome, Ok(())).and(written);
        }
    });
    outcome.map_err(io(&result))?;
    let done = folder.join(DONE);
    std::fs::write(&done, count.to_string()).map_err(io(&done))?;
    Ok(())
}

/// Findings of a worker that runs the library of an FMU for at most `limit`, and until `stop` is set.
///
/// # Errors
/// The worker cannot be started.
pub fn findings(fmu: &Fmu, limit: Duration, stop: &AtomicBool) -> Result<Vec<Finding>, Error> {
    let io = |source| airloop_cosim::system::Error::Io { file: fmu.shown.clone(), source };
    let folder = airloop_series::scratch::folder().map_err(io)?;
    let mut command = Command::new(std::env::current_exe().map_err(io)?);
    command
        .args(["inspect", "--check", "--worker"])
        .arg(folder.path())
        .arg("--")
        .arg(std::path::absolute(&fmu.path).map_err(io)?);
    let mut process = Process::start(command, folder.path(), MEMORY).map_err(io)?;
    let began = Instant::now();
    let status = loop {
        match process.ended() {
            Some(status) => break Some(status),
            None if began.elapsed() > limit || stop.load(Ordering::Relaxed) => break None,
            None => std::thread::sleep(POLL_INTERVAL),
        }
    };
    // Also what the library started.
    process.kill();
    let written = std::fs::read_to_string(folder.path().join(FINDINGS)).unwrap_or_default();
    // The last line may be cut off.
    let mut found: Vec<Finding> =
        written.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    let count = std::fs::read_to_string(folder.path().join(DONE)).ok();
    let count = count.and_then(|count| count.parse::<usize>().ok());
    let is_done = count.is_some();
    if let Some(count) = count
        && status.is_some_and(|status| status.success())
    {
        if found.len() < count {
            let message = format!(
                "{} of {count} findings came out of the process of the FMU: the library closed or replaced its files",
                found.len()
            );
            let element = "files of the process".into();
            found.push(Finding { severity: Severity::Error, rule: "findings-lost".into(), element, message });
        }
        return Ok(found);
    }
    let element = match trace::last_call(&folder.path().join(CALL)) {
        // Libraries inside of an FMU that airloop wrote are unloaded there.
        _ if is_done => "end of the process, after all checks".to_owned(),
        None => "before the first call".to_owned(),
        Some(call) => format!("call of {call}"),
    };
    if status.is_none() && stop.load(Ordering::Relaxed) {
        let message = "the check was interrupted here: what comes after it was not looked at".into();
        found.push(Finding { severity: Severity::Warning, rule: INTERRUPTED.into(), element, message });
        return Ok(found);
    }
    let mut message = match status {
        None => format!("it did not return within {} s; --time-limit allows more", limit.as_secs_f64()),
        Some(status) => format!("the process of the FMU ended there by {}", cause(status)),
    };
    let printed = process.printed();
    if !printed.is_empty() {
        message.push_str(&format!("; printed last: {}", printed.join(" | ")));
    }
    found.push(Finding { severity: Severity::Error, rule: "process-lost".into(), element, message });
    Ok(found)
}
