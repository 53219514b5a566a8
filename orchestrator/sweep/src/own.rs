//! Results of a sweep that may be replaced: those that a merge or a report wrote.

use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use crate::Error;

/// Bytes at the end of a Parquet file in which its metadata lie.
const TAIL: u64 = 1 << 20;

/// Refuses to replace a file of the user.
///
/// # Errors
/// [`Error::Present`] names it.
pub fn check(path: &Path, mark: &str) -> Result<(), Error> {
    let Ok(mut file) = std::fs::File::open(path) else { return Ok(()) };
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
