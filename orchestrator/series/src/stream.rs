//! CSV files that are longer than the memory: some columns, block by block, as often as wanted.
//!
//! The format is that of [`super::csv`], which reads whole files through this module, with two differences: only the
//! columns that are asked for are read, and a cell of theirs that is empty or `NaN` is a missing value (NaN) instead of
//! an error. What a missing value means is left to the caller.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::header::{Error, Seconds, begin_of, header_cells, some_of};

/// Bytes read at once.
const CHUNK: usize = 1 << 18;
/// Longest line \[bytes\]; a longer one is not a table.
const LONGEST_LINE: usize = 1 << 26;

/// Rows of a file.
#[derive(Debug, Clone, Default)]
pub struct Rows {
    /// Times \[s\], shape \[n\].
    pub time: Vec<f64>,
    /// Values of the columns asked for, in that order, shape \[columns\]\[n\]; NaN where there is none.
    pub columns: Vec<Vec<f64>>,
    /// Line of each row in the file, from 1, shape \[n\].
    pub lines: Vec<usize>,
    /// Columns in which a value is written as `true` or `false`, shape \[columns\].
    pub words: Vec<bool>,
}

/// A CSV file that is read from the beginning to the end.
#[derive(Debug)]
pub struct Stream<R = File> {
    path: PathBuf,
    file: R,
    /// Bytes that are read but not used: `buffer[at..]`.
    buffer: Vec<u8>,
    at: usize,
    /// There is no line break from `at` to here.
    searched: usize,
    /// Bytes read from the file.
    read: u64,
    line: usize,
    names: Vec<(String, Option<String>)>,
    seconds: Seconds,
    /// For each column of the file, which of the wanted ones it is.
    target: Vec<Option<usize>>,
    wanted: Vec<usize>,
    /// Whether cells may be missing values: empty or `NaN`.
    gaps: bool,
}

impl Stream {
    /// Opens a file and reads its header; `wanted` are names of columns.
    ///
    /// # Errors
    /// [`Error`] for the file, its header, or a column that is not there.
    pub fn open(path: &Path, wanted: &[String]) -> Result<Stream, Error> {
        let file = super::file::open(path).map_err(|source| Error::Io { path: path.into(), source })?;
        let mut stream = Stream { gaps: true, ..Stream::begin(file, path)? };
        for name in wanted {
            let column = stream.names.iter().skip(1).position(|(known, _)| known == name);
            let Some(column) = column.map(|column| column + 1) else {
                let columns = some_of(stream.names[1..].iter().map(|(name, _)| name.as_str()));
                return Err(Error::MissingColumn { path: path.into(), column: name.clone(), columns });
            };
            stream.want(column);
        }
        Ok(stream)
    }

    /// Rows that are still to come, estimated from the size of the file and its lines so far, rather too many.
    pub fn rows_left(&self) -> usize {
        let size = self.file.metadata().map_or(0, |data| data.len());
        let used = (self.read - (self.buffer.len() - self.at) as u64).max(1);
        let left = size.saturating_sub(used) as f64 / used as f64 * self.line as f64;
        (1.01 * left) as usize + 64
    }
}

impl<R: Read> Stream<R> {
    /// All columns of `file`, without missing values; `path` is only used in messages.
    pub(super) fn whole(file: R, path: &Path) -> Result<Stream<R>, Error> {
        let mut stream = Stream::begin(file, path)?;
        (1..stream.names.len()).for_each(|column| stream.want(column));
        Ok(stream)
    }

    /// The same with cells that are empty or `NaN` as missing values (NaN).
    pub(super) fn with_gaps(self) -> Stream<R> {
        Stream { gaps: true, ..self }
    }

    /// Names and units of all columns; the first is `time`.
    pub(super) fn into_names(self) -> Vec<(String, Option<String>)> {
        self.names
    }

