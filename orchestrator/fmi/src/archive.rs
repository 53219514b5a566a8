//! Safe reading of an FMU archive: everything is checked before the first file is written.
//!
//! The meaning of the files is left to `open` and `description`.

use std::collections::{HashMap, HashSet};
use std::fs::{self, File};
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use tempfile::TempDir;
use zip::ZipArchive;
use zip::result::ZipError;

/// Name of the model description inside the archive.
const DESCRIPTION: &str = "modelDescription.xml";

/// Longest name of an entry \[bytes\] and most folders that it may lie in: what file systems take.
const MAX_NAME_BYTES: usize = 4096;
const MAX_NAME_DEPTH: usize = 128;

/// Below this unpacked size \[bytes\] an archive may be packed as tightly as it likes.
const RATIO_FLOOR: u64 = 32 << 20;

/// Limits of the content of an archive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Sum of the unpacked sizes \[bytes\]; default 1 GiB.
    pub total_size: u64,
    /// Unpacked size over size of the archive; default 100. Archives that unpack to 32 MiB or less may exceed it.
    pub ratio: u64,
    /// Number of entries; default 10 000.
    pub entries: usize,
    /// Size of `modelDescription.xml` \[bytes\]; default 64 MiB.
    pub description_size: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Limits { total_size: 1 << 30, ratio: 100, entries: 10_000, description_size: 64 << 20 }
    }
}

/// Reason why an archive was refused. Nothing is left on disk.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// The file cannot be opened or read.
    #[error("the file cannot be read: {0}")]
    Read(#[source] io::Error),
    /// A folder or device.
    #[error("this is not a file; an FMU is one .fmu file (a zip archive)")]
    NotAFile,
    /// Nothing in it.
    #[error("the file is empty; an FMU is a zip archive")]
    Empty,
    /// No zip archive, or a damaged one.
    #[error("this is not a readable zip archive, perhaps a truncated one: {0}")]
    NotAZip(String),
    /// No `modelDescription.xml` at the root.
    #[error("the archive has no modelDescription.xml at its root{0}")]
    NoDescription(String),
    /// A name that would lead out of the folder or cannot be a file everywhere.
    #[error("the entry \"{name}\" is refused: {reason}")]
    Name {
        /// Name as stored.
        name: String,
        /// Fault of the name.
        reason: &'static str,
    },
    /// Two entries for one file.
    #[error("the entries \"{first}\" and \"{second}\" would be the same file; keep one of them")]
    Collision {
        /// The earlier entry.
        first: String,
        /// The later entry.
        second: String,
    },
    /// A limit of [`Limits`] is exceeded.
    #[error("{what} is {found}, above the limit of {limit}; a genuine FMU this large needs other limits")]
    TooLarge {
        /// Limited quantity.
        what: String,
        /// Value in the archive.
        found: u64,
        /// The limit.
        limit: u64,
    },
    /// An entry holds more or less than it declares, or its checksum is wrong.
    #[error("the entry \"{name}\" is damaged: {reason}")]
    Damaged {
        /// Name as stored.
        name: String,
        /// Fault of the archive.
        reason: String,
    },
    /// There is no place to unpack to.
    #[error(
        "no temporary folder can be made: {0}; check free space, or set TMPDIR to a folder that is there"
    )]
    Folder(#[source] io::Error),
    /// No room or no permission for the temporary files.
    #[error("cannot unpack \"{name}\" into a temporary folder: {source}; check free space, or set TMPDIR")]
    Write {
        /// Entry.
        name: String,
        /// Message of the operating system.
        source: io::Error,
    },
}

/// An archive whose names and declared sizes are sound.
pub(super) struct Archive {
    zip: ZipArchive<BufReader<File>>,
    limits: Limits,
}

/// An archive on disk.
pub(super) struct Unpacked {
    /// Holds all files; removed when dropped.
    pub(super) folder: TempDir,
    /// Names of all files, with forward slashes, in archive order.
    pub(super) files: Vec<String>,
    /// Names of the folders that are entries of their own, with a slash at the end.
    pub(super) folders: Vec<String>,
}

