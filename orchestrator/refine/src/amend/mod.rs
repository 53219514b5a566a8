//! The amended system: the declared system of FMUs with the effects of an answer added, as files that any FMI tool
//! runs.
//!
//! [`network`] puts blocks in series into a system. A block is chosen by [`blocks`] for an effect of the vocabulary in
//! the rig, by [`port`] at any port of a study, and by [`own`] for a formula. [`rig`] builds the declared rig and
//! [`study`] the system of a study; both say where blocks go. [`write()`] derives the FMUs and writes `.ssd`, `.ssp`
//! and the table of the columns of a study's records.
//!
//! The declared FMUs keep their equations: an effect is a block connected to them, or another value of a parameter.

pub mod blocks;
pub mod network;
pub mod own;
pub mod port;
mod rates;
pub mod rig;
pub mod study;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::ssp::Structure;
use airloop_cosim::system::write::Version;
use airloop_fmi::derive::{self, Derivation, DeriveError};
use airloop_fmi::template_folder::{self, TemplateNotFound};
use airloop_fmi::{Causality, Fmu};

pub use network::Network;

/// Folder of the amended system inside that of the report.
pub const FOLDER: &str = "system";
/// Table of the columns of the records inside that folder, where they are not named as the connectors.
pub const SIGNALS: &str = "signals.toml";

/// Why the amended system cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The declared FMUs are not built.
    #[error(transparent)]
    Template(#[from] TemplateNotFound),
    /// An FMU cannot be derived.
    #[error(transparent)]
    Derive(#[from] DeriveError),
    /// The system does not hold together.
    #[error(transparent)]
    System(#[from] airloop_cosim::system::Error),
    /// An FMU cannot get inputs at rates of its states.
    #[error("component `{component}` gets no inputs at the rates of its states: {source}")]
    Rates {
        /// Component.
        component: String,
        /// Reason.
        source: airloop_system::Error,
    },
    /// The system of a study cannot be read.
    #[error(transparent)]
    Study(#[from] Box<crate::Error>),
    /// The file system.
    #[error("{}: the amended system cannot be written: {source}; choose another folder with `-o`", path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// Reason.
        source: std::io::Error,
    },
}

/// Writes `system.ssd`, `system.ssp` and the FMUs into `folder`/[`FOLDER`]; what was there before is replaced in one
/// move, and stays if anything fails.
///
/// `templates`: folder of the FMUs that are derived from; `None`: where [`template_folder::template`] looks.
///
/// # Errors
/// A template that is not there, a parameter that does not fit, or the file system.
pub fn write(network: &Network, folder: &Path, templates: Option<&Path>) -> Result<(), Error> {
    let io = |path: &Path| {
        let path = path.to_owned();
        move |source| Error::Io { path, source }
    };
    let work = tempfile::Builder::new().prefix(".writing-").tempdir_in(folder).map_err(io(folder))?;
    let mut structure = network.structure.clone();
    structure.file = work.path().join("system.ssd");
    for component in &mut structure.components {
        component.source = work.path().join(&component.source);
    }
    for (source, name) in &network.copies {
        std::fs::copy(source, work.path().join(name)).map_err(io(source))?;
    }
    for baked in &network.baked {
        derive::derive(&baked.source, &work.path().join(&baked.file), &baked.derivation)?;
    }
    for part in &network.parts {
        let template = template_folder::template(part.template, templates)?;
        let derivation = Derivation {
            name: part.name.clone(),
            description: part.description.clone(),
            start: part.start.clone(),
            resources: Vec::new(),
        };
        derive::derive(&template, &work.path().join(format!("{}.fmu", part.name)), &derivation)?;
    }
    rates::add_inputs(&mut structure, &network.rates, (work.path(), templates))?;
    expose(&structure)?;
    let graph = SystemGraph::from_structure(structure, None)?;
    for name in ["system.ssd", "system.ssp"] {
        airloop_cosim::system::write::write(&graph, &work.path().join(name), Version::V1_0)?;
    }
    if !network.columns.is_empty() {
        let row = |(connector, column): &(String, String)| format!("{connector:?} = {column:?}\n");
        let rows: String = network.columns.iter().map(row).collect();
        let path = work.path().join(SIGNALS);
        std::fs::write(&path, format!("[signals]\n{rows}")).map_err(io(&path))?;
    }
    drop(graph);
    let place = folder.join(FOLDER);
    remove(folder)?;
    readable(work.path()).map_err(io(&place))?;
    std::fs::rename(work.keep(), &place).map_err(io(&place))
}

/// Makes local variables outputs that blocks read or the system shows.
fn expose(structure: &Structure) -> Result<(), Error> {
    let mut all: BTreeMap<&Path, Vec<String>> = BTreeMap::new();
    for own in &structure.components {
        let read = own.connectors.iter().filter(|connector| connector.kind == "output");
        all.entry(&own.source).or_default().extend(read.map(|connector| connector.name.clone()));
    }
    for (file, names) in all.iter().filter(|(_, names)| !names.is_empty()) {
        let fmu = Fmu::open(file).map_err(|source| DeriveError::Template(Box::new(source)))?;
        let is_local = |name: &&String| {
            fmu.description.variable(name).is_some_and(|variable| variable.causality == Causality::Local)
        };
        let locals: Vec<String> = names.iter().filter(is_local).cloned().collect();
        drop(fmu);
        if !locals.is_empty() {
            derive::expose(file, file, &locals)?;
        }
    }
    Ok(())
}

/// Removes the amended system of an earlier report.
///
/// # Errors
/// The file system.
pub fn remove(folder: &Path) -> Result<(), Error> {
    let place = folder.join(FOLDER);
    match std::fs::remove_dir_all(&place) {
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
            Err(Error::Io { path: place, source })
        }
        _ => Ok(()),
    }
}

/// Temporary folders are private to the user; a result is an ordinary folder.
#[cfg(unix)]
fn readable(folder: &Path) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(folder, std::fs::Permissions::from_mode(0o755))
}

#[cfg(not(unix))]
fn readable(_: &Path) -> std::io::Result<()> {
    Ok(())
}
