//! A zip archive whose bytes depend on its contents only.
//!
//! Order is that of the contents; time stamps are the earliest that zip has (1980), permissions are fixed.

use crate::Error;
use std::io::{Seek, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// One entry of an archive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Member {
    /// Path with forward slashes; a folder ends with one.
    pub path: String,
    /// Content, empty for a folder.
    pub bytes: Vec<u8>,
    /// True for shared libraries.
    pub executable: bool,
}

impl Member {
    /// An ordinary file.
    pub fn file(path: impl Into<String>, bytes: impl Into<Vec<u8>>) -> Self {
        Self { path: path.into(), bytes: bytes.into(), executable: false }
    }

    /// A folder; the path ends with a slash.
    pub fn folder(path: impl Into<String>) -> Self {
        Self::file(path, Vec::new())
    }
}

/// Writes the archive next to its final place and moves it there, so that no reader meets half a file.
///
/// # Errors
/// Fails where the file system or the archive library refuses; the path stands in the message.
pub fn write(path: &Path, members: &[Member]) -> Result<(), Error> {
    let folder = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(Error::file(folder))?;
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(Error::file(folder))?;
    write_to(&mut file, members).map_err(|source| Error::Archive { path: path.to_path_buf(), source })?;
    // Temporary files are private; an FMU is as readable as any other build product.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let permissions = std::fs::Permissions::from_mode(0o644);
        file.as_file().set_permissions(permissions).map_err(Error::file(path))?;
    }
    file.persist(path).map_err(|e| Error::File { path: path.to_path_buf(), source: e.error })?;
    Ok(())
}

/// Writes the archive into anything that can be written. Libraries are stored as they are: a tool that opens the FMU
/// copies them instead of decompressing them.
///
/// # Errors
/// Those of the writer.
pub fn write_to(to: impl Write + Seek, members: &[Member]) -> zip::result::ZipResult<()> {
    let mut zip = ZipWriter::new(to);
    for member in members {
        let method = if member.executable { CompressionMethod::Stored } else { CompressionMethod::Deflated };
        let options = SimpleFileOptions::default()
            .compression_method(method)
            .last_modified_time(DateTime::default())
            .unix_permissions(if member.executable { 0o755 } else { 0o644 });
        match member.path.strip_suffix('/') {
            Some(folder) => zip.add_directory(folder, options.unix_permissions(0o755))?,
            None => {
                zip.start_file(member.path.as_str(), options)?;
                zip.write_all(&member.bytes)?;
            }
        }
    }
    zip.finish()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn bytes_of(members: &[Member]) -> Vec<u8> {
        let mut buffer = Cursor::new(Vec::new());
        write_to(&mut buffer, members).expect("memory takes everything");
        buffer.into_inner()
    }

    #[test]
    fn equal_contents_give_equal_bytes() {
        let members = [Member::file("a.txt", "one"), Member::folder("resources/")];
        assert_eq!(bytes_of(&members), bytes_of(&members));
    }

    #[test]
    fn members_read_back_with_stamp_and_order() {
        let library = Member { executable: true, ..Member::file("binaries/linux64/a.so", vec![7; 1000]) };
        let bytes = bytes_of(&[Member::file("z.txt", "text"), library, Member::folder("resources/")]);
        let mut zip = zip::ZipArchive::new(Cursor::new(bytes)).expect("an archive");
        let names: Vec<String> = zip.file_names().map(str::to_owned).collect();
        assert_eq!(names, ["z.txt", "binaries/linux64/a.so", "resources/"]);
        for i in 0..zip.len() {
            let file = zip.by_index(i).expect("three members");
            assert_eq!(file.last_modified().map(|t| t.year()), Some(1980));
            let stored = file.compression() == CompressionMethod::Stored;
            assert_eq!(stored, i > 0, "{}", file.name());
            let mode = file.unix_mode().expect("permissions were given") & 0o777;
            assert_eq!(mode, if i == 0 { 0o644 } else { 0o755 }, "{}", file.name());
        }
    }

    #[test]
    fn an_existing_archive_is_replaced_and_no_temporary_file_stays() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("sub/a.fmu");
        write(&path, &[Member::file("a.txt", "one")]).expect("writable");
        write(&path, &[Member::file("a.txt", "two")]).expect("writable");
        assert_eq!(std::fs::read_dir(path.parent().expect("sub")).expect("readable").count(), 1);
        assert_eq!(std::fs::read(&path).expect("readable"), bytes_of(&[Member::file("a.txt", "two")]));
    }
}
