//! Numbers with units as problem files write them: `0.15`, `"150 mm"`, `"180 deg"`, or a table in their place.

use std::fmt;
use std::marker::PhantomData;

use airloop_series::units;
use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};
use toml::Spanned;

use super::source::Place;

/// A number, with the name of its unit where one was written.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    /// Number as written.
    pub value: f64,
    /// Unit as written; none: that of the variable.
    pub unit: Option<String>,
    /// Place in the file.
    pub place: Place,
}

/// A quantity, or a table in its place.
#[derive(Debug, Clone, PartialEq, JsonSchema)]
#[schemars(untagged, inline)]
pub enum QuantityOr<T> {
    /// One value.
    Quantity(Quantity),
    /// More than one value.
    Table(T),
}

/// Value in the file before it is read as a quantity. Unlike an untagged enum it keeps the places in the table.
pub(super) enum Raw<T> {
    Number(f64),
    Text(String),
    Table(T),
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Raw<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Raw<T>, D::Error> {
        deserializer.deserialize_any(RawVisitor(PhantomData))
    }
}

struct RawVisitor<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for RawVisitor<T> {
    type Value = Raw<T>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a number, or a text such as \"150 mm\"")
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Raw<T>, E> {
        Ok(Raw::Number(value as f64))
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Raw<T>, E> {
        Ok(Raw::Number(value))
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Raw<T>, E> {
        Ok(Raw::Text(value.to_owned()))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Raw<T>, A::Error> {
        T::deserialize(MapAccessDeserializer::new(map)).map(Raw::Table)
    }
}

impl<T> TryFrom<Spanned<Raw<T>>> for QuantityOr<T> {
    type Error = String;

    fn try_from(raw: Spanned<Raw<T>>) -> Result<QuantityOr<T>, String> {
        let place = Place(raw.span().start);
        let (value, unit) = match raw.into_inner() {
            Raw::Number(value) => (value, None),
            Raw::Text(text) => units::parse_quantity(&text)?,
            Raw::Table(table) => return Ok(QuantityOr::Table(table)),
        };
        Ok(QuantityOr::Quantity(Quantity { value, unit, place }))
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for QuantityOr<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<QuantityOr<T>, D::Error> {
        Spanned::<Raw<T>>::deserialize(deserializer)?.try_into().map_err(D::Error::custom)
    }
}

/// No table may stand there.
enum Never {}

impl<'de> Deserialize<'de> for Never {
    fn deserialize<D: Deserializer<'de>>(_: D) -> Result<Never, D::Error> {
        Err(D::Error::custom("this is a table; a number, or a text such as \"150 mm\" is wanted"))
    }
}

impl<'de> Deserialize<'de> for Quantity {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Quantity, D::Error> {
        match QuantityOr::<Never>::deserialize(deserializer)? {
            QuantityOr::Quantity(quantity) => Ok(quantity),
            QuantityOr::Table(never) => match never {},
        }
    }
}
