//! `result.states.json`: a point of a run from which another process can go on.
//!
//! The bytes of every component are those of `fmi2SerializeFMUstate`; only the FMU that wrote them can read them.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// Version of the layout of the file; it grows when a field changes its meaning or goes.
pub const SCHEMA_VERSION: u32 = 1;

/// Contents of the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct States {
    /// [`SCHEMA_VERSION`] of the program that wrote the file.
    pub states_version: u32,
    /// Version of airloop.
    pub airloop_version: String,
    /// Communication point \[s\].
    pub time: f64,
    /// Macro steps before it.
    pub steps: u64,
    /// Rows of the result, and the one of this point.
    pub rows: RowsSoFar,
    /// Settings, FMUs and start values by name: a run that goes on has the same.
    pub run: BTreeMap<String, String>,
    /// State of every component, in evaluation order.
    pub components: Vec<ComponentState>,
    /// Values that are exchanged, and what the master carries from step to step, in hexadecimal digits.
    pub master: String,
}

/// Rows of a result up to a point.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct RowsSoFar {
    /// Rows in the file before the point.
    pub before: u64,
    /// Intervals of the output after which the next row is kept.
    pub next: f64,
    /// Whether the row of this point is left out once another comes.
    pub passing: bool,
}

/// State of a component.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ComponentState {
    /// Component.
    pub component: String,
    /// Serialized state in hexadecimal digits.
    pub state: String,
}

/// Reason why states cannot be read, or do not belong to a run.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct Error {
    /// File.
    pub path: PathBuf,
    /// Obstacle and remedy.
    pub problem: String,
}

/// Reads the file.
///
/// # Errors
/// It cannot be read, or is none of this version.
pub fn read(path: &Path) -> Result<States, Error> {
    let error = |problem: String| Error { path: path.into(), problem };
    let text = airloop_series::file::read(path)
        .map_err(|source| error(format!("the states cannot be read: {source}")))?;
    let states: States = serde_json::from_slice(&text).map_err(|source| {
        error(format!("these are no saved states of version {SCHEMA_VERSION}: {source}; give the folder of a run with --save-states, or its result.states.json"))
    })?;
    match states.states_version {
        SCHEMA_VERSION => Ok(states),
        other => Err(error(format!(
            "the saved states have version {other}, and this airloop reads {SCHEMA_VERSION}; continue the run with the version that began it, airloop {}",
            states.airloop_version
        ))),
    }
}

/// Writes the file in one piece, on the disk when this returns. Killed on the way it leaves the file as it was, and a
/// [`begun`] one.
///
/// # Errors
/// Those of the file system.
pub fn write(states: &States, path: &Path) -> std::io::Result<()> {
    let begun = begun(path);
    let mut out = std::io::BufWriter::new(std::fs::File::create(&begun)?);
    serde_json::to_writer(&mut out, states)?;
    out.write_all(b"\n")?;
    out.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_data()?;
    std::fs::rename(begun, path)
}

/// Name of the file while it is being written.
pub fn begun(path: &Path) -> PathBuf {
    path.with_extension("json.new")
}

impl States {
    /// The first of [`States::run`] that differs from `run`, as a sentence.
    pub(crate) fn difference(&self, run: &BTreeMap<String, String>) -> Option<String> {
        let names = self.run.keys().chain(run.keys());
        let name = names.into_iter().find(|name| self.run.get(*name) != run.get(*name))?;
        let of = |run: &BTreeMap<String, String>| {
            run.get(name).map_or("none".into(), |value| format!("`{value}`"))
        };
        Some(format!(
            "{name} was {} where the states were saved and is {} now; repeat the command of the run with --restart-from",
            of(&self.run),
            of(run)
        ))
    }
}

/// Bytes as hexadecimal digits.
pub(crate) fn hex(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 16] = b"0123456789abcdef";
    let digits = |byte: &u8| [byte >> 4, byte & 15].map(|digit| char::from(DIGITS[usize::from(digit)]));
    bytes.iter().flat_map(digits).collect()
}

/// The bytes of [`hex`]; `None` for other texts.
pub(crate) fn bytes(text: &str) -> Option<Vec<u8>> {
    let digit = |letter: u8| char::from(letter).to_digit(16);
    let pairs = text.as_bytes().chunks(2);
    pairs.map(|pair| Some((digit(pair[0])? << 4 | digit(*pair.get(1)?)?) as u8)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_read_back_to_all_bytes_and_other_texts_to_none() {
        let all: Vec<u8> = (0..=255).collect();
        assert_eq!(bytes(&hex(&all)).unwrap(), all);
        assert_eq!(hex(&[0, 15, 160]), "000fa0");
        assert_eq!((bytes("0"), bytes("0g"), bytes("")), (None, None, Some(Vec::new())));
    }
}
