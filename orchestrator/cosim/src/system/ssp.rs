//! Reading of SSP 1.0 and 2.0 system descriptions (`.ssd`): what the file says, names not yet resolved.
//!
//! Both versions share their namespaces; elements are recognized by namespace and local name. Parts that would
//! change the simulation but are not supported (nested systems, signal dictionaries, parameter mappings, mapping
//! transformations other than linear) are refused by name; geometry and annotations are skipped.

use std::collections::HashSet;
use std::path::{Component as PathPart, Path, PathBuf};

use super::Error;
use super::ssv::{self, Parameter};
use super::xml::{self, Attributes, Element};
use airloop_series::units::{Exponents, Unit};

/// Namespace of system descriptions, the same in SSP 1.0 and 2.0.
pub const NAMESPACE: &str = "http://ssp-standard.org/SSP1/SystemStructureDescription";

/// A system description as written.
#[derive(Debug, Clone)]
pub struct Structure {
    /// The `.ssd` file.
    pub file: PathBuf,
    /// Name of the system, or of the description if the system has none.
    pub name: String,
    /// Connectors of the system.
    pub connectors: Vec<Connector>,
    /// Components.
    pub components: Vec<ComponentElement>,
    /// Connections.
    pub connections: Vec<ConnectionElement>,
    /// Parameters bound at the system, prefix applied, later ones win.
    pub parameters: Vec<Parameter>,
    /// Declared units.
    pub units: Vec<(String, Unit)>,
    /// Start time of the default experiment \[s\].
    pub start_time: Option<f64>,
    /// Stop time of the default experiment \[s\].
    pub stop_time: Option<f64>,
}

/// A connector as written.
#[derive(Debug, Clone)]
pub struct Connector {
    /// Name.
    pub name: String,
    /// `input`, `output`, `parameter` ... from the point of view of its element.
    pub kind: String,
    /// Type element (`Real`, `Integer` ...), if given.
    pub data_type: Option<String>,
    /// Unit, if given.
    pub unit: Option<String>,
    /// Line in the file.
    pub line: usize,
}

/// A component as written.
#[derive(Debug, Clone)]
pub struct ComponentElement {
    /// Name.
    pub name: String,
    /// File of the FMU, relative paths resolved against the description.
    pub source: PathBuf,
    /// Name of that file in messages: the same, or its place inside of a package.
    pub shown: PathBuf,
    /// Connectors.
    pub connectors: Vec<Connector>,
    /// Parameters bound at the component.
    pub parameters: Vec<Parameter>,
    /// Line in the file.
    pub line: usize,
}

/// One end of a connection.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Endpoint {
    /// Component, or `None` for the system itself.
    pub element: Option<String>,
    /// Connector.
    pub connector: String,
}

impl std::fmt::Display for Endpoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.element {
            Some(element) => write!(f, "{element}.{}", self.connector),
            None => write!(f, "{} (system)", self.connector),
        }
    }
}

/// A connection as written.
#[derive(Debug, Clone)]
pub struct ConnectionElement {
    /// Source of the value.
    pub start: Endpoint,
    /// Destination.
    pub end: Endpoint,
    /// Value at the end = factor * value at the start + offset, in the unit of the end.
    pub transformation: Option<(f64, f64)>,
    /// The values are not converted between units.
    pub suppress_unit_conversion: bool,
    /// Line in the file.
    pub line: usize,
}

/// Reads a `.ssd` file with the `.ssv` files it refers to.
///
/// # Errors
/// [`Error`] names file, line and element.
pub fn read(file: &Path) -> Result<Structure, Error> {
    read_description(file, file, None)
}

/// Files that a description names as `source` of anything: FMUs, parameter sets, mappings; also those that are not
/// there.
///
/// # Errors
/// [`Error::Io`], [`Error::Xml`] for a file that cannot be read.
pub fn sources(file: &Path) -> Result<Vec<PathBuf>, Error> {
    let root = xml::read(file, file)?;
    let reader = Reader { file, base: file.parent().unwrap_or(Path::new("")), package: None };
    let mut found = Vec::new();
    let mut open = vec![&root];
    while let Some(element) = open.pop() {
        let source = element.attribute("source").and_then(|uri| reader.resolve(element, uri).ok());
        found.extend(source.map(|(path, _)| path));
        open.extend(&element.children);
    }
    Ok(found)
}

