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
use schemars::generate::SchemaSettings;
use schemars::transform::RecursiveTransform;
use schemars::{JsonSchema, Schema};
use serde_json::Value;
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

/// JSON schema of a file, for editors that complete and check TOML.
pub fn schema_of<T: JsonSchema>() -> String {
    let settings = SchemaSettings::draft07().with_transform(RecursiveTransform(without_null));
    let schema = settings.into_generator().into_root_schema_for::<T>();
    serde_json::to_string_pretty(&schema).expect("a schema is a JSON value") + "\n"
}

/// Takes `null` out of a schema: a key of TOML that may be left out has no other value for nothing.
fn without_null(schema: &mut Schema) {
    if let Some(Value::Array(kinds)) = schema.get_mut("type")
        && let [kind, Value::String(null)] = &kinds[..]
        && null == "null"
    {
        let kind = kind.clone();
        schema.insert("type".into(), kind);
    }
    if let Some(Value::Array(choices)) = schema.get_mut("anyOf") {
        choices.retain(|one| one["type"] != "null");
    }
    if schema.get("default") == Some(&Value::Null) {
        schema.remove("default");
    }
}

/// JSON schema of the problem file.
pub fn schema() -> String {
    schema_of::<Statement>()
}

#[cfg(test)]
mod tests;
