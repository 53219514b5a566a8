//! Files that are complete or not there: written under a temporary name, then renamed.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use serde::Serialize;
use tempfile::NamedTempFile;

/// Writes a file in one piece: `fill` writes to a temporary file next to `path`, which then takes that name.
///
/// # Errors
/// Whatever `fill` or the file system reports; nothing is left under `path` or next to it.
pub fn write_whole(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<NamedTempFile>) -> std::io::Result<()>,
) -> std::io::Result<()> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut writer = BufWriter::with_capacity(1 << 16, temporary(folder)?);
    fill(&mut writer)?;
    writer.flush()?;
    persist(writer.into_inner().map_err(|error| error.into_error())?, path)
}

/// Writes a value as JSON for people to read, in one piece.
///
/// # Errors
/// Same as [`write_whole`].
pub fn write_json<T: Serialize + ?Sized>(path: &Path, value: &T) -> std::io::Result<()> {
    write_whole(path, |out| {
        serde_json::to_writer_pretty(&mut *out, value)?;
        out.write_all(b"\n")
    })
}

/// A file in `folder` that goes away by itself, unless [`persist`] gives it a name.
///
/// # Errors
/// Whatever the file system reports.
pub fn temporary(folder: &Path) -> std::io::Result<NamedTempFile> {
    tempfile::Builder::new().prefix(".writing-").tempfile_in(folder)
}

/// Gives a complete temporary file its name; a file of that name is replaced.
///
/// # Errors
/// Whatever the file system reports.
pub fn persist(file: NamedTempFile, path: &Path) -> std::io::Result<()> {
    readable_by_all(file.as_file())?;
    file.persist(path)?;
    Ok(())
}

/// Temporary files are private to the user; a result is an ordinary file.
#[cfg(unix)]
fn readable_by_all(file: &File) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn readable_by_all(_: &File) -> std::io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_write_that_fails_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.csv");
        let outcome = write_whole(&path, |out| {
            out.write_all(b"half")?;
            Err(std::io::Error::other("disk full"))
        });
        assert!(outcome.is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
