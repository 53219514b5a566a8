//! Elements and attributes as text, indented, with everything escaped that an attribute must not hold.

use std::path::Path;

use crate::system::Error;

/// A growing document.
pub(super) struct Xml {
    text: String,
    open: Vec<&'static str>,
    /// The first value that XML 1.0 cannot hold in any spelling.
    refused: Option<String>,
}

impl Xml {
    pub fn new() -> Xml {
        Xml { text: "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n".into(), open: Vec::new(), refused: None }
    }

    /// An element with content.
    pub fn open(&mut self, name: &'static str, attributes: &[(&str, &str)]) {
        self.start(name, attributes);
        self.text.push_str(">\n");
        self.open.push(name);
    }

    /// An element without content.
    pub fn empty(&mut self, name: &str, attributes: &[(&str, &str)]) {
        self.start(name, attributes);
        self.text.push_str("/>\n");
    }

    /// Ends the element that was opened last.
    pub fn close(&mut self) {
        if let Some(name) = self.open.pop() {
            self.indent();
            self.text.push_str(&format!("</{name}>\n"));
        }
    }

    /// The whole text.
    ///
    /// # Errors
    /// [`Error::Unwritable`] for control characters, which XML does not know.
    pub fn finish(self, file: &Path) -> Result<String, Error> {
        match self.refused {
            None => Ok(self.text),
            Some(value) => Err(Error::Unwritable {
                file: file.into(),
                what: format!("the text {value:?}"),
                problem: "it has a control character, which XML cannot hold; choose another text".into(),
            }),
        }
    }

    fn start(&mut self, name: &str, attributes: &[(&str, &str)]) {
        self.indent();
        self.text.push('<');
        self.text.push_str(name);
        for (key, value) in attributes {
            if self.refused.is_none() && !value.chars().all(allowed) {
                self.refused = Some((*value).to_owned());
            }
            self.text.push_str(&format!(" {key}=\"{}\"", escaped(value)));
        }
    }

    fn indent(&mut self) {
        self.text.extend(std::iter::repeat_n("  ", self.open.len()));
    }
}

/// Characters of XML 1.0 (section 2.2).
fn allowed(c: char) -> bool {
    matches!(c, '\t' | '\n' | '\r' | '\u{20}'..='\u{D7FF}' | '\u{E000}'..='\u{FFFD}' | '\u{10000}'..)
}

/// Line ends and tabs as references: readers turn plain ones in attributes into spaces.
fn escaped(text: &str) -> String {
    let mut result = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => result.push_str("&amp;"),
            '<' => result.push_str("&lt;"),
            '>' => result.push_str("&gt;"),
            '"' => result.push_str("&quot;"),
            '\t' | '\n' | '\r' => result.push_str(&format!("&#{};", u32::from(c))),
            _ => result.push(c),
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_text_comes_back_from_an_attribute() {
        let text = " a \"b\" <c> & 'd'\n\te\r\u{e4}\u{1F600} ";
        let mut xml = Xml::new();
        xml.open("x", &[]);
        xml.empty("y", &[("k", text)]);
        xml.close();
        let root = airloop_fmi::xml::parse(xml.finish(Path::new("a.ssd")).unwrap().as_bytes()).unwrap();
        assert_eq!(root.children[0].attribute("k"), Some(text));
    }

    #[test]
    fn control_characters_are_refused() {
        let mut xml = Xml::new();
        xml.empty("y", &[("k", "bell \u{7}")]);
        let message = xml.finish(Path::new("a.ssd")).unwrap_err().to_string();
        assert!(message.starts_with("a.ssd: ") && message.contains("\\u{7}"), "{message}");
    }
}
