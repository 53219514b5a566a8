//! The C function that an FMU is in, written down for another process: after a crash or an endless call it is all that
//! is left of this one.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::{Mutex, OnceLock, PoisonError};

/// Longer than any name of FMI.
const WIDTH: usize = 64;

static FILE: OnceLock<Mutex<File>> = OnceLock::new();

/// Writes the name of every C function of an FMU to the file at `path` before it is called, from now on and for the
/// whole process. Costs a system call each time, so it is for checks, not for runs.
///
/// # Errors
/// The file cannot be made.
pub fn write_calls_to(path: &Path) -> std::io::Result<()> {
    let file = Mutex::new(File::create(path)?);
    // A second file is not needed by anybody.
    let _ = FILE.set(file);
    Ok(())
}

/// The function that was called last, from the file that another process wrote.
pub fn last_call(path: &Path) -> Option<String> {
    let text = std::fs::read_to_string(path).ok()?;
    let name = text.trim_end();
    (!name.is_empty()).then(|| name.to_owned())
}

/// Notes that `function` is called next.
#[inline]
pub(crate) fn enter(function: &str) {
    if let Some(file) = FILE.get() {
        let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
        // Where it cannot be written, a crash has no name; the check goes on.
        let _ = file.seek(SeekFrom::Start(0)).and_then(|_| write!(file, "{function:<WIDTH$}"));
    }
}
