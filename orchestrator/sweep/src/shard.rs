//! Shards: consecutive tasks whose rows are one file, which is there as a whole or not at all.
//!
//! A file is named by its tasks, not by the number of shards, so that runs with different numbers complete each other.
//! Its first line says to which plan it belongs, its last how many rows it has and their SHA-256.

use std::fs::{File, TryLockError};
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use airloop_series::file;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::digest::Hashed;
use crate::manifest::{Manifest, Tasks, leading_cells, short};
use crate::signals::Tape;
use crate::table::{self, Cell};
use crate::task::{self, Place, Work};
use crate::{Error, Task};

/// Folder of the shards in that of a sweep.
const SHARDS: &str = "shards";
/// Tasks that are shared out among the threads at a time; the rows of so many are in memory.
const BLOCK: u64 = 4096;
/// Same where signals are kept.
const BLOCK_WITH_SIGNALS: u64 = 256;

/// Part `index` of `of`, from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Number, from 1.
    pub index: u64,
    /// Number of shards.
    pub of: u64,
}

impl std::str::FromStr for Shard {
    type Err = Error;

    fn from_str(text: &str) -> Result<Shard, Error> {
        let numbers = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((index, of)) if (1..=of).contains(&index) => Ok(Shard { index, of }),
            _ => Err(Error::Shard { shard: text.into() }),
        }
    }
}

impl Shard {
    /// Its tasks of `all`; shards differ by one task at most.
    pub fn tasks(self, all: u64) -> Range<u64> {
        let begin = |index: u64| (u128::from(all) * u128::from(index) / u128::from(self.of)) as u64;
        begin(self.index - 1)..begin(self.index)
    }
}

/// First line of a shard.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Head {
    digest: String,
    from: u64,
    to: u64,
}

/// Last line of a shard.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Foot {
    /// Rows.
    pub rows: u64,
    /// SHA-256 of their lines.
    pub sha256: String,
    /// SHA-256 of the file of the signals, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub signals: Option<String>,
    /// Tasks that are not `ok`.
    pub failed: u64,
    /// Wall-clock time \[s\].
    pub seconds: f64,
    /// Threads.
    pub threads: usize,
    /// Computer.
    pub host: String,
}

/// File of some tasks.
pub fn path(folder: &Path, tasks: &Range<u64>) -> PathBuf {
    folder.join(SHARDS).join(format!("{:010}-{:010}.csv", tasks.start, tasks.end))
}

/// Finished shards by their tasks, in order.
///
/// # Errors
/// [`Error::Io`] if the folder cannot be read.
pub fn finished(folder: &Path) -> Result<Vec<(Range<u64>, PathBuf)>, Error> {
    let folder = folder.join(SHARDS);
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let named = |path: PathBuf| {
        let (from, to) = path.file_name()?.to_str()?.strip_suffix(".csv")?.split_once('-')?;
        Some((from.parse().ok()?..to.parse().ok()?, path.clone()))
    };
    Ok(crate::digest::entries(&folder)?.into_iter().filter_map(named).collect())
}

/// Outcome of a shard.
#[derive(Debug, Clone, PartialEq)]
pub enum Done {
    /// Its tasks ran.
    Ran(Foot),
    /// It was finished before.
    Skipped(Foot),
    /// It has no tasks: there are more shards than tasks.
    Nothing,
}

/// Result of a task.
struct Row {
    line: String,
    ok: bool,
    signals: Vec<Vec<f64>>,
}

/// A sweep whose tasks can run.
pub struct Runner {
    folder: PathBuf,
    /// The manifest.
    pub manifest: Manifest,
    tasks: Tasks,
    work: Box<dyn Work>,
    threads: usize,
}

impl Runner {
    /// Opens the sweep of a folder for this many threads, and checks that program and inputs are those of the plan.
    /// FMUs run in processes of their own where [`isolate::choose`](airloop_fmi::isolate::choose) says so.
    ///
    /// # Errors
    /// [`Error::Changed`], [`Error::Program`], or whatever opening the plan says.
    pub fn open(folder: &Path, threads: usize) -> Result<Runner, Error> {
        let manifest = Manifest::read(folder)?;
        manifest.check()?;
        Runner::new(folder, manifest, threads)
    }

    /// The tasks of a manifest, which need not lie in the folder yet.
    ///
    /// # Errors
    /// The errors of opening the plan.
    pub fn new(folder: &Path, manifest: Manifest, threads: usize) -> Result<Runner, Error> {
        let plan = manifest.file()?;
        let tasks = Tasks::new(&plan, &manifest.base)?;
        let work = task::open(&plan, &manifest.base)?;
        Ok(Runner { folder: folder.into(), manifest, tasks, work, threads: threads.max(1) })
    }

