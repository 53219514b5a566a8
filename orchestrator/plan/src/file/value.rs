//! Values of a file with their places: texts, tables whose keys are names, choices and checked numbers.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::ops::{Deref, DerefMut};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserialize, Deserializer, Error};
use toml::Spanned;

use super::quantity::Quantity;
use super::source::Place;

/// A text with its place; texts are ordered by place.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Text {
    /// Where it stands.
    pub place: Place,
    /// The text.
    pub text: String,
}

/// A value with its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed<T> {
    /// Where it stands.
    pub place: Place,
    /// The value.
    pub value: T,
}

/// A table whose keys are names, in the order of the file.
#[derive(Debug, Clone, PartialEq, serde::Deserialize)]
#[serde(from = "BTreeMap<Text, T>")]
pub struct Entries<T>(pub Vec<(Text, T)>);

/// A start value of a parameter.
#[derive(Debug, Clone, PartialEq, serde::Deserialize, JsonSchema)]
#[serde(untagged, expecting = "a start value is a number, a text, true or false")]
#[schemars(inline)]
#[allow(missing_docs, reason = "kinds of values")]
pub enum StartValue {
    Truth(bool),
    Whole(i64),
    Number(f64),
    Text(String),
}

/// Start values of parameters: component.variable, or variable for a single FMU.
pub type Parameters = Entries<StartValue>;

impl fmt::Display for StartValue {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            StartValue::Truth(value) => value.fmt(f),
            StartValue::Whole(value) => value.fmt(f),
            StartValue::Number(value) => value.fmt(f),
            StartValue::Text(value) => value.fmt(f),
        }
    }
}

impl<'de> Deserialize<'de> for Text {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Text, D::Error> {
        let Placed { place, value } = Placed::deserialize(deserializer)?;
        Ok(Text { place, text: value })
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Placed<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Placed<T>, D::Error> {
        let spanned = Spanned::<T>::deserialize(deserializer)?;
        Ok(Placed { place: Place(spanned.span().start), value: spanned.into_inner() })
    }
}

impl<T> Deref for Placed<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> DerefMut for Placed<T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.value
    }
}

impl<T> From<BTreeMap<Text, T>> for Entries<T> {
    fn from(entries: BTreeMap<Text, T>) -> Entries<T> {
        Entries(entries.into_iter().collect())
    }
}

impl<T> Default for Entries<T> {
    fn default() -> Entries<T> {
        Entries(Vec::new())
    }
}

impl<T> Deref for Entries<T> {
    type Target = Vec<(Text, T)>;

    fn deref(&self) -> &Vec<(Text, T)> {
        &self.0
    }
}

impl<'a, T> IntoIterator for &'a Entries<T> {
    type Item = &'a (Text, T);
    type IntoIter = std::slice::Iter<'a, (Text, T)>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

/// The schema of a type is that of another; for types that are made from what is declared.
macro_rules! same_schema {
    ($([$($parameter:ident)?] $own:ty = $other:ty;)*) => {$(
        impl$(<$parameter: schemars::JsonSchema>)? schemars::JsonSchema for $own {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                <$other>::schema_name()
            }

            fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
                <$other>::json_schema(generator)
            }

            fn inline_schema() -> bool {
                <$other>::inline_schema()
            }
        }
    )*};
}
pub(crate) use same_schema;

same_schema! {
    [] Text = String;
    [T] Placed<T> = T;
    [T] Entries<T> = BTreeMap<String, T>;
}

impl JsonSchema for Quantity {
    fn schema_name() -> Cow<'static, str> {
        "Quantity".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A number in the unit of the variable, or a text with a unit such as \"150 mm\".",
            "anyOf": [{ "type": "number" }, { "type": "string", "pattern": r"^\s*[-+]?[0-9.]+([eE][-+]?[0-9]+)?.*$" }]
        })
    }
}

/// A type of another crate whose values have names in files.
pub trait Choice: Copy + 'static {
    /// Names and values.
    const CHOICES: &'static [(&'static str, Self)];
}

/// Reads one of the named values.
///
/// # Errors
/// A text that is none of the names; the message lists them.
pub fn choice<'de, D: Deserializer<'de>, T: Choice, R: From<T>>(deserializer: D) -> Result<R, D::Error> {
    let text = String::deserialize(deserializer)?;
    let names: Vec<&str> = T::CHOICES.iter().map(|(name, _)| *name).collect();
    let found = T::CHOICES.iter().find(|(name, _)| *name == text).map(|(_, value)| R::from(*value));
    found.ok_or_else(|| D::Error::custom(format!("`{text}` is none of {}", names.join(", "))))
}

/// The schema of [`choice`].
pub fn choices<T: Choice>(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "enum": T::CHOICES.iter().map(|(name, _)| *name).collect::<Vec<_>>() })
}

fn checked<'de, D, T, R>(deserializer: D, wanted: &str, good: impl Fn(&T) -> bool) -> Result<R, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + fmt::Display,
    R: From<T>,
{
    let value = T::deserialize(deserializer)?;
    match good(&value) {
        true => Ok(value.into()),
        false => Err(D::Error::custom(format!("this is {value}; {wanted} is wanted"))),
    }
}

/// A tolerance, above 0 and below 1.
///
/// # Errors
/// No number, or one outside of that range.
pub fn tolerance<'de, D: Deserializer<'de>, R: From<f64>>(deserializer: D) -> Result<R, D::Error> {
    checked(deserializer, "a tolerance between 0 and 1", |value| *value > 0.0 && *value < 1.0)
}

/// A number of 0 or more.
///
/// # Errors
/// No number, or a negative one.
pub fn not_negative<'de, D: Deserializer<'de>, R: From<f64>>(deserializer: D) -> Result<R, D::Error> {
    checked(deserializer, "a number of 0 or more", |value| *value >= 0.0)
}

/// A whole number of 1 or more.
///
/// # Errors
/// No whole number, or 0.
pub fn count<'de, D: Deserializer<'de>, R: From<usize>>(deserializer: D) -> Result<R, D::Error> {
    checked(deserializer, "a whole number of at least 1", |value| *value >= 1)
}

/// A number of intervals: 1 to 100,000. A problem with more does not fit into the memory of a machine.
///
/// # Errors
/// No whole number, or one outside of that range.
pub fn intervals<'de, D: Deserializer<'de>, R: From<usize>>(deserializer: D) -> Result<R, D::Error> {
    let value = count::<_, usize>(deserializer)?;
    if value <= 100_000 {
        return Ok(value.into());
    }
    Err(serde::de::Error::custom(format!("{value} intervals; allowed is a whole number of 1 to 100000")))
}

/// The default of factors and weights.
pub(super) fn one() -> f64 {
    1.0
}