/// Reads the description of a package that is unpacked in `folder`; messages name places inside of `package`.
pub(super) fn read_unpacked(folder: &Path, package: &Path) -> Result<Structure, Error> {
    let file = folder.join(DESCRIPTION);
    if !file.is_file() {
        return Err(Error::NoDescription { file: package.into(), found: entries(folder) });
    }
    read_description(&file, &inside(package, Path::new(DESCRIPTION)), Some(package))
}

/// Name of the description at the root of a package.
const DESCRIPTION: &str = "SystemStructure.ssd";

/// A place inside of a package, for messages.
fn inside(package: &Path, place: &Path) -> PathBuf {
    PathBuf::from(format!("{}:{}", package.display(), place.display()))
}

/// Names at the root of an unpacked package, for messages.
fn entries(folder: &Path) -> String {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()))
        .collect();
    names.sort();
    names.join(", ")
}

fn read_description(file: &Path, shown: &Path, package: Option<&Path>) -> Result<Structure, Error> {
    let root = xml::read(file, shown)?;
    let base = file.parent().unwrap_or(Path::new(""));
    let file = shown;
    if root.name != "SystemStructureDescription" || root.namespace != NAMESPACE {
        let problem =
            format!("expected <SystemStructureDescription> of namespace {NAMESPACE}, found <{}>", root.name);
        return Err(Error::Xml { file: file.into(), line: root.line, problem });
    }
    Reader { file, base, package }.structure(&root)
}

/// Unpacks a `.ssp` archive into a temporary folder.
pub(super) fn unpack(file: &Path) -> Result<tempfile::TempDir, Error> {
    airloop_fmi::unpack_package(file).map_err(|error| Error::Archive(Box::new(error)))
}

struct Reader<'a> {
    /// For messages.
    file: &'a Path,
    /// Folder that relative sources start from.
    base: &'a Path,
    /// The package whose files lie in `base`; nothing outside of it may be used.
    package: Option<&'a Path>,
}

