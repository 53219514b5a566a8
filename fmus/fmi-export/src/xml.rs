//! XML as text.
//!
//! Written by hand rather than through an XML library: the export crate sits in every FMU library and depends on
//! nothing.

use std::fmt::{Display, Write};

/// Shortest text that reads back to the same number.
pub fn number(x: f64) -> String {
    let text = format!("{x:?}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

/// Text that may stand in an XML attribute or element.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\n' => escaped.push_str("&#10;"),
            '\t' => escaped.push_str("&#9;"),
            '\r' => escaped.push_str("&#13;"),
            c => escaped.push(c),
        }
    }
    escaped
}

/// A start tag in the making.
pub(crate) struct Element {
    text: String,
}

impl Element {
    pub(crate) fn new(name: &str) -> Self {
        Self { text: format!("<{name}") }
    }

    pub(crate) fn with(mut self, name: &str, value: impl Display) -> Self {
        let value = escape(&value.to_string());
        write!(self.text, " {name}=\"{value}\"").expect("writing to a String cannot fail");
        self
    }

    pub(crate) fn with_some(self, name: &str, value: Option<impl Display>) -> Self {
        match value {
            Some(value) => self.with(name, value),
            None => self,
        }
    }
}

/// Lines with indentation by depth.
#[derive(Default)]
pub(crate) struct Xml {
    pub(crate) text: String,
    depth: usize,
}

impl Xml {
    pub(crate) fn line(&mut self, line: &str) {
        for _ in 0..self.depth {
            self.text.push_str("  ");
        }
        self.text.push_str(line);
        self.text.push('\n');
    }

    pub(crate) fn open(&mut self, element: Element) {
        self.line(&format!("{}>", element.text));
        self.depth += 1;
    }

    pub(crate) fn empty(&mut self, element: Element) {
        self.line(&format!("{}/>", element.text));
    }

    pub(crate) fn close(&mut self, name: &str) {
        self.depth -= 1;
        self.line(&format!("</{name}>"));
    }
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn numbers_read_back_to_themselves() {
        for x in [0.1, 1.0, -2.5e-300, 1e300, f64::MIN_POSITIVE, 1.0 / 3.0, 57.29577951308232] {
            assert_eq!(number(x).parse::<f64>(), Ok(x), "{}", number(x));
        }
    }
}
