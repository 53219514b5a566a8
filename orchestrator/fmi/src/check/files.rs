//! Files of the archive: binaries where the interfaces expect them, documentation, nothing misplaced.

use super::Findings;
use crate::xml::Element;
use crate::{Fmu, InterfaceKind};

/// Folders and files that FMI 2.0.5 section 2.3 knows at the root of the archive; `extra` is of layered standards.
const ROOT: [&str; 9] = [
    "modelDescription.xml",
    "model.png",
    "documentation",
    "licenses",
    "sources",
    "binaries",
    "resources",
    "extra",
    "terminalsAndIcons",
];

pub(super) fn check(fmu: &Fmu, findings: &mut Findings) {
    for kind in [InterfaceKind::CoSimulation, InterfaceKind::ModelExchange] {
        let Some(interface) = fmu.interface(kind) else { continue };
        let identifier = &interface.model_identifier;
        let mut characters = identifier.chars();
        let starts = characters.next().is_some_and(|first| first.is_ascii_alphabetic() || first == '_');
        if !starts || !characters.all(|c| c.is_ascii_alphanumeric() || c == '_') {
            findings.error(
                "model-identifier",
                format!("interface {kind}"),
                format!("modelIdentifier=\"{identifier}\" is not a C identifier, which FMI asks for"),
            );
        }
        for platform in fmu.platforms() {
            let ending = match platform {
                "linux32" | "linux64" => "so",
                "darwin64" => "dylib",
                "win32" | "win64" => "dll",
                // The tuples of FMI 3.0 section 2.5.1.4.1.
                tuple if tuple.ends_with("-linux") => "so",
                tuple if tuple.ends_with("-darwin") => "dylib",
                tuple if tuple.ends_with("-windows") => "dll",
                _ => continue,
            };
            let path = format!("binaries/{platform}/{identifier}.{ending}");
            if !fmu.files().contains(&path) {
                findings.error(
                    "binary-missing",
                    path,
                    format!("the library of {kind} for {platform} is not there"),
                );
            }
        }
        if interface.can_serialize_fmu_state && !interface.can_get_and_set_fmu_state {
            findings.error(
                "capabilities",
                format!("interface {kind}"),
                "canSerializeFMUstate without canGetAndSetFMUstate: there is no state to serialize",
            );
        }
    }
    if !fmu.has_folder("binaries/") && !fmu.has_folder("sources/") {
        findings.error("binary-missing", "binaries/", "there is neither a library nor source code");
    }
    if !fmu.files().iter().any(|file| file == "documentation/index.html") {
        findings.note("documentation", "documentation/index.html", "there is no documentation to open");
    }
    if !fmu.has_folder("resources/") {
        findings.note("resources", "resources/", "there is no resources folder; some importers expect one");
    }
    let mut roots: Vec<&str> = fmu.files().iter().filter_map(|file| file.split('/').next()).collect();
    roots.sort_unstable();
    roots.dedup();
    for root in roots.into_iter().filter(|root| !ROOT.contains(root)) {
        findings.note("unknown-file", root, "FMI does not know this at the root of the archive");
    }
}

/// Source files: those that FMI 2.0 lists, and the list that FMI 3.0 wants next to them.
pub(super) fn check_sources(fmu: &Fmu, root: &Element, findings: &mut Findings) {
    let lists = root.children.iter().flat_map(|interface| interface.children("SourceFiles"));
    for file in lists.flat_map(|list| list.children("File")) {
        let Some(name) = file.attribute("name") else { continue };
        let path = format!("sources/{name}");
        if !fmu.files().contains(&path) {
            findings.error(
                "source-missing",
                path,
                format!("line {} lists it, but it is not there", file.line),
            );
        }
    }
    let described = fmu.files().iter().any(|file| file == "sources/buildDescription.xml");
    let has_sources = fmu.files().iter().any(|file| file.starts_with("sources/"));
    if fmu.description.is_fmi3() && has_sources && !described {
        let message = "FMI 3.0 asks for it where there are sources";
        findings.error("source-missing", "sources/buildDescription.xml", message);
    }
}