impl Archive {
    /// Opens the archive at `path` and checks names, kinds and declared sizes of all entries.
    pub(super) fn open(path: &Path, limits: &Limits) -> Result<Self, ArchiveError> {
        let metadata = fs::metadata(path).map_err(ArchiveError::Read)?;
        if !metadata.is_file() {
            return Err(ArchiveError::NotAFile);
        }
        if metadata.len() == 0 {
            return Err(ArchiveError::Empty);
        }
        limit("the size of the archive in bytes", metadata.len(), limits.total_size)?;
        let file = File::open(path).map_err(ArchiveError::Read)?;
        check_directory(&file, metadata.len(), limits)?;
        let mut zip = ZipArchive::new(BufReader::new(file)).map_err(not_a_zip)?;
        let directory = File::open(path).map_err(ArchiveError::Read)?;
        let stored = stored_names(directory, zip.central_directory_start())?;
        limit("the number of entries", stored.len() as u64, limits.entries as u64)?;
        check_names(stored.iter().map(String::as_str))?;
        // Once more as the zip library sees them: an extra field can replace a name.
        check_names(zip.file_names())?;

        let mut total = 0_u64;
        for index in 0..zip.len() {
            let entry = zip.by_index_raw(index).map_err(not_a_zip)?;
            let refuse = |reason| Err(ArchiveError::Name { name: entry.name().to_owned(), reason });
            if entry.is_symlink() {
                return refuse("it is a symbolic link, which FMUs may not hold");
            }
            if entry.encrypted() {
                return refuse("it is encrypted");
            }
            total = total.saturating_add(entry.size());
        }
        limit("the unpacked size in bytes", total, limits.total_size)?;
        if total > RATIO_FLOOR {
            limit("the ratio of unpacked to packed size", total / metadata.len(), limits.ratio)?;
        }
        Ok(Archive { zip, limits: *limits })
    }

    /// The bytes of `modelDescription.xml`.
    pub(super) fn description(&mut self) -> Result<Vec<u8>, ArchiveError> {
        let Some(index) = self.zip.index_for_name(DESCRIPTION) else {
            let nested = self.zip.file_names().find(|name| name.ends_with(&format!("/{DESCRIPTION}")));
            let hint = nested.map_or_else(String::new, |name| {
                format!("; there is {name}: pack the content of that folder, not the folder")
            });
            return Err(ArchiveError::NoDescription(hint));
        };
        let size = self.zip.by_index_raw(index).map_err(not_a_zip)?.size();
        limit("the size of modelDescription.xml in bytes", size, self.limits.description_size)?;
        let mut bytes = Vec::new();
        self.copy(index, &mut bytes)?;
        Ok(bytes)
    }

    /// Writes all files into a new temporary folder.
    pub(super) fn unpack(mut self) -> Result<Unpacked, ArchiveError> {
        let folder = airloop_series::scratch::folder().map_err(ArchiveError::Folder)?;
        let (mut files, mut folders) = (Vec::new(), Vec::new());
        for index in 0..self.zip.len() {
            let name = self.zip.name_for_index(index).expect("index is below len").to_owned();
            let path = folder.path().join(name.trim_end_matches('/'));
            let failed = |source| ArchiveError::Write { name: name.clone(), source };
            if name.ends_with('/') {
                fs::create_dir_all(&path).map_err(failed)?;
                folders.push(name);
                continue;
            }
            if let Some(parent) = path.parent() {
                fs::create_dir_all(parent).map_err(failed)?;
            }
            let mut file = File::options().write(true).create_new(true).open(&path).map_err(failed)?;
            self.copy(index, &mut file)?;
            files.push(name);
        }
        // fmi2Instantiate gets the address of this folder also when the archive has none.
        fs::create_dir_all(folder.path().join("resources"))
            .map_err(|source| ArchiveError::Write { name: "resources".to_owned(), source })?;
        Ok(Unpacked { folder, files, folders })
    }

    /// Unpacks one entry, at most as many bytes as it declares: headers can lie.
    fn copy(&mut self, index: usize, to: &mut impl io::Write) -> Result<(), ArchiveError> {
        let name = self.zip.name_for_index(index).expect("index is below len").to_owned();
        let damaged = |reason: String| ArchiveError::Damaged { name: name.clone(), reason };
        let entry = self.zip.by_index(index).map_err(|error| damaged(error.to_string()))?;
        let declared = entry.size();
        let mut buffer = vec![0_u8; 64 << 10];
        let mut entry = entry.take(declared.saturating_add(1));
        let mut written = 0_u64;
        loop {
            let count = entry.read(&mut buffer).map_err(|error| damaged(error.to_string()))?;
            if count == 0 {
                break;
            }
            written += count as u64;
            if written > declared {
                break;
            }
            to.write_all(&buffer[..count])
                .map_err(|source| ArchiveError::Write { name: name.clone(), source })?;
        }
        if written != declared {
            let reason = format!(
                "it declares {declared} bytes and holds {}",
                if written > declared { "more" } else { "fewer" }
            );
            return Err(damaged(reason));
        }
        Ok(())
    }
}

fn limit(what: &str, found: u64, limit: u64) -> Result<(), ArchiveError> {
    if found <= limit {
        return Ok(());
    }
    Err(ArchiveError::TooLarge { what: what.to_owned(), found, limit })
}

fn not_a_zip(error: ZipError) -> ArchiveError {
    ArchiveError::NotAZip(error.to_string())
}

