//! XML as a small tree with line numbers, read with limits and without DTD, so that no entity can expand.
//!
//! Elements are known by local name and namespace, attributes by their name; of text outside of attributes is kept
//! whether there is some. What the elements mean is left to `fmu` and `system`.

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::name::ResolveResult;
use quick_xml::reader::NsReader;

/// Elements may be nested this deep.
const MAX_DEPTH: usize = 64;

/// A file may hold this many elements; each takes about 200 bytes of memory.
const MAX_ELEMENTS: usize = 2_000_000;

/// An element may have this many attributes; looking for repeated ones takes time with their square.
const MAX_ATTRIBUTES: usize = 100;

/// An element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Element {
    /// Name without prefix.
    pub name: String,
    /// URI of its namespace; empty if it has none, or a prefix that is not declared.
    pub namespace: String,
    /// Line in the file, from 1.
    pub line: usize,
    /// Names, those in a namespace with their prefix, and values, in file order.
    pub attributes: Vec<(String, String)>,
    /// It holds text other than white space.
    pub has_text: bool,
    /// Child elements in file order.
    pub children: Vec<Element>,
}

impl Element {
    /// Value of an attribute.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// The first child of a name.
    pub fn child(&self, name: &str) -> Option<&Element> {
        self.children.iter().find(|child| child.name == name)
    }

    /// All children of a name.
    pub fn children<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Element> + 'a {
        self.children.iter().filter(move |child| child.name == name)
    }
}

/// Reason why a text is not accepted as XML.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct XmlError {
    /// Line in the file, from 1.
    pub line: usize,
    /// Fault.
    pub message: String,
    /// The text is not UTF-8.
    pub is_encoding: bool,
}

/// Reads a whole document and returns its root.
///
/// # Errors
/// [`XmlError`] with the line of the fault: another encoding than UTF-8, or a document that is not well-formed.
pub fn parse(bytes: &[u8]) -> Result<Element, XmlError> {
    const UTF_16: [&[u8]; 4] = [b"\xFE\xFF", b"\xFF\xFE", b"<\0", b"\0<"];
    if UTF_16.iter().any(|start| bytes.starts_with(start)) {
        let message = "the file is UTF-16; save it in UTF-8".to_owned();
        return Err(XmlError { line: 1, message, is_encoding: true });
    }
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes).map_err(|error| XmlError {
        line: Lines::new(bytes).at(error.valid_up_to()),
        message: match declared_encoding(bytes) {
            Some(encoding) => format!("the file is written in {encoding}; save it in UTF-8"),
            None => "a byte that is not UTF-8; save the file in UTF-8".to_owned(),
        },
        is_encoding: true,
    })?;
    let mut lines = Lines::new(bytes);
    let mut reader = NsReader::from_str(text);
    let mut open: Vec<Element> = Vec::new();
    let mut root = None;
    let mut count = 0;
    loop {
        let line = lines.at(usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX));
        let error = |message: String| XmlError { line, message, is_encoding: false };
        let (namespace, event) =
            reader.read_resolved_event().map_err(|e| error(format!("this is not well-formed XML: {e}")))?;
        let namespace = match namespace {
            ResolveResult::Bound(namespace) => namespace.0.to_owned(),
            ResolveResult::Unbound | ResolveResult::Unknown(_) => String::new(),
        };
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
            Event::Text(text) if !text.chars().all(char::is_whitespace) => match open.last_mut() {
                Some(element) => {
                    element.has_text = true;
                    continue;
                }
                None => return Err(error("text outside of the root element".to_owned())),
            },
            Event::Eof => break,
            _ => continue,
        };
        if open.is_empty() && root.is_some() {
            return Err(error("a second root element".to_owned()));
        }
        if open.len() == MAX_DEPTH {
            return Err(error(format!("elements are nested more than {MAX_DEPTH} deep")));
        }
        count += 1;
        if count > MAX_ELEMENTS {
            return Err(error(format!("there are more than {MAX_ELEMENTS} elements")));
        }
        let element = element(&start, namespace, line).map_err(error)?;
        if closed { close(element, &mut open, &mut root) } else { open.push(element) }
    }
    match (open.pop(), root) {
        (Some(element), _) => Err(XmlError {
            line: element.line,
            message: format!("the element {} is not closed; the file may be truncated", element.name),
            is_encoding: false,
        }),
        (None, Some(root)) => Ok(root),
        (None, None) => {
            Err(XmlError { line: 1, message: "the file has no element".to_owned(), is_encoding: false })
        }
    }
}

