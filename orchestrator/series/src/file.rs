//! Files that are complete or not there: written under a temporary name, then renamed. Files of the user are opened
//! here, too, unless reading them could wait for ever or never end.

use std::fs::File;
use std::io::{BufWriter, Error, ErrorKind, Read, Write};
use std::path::Path;

use serde::Serialize;
use tempfile::NamedTempFile;

use crate::scratch;

/// Most bytes of a file that is read as a whole.
const MAX_BYTES: u64 = 1 << 28;

/// Opens a file to read it. A stream of this process may be given (`/dev/stdin`), other pipes and devices may not.
///
/// # Errors
/// Those of the file system; a named pipe, which may wait for a writer for ever, and a device, which may have no end.
pub fn open(path: &Path) -> std::io::Result<File> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let kind = std::fs::metadata(path)?.file_type();
        let is_own = ["/dev/stdin", "/dev/fd", "/proc"].iter().any(|own| path.starts_with(own));
        let what = if kind.is_fifo() && !is_own {
            "a named pipe; give a file, or write into /dev/stdin"
        } else if kind.is_block_device() || (kind.is_char_device() && !is_own) {
            "a device; give a file"
        } else {
            return File::open(path);
        };
        Err(Error::new(ErrorKind::InvalidInput, format!("this is {what}")))
    }
    #[cfg(not(unix))]
    File::open(path)
}

/// Reads a whole file.
///
/// # Errors
/// Same as [`open`]; more than 256 MiB.
pub fn read(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.take(MAX_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MAX_BYTES {
        let limit = MAX_BYTES >> 20;
        return Err(Error::new(ErrorKind::FileTooLarge, format!("it has more than {limit} MiB")));
    }
    Ok(bytes)
}

/// Reads a whole text.
///
/// # Errors
/// Same as [`read`]; bytes that are not UTF-8.
pub fn read_to_string(path: &Path) -> std::io::Result<String> {
    let bytes = read(path)?;
    String::from_utf8(bytes).map_err(|error| {
        let found = if begins_as_utf_16(error.as_bytes()) { "UTF-16" } else { "not UTF-8" };
        Error::new(ErrorKind::InvalidData, format!("the text is {found}; save it in UTF-8"))
    })
}

/// Whether a text begins with the mark of UTF-16.
pub(super) fn begins_as_utf_16(bytes: &[u8]) -> bool {
    [&b"\xff\xfe"[..], b"\xfe\xff"].iter().any(|mark| bytes.starts_with(mark))
}

/// Writes a file in one piece: `fill` writes to a temporary file next to `path`, which then takes that name. A link
/// stays, and the file that it leads to is replaced.
///
/// # Errors
/// An error of `fill` or of the file system; nothing is left under `path` or next to it.
pub fn write_whole(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<NamedTempFile>) -> std::io::Result<()>,
) -> std::io::Result<()> {
    let leads_to = if path.is_symlink() { path.canonicalize().ok() } else { None };
    let path = leads_to.as_deref().unwrap_or(path);
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    check_place(path)?;
    let mut writer = BufWriter::with_capacity(1 << 16, temporary(folder)?);
    fill(&mut writer)?;
    writer.flush()?;
    persist(writer.into_inner().map_err(|error| error.into_error())?, path)
}

/// Refuses a place where no file can be put: a folder, a device, a pipe or a socket. A link is followed.
///
/// # Errors
/// What is there.
pub fn check_place(path: &Path) -> std::io::Result<()> {
    match std::fs::metadata(path) {
        Ok(found) if !found.is_file() => {
            let what = if found.is_dir() { "a folder" } else { "a device or a pipe" };
            Err(Error::new(
                ErrorKind::InvalidInput,
                format!("{what} of that name is there; choose another name"),
            ))
        }
        _ => Ok(()),
    }
}

/// Makes the folder of a file that a user names, where it is missing.
///
/// # Errors
/// An error of the file system.
pub fn make_folder_of(path: &Path) -> std::io::Result<()> {
    path.parent().map_or(Ok(()), std::fs::create_dir_all)
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
/// An error of the file system.
pub fn temporary(folder: &Path) -> std::io::Result<NamedTempFile> {
    let file = tempfile::Builder::new().prefix(".writing-").tempfile_in(folder).map_err(without_path)?;
    scratch::pending(file.path());
    Ok(file)
}

/// The same error without the name of a temporary file, which says nothing to a user: messages name the file that was
/// to be written.
pub fn without_path(error: Error) -> Error {
    let text = error.to_string();
    let reason = text.split(" at path ").next().unwrap_or_default();
    Error::new(error.kind(), reason.to_owned())
}

/// Gives a complete temporary file its name; a file of that name is replaced.
///
/// # Errors
/// An error of the file system; same as [`check_place`].
pub fn persist(file: NamedTempFile, path: &Path) -> std::io::Result<()> {
    check_place(path)?;
    readable_by_all(file.as_file())?;
    scratch::settled(file.path());
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

    #[cfg(unix)]
    #[test]
    fn links_stay_links_and_what_is_no_file_is_refused() {
        use std::os::unix::net::UnixListener;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("real.csv"), "old").unwrap();
        std::os::unix::fs::symlink(at("real.csv"), at("link.csv")).unwrap();
        write_whole(&at("link.csv"), |out| out.write_all(b"new")).unwrap();
        assert!(at("link.csv").is_symlink());
        assert_eq!(std::fs::read_to_string(at("real.csv")).unwrap(), "new");
        let _socket = UnixListener::bind(at("socket")).unwrap();
        for place in [at("socket"), folder.path().into(), "/dev/null".into()] {
            let message = write_whole(&place, |_| panic!("nothing is written")).unwrap_err().to_string();
            assert!(message.contains("choose another name"), "{message}");
        }
    }
}
