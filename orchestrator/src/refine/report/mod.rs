//! The answer as files: `report.json` for programs, `report.md` and `report.html` for readers.

pub mod json;
