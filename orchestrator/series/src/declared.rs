//! From the text of a TOML file to the struct that declares it, and from the errors of serde to messages that a user
//! understands: the table or key, the value, and the key that was meant.

use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, Deserializer};

use crate::names;

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

/// Something that does not fit in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// Where, in bytes from the beginning.
    pub at: usize,
    /// The problem, and what to do.
    pub words: String,
}

impl Problem {
    fn of(error: &toml::de::Error, text: &str) -> Problem {
        Problem { at: error.span().map_or(text.len(), |span| span.start), words: words(error) }
    }
}

/// Values of a text, not yet of a type.
///
/// # Errors
/// A text that is no TOML.
pub fn document(text: &str) -> Result<Spanned<DeTable<'_>>, Problem> {
    DeTable::parse(text).map_err(|error| Problem::of(&error, text))
}

/// The type that declares the keys of `document`, the values of `text`.
///
/// # Errors
/// A key that there is not, one that is missing, or a value of another type.
pub fn from_document<T: DeserializeOwned>(document: Spanned<DeTable<'_>>, text: &str) -> Result<T, Problem> {
    T::deserialize(Deserializer::from(document)).map_err(|error| Problem::of(&error, text))
}

/// Reads the text of a file into the type that declares its keys.
///
/// # Errors
/// Those of [`document`] and [`from_document`].
pub fn read<T: DeserializeOwned>(text: &str) -> Result<T, Problem> {
    from_document(document(text)?, text)
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

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only the reading is looked at")]
    struct Body {
        mass: f64,
        #[serde(default)]
        is_fixed: bool,
    }

    fn refused(text: &str) -> (usize, String) {
        let problem = read::<BTreeMap<String, Body>>(text).unwrap_err();
        (problem.at, problem.words)
    }

    #[test]
    fn errors_name_table_key_and_remedy() {
        let (at, words) = refused("[cart]\nmass = 1\nis_fixd = true\n");
        assert_eq!((at, &words[..]), (16, "[cart] has no key `is_fixd`; did you mean `is_fixed`?"));
        assert_eq!(refused("[cart]\nis_fixed = true\n").1, "[cart] has no `mass`; add it");
        assert_eq!(
            refused("[cart]\nmass = \"1\"\n").1,
            "`cart.mass`: this is the text \"1\"; a number is wanted"
        );
        assert!(refused("[cart\n").1.contains("unclosed table"), "{:?}", refused("[cart\n"));
    }
}
