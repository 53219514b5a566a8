//! XML as a small tree with line numbers, read with limits and without DTD, so that no entity can expand.
//!
//! Elements and attributes are known by their local name; text outside of attributes is not kept.

use quick_xml::Reader;
use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};

/// Elements may be nested this deep.
const MAX_DEPTH: usize = 64;

/// An element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Element {
    /// Name without prefix.
    pub(crate) name: String,
    /// Line in the file, from 1.
    pub(crate) line: usize,
    /// Names without prefix, and values, in file order.
    pub(crate) attributes: Vec<(String, String)>,
    /// Child elements in file order.
    pub(crate) children: Vec<Element>,
}

impl Element {
    /// Value of an attribute.
    pub(crate) fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// The first child of a name.
    pub(crate) fn child(&self, name: &str) -> Option<&Element> {
        self.children.iter().find(|child| child.name == name)
    }

    /// All children of a name.
    pub(crate) fn children<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Element> + 'a {
        self.children.iter().filter(move |child| child.name == name)
    }
}

/// Why a text is not accepted as XML.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct XmlError {
    /// Line in the file, from 1.
    pub(crate) line: usize,
    /// What is wrong.
    pub(crate) message: String,
}

/// Reads a whole document and returns its root.
pub(crate) fn parse(bytes: &[u8]) -> Result<Element, XmlError> {
    if bytes.starts_with(&[0xFE, 0xFF]) || bytes.starts_with(&[0xFF, 0xFE]) {
        return Err(XmlError { line: 1, message: "the file is UTF-16; FMI 2.0 asks for UTF-8".to_owned() });
    }
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes).map_err(|error| XmlError {
        line: Lines::new(bytes).at(error.valid_up_to()),
        message: "a byte that is no UTF-8; save the file in UTF-8, which FMI 2.0 asks for".to_owned(),
    })?;
    let mut lines = Lines::new(bytes);
    let mut reader = Reader::from_str(text);
    let mut open: Vec<Element> = Vec::new();
    let mut root = None;
    loop {
        let line = lines.at(usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX));
        let error = |message: String| XmlError { line, message };
        let event = reader.read_event().map_err(|e| error(format!("this is no well-formed XML: {e}")))?;
        // The line of the tag itself: the event before ends where this one starts.
        let (start, closed) = match event {
            Event::Start(start) => (start, false),
            Event::Empty(start) => (start, true),
            Event::End(_) => {
                let element = open.pop().ok_or_else(|| error("an end tag without a start tag".to_owned()))?;
                close(element, &mut open, &mut root);
                continue;
            }
            Event::DocType(_) => {
                return Err(error("a DOCTYPE is refused: the file may not define entities".to_owned()));
            }
            Event::Text(text) if open.is_empty() && !text.chars().all(char::is_whitespace) => {
                return Err(error("text outside of the root element".to_owned()));
            }
            Event::Eof => break,
            _ => continue,
        };
        if open.is_empty() && root.is_some() {
            return Err(error("a second root element".to_owned()));
        }
        if open.len() == MAX_DEPTH {
            return Err(error(format!("elements are nested more than {MAX_DEPTH} deep")));
        }
        let element = element(&start, line).map_err(error)?;
        if closed { close(element, &mut open, &mut root) } else { open.push(element) }
    }
    match (open.pop(), root) {
        (Some(element), _) => Err(XmlError {
            line: element.line,
            message: format!("the element {} is not closed; the file may be truncated", element.name),
        }),
        (None, Some(root)) => Ok(root),
        (None, None) => Err(XmlError { line: 1, message: "the file has no element".to_owned() }),
    }
}

fn close(element: Element, open: &mut [Element], root: &mut Option<Element>) {
    match open.last_mut() {
        Some(parent) => parent.children.push(element),
        None => *root = Some(element),
    }
}

fn element(start: &BytesStart<'_>, line: usize) -> Result<Element, String> {
    let name = local(start.name().as_ref()).to_owned();
    let mut attributes = Vec::new();
    for attribute in start.attributes() {
        let attribute = attribute.map_err(|error| format!("in element {name}: {error}"))?;
        let key = attribute.key.as_ref();
        if key == "xmlns" || key.starts_with("xmlns:") {
            continue;
        }
        let value = attribute
            .normalized_value(XmlVersion::Implicit1_0)
            .map_err(|error| format!("in element {name}, attribute {key}: {error}"))?;
        attributes.push((local(key).to_owned(), value.into_owned()));
    }
    Ok(Element { name, line, attributes, children: Vec::new() })
}

fn local(name: &str) -> &str {
    name.rsplit_once(':').map_or(name, |(_, local)| local)
}

/// Turns growing byte positions into line numbers.
struct Lines<'a> {
    bytes: &'a [u8],
    position: usize,
    line: usize,
}

impl<'a> Lines<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Lines { bytes, position: 0, line: 1 }
    }

    /// The line of `position`, which must not go back between calls.
    fn at(&mut self, position: usize) -> usize {
        let end = position.min(self.bytes.len());
        if let Some(passed) = self.bytes.get(self.position..end) {
            self.line += passed.iter().filter(|&&byte| byte == b'\n').count();
            self.position = end;
        }
        self.line
    }
}
