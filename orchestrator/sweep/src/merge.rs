//! Merged results: one CSV and one Parquet file that depend on plan, program and inputs alone.

use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};

use airloop_series::file::write_whole;
use serde::Serialize;

use crate::Error;
use crate::manifest::Manifest;
use crate::own;
use crate::parquet_file::{Complete, METADATA, Writer};
use crate::shard::{self, Foot, Reader};
use crate::signals::{self, SIGNALS};
use crate::table::{self, Cell};

/// Merged rows as text.
pub const RESULTS: &str = "results.csv";
/// Merged rows for other tools.
pub const PARQUET: &str = "results.parquet";
/// Numbers about the tasks.
pub const SUMMARY: &str = "summary.json";

/// `summary.json`
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Content of plan, program and inputs.
    pub digest: String,
    /// Version of the program.
    pub airloop_version: String,
    /// Tasks.
    pub tasks: u64,
    /// Tasks that are not `ok`.
    pub failed: u64,
    /// Files.
    pub files: Vec<String>,
}

/// How far a sweep is.
#[derive(Debug, Clone, PartialEq)]
pub struct Status {
    /// Tasks.
    pub tasks: u64,
    /// Tasks with a row.
    pub done: u64,
    /// Tasks with a row that are not `ok`.
    pub failed: u64,
    /// First task without a row.
    pub first_missing: Option<u64>,
    /// Wall-clock time of the finished shards times their threads \[s\].
    pub busy: f64,
    /// Finished shards that another program or plan wrote, or that are damaged, with what is wrong.
    pub damaged: Vec<String>,
}

/// Tells how far the sweep of a folder is; every finished shard is read.
///
/// # Errors
/// A folder that is no sweep or cannot be read.
pub fn status(folder: &Path) -> Result<Status, Error> {
    let manifest = Manifest::read(folder)?;
    let mut status = Status {
        tasks: manifest.tasks,
        done: 0,
        failed: 0,
        first_missing: None,
        busy: 0.0,
        damaged: Vec::new(),
    };
    let mut next = 0;
    for (tasks, path) in shard::finished(folder)? {
        match failed_from(&path, &manifest, tasks.start.max(next)) {
            Err(Error::Io { path, source }) => return Err(Error::Io { path, source }),
            Err(error) => status.damaged.push(error.to_string()),
            Ok((failed, foot)) => {
                if tasks.start > next {
                    status.first_missing.get_or_insert(next);
                }
                status.done += tasks.end.saturating_sub(tasks.start.max(next));
                status.failed += failed;
                status.busy += foot.seconds * foot.threads as f64;
                next = next.max(tasks.end);
            }
        }
    }
    if next < manifest.tasks {
        status.first_missing.get_or_insert(next);
    }
    Ok(status)
}

/// Rows of a shard that are not ok, from task `from` on: those before are counted elsewhere; and its last line.
fn failed_from(path: &Path, manifest: &Manifest, from: u64) -> Result<(u64, Foot), Error> {
    let status = manifest.columns.len() - 2;
    let mut reader = Reader::open(path, manifest)?;
    let mut failed = 0;
    loop {
        let line = match reader.next_row()? {
            Ok(line) => line,
            Err(foot) => return Ok((failed, foot)),
        };
        let cells = table::read_row(&line, &manifest.columns).ok_or_else(|| Error::Damaged {
            path: path.into(),
            problem: format!("the row `{line}` cannot be read"),
        })?;
        let counted = matches!(cells[0], Cell::Integer(task) if task >= from);
        failed += u64::from(counted && cells[status] != Cell::Text("ok".into()));
    }
}

