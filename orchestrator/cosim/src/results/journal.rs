//! Rows of a run on disk while it goes on: after a crash they are there up to the last moments before it.

use std::fs::File;
use std::io::{Result, Write};
use std::time::{Duration, Instant};

use airloop_series::rows;

/// Bytes that are written at once; whole rows, so that there is no half row between two writes.
const BLOCK: usize = 1 << 14;
/// Time that a finished row waits at most, while the run makes steps.
const LATEST: Duration = Duration::from_millis(20);

/// A file of rows, in the format of [`airloop_series::csv`].
#[derive(Debug)]
pub(super) struct Journal {
    file: File,
    block: Vec<u8>,
    flushed: Instant,
}

impl Journal {
    /// Writes the header.
    pub(super) fn new<'a>(file: File, names: impl IntoIterator<Item = &'a str>) -> Result<Journal> {
        let mut journal = Journal { file, block: Vec::with_capacity(2 * BLOCK), flushed: Instant::now() };
        rows::write_header(&mut journal.block, names)?;
        journal.flush()?;
        Ok(journal)
    }

    /// Whether the last writing was long ago.
    pub(super) fn is_due(&self) -> bool {
        self.flushed.elapsed() > LATEST
    }

    /// Adds a row; every now and then rows go to the file.
    pub(super) fn row(&mut self, time: f64, values: impl Iterator<Item = f64>) -> Result<()> {
        rows::write_row(&mut self.block, time, values)?;
        if self.block.len() < BLOCK { Ok(()) } else { self.flush() }
    }

    /// Gives all rows to the file.
    pub(super) fn flush(&mut self) -> Result<()> {
        let outcome = self.file.write_all(&self.block);
        self.block.clear();
        self.flushed = Instant::now();
        outcome
    }
}