/// The encoding that the XML declaration names, unless it is UTF-8.
fn declared_encoding(bytes: &[u8]) -> Option<String> {
    let declaration = String::from_utf8_lossy(&bytes[..bytes.len().min(200)]).into_owned();
    let declaration = declaration.strip_prefix("<?xml")?.split("?>").next()?.to_owned();
    let value = declaration.split_once("encoding")?.1.trim_start().strip_prefix('=')?.trim_start().to_owned();
    let quote = value.chars().next().filter(|quote| matches!(quote, '"' | '\''))?;
    let encoding = value[1..].split(quote).next()?.to_owned();
    (!encoding.eq_ignore_ascii_case("utf-8")).then_some(encoding)
}

fn close(element: Element, open: &mut [Element], root: &mut Option<Element>) {
    match open.last_mut() {
        Some(parent) => parent.children.push(element),
        None => *root = Some(element),
    }
}

fn element(start: &BytesStart<'_>, namespace: String, line: usize) -> Result<Element, String> {
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
        if attributes.len() == MAX_ATTRIBUTES {
            return Err(format!("the element {name} has more than {MAX_ATTRIBUTES} attributes"));
        }
        attributes.push((key.to_owned(), value.into_owned()));
    }
    Ok(Element { name, namespace, line, attributes, has_text: false, children: Vec::new() })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_have_local_name_namespace_and_line() {
        let text =
            "<?xml version=\"1.0\"?>\n<p:a xmlns:p=\"urn:x\" k=\"1 &lt; 2\">\n  <p:b/>\n  <c/>\n</p:a>";
        let root = parse(text.as_bytes()).unwrap();
        assert_eq!((root.name.as_str(), root.namespace.as_str(), root.line), ("a", "urn:x", 2));
        assert_eq!(root.attribute("k"), Some("1 < 2"));
        assert!(!root.has_text);
        assert_eq!((root.children[0].name.as_str(), root.children[0].line), ("b", 3));
        assert_eq!((root.children[1].namespace.as_str(), root.children[1].line), ("", 4));
    }

    #[test]
    fn broken_or_hostile_texts_are_refused_with_the_line() {
        let deep = "<a>\n".repeat(100);
        let cases = [
            ("", 1, "no element"),
            ("<a>\n<b></a>", 2, "not well-formed XML"),
            ("\n<a>\n", 2, "not closed"),
            ("<!DOCTYPE a [<!ENTITY x \"y\">]><a/>", 1, "DOCTYPE"),
            (deep.as_str(), 65, "nested more than 64 deep"),
            ("<a k=\"&nope;\"/>", 1, "nope"),
            ("<a/><b/>", 1, "second root"),
        ];
        let latin = b"<?xml version=\"1.0\" encoding='ISO-8859-1'?>\n<a k=\"\xE4\"/>";
        let error = parse(latin).unwrap_err();
        assert!(error.is_encoding && error.line == 2, "{error:?}");
        assert_eq!(error.message, "the file is written in ISO-8859-1; save it in UTF-8");
        let wide: Vec<u8> = "<a/>".encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert!(parse(&wide).unwrap_err().message.contains("UTF-16"));
        for (text, line, expected) in cases {
            let error = parse(text.as_bytes()).unwrap_err();
            assert!(error.line == line && error.message.contains(expected), "{text:.30}: {error:?}");
        }
    }
}
