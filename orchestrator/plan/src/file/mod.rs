//! The problem file: TOML with named variables and units, read with the line and column of everything.
//!
//! The structs are the declaration of the file: [`read()`] gives a [`Statement`], [`schema()`] describes it to editors.
//! The meaning of names and units in a system is left to [`crate::task`].

pub mod balance;
pub mod cycle;
pub mod declared;
pub mod feed_forward;
pub mod guess;
pub mod phase;
pub mod quantity;
pub mod source;
pub mod statement;
mod stick_figure;
pub mod value;

use std::path::{Path, PathBuf};

pub use quantity::{Quantity, QuantityOr};
pub use source::{Place, Source};
pub use statement::{Statement, TRANSCRIPTIONS, parse, transcription_name};
pub use stick_figure::{Angle, Length, Rod, StickFigure};
pub use value::{Entries, Parameters, Placed, StartValue, Text};

use crate::Error;

/// Reads a problem file.
///
/// # Errors
/// [`Error::Io`], or [`Error::File`] with line, column, value and remedy.
pub fn read(file: &Path) -> Result<Statement, Error> {
    parse(Source::read(file)?)
}

/// The file of a variant that a problem file names.
///
/// # Errors
/// [`Error::Place`] with the names that there are.
pub fn variant(statement: &Statement, name: &str) -> Result<PathBuf, Error> {
    let folder = statement.source.file.parent().unwrap_or(Path::new(""));
    let found = statement.variants.iter().find(|(own, _)| own.text == name);
    found.map(|(_, file)| folder.join(&file.text)).ok_or_else(|| {
        let known: Vec<&str> = statement.variants.iter().map(|(own, _)| own.text.as_str()).collect();
        let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
        let problem = format!("{} has no variant `{name}`; it has: {known}", statement.source.file.display());
        Error::Place { place: "--variant".into(), problem }
    })
}

/// JSON schema of the problem file.
pub fn schema() -> String {
    airloop_series::schema::schema_of::<Statement>()
}

#[cfg(test)]
mod tests;
