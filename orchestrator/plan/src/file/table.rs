//! Tables of a problem file read key by key: every key is wanted by name, what nobody wanted is an error with its
//! place.

use std::cell::RefCell;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::quantity::{self, Quantity};
use super::source::{Place, Source};
use crate::{Error, names};

/// A text with its place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Text {
    /// The text.
    pub text: String,
    /// Place in the file.
    pub place: Place,
}

/// A value of the file with what it belongs to.
#[derive(Clone, Copy)]
pub struct Value<'a> {
    source: &'a Source,
    value: &'a Spanned<DeValue<'a>>,
}

/// A table of the file, and which keys were asked for.
pub struct Table<'a> {
    source: &'a Source,
    place: Place,
    entries: &'a DeTable<'a>,
    /// Words for the table in messages, e.g. `[settings]`.
    name: String,
    known: RefCell<Vec<&'static str>>,
}

/// The value in the words of a message.
fn kind(value: &DeValue) -> &'static str {
    match value {
        DeValue::String(_) => "a text",
        DeValue::Integer(_) => "a whole number",
        DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "a truth value",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a table",
    }
}

impl<'a> Value<'a> {
    /// Place in the file.
    pub fn place(&self) -> Place {
        self.source.place(&self.value.span())
    }

    /// Error at this value.
    pub fn error(&self, problem: impl Into<String>) -> Error {
        self.source.error(&self.value.span(), problem)
    }

    fn wrong(&self, wanted: &str) -> Error {
        self.error(format!("this is {}; {wanted} is wanted", kind(self.value.get_ref())))
    }

    /// A text.
    ///
    /// # Errors
    /// [`Error::File`] for anything else; so in the functions below.
    pub fn text(&self) -> Result<Text, Error> {
        match self.value.get_ref() {
            DeValue::String(text) => Ok(Text { text: text.to_string(), place: self.place() }),
            _ => Err(self.wrong("a text in quotes")),
        }
    }

    /// A finite number without unit.
    pub fn number(&self) -> Result<f64, Error> {
        let (text, radix) = match self.value.get_ref() {
            DeValue::Float(number) => (number.as_str(), 10),
            DeValue::Integer(number) => (number.as_str(), number.radix()),
            _ => return Err(self.wrong("a number")),
        };
        let number = match radix {
            10 => text.parse().ok(),
            radix => i64::from_str_radix(text, radix).ok().map(|number| number as f64),
        };
        match number {
            Some(number) if f64::is_finite(number) => Ok(number),
            _ => Err(self.error(format!("`{text}` is not a finite number"))),
        }
    }

    /// A whole number of at least `least`.
    pub fn whole(&self, least: usize) -> Result<usize, Error> {
        let number = match self.value.get_ref() {
            DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix()).ok(),
            _ => None,
        };
        match number.and_then(|number| usize::try_from(number).ok()).filter(|number| *number >= least) {
            Some(number) => Ok(number),
            None => {
                let found = &self.source.text[self.value.span()];
                Err(self.error(format!("`{found}` is not a whole number of at least {least}")))
            }
        }
    }

    /// A number, or a text of number and unit.
    pub fn quantity(&self) -> Result<Quantity, Error> {
        if let DeValue::String(text) = self.value.get_ref() {
            let (value, unit) = quantity::parse(text).map_err(|problem| self.error(problem))?;
            return Ok(Quantity { value, unit, place: self.place() });
        }
        match self.value.get_ref() {
            DeValue::Float(_) | DeValue::Integer(_) => {
                Ok(Quantity { value: self.number()?, unit: None, place: self.place() })
            }
            _ => Err(self.wrong("a number, or a text such as \"150 mm\"")),
        }
    }

    /// `true` or `false`.
    pub fn truth(&self) -> Result<bool, Error> {
        self.value.get_ref().as_bool().ok_or_else(|| self.wrong("true or false"))
    }

    /// The values of a list.
    pub fn list(&self) -> Result<Vec<Value<'a>>, Error> {
        match self.value.get_ref() {
            DeValue::Array(values) => {
                Ok(values.iter().map(|value| Value { source: self.source, value }).collect())
            }
            _ => Err(self.wrong("a list in brackets")),
        }
    }

    /// Whether it is a table.
    pub fn is_table(&self) -> bool {
        self.value.get_ref().is_table()
    }

    /// The table, called `name` in messages.
    pub fn table(&self, name: &str) -> Result<Table<'a>, Error> {
        match self.value.get_ref() {
            DeValue::Table(entries) => Ok(Table {
                source: self.source,
                place: self.place(),
                entries,
                name: name.into(),
                known: RefCell::default(),
            }),
            _ => Err(self.wrong("a table")),
        }
    }

    /// One of the named choices.
    pub fn choice<T: Copy>(&self, choices: &[(&str, T)]) -> Result<T, Error> {
        let text = self.text()?.text;
        let found = choices.iter().find(|(name, _)| *name == text);
        found.map(|(_, choice)| *choice).ok_or_else(|| {
            let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
            self.error(format!("`{text}` is none of {}", names.join(", ")))
        })
    }
}

impl<'a> Table<'a> {
    /// The whole document; `document` is the parsed text of `source`.
    pub fn root(source: &'a Source, document: &'a DeTable<'a>) -> Table<'a> {
        let place = Place { line: 1, column: 1 };
        Table { source, place, entries: document, name: "the file".into(), known: RefCell::default() }
    }

    /// Error that concerns the table as a whole.
    pub fn error(&self, problem: impl Into<String>) -> Error {
        self.source.error_at(self.place, problem)
    }

    /// Place in the file.
    pub fn place(&self) -> Place {
        self.place
    }

    /// The value of a key, where it is there.
    pub fn get(&self, key: &'static str) -> Option<Value<'a>> {
        self.known.borrow_mut().push(key);
        self.entries.get(key).map(|value| Value { source: self.source, value })
    }

    /// The value of a key.
    ///
    /// # Errors
    /// [`Error::File`] when it is not there.
    pub fn need(&self, key: &'static str) -> Result<Value<'a>, Error> {
        self.get(key).ok_or_else(|| self.error(format!("{} has no `{key}`; add it", self.name)))
    }

    /// Value of a key as converted by `read`, where it is there.
    ///
    /// # Errors
    /// Those of `read`.
    pub fn maybe<T>(
        &self,
        key: &'static str,
        read: impl FnOnce(Value<'a>) -> Result<T, Error>,
    ) -> Result<Option<T>, Error> {
        self.get(key).map(read).transpose()
    }

    /// All entries in the order of the file, for tables whose keys are names.
    pub fn entries(&self) -> Vec<(Text, Value<'a>)> {
        let mut entries: Vec<_> = self.entries.iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        let entry = |(key, value): (&'a Spanned<std::borrow::Cow<'a, str>>, &'a Spanned<DeValue<'a>>)| {
            let name = Text { text: key.get_ref().to_string(), place: self.source.place(&key.span()) };
            (name, Value { source: self.source, value })
        };
        entries.into_iter().map(entry).collect()
    }

    /// Refuses keys that nobody asked for.
    ///
    /// # Errors
    /// [`Error::File`] names the first of them and what was meant.
    pub fn finish(&self) -> Result<(), Error> {
        let known = self.known.borrow();
        for (key, _) in self.entries() {
            if !known.contains(&key.text.as_str()) {
                let meant = names::suggestion(&key.text, known.iter().copied());
                let problem = format!("{} has no key `{}`; {meant}", self.name, key.text);
                return Err(self.source.error_at(key.place, problem));
            }
        }
        Ok(())
    }
}