    /// Time of a task \[s\]: the mean of the first, the middle and the last, whose results are forgotten. None if there
    /// is no task, or it was interrupted.
    pub fn time_of_a_task(&self, stop: &AtomicBool) -> Option<f64> {
        let all = self.manifest.tasks;
        let mut tried = vec![0, all / 2, all.saturating_sub(1)];
        tried.dedup();
        tried.retain(|&task| task < all);
        let began = Instant::now();
        for &task in &tried {
            self.row(&self.tasks.task(task), stop)?;
        }
        (!tried.is_empty()).then(|| began.elapsed().as_secs_f64() / tried.len() as f64)
    }

    /// Runs a shard, or skips it if it is finished. `progress` is told the tasks done.
    ///
    /// # Errors
    /// [`Error::Busy`] if another process runs it, [`Error::Interrupted`], [`Error::Changed`], or a file that cannot be
    /// written; nothing half-written is left.
    pub fn run(
        &self,
        shard: Shard,
        stop: &AtomicBool,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Done, Error> {
        let tasks = shard.tasks(self.manifest.tasks);
        if tasks.is_empty() {
            return Ok(Done::Nothing);
        }
        let path = path(&self.folder, &tasks);
        std::fs::create_dir_all(self.folder.join(SHARDS)).map_err(Error::io(&path))?;
        let _lock = lock(&path.with_extension("lock"))?;
        if path.exists() {
            return Ok(Done::Skipped(Reader::open(&path, &self.manifest)?.check()?));
        }
        let foot = self.write(&tasks, &path, stop, progress)?;
        // The directory entry lasts too.
        if let Some(folder) = path.parent().and_then(|folder| File::open(folder).ok()) {
            let _ = folder.sync_all();
        }
        Ok(Done::Ran(foot))
    }

    fn write(
        &self,
        tasks: &Range<u64>,
        path: &Path,
        stop: &AtomicBool,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Foot, Error> {
        let io = || Error::io(path);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads).build();
        let pool =
            pool.map_err(|error| Error::Plan { place: "--threads".into(), problem: error.to_string() })?;
        let began = Instant::now();
        let mut out = BufWriter::new(file::temporary(&self.folder.join(SHARDS)).map_err(io())?);
        let head = Head { digest: self.manifest.digest.clone(), from: tasks.start, to: tasks.end };
        writeln!(out, "# {}", json(&head)).map_err(io())?;
        out.write_all(table::header(&self.manifest.columns).as_bytes()).map_err(io())?;
        let mut out = Hashed::new(out);
        let (done, failed) = (AtomicU64::new(0), AtomicU64::new(0));
        let row = |number: u64| {
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            let row = self.row(&self.tasks.task(number), stop)?;
            failed.fetch_add(u64::from(!row.ok), Ordering::Relaxed);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1);
            Some((number, row))
        };
        let mut tape = Tape::create(path, &self.manifest)?;
        let most = if tape.is_some() { BLOCK_WITH_SIGNALS } else { BLOCK };
        let mut from = tasks.start;
        while from < tasks.end {
            let end = tasks.end.min(from + most);
            let block: Vec<u64> = (from..end).collect();
            from = end;
            let rows: Option<Vec<(u64, Row)>> =
                pool.install(|| block.into_par_iter().with_max_len(1).map(row).collect());
            for (number, row) in rows.ok_or(Error::Interrupted)? {
                out.write_all(row.line.as_bytes()).map_err(io())?;
                if let Some(tape) = &mut tape {
                    tape.push(number, &row.signals)?;
                }
            }
        }
        // A file that changed while the tasks ran would make rows of two contents.
        self.manifest.check()?;
        // The rows come last: where they are, the signals are too.
        let signals = tape.map(Tape::finish).transpose()?;
        let (mut out, sha256) = out.finish();
        let foot = Foot {
            rows: tasks.end - tasks.start,
            sha256,
            signals,
            failed: failed.into_inner(),
            seconds: began.elapsed().as_secs_f64(),
            threads: self.threads,
            host: host(),
        };
        writeln!(out, "# {}", json(&foot)).map_err(io())?;
        let written = out.into_inner().map_err(|error| Error::io(path)(error.into_error()))?;
        written.as_file().sync_all().map_err(io())?;
        file::persist(written, path).map_err(io())?;
        Ok(foot)
    }

