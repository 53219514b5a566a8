//! The tables that the instances of one library have read.
//!
//! A table is constant and large: instances share it, and the FMU state holds its fingerprint only.

use super::gains::{FILE, Gains};
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::SystemTime;

/// A file as it was when it was read.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Source {
    path: PathBuf,
    length: u64,
    modified: Option<SystemTime>,
}

#[derive(Debug)]
struct Entry {
    fingerprint: f64,
    sources: Vec<Source>,
    gains: Arc<Gains>,
}

/// Tables by fingerprint; fingerprint 0 is the dense one.
#[derive(Debug)]
pub(super) struct Library(RwLock<Vec<Entry>>);

impl Library {
    pub fn new() -> Self {
        let dense = Entry { fingerprint: 0.0, sources: Vec::new(), gains: Arc::new(Gains::dense()) };
        Self(RwLock::new(vec![dense]))
    }

    /// The table with this fingerprint.
    pub fn get(&self, fingerprint: f64) -> Option<Arc<Gains>> {
        let entries = self.0.read().unwrap_or_else(PoisonError::into_inner);
        entries.iter().find(|entry| entry.fingerprint == fingerprint).map(|entry| Arc::clone(&entry.gains))
    }

    /// Reads the table of a resources folder and gives its fingerprint; a file that has not changed is not read again.
    ///
    /// # Errors
    /// A file that cannot be read or is malformed: file, line, what was found and what is allowed.
    pub fn load(&self, folder: &Path) -> Result<f64, String> {
        let path = folder.join(FILE);
        let missing = |error| format!("{}: {error}; unpack the FMU with its resources", path.display());
        let about = std::fs::metadata(&path).map_err(missing)?;
        let source = Source { path: path.clone(), length: about.len(), modified: about.modified().ok() };
        let mut entries = self.0.write().unwrap_or_else(PoisonError::into_inner);
        if source.modified.is_some()
            && let Some(known) = entries.iter().find(|entry| entry.sources.contains(&source))
        {
            return Ok(known.fingerprint);
        }
        let text = std::fs::read_to_string(&path).map_err(missing)?;
        let fingerprint = fingerprint(&text);
        if let Some(known) = entries.iter_mut().find(|entry| entry.fingerprint == fingerprint) {
            known.sources.push(source);
            return Ok(fingerprint);
        }
        let gains = Arc::new(Gains::parse(&text, &path)?);
        entries.push(Entry { fingerprint, sources: vec![source], gains });
        Ok(fingerprint)
    }
}

/// FNV-1a of 64 bits, of which a number keeps 52; never 0.
fn fingerprint(text: &str) -> f64 {
    let hash = text
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |h, byte| (h ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3));
    1.0 + (hash >> 12) as f64
}
