//! Content of files and texts as SHA-256.

use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use crate::{Error, follow};

/// SHA-256 as hexadecimal digits.
pub fn hex(hash: Sha256) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Content of a text.
pub fn of_text(text: &str) -> String {
    hex(Sha256::new_with_prefix(text))
}

/// Content of a file, or the relative paths of all files under a folder.
///
/// # Errors
/// [`Error::Io`] if something cannot be read.
pub fn of_path(path: &Path) -> Result<String, Error> {
    if !path.is_dir() {
        return of_file(path);
    }
    let mut hash = Sha256::new();
    for file in follow::files_under(path)? {
        let name = file.strip_prefix(path).unwrap_or(&file).to_string_lossy().replace('\\', "/");
        hash.update(format!("{name}\n"));
    }
    Ok(hex(hash))
}

fn of_file(path: &Path) -> Result<String, Error> {
    let mut file = File::open(path).map_err(Error::io(path))?;
    let (mut hash, mut buffer) = (Sha256::new(), vec![0; 1 << 20]);
    loop {
        match file.read(&mut buffer).map_err(Error::io(path))? {
            0 => return Ok(hex(hash)),
            read => hash.update(&buffer[..read]),
        }
    }
}

/// Entries of a folder in the order of their names, without hidden ones.
///
/// # Errors
/// [`Error::Io`] if the folder cannot be read.
pub fn entries(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let all = std::fs::read_dir(folder).map_err(Error::io(folder))?;
    let all = all.map(|entry| entry.map(|entry| entry.path())).collect::<Result<Vec<_>, _>>();
    let mut all = all.map_err(Error::io(folder))?;
    all.retain(|path| !path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.')));
    all.sort();
    Ok(all)
}

/// A writer that hashes what passes.
#[derive(Debug)]
pub struct Hashed<W> {
    inner: W,
    hash: Sha256,
}

impl<W: Write> Hashed<W> {
    /// A writer around another.
    pub fn new(inner: W) -> Hashed<W> {
        Hashed { inner, hash: Sha256::new() }
    }

    /// The other writer, and the hash of what was written.
    pub fn finish(self) -> (W, String) {
        (self.inner, hex(self.hash))
    }
}

impl<W: Write> Write for Hashed<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.inner.write(bytes)?;
        self.hash.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.inner.flush()
    }
}
