//! Files in the archive of one FMU (FMI 2.0.4 section 2.3).

use crate::archive::Member;
use crate::{Error, documentation, parameter_set};
use airloop_models::registry::Entry;
use std::path::{Path, PathBuf};

/// A shared library of one FMU.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Library {
    /// FMI name of the platform, such as `linux64`.
    pub platform: String,
    /// FMU that it belongs to.
    pub model_identifier: String,
    /// The file.
    pub path: PathBuf,
}

/// The license files of the repository as they stand in every FMU.
const LICENSES: [&str; 2] = ["LICENSE-APACHE", "LICENSE-MIT"];

/// Reads the licenses.
///
/// # Errors
/// A license that cannot be read.
pub fn licenses(root: &Path) -> Result<Vec<Member>, Error> {
    LICENSES
        .iter()
        .map(|name| {
            let path = root.join(name);
            let text = std::fs::read(&path).map_err(Error::file(&path))?;
            Ok(Member::file(format!("documentation/licenses/{name}.txt"), text))
        })
        .collect()
}

/// Version of FMI of an archive; the library is the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0.
    Two,
    /// FMI 3.0.
    Three,
}

impl Version {
    /// Path of the picture of the model.
    fn picture(self) -> &'static str {
        match self {
            Version::Two => "model.png",
            Version::Three => "terminalsAndIcons/icon.png",
        }
    }

    /// Folder of a platform below `binaries/`, given its name in FMI 2.0.
    fn platform(self, two: &str) -> &str {
        match (self, two) {
            (Version::Two, name) => name,
            (Version::Three, "linux64") => "x86_64-linux",
            (Version::Three, "win64") => "x86_64-windows",
            (Version::Three, "darwin64") => "x86_64-darwin",
            (Version::Three, name) => name,
        }
    }
}

/// Everything in the FMU of one model, in the order of the archive.
///
/// # Errors
/// A library or the picture `fmus/<model>/model.png` that cannot be read.
pub fn of(
    root: &Path,
    entry: &Entry,
    libraries: &[&Library],
    licenses: &[Member],
) -> Result<Vec<Member>, Error> {
    of_version(root, entry, libraries, licenses, Version::Two)
}

/// Same as [`of`] for either version of FMI.
///
/// # Errors
/// Same as [`of`].
pub fn of_version(
    root: &Path,
    entry: &Entry,
    libraries: &[&Library],
    licenses: &[Member],
    version: Version,
) -> Result<Vec<Member>, Error> {
    let table = (entry.table)();
    let xml = match version {
        Version::Two => entry.xml,
        Version::Three => entry.xml_fmi3,
    };
    let mut members = vec![Member::file("modelDescription.xml", xml())];
    let mut libraries = libraries.to_vec();
    libraries.sort_by(|a, b| a.platform.cmp(&b.platform));
    for library in libraries {
        let extension = library.path.extension().unwrap_or_default().to_string_lossy();
        let platform = version.platform(&library.platform);
        let name = format!("binaries/{platform}/{}.{extension}", library.model_identifier);
        let bytes = std::fs::read(&library.path).map_err(Error::file(&library.path))?;
        members.push(Member { executable: true, ..Member::file(name, bytes) });
    }
    let page = documentation::page(entry, &table);
    let page = page.replace("../model.png", &format!("../{}", version.picture()));
    members.push(Member::file("documentation/index.html", page));
    members.extend_from_slice(licenses);
    let picture = root.join("fmus").join(entry.identity.model_name).join("model.png");
    members.push(Member::file(version.picture(), std::fs::read(&picture).map_err(Error::file(&picture))?));
    members.push(Member::folder("resources/"));
    for set in &entry.parameter_sets {
        let text = parameter_set::text(set, &table);
        members.push(Member::file(format!("resources/{}.ssv", set.name), text));
    }
    for (name, text) in entry.resources {
        members.push(Member::file(format!("resources/{name}"), *text));
    }
    Ok(members)
}

#[cfg(test)]
mod tests {
    use super::*;
    use airloop_models::registry;

    fn root() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
    }

    #[test]
    fn every_model_has_a_picture_of_its_own() {
        let mut seen: Vec<Vec<u8>> = Vec::new();
        for entry in registry::all() {
            let name = entry.identity.model_name;
            let members = of(&root(), &entry, &[], &[]).expect("the picture is there");
            let picture = &members.iter().find(|member| member.path == "model.png").expect("a picture").bytes;
            // Signature, then the header chunk: width and height as big-endian numbers.
            assert_eq!(&picture[..8], b"\x89PNG\r\n\x1a\n", "{name}");
            assert_eq!(&picture[16..24], &[0, 0, 0, 128, 0, 0, 0, 128], "{name} is not 128 x 128 pixels");
            assert!(!seen.contains(picture), "{name} looks like another");
            seen.push(picture.clone());
        }
    }

    #[test]
    fn every_fmu_has_what_the_standard_and_the_reader_want() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let library = folder.path().join("any.so");
        std::fs::write(&library, "binary").expect("writable");
        for entry in registry::all() {
            let model_identifier = entry.identity.model_identifier.to_owned();
            let library = Library { platform: "linux64".into(), model_identifier, path: library.clone() };
            let members = of(&root(), &entry, &[&library], &[]).expect("the library is there");
            let paths: Vec<&str> = members.iter().map(|m| m.path.as_str()).collect();
            let binary = format!("binaries/linux64/{}.so", entry.identity.model_identifier);
            for path in ["documentation/index.html", "model.png", "resources/", &binary] {
                assert!(paths.contains(&path), "{path} is not in {paths:?}");
            }
            assert_eq!(paths[0], "modelDescription.xml");
            assert_eq!(
                paths.iter().filter(|p| p.ends_with(".ssv")).count(),
                entry.parameter_sets.len(),
                "{paths:?}"
            );
        }
    }
}