    /// Reads the header.
    fn begin(file: R, path: &Path) -> Result<Stream<R>, Error> {
        let mut stream = Stream {
            path: path.into(),
            file,
            buffer: Vec::new(),
            at: 0,
            searched: 0,
            read: 0,
            line: 1,
            names: Vec::new(),
            seconds: Seconds::Times(1.0),
            target: Vec::new(),
            wanted: Vec::new(),
            gaps: false,
        };
        while stream.last_break().is_none() && stream.fill()? {
            stream.check_length(1)?;
        }
        if stream.buffer.is_empty() {
            return Err(Error::NoText { path: path.into() });
        }
        let end = stream.buffer.iter().position(|&byte| byte == b'\n').unwrap_or(stream.buffer.len());
        if super::file::begins_as_utf_16(&stream.buffer) {
            return Err(Error::Utf16 { path: path.into() });
        }
        let header = String::from_utf8_lossy(&stream.buffer[..end]).into_owned();
        stream.at = (end + 1).min(stream.buffer.len());
        let header = header.trim_start_matches('\u{feff}').trim_end_matches('\r');
        stream.names = header_cells(header, path)?;
        if let Some(unit) = &stream.names[0].1 {
            stream.seconds =
                Seconds::of(unit).ok_or_else(|| Error::TimeUnit { path: path.into(), unit: unit.clone() })?;
        }
        stream.target = vec![None; stream.names.len()];
        Ok(stream)
    }

    fn want(&mut self, column: usize) {
        self.target[column] = Some(self.wanted.len());
        self.wanted.push(column);
    }

    /// Unit of a wanted column, if the header has one.
    pub fn unit(&self, index: usize) -> Option<&str> {
        self.names[self.wanted[index]].1.as_deref()
    }

    /// Replaces what is in `rows` by the next rows, `limit` at most; fewer only at the end of the file, none after it.
    ///
    /// # Errors
    /// [`Error`] names file, line and column of a cell that is not a number, and of a row with missing or additional
    /// cells.
    pub fn read(&mut self, rows: &mut Rows, limit: usize) -> Result<usize, Error> {
        rows.time.clear();
        rows.lines.clear();
        rows.columns.resize_with(self.wanted.len(), Vec::new);
        rows.columns.iter_mut().for_each(Vec::clear);
        rows.words.resize(self.wanted.len(), false);
        while rows.time.len() < limit {
            // All lines up to the last line break in the buffer are complete.
            let Some(complete) = self.last_break().map(|at| at + 1) else {
                self.check_length(self.line + 1)?;
                if self.fill()? {
                    continue;
                }
                if self.at == self.buffer.len() {
                    break;
                }
                // The last line has no line break.
                self.buffer.push(b'\n');
                continue;
            };
            while self.at < complete && rows.time.len() < limit {
                self.line += 1;
                self.at = self.row(rows)?;
            }
        }
        Ok(rows.time.len())
    }

    /// Place of the last line break in what is read and not used.
    fn last_break(&mut self) -> Option<usize> {
        let from = self.searched.max(self.at);
        self.searched = self.buffer.len();
        let found = self.buffer[from..].iter().rposition(|&byte| byte == b'\n').map(|length| from + length);
        if found.is_some() {
            // More rows may be asked for before the next bytes are read.
            self.searched = self.at;
        }
        found
    }

    /// Refuses a line without an end.
    fn check_length(&self, line: usize) -> Result<(), Error> {
        if self.buffer.len() - self.at <= LONGEST_LINE {
            return Ok(());
        }
        Err(Error::LongLine { path: self.path.clone(), line, most: LONGEST_LINE >> 20 })
    }

    /// Drops what is used and reads more; false at the end of the file.
    fn fill(&mut self) -> Result<bool, Error> {
        self.buffer.drain(..self.at);
        self.searched = self.searched.saturating_sub(self.at);
        self.at = 0;
        let before = self.buffer.len();
        self.buffer.resize(before + CHUNK, 0);
        let read = loop {
            match self.file.read(&mut self.buffer[before..]) {
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                other => break other,
            }
        };
        self.buffer.truncate(before + *read.as_ref().unwrap_or(&0));
        let read = read.map_err(|source| Error::Io { path: self.path.clone(), source })?;
        self.read += read as u64;
        Ok(read > 0)
    }

