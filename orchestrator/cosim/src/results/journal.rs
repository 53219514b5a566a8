//! Rows of a run on disk while it goes on: after a crash they are there up to the last moments before it.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result, Seek, SeekFrom, Write};
use std::time::{Duration, Instant};

use airloop_series::rows;

/// Bytes that are written at once; whole rows, so that there is no half row between two writes.
const BLOCK: usize = 1 << 14;
/// Bytes of a page of the system's cache. A kill can cut a writing where it goes on to the next page, above all as the
/// system lets who writes much wait there.
const PAGE: usize = 4096;
/// Time that a finished row waits at most, while the run makes steps.
const LATEST: Duration = Duration::from_millis(20);

/// A file of rows, in the format of [`airloop_series::csv`].
#[derive(Debug)]
pub(super) struct Journal {
    file: File,
    block: Vec<u8>,
    flushed: Instant,
    /// Rows in the file, and in the block.
    rows: u64,
}

impl Journal {
    /// Writes the header into an empty file, or goes on after the rows of a file with the same header.
    pub(super) fn new<'a>(file: File, names: impl IntoIterator<Item = &'a str>) -> Result<Journal> {
        let mut journal =
            Journal { file, block: Vec::with_capacity(2 * BLOCK), flushed: Instant::now(), rows: 0 };
        rows::write_header(&mut journal.block, names)?;
        if journal.file.metadata()?.len() == 0 {
            journal.flush()?;
            return Ok(journal);
        }
        journal.file.rewind()?;
        let mut header = vec![0; journal.block.len()];
        let read = journal.file.read_exact(&mut header);
        if read.is_err() || header != journal.block {
            let problem = "the columns of the rows so far are not those of this run";
            return Err(Error::new(ErrorKind::InvalidData, problem));
        }
        let mut chunk = vec![0; BLOCK];
        loop {
            let length = journal.file.read(&mut chunk)?;
            if length == 0 {
                break;
            }
            journal.rows += chunk[..length].iter().filter(|&&byte| byte == b'\n').count() as u64;
        }
        journal.block.clear();
        journal.file.seek(SeekFrom::End(0))?;
        Ok(journal)
    }

    /// Whether the last writing was long ago.
    pub(super) fn is_due(&self) -> bool {
        self.flushed.elapsed() > LATEST
    }

    /// Adds a row; every now and then rows go to the file.
    pub(super) fn row(&mut self, time: f64, values: impl Iterator<Item = f64>) -> Result<()> {
        rows::write_row(&mut self.block, time, values)?;
        self.rows += 1;
        if self.block.len() < BLOCK { Ok(()) } else { self.flush() }
    }

    /// Gives all rows to the file. One that cannot take all of them, as on a full disk, keeps whole rows.
    pub(super) fn flush(&mut self) -> Result<()> {
        let mut written = 0;
        let mut outcome = Ok(());
        // Without a position, as that of a device, rows are as good at any.
        let mut position = self.file.stream_position().unwrap_or(0);
        while written < self.block.len() && outcome.is_ok() {
            let rest = &self.block[written..];
            match self.file.write(&rest[..piece(rest, position)]) {
                Ok(0) => outcome = Err(ErrorKind::WriteZero.into()),
                Ok(count) => (written, position) = (written + count, position + count as u64),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => outcome = Err(error),
            }
        }
        if outcome.is_err() && self.file.metadata().is_ok_and(|file| file.is_file()) {
            let begun = self.block[..written].iter().rev().take_while(|&&byte| byte != b'\n').count() as u64;
            let end = self.file.stream_position()?;
            self.file.set_len(end - begun)?;
            self.file.seek(SeekFrom::End(0))?;
        }
        self.block.clear();
        self.flushed = Instant::now();
        outcome
    }

    /// Waits until the file is on the disk; the number of rows that were given to it.
    pub(super) fn sync(&self) -> Result<u64> {
        self.file.sync_data()?;
        Ok(self.rows)
    }
}

/// Bytes of whole rows that are written at once at a position of the file: those that end in the page where they begin,
/// or the one that does not.
fn piece(rows: &[u8], position: u64) -> usize {
    let room = PAGE - (position % PAGE as u64) as usize;
    let within = rows[..rows.len().min(room)].iter().rposition(|&byte| byte == b'\n');
    let last = within.or_else(|| rows.iter().position(|&byte| byte == b'\n'));
    last.map_or(rows.len(), |last| last + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_row_that_does_not_fit_crosses_a_page() {
        let rows: Vec<u8> = b"123456789\n".repeat(1000);
        let (mut position, mut crossed) = (4090_u64, 0);
        let mut written = 0;
        while written < rows.len() {
            let count = piece(&rows[written..], position);
            assert_eq!(rows[written + count - 1], b'\n');
            let crosses = position / PAGE as u64 != (position + count as u64 - 1) / PAGE as u64;
            assert!(!crosses || count == 10, "{count} bytes at {position}");
            crossed += u32::from(crosses);
            (written, position) = (written + count, position + count as u64);
        }
        assert_eq!(crossed, 3);
        assert_eq!(piece(b"no end", 0), 6);
    }
}
