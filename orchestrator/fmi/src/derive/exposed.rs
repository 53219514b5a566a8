//! FMUs whose local variables are outputs: a system of other tools connects outputs only.
//!
//! The library stays as it is, and so does the GUID (instantiation token) that it compares with its own: only the
//! causality of the variables and their entries in the model structure change.

use std::ops::Range;
use std::path::Path;

use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

use super::description::with_attributes;
use super::{DeriveError, Member, write};
use crate::open::Fmu;
use crate::{Causality, Initial, ModelDescription};

/// Writes the FMU at `fmu` to `out`, which may be the same file, with `locals` as outputs; those that are no local
/// variables stay as they are. An element of an array stands for the whole (FMI 3.0).
///
/// # Errors
/// [`DeriveError`]: no FMU, a name that it does not have, or a file that cannot be written. Nothing is left at `out`
/// then.
pub fn expose(fmu: &Path, out: &Path, locals: &[String]) -> Result<(), DeriveError> {
    let own = Fmu::open(fmu).map_err(|source| DeriveError::Template(Box::new(source)))?;
    let mut members = Vec::new();
    for name in own.files() {
        let bytes = std::fs::read(own.folder().join(name))
            .map_err(|source| DeriveError::File { path: fmu.join(name), source })?;
        let bytes = match name.as_str() {
            "modelDescription.xml" => described(&bytes, &own.description, locals, fmu)?,
            _ => bytes,
        };
        members.push(Member { path: name.clone(), bytes });
    }
    write(out, &members)
}

/// A variable that becomes an output.
struct Exposed<'a> {
    /// Name of its element.
    name: &'a str,
    /// By what the model structure calls it: index from 1 (FMI 2.0) or value reference, once its element was seen.
    key: String,
    /// It is a continuous state.
    is_state: bool,
    /// It becomes an unknown of the initialization.
    is_unknown: bool,
}

impl Exposed<'_> {
    /// Attributes of its entry in the model structure. A state follows itself alone; of others nothing is known.
    fn entry(&self, is_fmi3: bool) -> String {
        let (key, by) = (&self.key, if is_fmi3 { "valueReference" } else { "index" });
        let dependencies = if self.is_state { format!(" dependencies=\"{key}\"") } else { String::new() };
        format!("{by}=\"{key}\"{dependencies}")
    }
}

/// The name of the element of a variable: an array is one.
fn element(name: &str) -> &str {
    name.strip_suffix(']').and_then(|own| own.rsplit_once('[')).map_or(name, |(array, _)| array)
}

/// The local variables among `names`.
fn exposed<'a>(
    description: &ModelDescription,
    names: &'a [String],
    path: &Path,
) -> Result<Vec<Exposed<'a>>, DeriveError> {
    let states: Vec<usize> = description.continuous_states().collect();
    let mut found: Vec<Exposed> = Vec::new();
    for name in names {
        let unknown =
            || DeriveError::Unknown { path: path.to_owned(), variable: name.clone(), hint: String::new() };
        let position = description.index_of(name).ok_or_else(unknown)?;
        let variable = &description.variables[position];
        let name = if description.is_fmi3() { element(name) } else { name };
        if variable.causality != Causality::Local || found.iter().any(|own| own.name == name) {
            continue;
        }
        let listed = description.initial_unknowns.iter().any(|own| own.variable == position);
        found.push(Exposed {
            name,
            key: (position + 1).to_string(),
            is_state: states.contains(&position),
            is_unknown: !listed && variable.initial != Some(Initial::Exact),
        });
    }
    Ok(found)
}

/// Where entries of the model structure go, and what stands around them there.
#[derive(Default)]
struct Places {
    /// Its own tag, and whether that is all of it.
    structure: Option<(Range<usize>, bool)>,
    /// Its end tag.
    structure_end: usize,
    /// `Outputs` and `InitialUnknowns` (FMI 2.0): tag, and whether that is all of it.
    lists: [Option<(Range<usize>, bool)>; 2],
    /// End of the last element that stands in front of the event indicators (FMI 3.0).
    last: Option<usize>,
}

