//! Other archives than FMUs (`.ssp`), unpacked with the same care.

use std::path::Path;

use tempfile::TempDir;

use super::archive::{Archive, Limits};
use super::error::Error;

/// Checks and unpacks an archive with the default [`Limits`]; its files are removed when the folder is dropped.
///
/// # Errors
/// [`Error::Archive`], with file, place and what is wrong; nothing is left on disk.
pub fn unpack_package(path: &Path) -> Result<TempDir, Error> {
    Archive::open(path, &Limits::default())
        .and_then(Archive::unpack)
        .map(|unpacked| unpacked.folder)
        .map_err(|source| Error::Archive { path: path.to_owned(), source })
}