impl Reader<'_> {
    fn structure(&self, root: &Element) -> Result<Structure, Error> {
        let version = root.required("version", self.file)?;
        if !version.starts_with("1.") && !version.starts_with("2.") {
            return Err(self.unsupported(root, format!("SSP version {version}"), "use version 1.0 or 2.0"));
        }
        let system = root.child("System").ok_or_else(|| Error::Xml {
            file: self.file.into(),
            line: root.line,
            problem: "there is no <System>".into(),
        })?;
        let name = system.attribute("name").filter(|name| !name.is_empty()).or(root.attribute("name"));
        let experiment = root.child("DefaultExperiment");
        let time = |name| experiment.map_or(Ok(None), |node| node.number(name, self.file));
        if system.child("SignalDictionaries").is_some() {
            let node = system.child("SignalDictionaries").unwrap_or(system);
            return Err(self.unsupported(
                node,
                "a signal dictionary".into(),
                "connect the components directly",
            ));
        }
        Ok(Structure {
            file: self.file.into(),
            name: name.unwrap_or("system").to_owned(),
            connectors: self.connectors(system)?,
            components: self.components(system)?,
            connections: system
                .list("Connections")
                .filter(|node| node.name == "Connection")
                .map(|node| self.connection(node))
                .collect::<Result<_, _>>()?,
            parameters: self.bindings(system, self.file)?,
            units: units(root, self.file)?,
            start_time: time("startTime")?,
            stop_time: time("stopTime")?,
        })
    }

    fn unsupported(&self, node: &Element, feature: String, advice: &'static str) -> Error {
        Error::Unsupported { file: self.file.into(), line: node.line, feature, advice }
    }

    fn connectors(&self, element: &Element) -> Result<Vec<Connector>, Error> {
        let mut seen = HashSet::new();
        let mut connectors = Vec::new();
        for node in element.list("Connectors") {
            let name = node.required("name", self.file)?.to_owned();
            if !seen.insert(name.clone()) {
                return Err(self.duplicate(node, "connector", name));
            }
            const TYPES: [&str; 16] = [
                "Real",
                "Float64",
                "Float32",
                "Integer",
                "Int8",
                "Int16",
                "Int32",
                "Int64",
                "UInt8",
                "UInt16",
                "UInt32",
                "UInt64",
                "Boolean",
                "String",
                "Enumeration",
                "Binary",
            ];
            let typed = node.children.iter().find(|child| TYPES.contains(&child.name.as_str()));
            if let Some(dimension) = node.child("Dimension") {
                let feature = format!("the array connector `{name}`");
                return Err(self.unsupported(dimension, feature, "use one connector per element"));
            }
            connectors.push(Connector {
                name,
                kind: node.required("kind", self.file)?.to_owned(),
                data_type: typed.map(|typed| typed.name.clone()),
                unit: typed.and_then(|typed| typed.attribute("unit")).map(str::to_owned),
                line: node.line,
            });
        }
        Ok(connectors)
    }

    fn duplicate(&self, node: &Element, what: &'static str, name: String) -> Error {
        Error::Duplicate { file: self.file.into(), line: node.line, what, name }
    }

    fn components(&self, system: &Element) -> Result<Vec<ComponentElement>, Error> {
        let mut seen = HashSet::new();
        let mut components = Vec::new();
        for node in system.list("Elements") {
            let name = node.required("name", self.file)?.to_owned();
            match node.name.as_str() {
                "Component" => {}
                "System" | "SignalDictionaryReference" => {
                    let feature = format!("the nested <{}> `{name}`", node.name);
                    return Err(self.unsupported(node, feature, "put its components into the top system"));
                }
                _ => {
                    return Err(Error::UnknownElement {
                        file: self.file.into(),
                        line: node.line,
                        element: node.name.clone(),
                        parent: "Elements".into(),
                    });
                }
            }
            if name.contains('.') {
                return Err(Error::BadValue {
                    file: self.file.into(),
                    line: node.line,
                    what: "name of a component".into(),
                    value: name,
                    allowed: "a name without a dot; results are written as component.variable",
                });
            }
            if !seen.insert(name.clone()) {
                return Err(self.duplicate(node, "component", name));
            }
            let kind = node.attribute("type").unwrap_or("application/x-fmu-sharedlibrary");
            if kind != "application/x-fmu-sharedlibrary" {
                let feature = format!("component `{name}` of type {kind}");
                return Err(self.unsupported(node, feature, "use an FMU (application/x-fmu-sharedlibrary)"));
            }
            if node.attribute("implementation") == Some("ModelExchange") {
                let feature = format!("component `{name}` with implementation ModelExchange");
                return Err(self.unsupported(node, feature, "use the Co-Simulation implementation"));
            }
            let (source, shown) = self.resolve(node, node.required("source", self.file)?)?;
            components.push(ComponentElement {
                connectors: self.connectors(node)?,
                parameters: self.bindings(node, &shown)?,
                name,
                source,
                shown,
                line: node.line,
            });
        }
        Ok(components)
    }

    /// File behind a relative URI, an absolute path or a `file:` URI, and its name for messages. A package refers to
    /// its own files only: what comes from elsewhere must not load libraries of this machine.
    fn resolve(&self, node: &Element, uri: &str) -> Result<(PathBuf, PathBuf), Error> {
        let path = match uri.split_once("://") {
            Some(("file", rest)) => rest,
            Some(_) => {
                return Err(self.unsupported(node, format!("the source {uri}"), "use a relative path"));
            }
            None => uri.strip_prefix("file:").unwrap_or(uri),
        };
        let decoded = percent_decoded(path);
        let Some(package) = self.package else {
            let path = self.base.join(decoded);
            return Ok((path.clone(), path));
        };
        let place: PathBuf =
            Path::new(&decoded).components().filter(|part| *part != PathPart::CurDir).collect();
        if uri.starts_with("file:") || !place.components().all(|part| matches!(part, PathPart::Normal(_))) {
            let feature = format!("the source {uri}, which leads out of the package,");
            let advice = "put the file into the package, for example into resources/";
            return Err(self.unsupported(node, feature, advice));
        }
        Ok((self.base.join(&place), inside(package, &place)))
    }

    fn connection(&self, node: &Element) -> Result<ConnectionElement, Error> {
        let end = |element, connector: &'static str| {
            Ok(Endpoint {
                element: node.attribute(element).filter(|name| !name.is_empty()).map(str::to_owned),
                connector: node.required(connector, self.file)?.to_owned(),
            })
        };
        let mut transformation = None;
        for child in &node.children {
            match child.name.as_str() {
                "LinearTransformation" => {
                    let factor = child.number("factor", self.file)?.unwrap_or(1.0);
                    transformation = Some((factor, child.number("offset", self.file)?.unwrap_or(0.0)));
                }
                name if name.ends_with("MappingTransformation") => {
                    return Err(self.unsupported(
                        child,
                        format!("the {name}"),
                        "do the mapping in a component",
                    ));
                }
                _ => {}
            }
        }
        Ok(ConnectionElement {
            start: end("startElement", "startConnector")?,
            end: end("endElement", "endConnector")?,
            transformation,
            suppress_unit_conversion: matches!(node.attribute("suppressUnitConversion"), Some("true" | "1")),
            line: node.line,
        })
    }

    /// Parameters of all bindings of an element; `component` is the base of sources with `sourceBase="component"`.
    fn bindings(&self, element: &Element, component: &Path) -> Result<Vec<Parameter>, Error> {
        let mut parameters = Vec::new();
        for node in element.list("ParameterBindings") {
            if let Some(mapping) = node.child("ParameterMapping") {
                let advice = "name the parameters as the FMU does, or use `prefix`";
                return Err(self.unsupported(mapping, "a parameter mapping".into(), advice));
            }
            if node.attribute("sourceBase") == Some("component") {
                let feature = format!("a parameter set inside {}", component.display());
                return Err(self.unsupported(node, feature, "copy the .ssv file next to the description"));
            }
            let set = match (node.attribute("source"), node.child("ParameterValues")) {
                (Some(source), _) => {
                    let (set, shown) = self.resolve(node, source)?;
                    if !set.exists() {
                        return Err(Error::MissingSet {
                            file: self.file.into(),
                            line: node.line,
                            set: shown,
                        });
                    }
                    ssv::read_as(&set, &shown)?
                }
                (None, Some(values)) => {
                    let inner = values.children.first().ok_or_else(|| Error::Xml {
                        file: self.file.into(),
                        line: values.line,
                        problem: "<ParameterValues> is empty".into(),
                    })?;
                    ssv::parameter_set(inner, self.file)?
                }
                (None, None) => {
                    return Err(Error::MissingAttribute {
                        file: self.file.into(),
                        line: node.line,
                        element: node.name.clone(),
                        attribute: "source",
                    });
                }
            };
            let prefix = node.attribute("prefix").unwrap_or("");
            parameters.extend(
                set.into_iter()
                    .map(|parameter| Parameter { name: format!("{prefix}{}", parameter.name), ..parameter }),
            );
        }
        Ok(parameters)
    }
}

