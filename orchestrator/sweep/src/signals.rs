//! Whole signals of all tasks: one Parquet file per shard, and one of all when shards are merged.

use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::manifest::Manifest;
use crate::parquet_file::{Complete, Reader, Writer};
use crate::table::{Cell, Column, Type};
use crate::{Error, digest};

/// Signals of all tasks.
pub const SIGNALS: &str = "signals.parquet";

/// File of the signals beside that of the rows of a shard.
pub fn path(shard: &Path) -> PathBuf {
    shard.with_extension(SIGNALS)
}

/// Columns of the file: the task, the time, the signals.
fn columns(manifest: &Manifest) -> Vec<Column> {
    std::iter::once(Column::new("task", Type::Integer)).chain(manifest.signals.iter().cloned()).collect()
}

/// Signals of the tasks of a shard while they are written.
pub struct Tape {
    writer: Writer,
    path: PathBuf,
}

impl Tape {
    /// Begins the file of a shard; none if the plan keeps no signals.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Parquet`].
    pub fn create(shard: &Path, manifest: &Manifest) -> Result<Option<Tape>, Error> {
        if manifest.signals.is_empty() {
            return Ok(None);
        }
        let path = path(shard);
        Ok(Some(Tape { writer: Writer::create(&path, &columns(manifest), manifest)?, path }))
    }

    /// Adds the signals of a task, column by column.
    ///
    /// # Errors
    /// [`Error::Parquet`].
    pub fn push(&mut self, task: u64, signals: &[Vec<f64>]) -> Result<(), Error> {
        push(&mut self.writer, task, signals, 0..signals.first().map_or(0, Vec::len))
    }

    /// Ends the file and gives it its name; its SHA-256.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Parquet`].
    pub fn finish(self) -> Result<String, Error> {
        self.writer.finish()?.persist()?;
        digest::of_path(&self.path)
    }
}

fn push(writer: &mut Writer, task: u64, signals: &[Vec<f64>], rows: Range<usize>) -> Result<(), Error> {
    for row in rows {
        let values = signals.iter().map(|column| Cell::Number(column[row]));
        writer.push(std::iter::once(Cell::Integer(task)).chain(values).collect())?;
    }
    Ok(())
}

/// Copies the signals of all shards into one file, in the order of the tasks; it has no name yet. None if the plan
/// keeps no signals.
///
/// # Errors
/// [`Error::Damaged`] for a file that is not what its shard wrote, [`Error::Io`], [`Error::Parquet`].
pub fn merge(
    cover: &[(Range<u64>, PathBuf)],
    manifest: &Manifest,
    folder: &Path,
) -> Result<Option<Complete>, Error> {
    if manifest.signals.is_empty() {
        return Ok(None);
    }
    let columns = columns(manifest);
    let mut writer = Writer::create(&folder.join(SIGNALS), &columns, manifest)?;
    for (wanted, shard) in cover {
        let path = path(shard);
        let written = crate::shard::Reader::open(shard, manifest)?.check()?.signals;
        if !path.exists() || written.as_ref() != Some(&digest::of_path(&path)?) {
            // Without the rows the tasks run again.
            let problem =
                format!("the signals in {} are not those that were written with it", path.display());
            return Err(Error::Damaged { path: shard.clone(), problem });
        }
        let reader = Reader::open(&path, columns.len())?;
        for group in 0..reader.groups() {
            let (tasks, signals) = reader.group(group)?;
            for (row, task) in tasks.iter().enumerate().filter(|(_, task)| wanted.contains(task)) {
                push(&mut writer, *task, &signals, row..row + 1)?;
            }
        }
    }
    Ok(Some(writer.finish()?))
}