/// Refuses a list of entries that is too long before anything of it is read into memory.
fn check_directory(mut file: &File, size: u64, limits: &Limits) -> Result<(), ArchiveError> {
    const SIGNATURE: &[u8] = b"PK\x05\x06";
    /// Bytes of the record at the end, and of the longest comment behind it.
    const MAX_BYTES_OF_END: u64 = 22 + 0xffff;
    /// Bytes of an entry in the list, with a long name.
    const ENTRY: u64 = 1024;
    file.seek(SeekFrom::Start(size.saturating_sub(MAX_BYTES_OF_END))).map_err(ArchiveError::Read)?;
    let mut end = Vec::new();
    file.take(MAX_BYTES_OF_END).read_to_end(&mut end).map_err(ArchiveError::Read)?;
    let Some(at) = end.windows(4).rposition(|bytes| bytes == SIGNATURE) else { return Ok(()) };
    let Some(record) = end.get(at..at + 22) else { return Ok(()) };
    let entries = u64::from(u16::from_le_bytes([record[10], record[11]]));
    let bytes = u64::from(u32::from_le_bytes([record[12], record[13], record[14], record[15]]));
    limit("the number of entries", entries, limits.entries as u64)?;
    limit("the size of the list of entries in bytes", bytes, limits.entries as u64 * ENTRY)
}

/// The names in the central directory at `start`, repeated ones included, which [`ZipArchive`] merges silently; but for
/// repeated files with the same length and checksum, which are harmless.
fn stored_names(file: File, start: u64) -> Result<Vec<String>, ArchiveError> {
    const SIGNATURE: [u8; 4] = *b"PK\x01\x02";
    const HEADER: usize = 46;
    let mut reader = BufReader::new(file);
    reader.seek(SeekFrom::Start(start)).map_err(ArchiveError::Read)?;
    let mut names = Vec::new();
    let mut seen = HashSet::new();
    let mut header = [0_u8; HEADER];
    // What follows the last header is at least 22 bytes long and has another signature.
    while reader.read_exact(&mut header[..4]).is_ok() && header[..4] == SIGNATURE {
        reader.read_exact(&mut header[4..]).map_err(ArchiveError::Read)?;
        let field = |at: usize| u16::from_le_bytes([header[at], header[at + 1]]);
        let mut name = vec![0_u8; usize::from(field(28))];
        reader.read_exact(&mut name).map_err(ArchiveError::Read)?;
        reader.seek_relative(i64::from(field(30)) + i64::from(field(32))).map_err(ArchiveError::Read)?;
        let name = String::from_utf8(name).map_err(|error| ArchiveError::Name {
            name: String::from_utf8_lossy(error.as_bytes()).into_owned(),
            reason: "the name is not UTF-8 text",
        })?;
        let content: [u8; 4] = [header[16], header[17], header[18], header[19]];
        let size: [u8; 4] = [header[24], header[25], header[26], header[27]];
        if seen.insert((name.clone(), content, size)) {
            names.push(name);
        }
    }
    Ok(names)
}

/// Refuses names that lead out of the folder, that not every system can store, or that meet in one file. A folder may
/// appear twice: it is one folder.
fn check_names<'a>(names: impl Iterator<Item = &'a str>) -> Result<(), ArchiveError> {
    // (Number of the folder, name in lower case) -> (own number, name, whether a file): as large as the names together.
    let mut seen: HashMap<(usize, String), (usize, &str, bool)> = HashMap::new();
    for name in names {
        if let Some(reason) = bad_name(name) {
            return Err(ArchiveError::Name { name: name.to_owned(), reason });
        }
        let is_file = !name.ends_with('/');
        let path = name.trim_end_matches('/');
        let (mut folder, mut start) = (0, 0);
        for part in path.split('/') {
            let part_is_file = is_file && start + part.len() == path.len();
            let next = seen.len() + 1;
            let &mut (number, earlier, earlier_is_file) =
                seen.entry((folder, part.to_lowercase())).or_insert((next, part, part_is_file));
            if number != next && (earlier != part || earlier_is_file || part_is_file) {
                return Err(ArchiveError::Collision {
                    first: path[..start].to_owned() + earlier,
                    second: name.to_owned(),
                });
            }
            folder = number;
            start += part.len() + 1;
        }
    }
    Ok(())
}

/// Reason why a name is refused, if it is.
pub(super) fn bad_name(name: &str) -> Option<&'static str> {
    let path = name.strip_suffix('/').unwrap_or(name);
    if name.len() > MAX_NAME_BYTES {
        return Some("it has more than 4096 bytes, which no file system takes");
    }
    if path.split('/').nth(MAX_NAME_DEPTH).is_some() {
        return Some("it lies more than 128 folders deep");
    }
    if name.starts_with('/') {
        return Some("it is an absolute path");
    }
    if name.contains('\\') {
        return Some("it contains a backslash; zip archives separate folders by forward slashes");
    }
    if name.as_bytes().get(1) == Some(&b':') {
        return Some("it begins with a drive letter");
    }
    if name.chars().any(char::is_control) {
        return Some("it contains a control character");
    }
    if path.split('/').any(|part| part == "..") {
        return Some("it leads out of the folder by \"..\"");
    }
    if path.split('/').any(|part| part.is_empty() || part == ".") {
        return Some("it has an empty part or a part \".\"");
    }
    None
}
