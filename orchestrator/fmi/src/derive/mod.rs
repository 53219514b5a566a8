//! Derived FMUs: the library of a template with a name, a GUID and start values of its own.
//!
//! The template is one of the project's FMUs, whose libraries read `resources/start_values.toml` (the format stands in
//! `fmi-export`). Where the templates are is left to [`super::template_folder`]; which values to give, to the caller.

mod description;
mod documentation;
mod error;
mod exposed;
mod start_values;

use std::path::Path;

use super::archive::bad_name;
use super::open::Fmu;
use crate::{Causality, Initial, ModelDescription, Variable};

pub use error::DeriveError;
pub use exposed::expose;

/// Exporter whose libraries read start values from their resources.
const EXPORTER: &str = "fmi-export";
/// Its name until version 0.2.
const EARLIER_EXPORTER: &str = "fmi2-export";
/// The resource that holds them.
const START_VALUES: &str = "start_values.toml";
/// First page of the documentation.
const PAGE: &str = "documentation/index.html";

/// Identity and start values of the derived FMU.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Derivation {
    /// `modelName`, shown to users; not empty.
    pub name: String,
    /// One sentence; becomes `description`. Empty: that of the template.
    pub description: String,
    /// Start values by variable name, in the unit of the variable; all others stay those of the template.
    pub start: Vec<(String, Value)>,
    /// Further files of the resources folder: path in it with forward slashes, and content. One that the template has
    /// already is replaced.
    pub resources: Vec<(String, Vec<u8>)>,
}

/// A start value; the type is that of the variable, an Enumeration takes the value of an item as an Integer.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Real, in the unit of the variable.
    Real(f64),
    /// Integer or Enumeration; also taken for a Real.
    Integer(i64),
    /// Boolean.
    Boolean(bool),
    /// String.
    String(String),
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Value::Real(x) => write!(f, "{x:?}"),
            Value::Integer(x) => write!(f, "{x}"),
            Value::Boolean(x) => write!(f, "{x}"),
            Value::String(x) => write!(f, "{x:?}"),
        }
    }
}

/// One file of the archive.
struct Member {
    path: String,
    bytes: Vec<u8>,
}

/// Whether the library of an FMU reads start values from its resources, so that others can be derived from it.
pub fn is_template(description: &ModelDescription) -> bool {
    let tool = &description.generation_tool;
    (tool.contains(EXPORTER) || tool.contains(EARLIER_EXPORTER)) && !description.is_fmi3()
}

/// Whether a derived FMU may have another start value of this variable: an input, or one whose `initial` is exact.
pub fn has_start(variable: &Variable) -> bool {
    variable.causality == Causality::Input || variable.initial == Some(Initial::Exact)
}

/// Writes the FMU at `out` (its folder must be there; a file of that name is replaced in one move) and gives its GUID.
///
/// `modelIdentifier`, binaries, variables and structure are those of the template; its other resources stay, its
/// documentation gets a section on top. The template may be a derived FMU itself: its start values
/// hold unless they are given again. The same template and the same derivation give the same bytes.
///
/// # Errors
/// [`DeriveError`]: a template that is not an FMU of this project, a name that it does not have, a value that does not
/// fit the variable, or a file that cannot be read or written. Nothing is left at `out` then.
pub fn derive(template: &Path, out: &Path, derivation: &Derivation) -> Result<String, DeriveError> {
    check_texts(derivation)?;
    let fmu = Fmu::open(template).map_err(|source| DeriveError::Template(Box::new(source)))?;
    if !is_template(&fmu.description) {
        let tool = fmu.description.generation_tool.clone();
        return Err(DeriveError::Exporter { path: template.to_owned(), tool });
    }
    let read = |name: &str| {
        std::fs::read(fmu.folder().join(name))
            .map_err(|source| DeriveError::File { path: template.join(name), source })
    };
    let (mut base, mut start) = (fmu.description.guid.clone(), Vec::new());
    if fmu.files().iter().any(|file| *file == format!("resources/{START_VALUES}")) {
        let text = read(&format!("resources/{START_VALUES}"))?;
        (base, start) = start_values::read(&text, template)?;
    }
    start.extend(derivation.start.iter().cloned());
    let start = start_values::check(&start, derivation.start.len(), &fmu.description, template)?;
    let guid = fingerprint(derivation, &base, &start, &fmu.description);

    let mut members = Vec::new();
    let own = |name: &str| derivation.resources.iter().any(|(own, _)| name == format!("resources/{own}"));
    let mut page = None;
    for name in fmu.files() {
        let bytes = read(name)?;
        let bytes = match name.as_str() {
            "modelDescription.xml" => description::rewrite(&bytes, derivation, &guid, &start, template)?,
            PAGE => {
                page = Some(String::from_utf8_lossy(&bytes).into_owned());
                continue;
            }
            name if own(name) || name == format!("resources/{START_VALUES}") => continue,
            _ => bytes,
        };
        members.push(Member { path: name.clone(), bytes });
    }
    let page = documentation::page(derivation, &start, &fmu.description, page.as_deref());
    members.push(Member { path: PAGE.into(), bytes: page.into_bytes() });
    let text = start_values::text(&base, &guid, &start, &fmu.description);
    members.push(Member { path: format!("resources/{START_VALUES}"), bytes: text.into_bytes() });
    for (name, bytes) in &derivation.resources {
        members.push(Member { path: format!("resources/{name}"), bytes: bytes.clone() });
    }
    write(out, &members)?;
    Ok(guid)
}

