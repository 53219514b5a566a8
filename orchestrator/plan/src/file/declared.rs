//! From the text of a file to the struct that declares it, and from the errors of serde to messages with their place.

use serde::de::DeserializeOwned;
use toml::de::{DeTable, DeValue, Deserializer};

use super::source::{Place, Source};
use crate::{Error, names};

/// Words of serde for what it found or wanted, and those of a message.
const FOUND: [(&str, &str); 6] = [
    ("string ", "the text "),
    ("integer ", "the whole number "),
    ("floating point ", "the number "),
    ("boolean ", ""),
    ("sequence", "a list"),
    ("map", "a table"),
];
const WANTED: [(&str, &str); 8] = [
    ("a string", "a text in quotes"),
    ("f64", "a number"),
    ("usize", "a whole number of at least 1"),
    ("i32", "a whole number"),
    ("a boolean", "true or false"),
    ("a sequence", "a list in brackets"),
    ("a map", "a table"),
    ("struct ", "a table"),
];

/// Reads the text of a file into the type that declares its keys.
///
/// # Errors
/// [`Error::File`] with line, column, value and remedy.
pub fn read<T: DeserializeOwned>(source: &Source) -> Result<T, Error> {
    let refuse = |error: &toml::de::Error| {
        let end = source.text.len();
        source.error_at(Place(error.span().map_or(end, |span| span.start)), words(error))
    };
    let document = DeTable::parse(&source.text).map_err(|error| refuse(&error))?;
    document.get_ref().values().try_for_each(|value| finite(source, value))?;
    T::deserialize(Deserializer::from(document)).map_err(|error| refuse(&error))
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

/// The message for an error of serde: the table or key that it is about, the value, and the key that was meant.
fn words(error: &toml::de::Error) -> String {
    let (message, whole) = (error.message(), error.to_string());
    // Only the display of an error without its text shows the path of keys.
    let path =
        whole.strip_prefix(message).and_then(|rest| rest.trim().strip_prefix("in `")?.strip_suffix('`'));
    let table = path.map_or("the file".to_owned(), |path| format!("[{path}]"));
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let key = path.map_or(String::new(), |path| format!("`{path}`: "));
    let begins = |with: &str| message.strip_prefix(with);
    match &quoted[..] {
        [name, known @ ..] if begins("unknown field").is_some() => {
            format!("{table} has no key `{name}`; {}", names::suggestion(name, known.iter().copied()))
        }
        [name, known @ ..] if begins("unknown variant").is_some() => {
            format!("{key}`{name}` is none of {}", known.join(", "))
        }
        [name, ..] if begins("missing field").is_some() => format!("{table} has no `{name}`; add it"),
        _ => {
            let wrong = begins("invalid type: ").or(begins("invalid value: "));
            match wrong.and_then(|rest| rest.rsplit_once(", expected ")) {
                Some((found, wanted)) => {
                    format!(
                        "{key}this is {}; {} is wanted",
                        in_words(found, &FOUND),
                        in_words(wanted, &WANTED)
                    )
                }
                None => format!("{key}{message}"),
            }
        }
    }
}

/// A phrase of serde in the words of a message; a value that follows it stays.
fn in_words(phrase: &str, words: &[(&str, &str)]) -> String {
    let found = words.iter().find_map(|(own, word)| Some((phrase.strip_prefix(own)?, *word)));
    match found {
        Some((rest, word)) if rest.starts_with(['`', '"']) => format!("{word}{rest}"),
        Some((_, word)) => word.to_owned(),
        None => phrase.to_owned(),
    }
}
