//! Rows of a run on disk while it goes on: after a crash they are there up to the last moments before it.
//!
//! No row crosses a page of the file, because SIGKILL may end a writing where it goes on to the next page, and nowhere
//! else: whatever happens, the file ends with a whole row. The row before one that would cross gets zeros that do not
//! change its numbers until it fills its page. Rows that are longer than a page have no such place, and before the
//! first row is the header, which stays as it is.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result, Seek, SeekFrom, Write};
use std::ops::Range;
use std::time::{Duration, Instant};

use airloop_series::rows;

/// Bytes that are written at once; whole rows.
const BLOCK: usize = 1 << 14;
/// Bytes of a page of the system's cache; where pages are larger, their ends are ends of these, too.
const PAGE: u64 = 4096;
/// Time that a finished row waits at most, while the run makes steps.
const MAX_WAIT_OF_ROW: Duration = Duration::from_millis(20);

/// A file of rows, in the format of [`airloop_series::csv`].
#[derive(Debug)]
pub(super) struct Journal {
    file: File,
    /// The last row of the file, and rows after it.
    block: Vec<u8>,
    /// Position of the block in the file.
    position: u64,
    /// Bytes of the block that the file has.
    written: usize,
    /// Begin of the last row of the block; its end, if that is the header.
    last: usize,
    flushed: Instant,
    /// Rows in the file, and in the block.
    rows: u64,
}

impl Journal {
    /// Writes the header into an empty file, or goes on after the rows of a file with the same header.
    pub(super) fn new<'a>(file: File, names: impl IntoIterator<Item = &'a str>) -> Result<Journal> {
        let mut header = Vec::with_capacity(2 * BLOCK);
        rows::write_header(&mut header, names)?;
        let (last, flushed) = (header.len(), Instant::now());
        let mut journal = Journal { file, block: header, position: 0, written: 0, last, flushed, rows: 0 };
        if journal.file.metadata()?.len() == 0 {
            journal.flush()?;
        } else {
            journal.go_on()?;
        }
        Ok(journal)
    }

    /// Takes up the rows of the file, whose header is to be that in the block.
    fn go_on(&mut self) -> Result<()> {
        self.file.rewind()?;
        let mut header = vec![0; self.block.len()];
        let read = self.file.read_exact(&mut header);
        if read.is_err() || header != self.block {
            let problem = "the columns of the rows so far are not those of this run";
            return Err(Error::new(ErrorKind::InvalidData, problem));
        }
        // The bytes of the last row, which may end at the end of a chunk.
        self.block.clear();
        self.position = header.len() as u64;
        let mut chunk = vec![0; BLOCK];
        loop {
            let length = self.file.read(&mut chunk)?;
            if length == 0 {
                break;
            }
            self.block.extend_from_slice(&chunk[..length]);
            self.rows += chunk[..length].iter().filter(|&&byte| byte == b'\n').count() as u64;
            let before = self.block.len().saturating_sub(1);
            let begin = self.block[..before].iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
            self.block.drain(..begin);
            self.position += begin as u64;
        }
        (self.written, self.last) = (self.block.len(), 0);
        Ok(())
    }

    /// Whether the last writing was long ago.
    pub(super) fn is_due(&self) -> bool {
        self.flushed.elapsed() > MAX_WAIT_OF_ROW
    }

    /// Adds a row; every now and then rows go to the file.
    pub(super) fn row(&mut self, time: f64, values: impl Iterator<Item = f64>) -> Result<()> {
        let begin = self.block.len();
        rows::write_row(&mut self.block, time, values)?;
        let mut fill = 0;
        if self.last < begin {
            fill = crossing(self.position + begin as u64, self.block.len() - begin);
            if fill > 0 {
                lengthen(&mut self.block, self.last..begin, fill);
                self.written = self.written.min(self.last);
            }
        }
        self.last = begin + fill;
        self.rows += 1;
        if self.block.len() < BLOCK { Ok(()) } else { self.flush() }
    }

    /// Gives all rows to the file. One that cannot take all of them, as on a full disk, keeps whole rows.
    pub(super) fn flush(&mut self) -> Result<()> {
        // Devices have no position, and rows are as good at any.
        let is_file = self.file.metadata().is_ok_and(|file| file.is_file());
        if is_file {
            self.file.seek(SeekFrom::Start(self.position + self.written as u64))?;
        }
        let mut outcome = Ok(());
        while self.written < self.block.len() && outcome.is_ok() {
            match self.file.write(&self.block[self.written..]) {
                Ok(0) => outcome = Err(ErrorKind::WriteZero.into()),
                Ok(count) => self.written += count,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => outcome = Err(error),
            }
        }
        if outcome.is_err() {
            let whole = self.block[..self.written].iter().rposition(|&byte| byte == b'\n');
            self.written = whole.map_or(0, |end| end + 1);
            if is_file {
                self.file.set_len(self.position + self.written as u64)?;
            }
            self.block.truncate(self.written);
            self.last = self.last.min(self.written);
        }
        self.block.drain(..self.last);
        self.position += self.last as u64;
        (self.written, self.last) = (self.block.len(), 0);
        self.flushed = Instant::now();
        outcome
    }

    /// Waits until the file is on the disk; the number of rows that were given to it.
    pub(super) fn sync(&self) -> Result<u64> {
        self.file.sync_data()?;
        Ok(self.rows)
    }
}

/// Bytes up to the end of the page in which a row of so many bytes begins, if it would go on in the next page and need
/// not; 0 otherwise.
fn crossing(position: u64, length: usize) -> usize {
    let room = PAGE - position % PAGE;
    let is_crossing = room < PAGE && room < length as u64 && length as u64 <= PAGE;
    if is_crossing { room as usize } else { 0 }
}

