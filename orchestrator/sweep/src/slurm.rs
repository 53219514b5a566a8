//! Shards as the tasks of one Slurm job array.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use airloop_series::file::{write_json, write_whole};
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::file::Slurm;
use crate::manifest::{Manifest, short};
use crate::shard;

/// File that says which job runs the shards.
pub const SUBMISSION: &str = "submission.json";
/// Script that was submitted.
pub const SCRIPT: &str = "submit.sh";
/// Folder of what the shards print.
const LOGS: &str = "logs";

/// `submission.json`
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Submission {
    /// Content of the plan.
    pub digest: String,
    /// Number of the job array.
    pub job: u64,
    /// Shards.
    pub shards: u64,
}

/// Script of a job array: each array task runs one shard, and is queued again if its node fails.
pub fn script(
    manifest: &Manifest,
    folder: &Path,
    program: &Path,
    (shards, threads): (u64, usize),
    more: &[String],
    options: &Slurm,
) -> String {
    let mut text = String::from("#!/bin/sh\n");
    let limit = options.at_a_time.map_or_else(String::new, |most| format!("%{most}"));
    let mut line = |option: &str, value: &str| {
        let _ = writeln!(text, "#SBATCH --{option}={value}");
    };
    line("job-name", &format!("airloop-{}", short(&manifest.digest)));
    line("array", &format!("1-{shards}{limit}"));
    line("cpus-per-task", &threads.to_string());
    line("output", &folder.join(LOGS).join("%a.log").to_string_lossy());
    line("open-mode", "append");
    for (option, value) in [
        ("time", &options.time),
        ("mem", &options.memory),
        ("partition", &options.partition),
        ("account", &options.account),
    ] {
        if let Some(value) = value {
            line(option, value);
        }
    }
    text += "#SBATCH --requeue\n";
    for module in &options.modules {
        let _ = writeln!(text, "module load {}", quoted(module));
    }
    let more: String = more.iter().map(|word| format!(" {}", quoted(word))).collect();
    let _ = writeln!(
        text,
        "exec {} sweep run {} --shard \"$SLURM_ARRAY_TASK_ID/{shards}\" --threads {threads} --quiet{more}",
        quoted(&program.to_string_lossy()),
        quoted(&folder.to_string_lossy())
    );
    text
}

/// A word as a shell takes it.
fn quoted(word: &str) -> String {
    format!("'{}'", word.replace('\'', "'\\''"))
}

/// Writes the script into a folder and submits it.
///
/// # Errors
/// A submission of the same folder that is not over, unless `again`; `sbatch` that is not there or refuses.
pub fn submit(
    folder: &Path,
    (shards, threads): (Option<u64>, usize),
    more: &[String],
    again: bool,
) -> Result<Submission, Error> {
    let folder = std::path::absolute(folder).map_err(Error::io(folder))?;
    let manifest = Manifest::read(&folder)?;
    manifest.check()?;
    // Two submissions at one moment would both find none before them.
    let _lock = shard::lock(&folder.join(SUBMISSION).with_extension("lock"))?;
    if let Some(earlier) = read(&folder)?
        && !again
        && !states(earlier.job)?.is_empty()
    {
        let problem = format!(
            "job {} runs this folder already; wait for it, end it with `airloop sweep cancel {}`, or give --again: shards that run twice are written once",
            earlier.job,
            folder.display()
        );
        return Err(Error::Engine { engine: "slurm", problem });
    }
    let program = std::env::current_exe().map_err(Error::io(Path::new("this program")))?;
    let shards = shards.unwrap_or(manifest.shards);
    let options = manifest.file()?.slurm;
    let text = script(&manifest, &folder, &program, (shards, threads), more, &options);
    let path = folder.join(SCRIPT);
    write_whole(&path, |out| std::io::Write::write_all(out, text.as_bytes())).map_err(Error::io(&path))?;
    let logs = folder.join(LOGS);
    std::fs::create_dir_all(&logs).map_err(Error::io(&logs))?;
    let printed = ask(Command::new("sbatch").arg("--parsable").arg(&path))?;
    let job = printed.trim().split(';').next().and_then(|job| job.parse().ok()).ok_or_else(|| {
        Error::Engine { engine: "slurm", problem: format!("sbatch printed `{}`", printed.trim()) }
    })?;
    let submission = Submission { digest: manifest.digest, job, shards };
    let path = folder.join(SUBMISSION);
    write_json(&path, &submission).map_err(Error::io(&path))?;
    Ok(submission)
}

/// The last submission of a folder.
///
/// # Errors
/// [`Error::Io`], [`Error::File`].
pub fn read(folder: &Path) -> Result<Option<Submission>, Error> {
    let path: PathBuf = folder.join(SUBMISSION);
    if !path.exists() {
        return Ok(None);
    }
    let text = std::fs::read_to_string(&path).map_err(Error::io(&path))?;
    let parsed = serde_json::from_str(&text);
    parsed.map(Some).map_err(|error| Error::File { file: path, problem: error.to_string() })
}

/// Ends the job of a folder; its number, none if there was none.
///
/// # Errors
/// `scancel` that is not there or refuses.
pub fn cancel(folder: &Path) -> Result<Option<u64>, Error> {
    let Some(submission) = read(folder)? else { return Ok(None) };
    ask(Command::new("scancel").arg(submission.job.to_string()))?;
    Ok(Some(submission.job))
}

/// Number of shards of a job in each state of the cluster, such as `PENDING` and `RUNNING`; those that are over are
/// left out.
///
/// # Errors
/// `squeue` that is not there.
pub fn states(job: u64) -> Result<BTreeMap<String, u64>, Error> {
    let job = job.to_string();
    let lines =
        match ask(Command::new("squeue").args(["--noheader", "--array", "--format=%T", "--jobs", &job])) {
            // Slurm forgets jobs that are over.
            Err(Error::Engine { problem, .. }) if problem.contains("Invalid job id") => String::new(),
            asked => asked?,
        };
    let mut states = BTreeMap::new();
    for state in lines.split_whitespace() {
        *states.entry(state.to_owned()).or_insert(0) += 1;
    }
    Ok(states)
}

/// Output of a program of Slurm.
fn ask(command: &mut Command) -> Result<String, Error> {
    let name = command.get_program().to_string_lossy().into_owned();
    let refused = |problem: String| Error::Engine { engine: "slurm", problem };
    let output = command.output().map_err(|error| {
        refused(format!(
            "`{name}` cannot be started ({error}); run this where Slurm is installed, or `airloop sweep run`"
        ))
    })?;
    match output.status.success() {
        true => Ok(String::from_utf8_lossy(&output.stdout).into_owned()),
        false => Err(refused(format!("{name}: {}", String::from_utf8_lossy(&output.stderr).trim()))),
    }
}
