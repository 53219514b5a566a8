//! Writing of systems as SSP 1.0 or 2.0: an `.ssd` that refers to its FMUs, or an `.ssp` that holds them.
//!
//! A written file reads back to an equal [`SystemGraph`], bit for bit: conversions between connectors are left to
//! the units where these give the same numbers, and are written out otherwise (`connections`). Equal graphs give
//! equal bytes. Geometry, annotations and connectors that are not connected are not part of a graph and are lost.
//!
//! The form of a file follows from the tool that reads it, see [`Tool`]: start values are inside the FMUs of a package
//! as far as these can hold them (`baked`) and in parameter sets of one name next to them, and a step size stands where
//! OMSimulator looks for it.

mod baked;
mod connections;
mod document;
mod package;
mod source;
mod tool;
mod types;
mod unpacked;
mod xml;

use std::io::Write;
use std::path::Path;

use super::{Error, SystemGraph};
use airloop_series::file::write_whole;

pub use tool::Tool;

/// Version of the SSP standard that a file follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Version {
    /// SSP 1.0 (2019): all that a graph holds, and what most tools read.
    #[default]
    V1_0,
    /// SSP 2.0, the current one.
    V2_0,
}

impl std::fmt::Display for Version {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Version::V1_0 => "1.0",
            Version::V2_0 => "2.0",
        })
    }
}

/// Writes a system in one piece, without loss. The ending decides: an `.ssd` names its FMUs by relative paths and holds
/// the start values, an `.ssp` is an archive with FMUs and one parameter set per component.
///
/// # Errors
/// Another ending, names that XML cannot hold, FMUs that lie inside an archive (`.ssd`), or the file system.
pub fn write(graph: &SystemGraph, file: &Path, version: Version) -> Result<(), Error> {
    write_for(graph, file, version, Tool::Any)
}

/// Same as [`write()`], in the form that `tool` reads.
///
/// # Errors
/// Same as [`write()`], and what the tool cannot take.
pub fn write_for(graph: &SystemGraph, file: &Path, version: Version, tool: Tool) -> Result<(), Error> {
    let graph = &*tool.form(graph, file)?;
    let how = document::How { version, tool };
    let io = |source| Error::Write { file: file.into(), source };
    let folder = match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    match file.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("ssd") => {
            std::fs::create_dir_all(folder).map_err(io)?;
            let sources = source::relative(graph, file, folder)?;
            let text = document::description(graph, &sources, None, how, file)?;
            write_whole(file, |out| out.write_all(text.as_bytes())).map_err(io)
        }
        Some("ssp") => {
            let package = package::Package::new(graph, how, file)?;
            std::fs::create_dir_all(folder).map_err(io)?;
            write_whole(file, |out| package.write(out)).map_err(io)
        }
        _ => Err(Error::WriteKind { file: file.into() }),
    }
}