/// Makes the row at `range` of `rows` longer by so many bytes: zeros at the end of its numbers, about as many in each.
fn lengthen(rows: &mut Vec<u8>, range: Range<usize>, mut bytes: usize) {
    let row = rows[range.clone()].strip_suffix(b"\n").unwrap_or(&rows[range.clone()]);
    let cells: Vec<&[u8]> = row.split(|&byte| byte == b',').collect();
    let mut ends = Vec::with_capacity(cells.len());
    // The time, which comes last here, takes what is left: it is always a number.
    for (column, cell) in cells.iter().enumerate().rev() {
        let share = bytes.div_ceil(column + 1);
        let text = zeros(cell, share);
        bytes -= text.len() - cell.len();
        ends.push(text);
    }
    ends.reverse();
    let mut longer = ends.join(&b","[..]);
    longer.push(b'\n');
    rows.splice(range, longer);
}

/// A number with so many bytes more, in a text that reads back to the same value; another cell as it is.
fn zeros(cell: &[u8], bytes: usize) -> Vec<u8> {
    let end = cell.iter().position(|&byte| byte == b'e').unwrap_or(cell.len());
    let (digits, exponent) = cell.split_at(end);
    let has_point = digits.contains(&b'.');
    let is_number = digits.last().is_some_and(u8::is_ascii_digit);
    if !is_number || bytes == 0 {
        return cell.to_vec();
    }
    let point = usize::from(!has_point);
    [digits, &b"."[..point], &b"0".repeat(bytes - point), exponent].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of different lengths, with numbers of all kinds.
    fn rows_of(journal: &mut Journal, range: Range<u32>, flush_after: u32) {
        for row in range {
            let x = f64::from(row);
            let values = [x.sin(), f64::NAN, x * 1e-9, -x, f64::INFINITY, x.exp(), f64::from(row % 7)];
            journal.row(0.001 * x, values.into_iter().take(3 + row as usize % 5)).unwrap();
            if row % flush_after == 0 {
                journal.flush().unwrap();
            }
        }
    }

    const NAMES: [&str; 2] = ["x", "y"];

    #[test]
    fn no_row_crosses_a_page_and_numbers_stay() {
        let mut files = Vec::new();
        for flush_after in [1, 17, u32::MAX] {
            let file = tempfile::NamedTempFile::new().unwrap();
            let mut journal = Journal::new(file.reopen().unwrap(), NAMES).unwrap();
            rows_of(&mut journal, 0..2000, flush_after);
            journal.flush().unwrap();
            files.push(std::fs::read(file.path()).unwrap());
        }
        assert!(
            files.iter().all(|file| *file == files[0]),
            "the bytes do not depend on the times of writing"
        );
        assert!(files[0].len() > 20 * PAGE as usize);
        for page in files[0].chunks(PAGE as usize) {
            assert_eq!(page.last(), Some(&b'\n'));
        }
        let text = String::from_utf8(files.remove(0)).unwrap();
        let mut plain = Vec::new();
        for row in 0..2000_u32 {
            let x = f64::from(row);
            let values = [x.sin(), f64::NAN, x * 1e-9, -x, f64::INFINITY, x.exp(), f64::from(row % 7)];
            rows::write_row(&mut plain, 0.001 * x, values.into_iter().take(3 + row as usize % 5)).unwrap();
        }
        let plain = String::from_utf8(plain).unwrap();
        assert_eq!(text.lines().count(), 2001);
        for (read, meant) in text.lines().skip(1).zip(plain.lines()) {
            let bits = |line: &str| -> Vec<u64> {
                line.split(',').map(|cell| cell.parse::<f64>().unwrap().to_bits()).collect()
            };
            assert_eq!(bits(read), bits(meant), "{read}");
        }
    }

    #[test]
    fn a_file_that_is_continued_has_the_bytes_of_one_that_is_not() {
        let whole = tempfile::NamedTempFile::new().unwrap();
        let mut journal = Journal::new(whole.reopen().unwrap(), NAMES).unwrap();
        rows_of(&mut journal, 0..500, 100);
        journal.flush().unwrap();
        let whole = std::fs::read(whole.path()).unwrap();
        for rows in [0, 1, 80, 81, 82, 83, 84, 85, 300] {
            let parts = tempfile::NamedTempFile::new().unwrap();
            let mut journal = Journal::new(parts.reopen().unwrap(), NAMES).unwrap();
            rows_of(&mut journal, 0..rows, 100);
            journal.flush().unwrap();
            let file = File::options().read(true).write(true).open(parts.path()).unwrap();
            let mut journal = Journal::new(file, NAMES).unwrap();
            assert_eq!(journal.sync().unwrap(), u64::from(rows));
            rows_of(&mut journal, rows..500, 100);
            journal.flush().unwrap();
            assert!(std::fs::read(parts.path()).unwrap() == whole, "continued after {rows} rows");
        }
    }

    #[test]
    fn rows_beyond_a_page_are_left_as_they_are() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let mut journal = Journal::new(file.reopen().unwrap(), NAMES).unwrap();
        for row in 0..5_u32 {
            journal.row(f64::from(row), std::iter::repeat_n(0.125, 1000)).unwrap();
        }
        journal.flush().unwrap();
        let row = ",0.125".repeat(1000);
        let expected: String = (0..5).map(|time| format!("{time}{row}\n")).collect();
        assert_eq!(std::fs::read_to_string(file.path()).unwrap(), format!("time,x,y\n{expected}"));
    }
}
