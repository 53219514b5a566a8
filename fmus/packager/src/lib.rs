//! Makes FMU archives and model descriptions from the models of the registry.
//!
//! [`contents`] says what stands in an archive, [`archive`] writes it byte for byte reproducibly, [`libraries`] builds
//! or finds the shared libraries, [`glibc`] makes them run on older systems, [`descriptions`] writes and checks the
//! model descriptions that are kept in the repository. The texts inside come from [`documentation`] and
//! [`parameter_set`], the pictures from `fmus/<model>/model.png`.
#![warn(missing_docs)]

pub mod archive;
pub mod contents;
pub mod descriptions;
pub mod documentation;
mod error;
pub mod glibc;
pub mod libraries;
pub mod parameter_set;
pub mod system;

pub use error::Error;

use airloop_models::registry::{self, Entry};
use contents::{Library, Version};
use std::path::{Path, PathBuf};

/// Sources of libraries and destination of FMUs.
#[derive(Clone, Debug)]
pub struct Request {
    /// Root of the repository.
    pub root: PathBuf,
    /// Folder of libraries of this host; none: build them.
    pub lib_dir: Option<PathBuf>,
    /// Folders with binaries of further platforms.
    pub add_platform: Vec<PathBuf>,
    /// Cargo profile of the library that runs a whole system.
    pub system_profile: String,
    /// Folder of the FMUs; those of the tests go to `test/` in it.
    pub out: PathBuf,
}

/// Writes every FMU and every shipped model description; gives the paths of the FMUs.
///
/// # Errors
/// A library that does not build or is not there, and files that cannot be read or written; the text names them.
pub fn package(request: &Request) -> Result<Vec<PathBuf>, Error> {
    let entries = registry::all();
    descriptions::write(&request.root, &entries)?;
    let host = match &request.lib_dir {
        Some(folder) => libraries::in_folder(folder, &entries)?,
        None => libraries::build(&request.root, &entries)?,
    };
    let further = libraries::of_platforms(&request.add_platform, &entries)?;
    let licenses = contents::licenses(&request.root)?;
    let mut written = Vec::new();
    for entry in &entries {
        let mut of_entry: Vec<&Library> =
            further.iter().filter(|l| l.model_identifier == entry.identity.model_identifier).collect();
        // A library that was built elsewhere for this platform, say against an older glibc, is preferred.
        let own = host.iter().find(|l| {
            l.model_identifier == entry.identity.model_identifier
                && !of_entry.iter().any(|other| other.platform == l.platform)
        });
        of_entry.extend(own);
        let path = fmu_path(&request.out, entry);
        for (version, path) in [(Version::Two, path.clone()), (Version::Three, fmi3_path(&path))] {
            let members = contents::of_version(&request.root, entry, &of_entry, &licenses, version)?;
            archive::write(&path, &members)?;
            written.push(path);
        }
    }
    written.push(system::package(request)?);
    Ok(written)
}

/// `OUT/<name>.fmu`, or `OUT/test/<name>.fmu` for what is not shipped.
pub fn fmu_path(out: &Path, entry: &Entry) -> PathBuf {
    let folder = if entry.shipped { out.to_path_buf() } else { out.join("test") };
    folder.join(format!("{}.fmu", entry.identity.model_name))
}

/// Path of the FMU of FMI 3.0 beside that of 2.0: a folder `fmi3` in the same folder.
pub fn fmi3_path(two: &Path) -> PathBuf {
    let folder = two.parent().unwrap_or(Path::new("")).join("fmi3");
    folder.join(two.file_name().unwrap_or_default())
}
