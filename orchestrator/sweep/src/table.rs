//! Tables of results: typed columns, and rows as lines of CSV that give the same values back bit for bit.

use serde::{Deserialize, Serialize};

/// Type of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Type {
    /// Whole number from 0 to 2^64 - 1.
    Integer,
    /// Number.
    Number,
    /// Text.
    Text,
}

/// A column.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// Name, unique in the table.
    pub name: String,
    /// Unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Type.
    #[serde(rename = "type")]
    pub kind: Type,
}

impl Column {
    /// A column without unit.
    pub fn new(name: &str, kind: Type) -> Column {
        Column { name: name.into(), unit: None, kind }
    }

    /// Name, with the unit as CSV files have it.
    pub fn title(&self) -> String {
        match &self.unit {
            Some(unit) => format!("{} [{unit}]", self.name),
            None => self.name.clone(),
        }
    }
}

/// A value of a row.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// No value.
    Empty,
    /// Of a column of whole numbers.
    Integer(u64),
    /// Of a column of numbers.
    Number(f64),
    /// Of a column of texts; empty texts are [`Cell::Empty`].
    Text(String),
}

/// Appends a row as a line; lines inside of texts become semicolons.
pub fn write_row<'a>(line: &mut String, cells: impl Iterator<Item = &'a Cell>) {
    use std::fmt::Write;
    for (index, cell) in cells.enumerate() {
        if index > 0 {
            line.push(',');
        }
        // A `String` takes everything.
        let _ = match cell {
            Cell::Empty => Ok(()),
            Cell::Integer(number) => write!(line, "{number}"),
            Cell::Number(number) => write!(line, "{number}"),
            Cell::Text(text) => {
                line.push_str(&quoted(text));
                Ok(())
            }
        };
    }
    line.push('\n');
}

/// The first line of a table.
pub fn header(columns: &[Column]) -> String {
    let mut line = String::new();
    let titles: Vec<Cell> = columns.iter().map(|column| Cell::Text(column.title())).collect();
    write_row(&mut line, titles.iter());
    line
}

fn quoted(text: &str) -> String {
    let text = text.lines().map(str::trim_end).collect::<Vec<_>>().join("; ");
    match text.contains([',', '"', '#']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text,
    }
}

/// Reads a line without its end; none if it does not have these columns.
pub fn read_row(line: &str, columns: &[Column]) -> Option<Vec<Cell>> {
    let mut cells = Vec::with_capacity(columns.len());
    let mut rest = Some(line);
    for column in columns {
        let text = rest?;
        let (word, after) = match text.strip_prefix('"') {
            Some(inside) => closing(inside)?,
            None => match text.split_once(',') {
                Some((word, after)) => (word.to_owned(), Some(after)),
                None => (text.to_owned(), None),
            },
        };
        rest = after;
        cells.push(match column.kind {
            _ if word.is_empty() => Cell::Empty,
            Type::Integer => Cell::Integer(word.parse().ok()?),
            Type::Number => Cell::Number(word.parse().ok()?),
            Type::Text => Cell::Text(word),
        });
    }
    rest.is_none().then_some(cells)
}

/// A quoted text from behind its first quote, and what follows behind the comma.
fn closing(inside: &str) -> Option<(String, Option<&str>)> {
    let (mut word, mut rest) = (String::new(), inside);
    loop {
        let (before, after) = rest.split_once('"')?;
        word.push_str(before);
        match (after.strip_prefix('"'), after.strip_prefix(',')) {
            (Some(more), _) => {
                word.push('"');
                rest = more;
            }
            (None, Some(next)) => return Some((word, Some(next))),
            (None, None) => return after.is_empty().then_some((word, None)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_back_bit_for_bit() {
        let columns = [
            Column::new("task", Type::Integer),
            Column::new("x", Type::Number),
            Column::new("cause", Type::Text),
            Column::new("y", Type::Number),
        ];
        let texts = ["plain", "a, \"b\" # c", "", "\"", "é,"];
        let numbers = [0.1 + 0.2, -0.0, f64::MIN_POSITIVE / 4.0, f64::INFINITY, 1e300];
        for (text, number) in texts.into_iter().zip(numbers) {
            let text = if text.is_empty() { Cell::Empty } else { Cell::Text(text.into()) };
            let row = [Cell::Integer(u64::MAX), Cell::Number(number), text, Cell::Empty];
            let mut line = String::new();
            write_row(&mut line, row.iter());
            let back = read_row(line.trim_end_matches('\n'), &columns).unwrap();
            assert_eq!(back, row);
            let Cell::Number(read) = back[1] else { panic!("{back:?}") };
            assert_eq!(read.to_bits(), number.to_bits());
        }
        for damaged in ["1,2", "1,2,a,3,4", "x,2,a,3", "1,2,\"a,3", "1,2,\"a\"b,3"] {
            assert_eq!(read_row(damaged, &columns), None, "{damaged}");
        }
    }
}
