//! Typed access to the attributes of an element; every error names line, element, attribute and value.

use std::fmt::Display;

use super::DescriptionError;
use crate::xml::Element;

/// Whether infinities are numbers too.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Range {
    /// Only finite values.
    Finite,
    /// Also plus and minus infinity, as bounds may be.
    Extended,
}

impl Element {
    /// An error at this element.
    pub(super) fn error(&self, message: impl Into<String>) -> DescriptionError {
        let element = match self.attribute("name") {
            Some(name) => format!("{} \"{name}\"", self.name),
            None => self.name.clone(),
        };
        DescriptionError { line: self.line, element, message: message.into() }
    }

    /// A text; empty if absent.
    pub(super) fn text(&self, name: &str) -> String {
        self.attribute(name).unwrap_or_default().to_owned()
    }

    /// A text that must be there and not be empty.
    pub(super) fn required(&self, name: &str) -> Result<&str, DescriptionError> {
        match self.attribute(name) {
            Some("") => Err(self.error(format!("the attribute {name} is empty"))),
            Some(value) => Ok(value),
            None => Err(self.error(format!("the attribute {name} is missing"))),
        }
    }

    /// A truth value.
    pub(super) fn boolean(&self, name: &str) -> Result<Option<bool>, DescriptionError> {
        self.attribute(name)
            .map(|value| match value.trim() {
                "true" | "1" => Ok(true),
                "false" | "0" => Ok(false),
                _ => Err(self.bad(name, value, "true or false")),
            })
            .transpose()
    }

    /// A truth value that is false if absent.
    pub(super) fn flag(&self, name: &str) -> Result<bool, DescriptionError> {
        Ok(self.boolean(name)?.unwrap_or(false))
    }

    /// A whole number.
    pub(super) fn integer<T: std::str::FromStr>(&self, name: &str) -> Result<Option<T>, DescriptionError> {
        self.attribute(name)
            .map(|value| {
                // XML schema allows a leading plus sign, as Rust does.
                value.trim().parse().map_err(|_| {
                    self.bad(
                        name,
                        value,
                        format_args!("a whole number that fits {}", std::any::type_name::<T>()),
                    )
                })
            })
            .transpose()
    }

    /// The value reference, which must be there.
    pub(super) fn value_reference(&self) -> Result<u32, DescriptionError> {
        self.integer("valueReference")?.ok_or_else(|| self.error("the attribute valueReference is missing"))
    }

    /// A real number.
    pub(super) fn real(&self, name: &str, range: Range) -> Result<Option<f64>, DescriptionError> {
        self.attribute(name)
            .map(|value| {
                let number: f64 = value.trim().parse().map_err(|_| self.bad(name, value, "a number"))?;
                let fine = number.is_finite() || (range == Range::Extended && number.is_infinite());
                if fine { Ok(number) } else { Err(self.bad(name, value, "a finite number")) }
            })
            .transpose()
    }

    /// One of several words.
    pub(super) fn word<T: Copy>(
        &self,
        name: &str,
        words: &[(&str, T)],
    ) -> Result<Option<T>, DescriptionError> {
        self.attribute(name)
            .map(|value| {
                words.iter().find(|(word, _)| *word == value).map(|&(_, meaning)| meaning).ok_or_else(|| {
                    let allowed: Vec<_> = words.iter().map(|(word, _)| *word).collect();
                    self.bad(name, value, format_args!("one of {}", allowed.join(", ")))
                })
            })
            .transpose()
    }

    /// An error about the value of an attribute.
    pub(super) fn bad(&self, name: &str, value: &str, allowed: impl Display) -> DescriptionError {
        self.error(format!("{name}=\"{value}\" where {allowed} is needed"))
    }
}