    /// Reads the row at the position; gives the position after it.
    fn row(&self, rows: &mut Rows) -> Result<usize, Error> {
        let bytes = &self.buffer;
        let mut at = self.at;
        let columns = self.target.len();
        for column in 0..columns {
            let target = if column == 0 { None } else { self.target[column] };
            let wanted = column == 0 || target.is_some();
            let fast = if wanted { simple_number(bytes, at) } else { None };
            let (value, end) = match fast {
                Some(found) => found,
                None => {
                    let length = bytes[at..].iter().position(|&byte| byte == b',' || byte == b'\n');
                    let end = at + length.unwrap_or(bytes.len() - at);
                    let cell = &bytes[at..end];
                    if column == 0 && bytes[end] == b'\n' && cell.iter().all(u8::is_ascii_whitespace) {
                        return Ok(end + 1);
                    }
                    let word = if wanted { truth(cell) } else { None };
                    let word = word.filter(|_| column > 0);
                    if let (Some(_), Some(index)) = (word, target) {
                        rows.words[index] = true;
                    }
                    let value = match word {
                        Some(value) => value,
                        None if wanted => self.number(cell, column)?,
                        None => 0.0,
                    };
                    (value, end)
                }
            };
            let last = bytes[end] == b'\n';
            if last != (column + 1 == columns) {
                let start = bytes[..end].iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1);
                let row = bytes[start..].split(|&byte| byte == b'\n').next().unwrap_or_default();
                let found = row.split(|&byte| byte == b',').count();
                let (path, line) = (self.path.clone(), self.line);
                return Err(Error::RowLength { path, line, found, expected: columns });
            }
            match target {
                Some(index) => rows.columns[index].push(value),
                None if column == 0 => rows.time.push(self.seconds.convert(value)),
                None => {}
            }
            at = end + 1;
        }
        rows.lines.push(self.line);
        Ok(at)
    }

    fn number(&self, cell: &[u8], column: usize) -> Result<f64, Error> {
        let text = String::from_utf8_lossy(cell);
        let trimmed = text.trim().trim_matches('"').trim();
        let missing = trimmed.is_empty() || trimmed.eq_ignore_ascii_case("nan");
        if missing && self.gaps && column > 0 {
            return Ok(f64::NAN);
        }
        let (path, line, column) = (self.path.clone(), self.line, self.names[column].0.clone());
        match trimmed.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            Ok(_) => Err(Error::NotFinite { path, line, column, value: begin_of(trimmed) }),
            Err(_) => Err(Error::NotANumber { path, line, column, value: begin_of(trimmed) }),
        }
    }
}

/// A truth value written as a word.
pub(super) fn truth(cell: &[u8]) -> Option<f64> {
    match cell.trim_ascii() {
        b"true" | b"True" | b"TRUE" | b"\"true\"" | b"\"True\"" | b"\"TRUE\"" => Some(1.0),
        b"false" | b"False" | b"FALSE" | b"\"false\"" | b"\"False\"" | b"\"FALSE\"" => Some(0.0),
        _ => None,
    }
}

/// The number from `at` to the next comma or line break, and where that stands, if reading it needs one rounding only:
/// at most 2^53 as digits, and a power of ten that is exact. The result is then the nearest double (Clinger 1990).
fn simple_number(bytes: &[u8], mut at: usize) -> Option<(f64, usize)> {
    let negative = bytes[at] == b'-';
    at += usize::from(negative);
    let (mut digits, mut exponent, begin) = (0u64, 0i32, at);
    while let digit @ 0..=9 = bytes[at].wrapping_sub(b'0') {
        digits = digits.wrapping_mul(10).wrapping_add(u64::from(digit));
        at += 1;
    }
    let mut count = at - begin;
    if bytes[at] == b'.' {
        at += 1;
        let begin = at;
        while let digit @ 0..=9 = bytes[at].wrapping_sub(b'0') {
            digits = digits.wrapping_mul(10).wrapping_add(u64::from(digit));
            at += 1;
        }
        count += at - begin;
        exponent = -i32::try_from(at - begin).ok()?;
    }
    // 19 digits cannot wrap around.
    if count == 0 || count > 19 || digits > 1 << 53 {
        return None;
    }
    if bytes[at] | 0x20 == b'e' {
        at += 1;
        let minus = bytes[at] == b'-';
        at += usize::from(minus || bytes[at] == b'+');
        let (mut power, begin) = (0i32, at);
        while let digit @ 0..=9 = bytes[at].wrapping_sub(b'0') {
            power = power.saturating_mul(10).saturating_add(i32::from(digit));
            at += 1;
        }
        if at == begin {
            return None;
        }
        exponent = exponent.saturating_add(if minus { -power } else { power });
    }
    if bytes[at] == b'\r' {
        at += 1;
    }
    if bytes[at] != b',' && bytes[at] != b'\n' {
        return None;
    }
    let power = *POWERS_OF_TEN.get(exponent.unsigned_abs() as usize)?;
    let size = if exponent < 0 { digits as f64 / power } else { digits as f64 * power };
    Some((if negative { -size } else { size }, at))
}