    /// The row of a task; none if it was interrupted.
    fn row(&self, task: &Task, stop: &AtomicBool) -> Option<Row> {
        let outcome = self.work.run(task, Place { folder: &self.folder, stop })?;
        let mut cells = leading_cells(task);
        cells.extend(outcome.cells);
        cells.push(Cell::Text(outcome.status.into()));
        cells.push(outcome.cause.filter(|cause| !cause.is_empty()).map_or(Cell::Empty, Cell::Text));
        let mut line = String::new();
        table::write_row(&mut line, cells.iter());
        Some(Row { line, ok: outcome.status == "ok", signals: outcome.signals })
    }
}

/// Takes a shard for this process until the file is dropped; the system frees it whatever the end is.
pub(crate) fn lock(path: &Path) -> Result<Option<File>, Error> {
    let file = File::options().create(true).append(true).open(path).map_err(Error::io(path))?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Err(Error::Busy { path: path.into() }),
        // Some network file systems have no locks: then two processes may write the same rows, and the last one stays.
        Err(TryLockError::Error(_)) => Ok(None),
    }
}

fn host() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    name.trim().to_owned()
}

fn json<T: Serialize>(value: &T) -> String {
    serde_json::to_string(value).expect("numbers and texts")
}

/// The rows of a finished shard, line by line.
pub struct Reader {
    path: PathBuf,
    lines: std::io::Lines<BufReader<File>>,
    hash: Hashed<std::io::Sink>,
    rows: u64,
    expected: u64,
}

impl Reader {
    /// Opens a shard of a sweep.
    ///
    /// # Errors
    /// [`Error::Damaged`] if it belongs to another plan or has other columns.
    pub fn open(path: &Path, manifest: &Manifest) -> Result<Reader, Error> {
        let damaged = |problem: String| Error::Damaged { path: path.into(), problem };
        let file = File::open(path).map_err(Error::io(path))?;
        let mut lines = BufReader::with_capacity(1 << 18, file).lines();
        let mut line = || lines.next().transpose().map_err(Error::io(path)).map(Option::unwrap_or_default);
        let head: Option<Head> = line()?.strip_prefix("# ").and_then(|text| serde_json::from_str(text).ok());
        let head = head.ok_or_else(|| damaged("its first line is no head of a shard".into()))?;
        if head.digest != manifest.digest {
            let (found, wanted) = (short(&head.digest), short(&manifest.digest));
            return Err(damaged(format!("it belongs to the plan {found}, not to {wanted}")));
        }
        if line()? != table::header(&manifest.columns).trim_end() {
            return Err(damaged("its columns are not those of the plan".into()));
        }
        let hash = Hashed::new(std::io::sink());
        Ok(Reader { path: path.into(), lines, hash, rows: 0, expected: head.to - head.from })
    }

    fn damaged(&self, problem: &str) -> Error {
        Error::Damaged { path: self.path.clone(), problem: problem.into() }
    }

    /// The next row, or the last line when there is none.
    ///
    /// # Errors
    /// [`Error::Damaged`] if rows are missing or are not those that were written.
    pub fn next_row(&mut self) -> Result<Result<String, Foot>, Error> {
        let line = self.lines.next().transpose().map_err(Error::io(&self.path))?;
        let line = line.ok_or_else(|| self.damaged("it ends before its last line"))?;
        let Some(text) = line.strip_prefix("# ") else {
            self.rows += 1;
            let _ = writeln!(self.hash, "{line}");
            return Ok(Ok(line));
        };
        let foot: Foot =
            serde_json::from_str(text).map_err(|_| self.damaged("its last line cannot be read"))?;
        let (_, sha256) = std::mem::replace(&mut self.hash, Hashed::new(std::io::sink())).finish();
        if foot.rows != self.rows || self.rows != self.expected || foot.sha256 != sha256 {
            return Err(self.damaged("its rows are not those that were written"));
        }
        Ok(Err(foot))
    }

    /// Reads all rows and gives the last line.
    ///
    /// # Errors
    /// Same as [`Reader::next_row`].
    pub fn check(mut self) -> Result<Foot, Error> {
        loop {
            if let Err(foot) = self.next_row()? {
                return Ok(foot);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_hold_every_task_once() {
        for (all, of) in [(10, 3), (500, 7), (3, 5), (1_000_000, 999)] {
            let mut next = 0;
            for index in 1..=of {
                let tasks = Shard { index, of }.tasks(all);
                assert_eq!(tasks.start, next);
                next = tasks.end;
            }
            assert_eq!(next, all);
        }
        for wrong in ["0/3", "4/3", "1", "a/b", "1/0"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
