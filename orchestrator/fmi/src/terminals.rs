//! Terminals of an FMU of FMI 3.0 (section 2.4.10): variables that a tool shows and connects as one plug, and icons.
//!
//! They change nothing in a simulation; `airloop inspect` shows them, and the checker holds them against the
//! variables.

use serde::Serialize;

use crate::Fmu;
use crate::xml::{self, Element};

/// Folder in the archive.
pub(crate) const FOLDER: &str = "terminalsAndIcons";

/// Content of `terminalsAndIcons/terminalsAndIcons.xml`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Terminals {
    /// All terminals, one inside of another behind it.
    pub terminals: Vec<Terminal>,
    /// Pictures that the file places, as paths in the archive.
    pub icons: Vec<String>,
}

/// A terminal.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Terminal {
    /// Name, behind those of the terminals around it: `outer.inner`.
    pub name: String,
    /// Rule by which the members of two terminals find each other: `plug`, `bus`, `sequence`, or one of a layered
    /// standard.
    pub matching_rule: String,
    /// Kind of the terminal in a layered standard.
    pub kind: Option<String>,
    /// Variables.
    pub members: Vec<Member>,
    /// Line in the file, from 1.
    pub line: usize,
}

/// A variable of a terminal.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Member {
    /// Name in the terminal; a bus or a plug finds members by it.
    pub name: Option<String>,
    /// Name of the variable; of an array without index.
    pub variable: String,
    /// Role such as `signal`, `inflow` or `outflow`.
    pub role: Option<String>,
    /// Line in the file, from 1.
    pub line: usize,
}

impl Fmu {
    /// Terminals and icons; `None` if the archive has no such file.
    ///
    /// # Errors
    /// Line and fault of a file that cannot be read.
    pub fn terminals(&self) -> Option<Result<Terminals, String>> {
        let path = format!("{FOLDER}/terminalsAndIcons.xml");
        if !self.files().contains(&path) {
            return None;
        }
        let bytes = std::fs::read(self.folder().join(path)).map_err(|error| error.to_string());
        Some(bytes.and_then(|bytes| read(&bytes)))
    }
}

fn read(bytes: &[u8]) -> Result<Terminals, String> {
    let root = xml::parse(bytes).map_err(|error| format!("line {}: {}", error.line, error.message))?;
    if root.name != "fmiTerminalsAndIcons" {
        return Err(format!(
            "line {}: the root element is {}, not fmiTerminalsAndIcons",
            root.line, root.name
        ));
    }
    let mut all = Terminals::default();
    if root.child("GraphicalRepresentation").is_some_and(|picture| picture.child("Icon").is_some()) {
        all.icons.push(format!("{FOLDER}/icon.png"));
    }
    for list in root.children("Terminals") {
        add(list, "", &mut all)?;
    }
    Ok(all)
}

fn required(element: &Element, name: &str) -> Result<String, String> {
    let value = element.attribute(name).map(str::to_owned);
    value.ok_or_else(|| format!("line {}, {}: the attribute {name} is missing", element.line, element.name))
}

/// Adds the terminals inside of an element, whose names begin with `before`.
fn add(around: &Element, before: &str, all: &mut Terminals) -> Result<(), String> {
    for element in around.children("Terminal") {
        let name = before.to_owned() + &required(element, "name")?;
        let text = |element: &Element, name: &str| element.attribute(name).map(str::to_owned);
        let mut members = Vec::new();
        for member in &element.children {
            let variables: &[(&str, Option<&str>)] = match member.name.as_str() {
                "TerminalMemberVariable" => &[("variableName", None)],
                "TerminalStreamMemberVariable" => &[
                    ("inStreamVariableName", Some("inStream")),
                    ("outStreamVariableName", Some("outStream")),
                ],
                _ => continue,
            };
            for &(attribute, role) in variables {
                members.push(Member {
                    name: text(member, "memberName"),
                    variable: required(member, attribute)?,
                    role: role.map(str::to_owned).or_else(|| text(member, "variableKind")),
                    line: member.line,
                });
            }
        }
        if let Some(picture) = element.child("TerminalGraphicalRepresentation")
            && let Some(icon) = picture.attribute("iconBaseName")
        {
            all.icons.push(format!("{FOLDER}/{icon}.png"));
        }
        all.terminals.push(Terminal {
            matching_rule: required(element, "matchingRule")?,
            kind: text(element, "terminalKind"),
            members,
            line: element.line,
            name: name.clone(),
        });
        add(element, &format!("{name}."), all)?;
    }
    Ok(())
}