/// Powers of ten that are doubles exactly.
const POWERS_OF_TEN: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::csv;

    fn file(text: &str) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        file
    }

    fn names(text: &[&str]) -> Vec<String> {
        text.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn every_bit_is_that_of_the_reader_of_whole_files() {
        let mut text = String::from("time [ms],a,skipped,b [N]\r\n");
        let mut state = 1u64;
        for k in 0..3000 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let wild = f64::from_bits(state & 0xbfff_ffff_ffff_ffff);
            let tame = (state >> 20) as f64 * 1e-9;
            text += &format!("{k},{wild:e},0,{tame}\r\n");
        }
        let file = file(&text);
        let whole = csv::read(file.path()).unwrap();
        let mut stream = Stream::open(file.path(), &names(&["b", "a"])).unwrap();
        assert_eq!((stream.unit(0), stream.unit(1)), (Some("N"), None));
        let (mut rows, mut at) = (Rows::default(), 0);
        loop {
            let n = stream.read(&mut rows, 700).unwrap();
            if n == 0 {
                break;
            }
            for k in 0..n {
                assert_eq!(rows.time[k], whole.time()[at + k]);
                assert_eq!(rows.lines[k], at + k + 2);
                for (column, name) in ["b", "a"].into_iter().enumerate() {
                    let expected = whole.channel(name).unwrap().values[at + k];
                    assert_eq!(
                        rows.columns[column][k].to_bits(),
                        expected.to_bits(),
                        "{name}, row {}",
                        at + k
                    );
                }
            }
            at += n;
        }
        assert_eq!(at, 3000);
    }

    #[test]
    fn missing_cells_are_nan_and_other_columns_are_not_read() {
        let file = file("time,a,text,b\n0,1,x,\n\n0.1,NaN,y,+2.5e1\n0.2,true,,1e400\n");
        let mut stream = Stream::open(file.path(), &names(&["a", "b"])).unwrap();
        let mut rows = Rows::default();
        assert_eq!(stream.read(&mut rows, 2).unwrap(), 2);
        assert!(rows.columns[0][1].is_nan() && rows.columns[1][0].is_nan());
        assert_eq!((rows.columns[1][1], rows.lines[1]), (25.0, 4));
        let message = stream.read(&mut rows, 2).unwrap_err().to_string();
        assert!(message.contains("line 5, column `b`: `1e400` is not finite"), "{message}");
    }

    #[test]
    fn bad_rows_and_columns_are_refused_with_their_place() {
        for (text, expected) in [
            ("time,a\n0,1\n1\n", "line 3: 1 cells, but the header has 2"),
            ("time,a\n0,1\n1,2,3", "line 3: 3 cells, but the header has 2"),
            ("time,a\n0,1\n1,x", "line 3, column `a`: `x` is not a number"),
            ("time,a\n,1\n", "line 2, column `time`: `` is not a number"),
            ("time,b\n0,1\n", "there is no column `a`; the file has: b"),
            ("t;a\n0;1\n", "semicolons"),
            ("", "the file is empty"),
        ] {
            let file = file(text);
            let mut rows = Rows::default();
            let outcome = Stream::open(file.path(), &names(&["a"]));
            let message = outcome.and_then(|mut stream| stream.read(&mut rows, 10)).unwrap_err().to_string();
            assert!(message.contains(expected), "{text:?}: {message}");
        }
        let wanted = names(&["a [V]"]);
        let message =
            Stream::open(file("time,a [V]\n0,1\n").path(), &wanted).map(|_| ()).unwrap_err().to_string();
        assert!(message.contains("no column `a [V]` (its name is `a`, without the unit)"), "{message}");
    }
}
