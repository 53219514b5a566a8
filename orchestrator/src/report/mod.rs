//! The answer of `refine` as files: `report.json` for programs, `report.md` and `report.html` for readers.

pub mod html;
pub mod json;
pub mod markdown;
pub mod words;

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::refine::answer::Answer;
use crate::series::file::write_whole;

/// Why a report cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: the report cannot be written: {source}; choose another folder with `-o`", path.display())]
pub struct Error {
    /// File.
    pub path: PathBuf,
    /// Reason.
    pub source: std::io::Error,
}

/// Writes all forms of the report into a folder.
///
/// # Errors
/// The first file that cannot be written.
pub fn write(answer: &Answer, case: &str, folder: &Path) -> Result<(), Error> {
    let forms = [
        ("report.md", markdown::text(answer, case)),
        ("report.html", html::text(answer, case)),
        ("report.json", json::text(answer, case)),
    ];
    for (name, text) in forms {
        let path = folder.join(name);
        write_whole(&path, |out| out.write_all(text.as_bytes())).map_err(|source| Error { path, source })?;
    }
    Ok(())
}
