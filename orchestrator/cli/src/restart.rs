//! Rows and states of a run while it goes on, and what a later run continues from.
//!
//! While a run goes on, its rows and its last saved states have names that say so. They belong together: the file of
//! the states says how many rows there are before them, and is written once these are on the disk.

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Error as IoError, ErrorKind, Write};
use std::path::{Path, PathBuf};

use airloop::Error;
use airloop_cosim::results::states::{self, States};
use airloop_cosim::results::summary;
use airloop_series::{TimeSeries, csv};

use super::folder::Results;

/// Rows of a result.
pub const ROWS: &str = "result.csv";
/// States that were saved last.
pub const STATES: &str = "result.states.json";
/// Rows of a run that goes on, or was killed.
pub const PARTIAL_ROWS: &str = "result.partial.csv";
/// States of a run that goes on, or was killed.
const PARTIAL_STATES: &str = "result.partial.states.json";

/// Longest time between two savings of states \[s\].
const MAX_INTERVAL: f64 = 1e9;

/// Time between two savings of states \[s\], of the command line.
///
/// # Errors
/// It is no time, or too long.
pub fn parse_interval(text: &str) -> Result<f64, String> {
    let interval = super::export::parse_step(text)?;
    if interval <= MAX_INTERVAL {
        Ok(interval)
    } else {
        Err(format!("allowed are at most {MAX_INTERVAL:e} s"))
    }
}

/// Earlier part of a run that is continued.
#[derive(Debug)]
pub struct Earlier {
    /// States.
    pub states: States,
    file: PathBuf,
    /// Rows beside them, if they are there.
    rows: Option<PathBuf>,
}

impl Earlier {
    /// Reads the states of a folder, or of a file.
    ///
    /// # Errors
    /// No states are there, they cannot be read, or rows before them are missing.
    pub fn open(path: &Path) -> Result<Earlier, Error> {
        let refused =
            |path: &Path, problem: String| Err(Error::States(states::Error { path: path.into(), problem }));
        let file = if path.is_dir() {
            let known = [PARTIAL_STATES, STATES].map(|name| path.join(name));
            let Some(file) = known.into_iter().find(|file| file.is_file()) else {
                if let Some(end) = complete_until(path) {
                    let problem = format!(
                        "this run is complete: it reached its stop time, {end} s, and states are kept only of a run that ended early; run it anew with a later --stop"
                    );
                    return refused(path, problem);
                }
                return refused(
                    path,
                    format!(
                        "no states were saved there ({STATES} or {PARTIAL_STATES}); give the folder of a run with --save-states"
                    ),
                );
            };
            file
        } else {
            path.to_owned()
        };
        let states = states::read(&file)?;
        let name = file.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let rows = name.strip_suffix(".states.json").map(|name| file.with_file_name(format!("{name}.csv")));
        let rows = rows.filter(|rows| rows.is_file());
        if let Some(rows) = &rows {
            let found = copy_rows(rows, states.rows.before, &mut std::io::sink());
            let found = found.map_err(|source| csv::Error::Io { path: rows.clone(), source })?;
            if found < states.rows.before {
                return refused(
                    rows,
                    format!(
                        "{found} whole rows are there, but {} belong to the states of {}; the file was changed or cut",
                        states.rows.before,
                        file.display()
                    ),
                );
            }
        }
        Ok(Earlier { states, file, rows })
    }

    /// A sentence for the summary.
    pub fn note(&self) -> String {
        let begin = match self.rows {
            Some(_) => "the rows before it are those of that run",
            None => "the result begins there, as no rows lie beside the file",
        };
        let (time, file) = (self.states.time, self.file.display());
        format!(
            "continued at t = {time} s from the states in {file}; {begin}, times and counts of work are since then"
        )
    }
}

/// Time \[s\] at which the run in a folder was complete, if it was.
fn complete_until(folder: &Path) -> Option<f64> {
    let summary = summary::read(&folder.join("summary.json")).ok()?;
    (summary.outcome.status == "completed").then_some(summary.outcome.end_time)
}

/// The rows and the states of a run that goes on; the rows are removed if the run cannot start.
#[derive(Debug)]
pub struct Partial {
    rows: PathBuf,
    states: PathBuf,
    file: File,
    /// The files are to stay: taken by the results, or all that there is of an earlier run.
    stays: bool,
}

