//! Errors of packaging; each message says what to do.

use std::path::PathBuf;

/// Error of the packager.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file could not be read or written.
    #[error("{path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// Message of the operating system.
        source: std::io::Error,
    },
    /// Cargo did not start or did not succeed.
    #[error("building the FMU libraries failed: {0}; the lines above say why")]
    Build(String),
    /// No library for a model.
    #[error(
        "{path}: no such library; build it with `cargo build --release -p {package}`, or leave out --lib-dir"
    )]
    NoLibrary {
        /// Place where it was sought.
        path: PathBuf,
        /// Cargo package that makes it.
        package: &'static str,
    },
    /// A folder of `--add-platform` holds nothing that fits.
    #[error(
        "{path}: no binary of any FMU; expected <platform>/<modelIdentifier>.so (.dll, .dylib) in it, for example \
         win64/friction.dll, or the same below binaries/"
    )]
    NoPlatform {
        /// The folder.
        path: PathBuf,
    },
    /// A checked-in model description differs from the models.
    #[error("{path} is stale: run `cargo run -p packager` and commit the result")]
    Stale {
        /// The file.
        path: PathBuf,
    },
    /// A model description without a model.
    #[error("{path} belongs to no model: remove it, or add the model to fmus/models/src/registry.rs")]
    Leftover {
        /// The file.
        path: PathBuf,
    },
    /// The archive could not be written.
    #[error("{path}: {source}")]
    Archive {
        /// The FMU.
        path: PathBuf,
        /// Message of the archive library.
        source: zip::result::ZipError,
    },
    /// The repository was not found.
    #[error("no fmus/packager above {path}; run inside the repository, or name it with --root")]
    NoRoot {
        /// Place where the search began.
        path: PathBuf,
    },
}

impl Error {
    /// Wraps an error of the file system with the path it is about.
    pub(crate) fn file(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::File { path, source }
    }
}
