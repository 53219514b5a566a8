//! Elements of system descriptions and parameter sets: what they must have, as errors with file and line.

use std::path::Path;

use super::Error;
pub(super) use airloop_fmi::xml::Element;

/// Largest file \[bytes\].
const MAX_BYTES: u64 = 64 << 20;

/// Attributes that SSP files may require of an element.
pub(super) trait Attributes {
    /// Value of an attribute that must be there and not be empty.
    fn required(&self, name: &'static str, file: &Path) -> Result<&str, Error>;

    /// A number attribute, finite, if it is there.
    fn number(&self, name: &'static str, file: &Path) -> Result<Option<f64>, Error>;

    /// Children of the element `list`, if there is one (`Connectors` and its `Connector`s).
    fn list(&self, list: &str) -> impl Iterator<Item = &Element>;
}

impl Attributes for Element {
    fn required(&self, name: &'static str, file: &Path) -> Result<&str, Error> {
        self.attribute(name).filter(|value| !value.is_empty()).ok_or_else(|| Error::MissingAttribute {
            file: file.into(),
            line: self.line,
            element: self.name.clone(),
            attribute: name,
        })
    }

    fn number(&self, name: &'static str, file: &Path) -> Result<Option<f64>, Error> {
        let Some(text) = self.attribute(name) else { return Ok(None) };
        match text.trim().parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(Some(value)),
            _ => Err(Error::BadValue {
                file: file.into(),
                line: self.line,
                what: format!("{name} of <{}>", self.name),
                value: text.into(),
                allowed: "a finite number",
            }),
        }
    }

    fn list(&self, list: &str) -> impl Iterator<Item = &Element> {
        self.child(list).into_iter().flat_map(|list| list.children.iter())
    }
}

/// Reads a file into its root element; messages call it `shown`.
pub(super) fn read(file: &Path, shown: &Path) -> Result<Element, Error> {
    let io = |source| Error::Io { file: shown.into(), source };
    let size = std::fs::metadata(file).map_err(io)?.len();
    if size > MAX_BYTES {
        let problem = format!("the file has {size} bytes, more than the {MAX_BYTES} that are read");
        return Err(Error::Xml { file: shown.into(), line: 1, problem });
    }
    parse(&airloop_series::file::read(file).map_err(io)?, shown)
}

/// Reads XML; `file` is used in messages.
pub(super) fn parse(bytes: &[u8], file: &Path) -> Result<Element, Error> {
    airloop_fmi::xml::parse(bytes).map_err(|error| Error::Xml {
        file: file.into(),
        line: error.line,
        problem: error.message,
    })
}