impl Partial {
    /// Begins in a folder, with the rows before the states that the run continues from.
    ///
    /// # Errors
    /// The file system refuses.
    pub fn new(folder: &Path, earlier: Option<&Earlier>) -> Result<Partial, Error> {
        let (rows, states) = (folder.join(PARTIAL_ROWS), folder.join(PARTIAL_STATES));
        let began = begin(&rows, &states, earlier);
        let file = began.map_err(|source| csv::Error::Io { path: rows.clone(), source })?;
        let same = |earlier: &Earlier| {
            earlier.file.canonicalize().ok().is_some_and(|file| states.canonicalize().ok() == Some(file))
        };
        Ok(Partial { stays: earlier.is_some_and(same), rows, states, file })
    }

    /// The file of the rows.
    ///
    /// # Errors
    /// The system has no descriptor left.
    pub fn file(&self) -> Result<File, Error> {
        Ok(self.file.try_clone().map_err(|source| csv::Error::Io { path: self.rows.clone(), source })?)
    }

    /// The file of the states.
    pub fn states(&self) -> PathBuf {
        self.states.clone()
    }

    /// Makes the rows a part of the results, and the states, if something is left to continue (`unfinished`).
    ///
    /// # Errors
    /// They cannot be moved.
    pub fn take(&mut self, results: &mut Results, unfinished: bool) -> Result<(), Error> {
        self.stays = true;
        let adopt = |results: &mut Results, path: &Path, name| {
            results.adopt(path, name).map_err(|source| csv::Error::Io { path: path.into(), source })
        };
        adopt(results, &self.rows, ROWS)?;
        if unfinished && self.states.is_file() {
            adopt(results, &self.states, STATES)?;
        } else {
            let _ = std::fs::remove_file(&self.states);
        }
        let _ = std::fs::remove_file(states::begun(&self.states));
        Ok(())
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        if !self.stays {
            let _ = std::fs::remove_file(&self.rows);
            let _ = std::fs::remove_file(&self.states);
            let _ = std::fs::remove_file(states::begun(&self.states));
        }
    }
}

/// Makes the files that a run begins with. Killed at any place, it leaves a pair from which a run can continue, if
/// there was one.
fn begin(rows: &Path, states: &Path, earlier: Option<&Earlier>) -> std::io::Result<File> {
    let _ = std::fs::remove_file(states::begun(states));
    let continued = earlier.and_then(|earlier| Some((earlier, earlier.rows.as_ref()?)));
    let Some((earlier, source)) = continued else {
        let file = File::create(rows)?;
        match std::fs::remove_file(states) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
            _ => return Ok(file),
        }
    };
    airloop_series::file::write_whole(rows, |out| {
        copy_rows(source, earlier.states.rows.before, out)?;
        out.flush()?;
        out.get_ref().as_file().sync_data()
    })?;
    states::write(&earlier.states, states)?;
    File::options().read(true).write(true).open(rows)
}

/// Copies the header and so many rows; the number of whole rows that there were, at most `count`.
fn copy_rows(source: &Path, count: u64, to: &mut impl Write) -> std::io::Result<u64> {
    let mut from = BufReader::new(File::open(source)?);
    let mut to = BufWriter::new(to);
    let mut line = Vec::new();
    // A quoted name may have line breaks.
    let mut quoted = false;
    loop {
        line.clear();
        if from.read_until(b'\n', &mut line)? == 0 {
            return Err(IoError::new(ErrorKind::UnexpectedEof, "the header is missing"));
        }
        to.write_all(&line)?;
        quoted ^= line.iter().filter(|&&byte| byte == b'"').count() % 2 == 1;
        if !quoted {
            break;
        }
    }
    let mut copied = 0;
    while copied < count {
        line.clear();
        from.read_until(b'\n', &mut line)?;
        if line.last() != Some(&b'\n') {
            break;
        }
        to.write_all(&line)?;
        copied += 1;
    }
    to.flush()?;
    Ok(copied)
}

/// The whole result of a continued run, from the file of its rows; `since` has names and units.
///
/// # Errors
/// The file cannot be read.
pub fn with_rows_before(since: &TimeSeries, rows: &Path) -> Result<TimeSeries, Error> {
    let whole = csv::read(rows)?;
    let named = since.channels().iter().zip(whole.channels());
    let channels =
        named.map(|(known, read)| (known.name.clone(), known.unit.clone(), read.values.clone())).collect();
    Ok(TimeSeries::with_channels(whole.time().to_vec(), channels)?)
}