/// Merges the finished shards of a folder into `results.csv`, `results.parquet` and `summary.json`, and their signals,
/// if they keep some, into `signals.parquet`.
///
/// # Errors
/// [`Error::Incomplete`] if rows are missing, [`Error::Damaged`], or a file that cannot be written.
pub fn merge(folder: &Path) -> Result<Summary, Error> {
    let manifest = Manifest::read(folder)?;
    let cover = cover(folder, &manifest)?;
    let header = table::header(&manifest.columns);
    let tables = [(RESULTS, header.as_str()), (PARQUET, METADATA), (SIGNALS, METADATA)];
    for (name, mark) in tables.into_iter().chain([(SUMMARY, "airloop_version")]) {
        own::check(&folder.join(name), mark)?;
    }
    let signals = signals::merge(&cover, &manifest, folder)?;
    let csv = folder.join(RESULTS);
    let parquet = folder.join(PARQUET);
    let mut outcome = None;
    let written = write_whole(&csv, |out| {
        out.write_all(header.as_bytes())?;
        let mut rows = |line: &str| writeln!(out, "{line}");
        let copied = copy(&cover, &manifest, &parquet, &mut rows);
        let complete = copied.is_ok();
        outcome = Some(copied);
        // Without all rows the file gets no name.
        if complete { out.flush() } else { Err(std::io::Error::other("the rows cannot be read")) }
    });
    // What the rows say comes first: it is why the file was not written.
    let copied = outcome.transpose()?;
    written.map_err(Error::io(&csv))?;
    let failed = match copied {
        // Both tables are complete on the disk before the first has its name.
        Some((failed, complete)) => complete.persist().map(|()| failed).inspect_err(|_| {
            let _ = std::fs::remove_file(&csv);
        })?,
        None => 0,
    };
    let names = [RESULTS, PARQUET].into_iter().chain(signals.as_ref().map(|_| SIGNALS)).chain([SUMMARY]);
    if let Some(signals) = signals {
        signals.persist()?;
    }
    let summary = Summary {
        digest: manifest.digest.clone(),
        airloop_version: manifest.program.version.clone(),
        tasks: manifest.tasks,
        failed,
        files: names.map(String::from).collect(),
    };
    let path = folder.join(SUMMARY);
    airloop_series::file::write_json(&path, &summary).map_err(Error::io(&path))?;
    Ok(summary)
}

/// Shards that together hold every task: each begins where rows are needed, or before.
fn cover(folder: &Path, manifest: &Manifest) -> Result<Vec<(Range<u64>, PathBuf)>, Error> {
    let mut cover = Vec::new();
    let (mut next, mut missing, mut first) = (0, 0, None);
    for (tasks, path) in shard::finished(folder)? {
        if tasks.end <= next {
            continue;
        }
        if tasks.start > next {
            first.get_or_insert(next);
            missing += tasks.start - next;
        }
        let begin = tasks.start.max(next);
        next = tasks.end;
        cover.push((begin..tasks.end, path));
    }
    missing += manifest.tasks - next.min(manifest.tasks);
    match missing {
        0 => Ok(cover),
        _ => Err(Error::Incomplete {
            folder: folder.into(),
            missing,
            all: manifest.tasks,
            first: first.unwrap_or(next),
        }),
    }
}

/// Passes all rows on in the order of the tasks and writes them as Parquet, without its name yet; with the number that
/// is not ok.
fn copy(
    cover: &[(Range<u64>, PathBuf)],
    manifest: &Manifest,
    parquet: &Path,
    rows: &mut dyn FnMut(&str) -> std::io::Result<()>,
) -> Result<(u64, Complete), Error> {
    let mut failed = 0;
    let mut writer = Writer::create(parquet, &manifest.columns, manifest)?;
    let status = manifest.columns.len() - 2;
    for (wanted, path) in cover {
        let damaged = |problem: &str| Error::Damaged { path: path.clone(), problem: problem.into() };
        let mut reader = Reader::open(path, manifest)?;
        let mut next = wanted.start;
        let _: Foot = loop {
            let line = match reader.next_row()? {
                Ok(line) => line,
                Err(foot) => break foot,
            };
            let cells = table::read_row(&line, &manifest.columns);
            let cells = cells.ok_or_else(|| damaged(&format!("the row `{line}` cannot be read")))?;
            match cells[0] {
                Cell::Integer(task) if task < wanted.start => continue,
                Cell::Integer(task) if task == next => next += 1,
                _ => return Err(damaged(&format!("the row of task {next} is missing"))),
            }
            failed += u64::from(cells[status] != Cell::Text("ok".into()));
            rows(&line).map_err(Error::io(&parquet.with_file_name(RESULTS)))?;
            writer.push(cells)?;
        };
        if next != wanted.end {
            return Err(damaged(&format!("the row of task {next} is missing")));
        }
    }
    Ok((failed, writer.finish()?))
}
