//! Results of a sweep that may be replaced: those that a merge or a report wrote.

use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use crate::Error;

/// Bytes looked through at both ends of a file: a table has its header first, a Parquet file its metadata last.
const TAIL: u64 = 1 << 20;

/// Refuses to replace a file of the user: one without `mark` in its first and in its last MiB.
///
/// # Errors
/// [`Error::Present`] names it; a file that cannot be read.
pub fn check(path: &Path, mark: &str) -> Result<(), Error> {
    let mut file = match std::fs::File::open(path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        found => found.map_err(Error::io(path))?,
    };
    let length = file.metadata().map_or(0, |data| data.len());
    let mut found = |from: u64| {
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(from)).ok()?;
        (&mut file).take(TAIL).read_to_end(&mut bytes).ok()?;
        Some(bytes.windows(mark.len()).any(|part| part == mark.as_bytes()))
    };
    let is_own = found(0) == Some(true) || found(length.saturating_sub(TAIL)) == Some(true);
    if is_own { Ok(()) } else { Err(Error::Present { path: path.into() }) }
}
