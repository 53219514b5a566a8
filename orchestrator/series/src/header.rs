//! Header of a CSV file: names and units of its columns; reasons why a file cannot be read.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::names::without_unit;

/// Reason why a CSV file cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "file, line (1-based), column and value, as named in each message")]
pub enum Error {
    /// The file cannot be opened, read or written.
    #[error("{}: the file cannot be read or written: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// The first column is not `time`.
    #[error(
        "{}: line 1: the first column must be `time` [s], found `{found}`; put the time first and name it `time`",
        path.display()
    )]
    NoTime { path: PathBuf, found: String },
    /// The file has no characters.
    #[error("{}: the file is empty; write a header such as `time,u` and rows of numbers", path.display())]
    NoText { path: PathBuf },
    /// Columns are not separated by commas.
    #[error(
        "{}: line 1: columns must be separated by commas, but this header has {found}; write it like `time,u`, with a dot as decimal sign",
        path.display()
    )]
    Separator { path: PathBuf, found: &'static str },
    /// The unit of the first column is none of time.
    #[error(
        "{}: line 1, column `time`: [{unit}] is not a unit of time that is known; use s, ms, us, ns, min or h",
        path.display()
    )]
    TimeUnit { path: PathBuf, unit: String },
    /// A value that the signal of the column cannot have.
    #[error("{}: line {line}, column `{column}`: `{value}` is not allowed for `{signal}`; allowed is {allowed}", path.display())]
    Value { path: PathBuf, line: usize, column: String, value: String, signal: String, allowed: String },
    /// No data row.
    #[error("{}: there is no row of data below the header", path.display())]
    Empty { path: PathBuf },
    /// A header cell is empty or there twice.
    #[error("{}: line 1, column {column}: the name `{name}` is {what}", path.display())]
    Header { path: PathBuf, column: usize, name: String, what: &'static str },
    /// A line without an end.
    #[error("{}: line {line}: it is longer than {most} MiB, so that this is no table", path.display())]
    LongLine { path: PathBuf, line: usize, most: usize },
    /// Another encoding.
    #[error("{}: the text is UTF-16; save it in UTF-8", path.display())]
    Utf16 { path: PathBuf },
    /// A quoted cell that does not end.
    #[error("{}: line {line}: a quoted cell is not closed", path.display())]
    Quote { path: PathBuf, line: usize },
    /// A row with more or fewer cells than the header.
    #[error(
        "{}: line {line}: {found} cells, but the header has {expected} columns; {}",
        path.display(), cells_hint(*found, *expected)
    )]
    RowLength { path: PathBuf, line: usize, found: usize, expected: usize },
    /// A cell that is not a number.
    #[error(
        "{}: line {line}, column `{column}`: `{value}` is not a number; write it like -1.5 or 2e-3",
        path.display()
    )]
    NotANumber { path: PathBuf, line: usize, column: String, value: String },
    /// NaN or infinity.
    #[error(
        "{}: line {line}, column `{column}`: `{value}` is not finite; remove the row or repair the value",
        path.display()
    )]
    NotFinite { path: PathBuf, line: usize, column: String, value: String },
    /// Time that does not increase.
    #[error(
        "{}: line {line}, column `time`: {after} s does not come after {before} s of the row before; sort the rows and remove repeated times",
        path.display()
    )]
    NotIncreasing { path: PathBuf, line: usize, before: f64, after: f64 },
    /// A column that the reader of the file has no use for.
    #[error(
        "{}: line 1, column `{column}`: no such signal; known are: {known}",
        path.display()
    )]
    UnknownColumn { path: PathBuf, column: String, known: String },
    /// A column that is asked for but not there.
    #[error("{}: there is no column `{column}`{}; the file has: {columns}", path.display(), without_unit(column, columns.split(", ")))]
    MissingColumn { path: PathBuf, column: String, columns: String },
}

/// A hint on a row of another length. With decimal commas every number makes two cells, but for those without digits
/// behind it.
fn cells_hint(found: usize, expected: usize) -> &'static str {
    if found < expected {
        "a missing value cannot be left out"
    } else if expected > 1 && 2 * found >= 3 * expected && found <= 2 * expected {
        "are there decimal commas? Numbers need points, as in 1.5"
    } else {
        "there is a comma too many"
    }
}

