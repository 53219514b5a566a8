//! A small XML tree with namespaces and line numbers, for files of modest size.
//!
//! No document type definition, no external entity, bounded depth and size: a file from elsewhere cannot make the
//! reader use more than a small multiple of its own length.

use std::path::Path;

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::name::ResolveResult;
use quick_xml::reader::NsReader;

use super::Error;

/// Deepest nesting of elements.
const MAX_DEPTH: usize = 64;
/// Largest file \[bytes\].
const MAX_BYTES: u64 = 64 << 20;

/// An element.
#[derive(Debug, Clone)]
pub struct Node {
    /// Name without prefix.
    pub name: String,
    /// Namespace URI, empty if none.
    pub namespace: String,
    /// Line of the start tag, from 1.
    pub line: usize,
    /// Attributes without a prefix.
    pub attributes: Vec<(String, String)>,
    /// Child elements.
    pub children: Vec<Node>,
}

impl Node {
    /// Value of an attribute.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// Value of an attribute that must be there and not be empty.
    pub fn required(&self, name: &'static str, file: &Path) -> Result<&str, Error> {
        self.attribute(name).filter(|value| !value.is_empty()).ok_or_else(|| Error::MissingAttribute {
            file: file.into(),
            line: self.line,
            element: self.name.clone(),
            attribute: name,
        })
    }

    /// A number attribute, finite, with a default.
    pub fn number(&self, name: &'static str, file: &Path) -> Result<Option<f64>, Error> {
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

    /// First child of this name.
    pub fn child(&self, name: &str) -> Option<&Node> {
        self.children.iter().find(|child| child.name == name)
    }

    /// Children of the element `list`, if there is one (`Connectors` and its `Connector`s).
    pub fn list(&self, list: &str) -> impl Iterator<Item = &Node> {
        self.child(list).into_iter().flat_map(|list| list.children.iter())
    }
}

/// Reads a file into its root element; messages call it `shown`.
pub fn read(file: &Path, shown: &Path) -> Result<Node, Error> {
    let io = |source| Error::Io { file: shown.into(), source };
    let size = std::fs::metadata(file).map_err(io)?.len();
    if size > MAX_BYTES {
        let problem = format!("the file has {size} bytes, more than the {MAX_BYTES} that are read");
        return Err(Error::Xml { file: shown.into(), line: 1, problem });
    }
    let bytes = std::fs::read(file).map_err(io)?;
    let text = String::from_utf8(bytes).map_err(|_| Error::Xml {
        file: shown.into(),
        line: 1,
        problem: "the file is not UTF-8; save it in that encoding".into(),
    })?;
    parse(&text, shown)
}

/// Reads XML text; `file` is used in messages.
pub fn parse(text: &str, file: &Path) -> Result<Node, Error> {
    let text = text.trim_start_matches('\u{feff}');
    let mut lines = LineCounter { text, position: 0, line: 1 };
    let mut reader = NsReader::from_str(text);
    let mut open: Vec<Node> = Vec::new();
    let mut root = None;
    loop {
        let line = lines.at(reader.buffer_position());
        let failed = |problem: String| Error::Xml { file: file.into(), line, problem };
        let (namespace, event) = match reader.read_resolved_event() {
            Ok((ResolveResult::Bound(namespace), event)) => (namespace.0.to_owned(), event),
            Ok((ResolveResult::Unknown(prefix), _)) => {
                return Err(failed(format!("the namespace prefix `{prefix}` is not declared")));
            }
            Ok((ResolveResult::Unbound, event)) => (String::new(), event),
            Err(error) => return Err(failed(error.to_string())),
        };
        match event {
            Event::Start(start) => {
                if open.len() >= MAX_DEPTH {
                    return Err(failed(format!("elements are nested more than {MAX_DEPTH} deep")));
                }
                open.push(node(&start, namespace, line).map_err(failed)?);
            }
            Event::Empty(start) => {
                let node = node(&start, namespace, line).map_err(failed)?;
                close(node, &mut open, &mut root);
            }
            Event::End(_) => {
                let node = open.pop().ok_or_else(|| failed("an end tag without start tag".into()))?;
                close(node, &mut open, &mut root);
            }
            Event::DocType(_) => {
                return Err(failed(
                    "a document type definition is not allowed; remove <!DOCTYPE ...>".into(),
                ));
            }
            Event::Eof => break,
            _ => {}
        }
    }
    let line = lines.at(text.len() as u64);
    let failed = |problem: String| Error::Xml { file: file.into(), line, problem };
    if let Some(unclosed) = open.last() {
        return Err(failed(format!("<{}> of line {} is not closed", unclosed.name, unclosed.line)));
    }
    root.ok_or_else(|| failed("there is no element".into()))
}

fn close(node: Node, open: &mut [Node], root: &mut Option<Node>) {
    match open.last_mut() {
        Some(parent) => parent.children.push(node),
        None => *root = Some(node),
    }
}

fn node(start: &BytesStart, namespace: String, line: usize) -> Result<Node, String> {
    let mut attributes = Vec::new();
    for attribute in start.attributes() {
        let attribute = attribute.map_err(|error| error.to_string())?;
        let key: &str = attribute.key.as_ref();
        if key.contains(':') || key == "xmlns" {
            continue;
        }
        let value = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|error| error.to_string())?;
        attributes.push((key.to_owned(), value.into_owned()));
    }
    let name: &str = start.local_name().into_inner();
    Ok(Node { name: name.to_owned(), namespace, line, attributes, children: Vec::new() })
}

/// Turns growing byte positions into line numbers.
struct LineCounter<'a> {
    text: &'a str,
    position: usize,
    line: usize,
}

impl LineCounter<'_> {
    fn at(&mut self, position: u64) -> usize {
        let position = usize::try_from(position).unwrap_or(usize::MAX).min(self.text.len());
        // White space before a tag is an event of its own, so the position is that of the tag.
        self.line += self.text.as_bytes()[self.position..position].iter().filter(|&&b| b == b'\n').count();
        self.position = position;
        self.line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Result<Node, Error> {
        parse(text, Path::new("a.ssd"))
    }

    #[test]
    fn elements_have_local_name_namespace_and_line() {
        let root =
            of("<?xml version=\"1.0\"?>\n<p:a xmlns:p=\"urn:x\" k=\"1 &lt; 2\">\n  <p:b/>\n</p:a>").unwrap();
        assert_eq!((root.name.as_str(), root.namespace.as_str(), root.line), ("a", "urn:x", 2));
        assert_eq!(root.attribute("k"), Some("1 < 2"));
        assert_eq!((root.children[0].name.as_str(), root.children[0].line), ("b", 3));
    }

    #[test]
    fn broken_or_hostile_files_are_refused_with_the_line() {
        let deep = "<a>\n".repeat(100);
        let cases = [
            ("", "there is no element"),
            ("<a>\n<b></a>", "line 2"),
            ("<a>\n", "<a> of line 1 is not closed"),
            ("<!DOCTYPE a [<!ENTITY x \"y\">]><a/>", "document type definition"),
            ("<p:a/>", "prefix `p` is not declared"),
            (deep.as_str(), "line 65: elements are nested more than 64 deep"),
            ("<a k=\"&nope;\"/>", "nope"),
        ];
        for (text, expected) in cases {
            let message = of(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{text:.30}: {message}");
        }
    }
}
