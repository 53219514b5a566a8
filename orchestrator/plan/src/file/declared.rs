//! From the text of a file to the struct that declares it, with the place of what does not fit.

use airloop_series::declared::{self, Problem};
use serde::de::DeserializeOwned;
use toml::de::DeValue;

use super::source::{Place, Source};
use crate::Error;

/// Reads the text of a file into the type that declares its keys.
///
/// # Errors
/// [`Error::File`] with line, column, value and remedy.
pub fn read<T: DeserializeOwned>(source: &Source) -> Result<T, Error> {
    let refuse = |problem: Problem| source.error_at(Place(problem.at), problem.words);
    let document = declared::document(&source.text).map_err(refuse)?;
    document.get_ref().values().try_for_each(|value| finite(source, value))?;
    declared::from_document(document, &source.text).map_err(refuse)
}

/// Refuses `inf`, `nan`, and numbers too large to be told from them.
fn finite(source: &Source, value: &toml::Spanned<DeValue>) -> Result<(), Error> {
    match value.get_ref() {
        DeValue::Float(number) if !number.as_str().parse().is_ok_and(f64::is_finite) => {
            let problem = format!("`{}` is not a finite number", number.as_str());
            Err(source.error_at(Place(value.span().start), problem))
        }
        DeValue::Array(values) => values.iter().try_for_each(|value| finite(source, value)),
        DeValue::Table(values) => values.values().try_for_each(|value| finite(source, value)),
        _ => Ok(()),
    }
}