/// Factor of a unit of time; small units divide by a whole number, which rounds once (7 ms is 0.007 s).
#[derive(Debug, Clone, Copy)]
pub(super) enum Seconds {
    Times(f64),
    Over(f64),
}

impl Seconds {
    pub(super) fn of(unit: &str) -> Option<Seconds> {
        Some(match unit {
            "s" => Seconds::Times(1.0),
            "ms" => Seconds::Over(1e3),
            "us" | "\u{b5}s" | "\u{3bc}s" => Seconds::Over(1e6),
            "ns" => Seconds::Over(1e9),
            "min" => Seconds::Times(60.0),
            "h" => Seconds::Times(3600.0),
            _ => return None,
        })
    }

    pub(super) fn convert(self, value: f64) -> f64 {
        match self {
            Seconds::Times(factor) => value * factor,
            Seconds::Over(divisor) => value / divisor,
        }
    }
}

/// Letters of a cell that a message shows.
const SHOWN_LETTERS: usize = 40;
/// Names that a message lists.
const SHOWN_NAMES: usize = 20;

/// A cell as a message shows it.
pub(super) fn begin_of(cell: &str) -> String {
    match cell.char_indices().nth(SHOWN_LETTERS) {
        Some((end, _)) => format!("{}...", &cell[..end]),
        None => cell.to_owned(),
    }
}

/// The first of many names, for messages.
pub fn some_of<'a>(names: impl ExactSizeIterator<Item = &'a str>) -> String {
    let count = names.len();
    let shown: Vec<&str> = names.take(SHOWN_NAMES).collect();
    match count - shown.len() {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}

/// Names and units of the header; the first is `time`.
pub(super) fn header_cells(header: &str, path: &Path) -> Result<Vec<(String, Option<String>)>, Error> {
    let cells = split_quoted(header).ok_or_else(|| Error::Quote { path: path.into(), line: 1 })?;
    let named: Vec<(String, Option<String>)> = cells.iter().map(|cell| name_and_unit(cell.trim())).collect();
    let first = &named[0].0;
    if first != "time" {
        let separators = [(';', "semicolons"), ('\t', "tabs")];
        if let Some((_, found)) = separators.into_iter().find(|(character, _)| header.contains(*character)) {
            return Err(Error::Separator { path: path.into(), found });
        }
        return Err(Error::NoTime { path: path.into(), found: begin_of(first) });
    }
    let mut seen = HashSet::new();
    for (index, (name, _)) in named.iter().enumerate() {
        let what = if name.is_empty() {
            "empty; every column needs a name"
        } else if !seen.insert(name.as_str()) {
            "a duplicate; rename one of the columns"
        } else {
            continue;
        };
        return Err(Error::Header { path: path.into(), column: index + 1, name: begin_of(name), what });
    }
    Ok(named)
}

/// Splits a line at its commas, except inside double quotes (`""` is a quote); `None` if a quote stays open.
fn split_quoted(line: &str) -> Option<Vec<String>> {
    let mut cells = vec![String::new()];
    let mut quoted = false;
    let mut characters = line.chars().peekable();
    while let Some(character) = characters.next() {
        match character {
            '"' if quoted && characters.peek() == Some(&'"') => {
                characters.next();
                push(&mut cells, '"');
            }
            '"' => quoted = !quoted,
            ',' if !quoted => cells.push(String::new()),
            other => push(&mut cells, other),
        }
    }
    (!quoted).then_some(cells)
}

fn push(cells: &mut [String], character: char) {
    cells.last_mut().expect("there is always a first cell").push(character);
}

/// Splits `x [m]` into name and unit. `A1[1,1]` is a name: a unit stands after a space.
fn name_and_unit(cell: &str) -> (String, Option<String>) {
    match cell.strip_suffix(']').and_then(|rest| rest.rsplit_once(" [")) {
        Some((name, unit)) => (name.trim().to_owned(), Some(unit.trim().to_owned())),
        None => (cell.to_owned(), None),
    }
}