/// A checked start value: position of the variable and value.
type Start = (usize, Value);

fn check_texts(derivation: &Derivation) -> Result<(), DeriveError> {
    if derivation.name.trim().is_empty() {
        let (name, reason) = (derivation.name.clone(), "it is empty");
        return Err(DeriveError::Text { what: "name", text: name, reason });
    }
    for (what, text) in [("name", &derivation.name), ("description", &derivation.description)] {
        if text.chars().any(char::is_control) {
            let reason = "it has a control character, and becomes an attribute in XML";
            return Err(DeriveError::Text { what, text: text.clone(), reason });
        }
    }
    for (index, (name, _)) in derivation.resources.iter().enumerate() {
        let twice = derivation.resources[..index].iter().any(|(other, _)| other == name);
        let reason = match bad_name(name) {
            _ if name == START_VALUES => Some("this file is made from the start values"),
            _ if name.ends_with('/') => Some("it is a folder"),
            _ if twice => Some("it is given twice"),
            bad => bad,
        };
        if let Some(reason) = reason {
            return Err(DeriveError::Text { what: "name of a resource", text: name.clone(), reason });
        }
    }
    Ok(())
}

/// GUID of everything that makes the FMU another one: FNV-1a of 128 bits, the same on every machine.
fn fingerprint(
    derivation: &Derivation,
    base: &str,
    start: &[Start],
    description: &ModelDescription,
) -> String {
    const OFFSET: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;
    let mut hash = OFFSET;
    // The length before every part keeps the parts apart.
    let mut add = |bytes: &[u8]| {
        for byte in (bytes.len() as u64).to_le_bytes().iter().chain(bytes) {
            hash = (hash ^ u128::from(*byte)).wrapping_mul(PRIME);
        }
    };
    add(derivation.name.as_bytes());
    add(derivation.description.as_bytes());
    add(start_values::text(base, "", start, description).as_bytes());
    for (name, bytes) in &derivation.resources {
        add(name.as_bytes());
        add(bytes);
    }
    let digits = format!("{hash:032x}");
    let part = |from: usize, to: usize| &digits[from..to];
    format!("{{{}-{}-{}-{}-{}}}", part(0, 8), part(8, 12), part(12, 16), part(16, 20), part(20, 32))
}

/// Writes the archive next to its final place and moves it there; time stamps are the earliest that zip has.
fn write(out: &Path, members: &[Member]) -> Result<(), DeriveError> {
    use airloop_series::fails_once::FailsOnce;
    use std::io::Write;
    use zip::write::SimpleFileOptions;
    use zip::{CompressionMethod, DateTime, ZipWriter};

    let failed = |source| DeriveError::File { path: out.to_owned(), source };
    airloop_series::file::make_folder_of(out).map_err(failed)?;
    airloop_series::file::write_whole(out, |file| {
        let mut zip = ZipWriter::new(FailsOnce::new(file));
        for member in members {
            let executable = member.path.starts_with("binaries/");
            let options = SimpleFileOptions::default()
                .compression_method(CompressionMethod::Deflated)
                .last_modified_time(DateTime::default())
                .unix_permissions(if executable { 0o755 } else { 0o644 });
            zip.start_file(member.path.as_str(), options)?;
            zip.write_all(&member.bytes)?;
        }
        zip.finish()?;
        Ok(())
    })
    .map_err(failed)
}
