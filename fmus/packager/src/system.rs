//! The library that runs a whole system as one FMU: template of `airloop export-fmu`.
//!
//! It is no FMU by itself, for it has no system; so it lies in a folder of its own, as an archive with the binaries.

use std::path::{Path, PathBuf};

use crate::archive::{self, Member};
use crate::contents::Library;
use crate::{Error, Request, contents, libraries};

/// Package and library.
const PACKAGE: &str = "airloop-system-fmu";
const IDENTIFIER: &str = "airloop_system";

/// Writes `OUT/template/airloop-system.fmu` and gives its path.
///
/// # Errors
/// A library that does not build or is not there, and files that cannot be read or written.
pub fn package(request: &Request) -> Result<PathBuf, Error> {
    let host = match &request.lib_dir {
        Some(folder) => libraries::named_in_folder(folder, PACKAGE, IDENTIFIER)?,
        None => {
            let own = [(PACKAGE, IDENTIFIER)];
            libraries::build_named(&request.root, &own, &request.system_profile)?.remove(0)
        }
    };
    let mut all: Vec<Library> = Vec::new();
    for folder in &request.add_platform {
        all.extend(libraries::named_of_platforms(folder, IDENTIFIER));
    }
    // As for the models, a library that was built elsewhere for this platform is preferred.
    if !all.iter().any(|library| library.platform == host.platform) {
        all.push(host);
    }
    all.sort_by(|a, b| a.platform.cmp(&b.platform));
    let mut members = contents::licenses(&request.root)?;
    for library in &all {
        let ending = library.path.extension().unwrap_or_default().to_string_lossy().into_owned();
        let bytes = std::fs::read(&library.path).map_err(Error::file(&library.path))?;
        let path = format!("binaries/{}/{IDENTIFIER}.{ending}", library.platform);
        members.push(Member { path, bytes, executable: true });
    }
    let path = template(&request.out);
    archive::write(&path, &members)?;
    Ok(path)
}

fn template(out: &Path) -> PathBuf {
    out.join("template").join("airloop-system.fmu")
}