/// Units that a file declares with a definition.
pub(super) fn units(root: &Element, file: &Path) -> Result<Vec<(String, Unit)>, Error> {
    let mut units = Vec::new();
    for node in root.list("Units").filter(|node| node.name == "Unit") {
        let name = node.required("name", file)?.to_owned();
        let Some(base) = node.child("BaseUnit") else { continue };
        let exponent = |symbol: &'static str| -> Result<i32, Error> {
            let text = base.attribute(symbol).unwrap_or("0");
            text.trim().parse().map_err(|_| Error::BadValue {
                file: file.into(),
                line: base.line,
                what: format!("exponent {symbol} of unit `{name}`"),
                value: text.into(),
                allowed: "an integer",
            })
        };
        let exponents = Exponents {
            kg: exponent("kg")?,
            m: exponent("m")?,
            s: exponent("s")?,
            A: exponent("A")?,
            K: exponent("K")?,
            mol: exponent("mol")?,
            cd: exponent("cd")?,
            rad: exponent("rad")?,
        };
        let factor = base.number("factor", file)?.unwrap_or(1.0);
        let offset = base.number("offset", file)?.unwrap_or(0.0);
        units.push((name, Unit { exponents, factor, offset }));
    }
    Ok(units)
}

/// `%20` and the like as characters; anything else stays as it is.
fn percent_decoded(text: &str) -> String {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&first, tail)) = rest.split_first() {
        let code = tail.get(..2).filter(|_| first == b'%').and_then(|hex| std::str::from_utf8(hex).ok());
        match code.and_then(|hex| u8::from_str_radix(hex, 16).ok()) {
            Some(byte) => {
                bytes.push(byte);
                rest = &tail[2..];
            }
            None => {
                bytes.push(first);
                rest = tail;
            }
        }
    }
    String::from_utf8(bytes).unwrap_or_else(|_| text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percent_codes_in_sources_are_decoded() {
        assert_eq!(percent_decoded("a%20b%2Fc.fmu"), "a b/c.fmu");
        assert_eq!(percent_decoded("100%"), "100%");
    }
}