/// The description with the variables as outputs.
fn described(
    xml: &[u8],
    description: &ModelDescription,
    names: &[String],
    path: &Path,
) -> Result<Vec<u8>, DeriveError> {
    let refuse = |problem: String| DeriveError::Xml { path: path.to_owned(), problem };
    let mut exposed = exposed(description, names, path)?;
    let xml = std::str::from_utf8(xml).map_err(|error| refuse(error.to_string()))?;
    let is_fmi3 = description.is_fmi3();
    // Bytes that are replaced, and their new text.
    let mut edits: Vec<(Range<usize>, String)> = Vec::new();
    let mut places = Places::default();
    let mut reader = Reader::from_str(xml);
    let mut open: Vec<String> = Vec::new();
    loop {
        let from = usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX);
        let event = reader.read_event().map_err(|error| refuse(error.to_string()))?;
        let to = usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX);
        let (tag, is_all) = match &event {
            Event::Start(tag) => (tag, false),
            Event::Empty(tag) => (tag, true),
            Event::Eof => break,
            Event::End(_) => {
                let ended = open.pop();
                if open.len() == 1 && ended.as_deref() == Some("ModelStructure") {
                    places.structure_end = from;
                }
                places.passed(&open, ended.as_deref().unwrap_or_default(), to);
                continue;
            }
            _ => continue,
        };
        let name = tag.local_name().as_ref().to_owned();
        if open.len() == 2 && open[1] == "ModelVariables" {
            let called = attribute(tag, "name").map_err(refuse)?;
            if let Some(own) = exposed.iter_mut().find(|own| Some(own.name) == called.as_deref()) {
                let changes = [("causality", "output".to_owned())];
                let end = if is_all { "/>" } else { ">" };
                edits.push((from..to, with_attributes(tag, &changes, end).map_err(refuse)?));
                if is_fmi3 {
                    own.key = attribute(tag, "valueReference").map_err(refuse)?.unwrap_or_default();
                }
            }
        }
        match (open.len(), name.as_str()) {
            (1, "ModelStructure") => places.structure = Some((from..to, is_all)),
            (2, "Outputs") if open[1] == "ModelStructure" => places.lists[0] = Some((from..to, is_all)),
            (2, "InitialUnknowns") if open[1] == "ModelStructure" => {
                places.lists[1] = Some((from..to, is_all));
            }
            _ => {}
        }
        if is_all {
            places.passed(&open, &name, to);
        } else {
            open.push(name);
        }
    }
    edits.extend(places.entries(&exposed, is_fmi3).ok_or_else(|| refuse("no ModelStructure".into()))?);
    // What goes in at one place keeps its order.
    edits.sort_by_key(|(range, _)| range.start);
    let mut text = String::with_capacity(xml.len() + 1000);
    let mut at = 0;
    for (range, new) in edits {
        text.push_str(xml.get(at..range.start).unwrap_or_default());
        text.push_str(&new);
        at = range.end;
    }
    text.push_str(xml.get(at..).unwrap_or_default());
    Ok(text.into_bytes())
}

/// An attribute of a tag.
fn attribute(tag: &BytesStart<'_>, name: &str) -> Result<Option<String>, String> {
    for attribute in tag.attributes() {
        let attribute = attribute.map_err(|error| error.to_string())?;
        if attribute.key.as_ref() == name {
            let value = attribute.normalized_value(XmlVersion::Implicit1_0);
            return value.map(|value| Some(value.into_owned())).map_err(|error| error.to_string());
        }
    }
    Ok(None)
}

impl Places {
    /// Notes the end of an element whose parents are `open`.
    fn passed(&mut self, open: &[String], name: &str, to: usize) {
        if open.len() == 2 && open[1] == "ModelStructure" && name != "EventIndicator" {
            self.last = Some(to);
        }
    }

    /// The new entries and where they go; none where there is no model structure.
    fn entries(&self, exposed: &[Exposed], is_fmi3: bool) -> Option<Vec<(Range<usize>, String)>> {
        let all = |tag: &str, own: &dyn Fn(&Exposed) -> bool| -> String {
            let entries = exposed.iter().filter(|one| own(one));
            entries.map(|one| format!("<{tag} {}/>", one.entry(is_fmi3))).collect()
        };
        let (outputs, unknowns) = if is_fmi3 {
            (all("Output", &|_| true), all("InitialUnknown", &|own| own.is_unknown))
        } else {
            (all("Unknown", &|_| true), all("Unknown", &|own| own.is_unknown))
        };
        let list = |name: &str, text: &str| {
            if is_fmi3 || text.is_empty() { text.to_owned() } else { format!("<{name}>{text}</{name}>") }
        };
        let (tag, is_all) = self.structure.clone()?;
        let new = [list("Outputs", &outputs), list("InitialUnknowns", &unknowns)];
        if is_all {
            return Some(vec![(tag, format!("<ModelStructure>{}</ModelStructure>", new.concat()))]);
        }
        let lacking = match is_fmi3 {
            true => [tag.end, self.last.unwrap_or(tag.end)],
            false => [tag.end, self.structure_end],
        };
        let one = |i: usize| match &self.lists[i] {
            Some((tag, true)) => (tag.clone(), new[i].clone()),
            Some((tag, false)) => (tag.end..tag.end, [&outputs, &unknowns][i].clone()),
            None => (lacking[i]..lacking[i], new[i].clone()),
        };
        Some([0, 1].map(one).into_iter().filter(|(_, text)| !text.is_empty()).collect())
    }
}
