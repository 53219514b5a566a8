//! The answer of `refine` as files: `report.json` for programs, `report.md` and `report.html` for readers.
//!
//! All three say the same. The page is complete in itself: charts are SVG, the style sheet and a small script for zoom
//! and values stand inside.

pub mod chart;
pub mod figures;
pub mod html;
pub mod json;
pub mod markdown;
pub mod names;
pub mod next;
pub mod plot;
pub mod words;

use std::io::Write;
use std::path::{Path, PathBuf};

use airloop_refine::amend;
use airloop_refine::answer::{Answer, Settings};
use airloop_refine::evidence::Evidence;
use airloop_series::file::write_whole;

/// JSON schema of `report.json`.
pub const SCHEMA: &str = include_str!("report.schema.json");
/// Files of a report, the one that programs read last: it is there only when the others are.
pub const FILES: [&str; 3] = ["report.md", "report.html", "report.json"];

/// Reason why a report cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: the report cannot be written: {source}; choose another folder with `-o`", path.display())]
pub struct Error {
    /// File.
    pub path: PathBuf,
    /// Reason.
    pub source: std::io::Error,
}

/// Everything that a report says.
#[derive(Debug, Clone, Copy)]
pub struct Report<'a> {
    /// Name of the case.
    pub case: &'a str,
    /// The answer.
    pub answer: &'a Answer,
    /// Material of the figures.
    pub evidence: &'a Evidence,
    /// Settings of the search.
    pub settings: &'a Settings,
    /// Folder of the amended system next to the report, if one was written.
    pub system: Option<&'a str>,
    /// The study that was asked, as seen from the folder of the report; none: a case of the rig.
    pub study: Option<&'a str>,
    /// Whether a table of the columns of the records stands in the folder of the amended system.
    pub signals: bool,
}

/// The command that runs the amended system in `folder`, from the folder of the report, and compares it with the
/// records.
fn command(report: &Report, folder: &str) -> String {
    if let Some(study) = report.study {
        let quote = if study.contains(' ') { "'" } else { "" };
        return format!("airloop run {folder}/system.ssd --study {quote}{study}{quote} -o out/amended");
    }
    let table =
        if report.signals { format!(" --signals {folder}/{}", amend::SIGNALS) } else { String::new() };
    format!("airloop run {folder}/system.ssd --master monolithic --measured RECORD.csv{table} -o out/amended")
}

/// Writes all forms of the report into a folder.
///
/// # Errors
/// The first file that cannot be written.
pub fn write(report: &Report, folder: &Path) -> Result<(), Error> {
    let texts = [markdown::text(report), html::text(report), json::text(report)];
    for (name, text) in FILES.into_iter().zip(texts) {
        let path = folder.join(name);
        write_whole(&path, |out| out.write_all(text.as_bytes())).map_err(|source| Error { path, source })?;
    }
    Ok(())
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
