//! Effects that are written as formulas: those of one's own, and laws that a search has found.
//!
//! [`own`] is such an effect, [`fmu_law`] one that an FMU computes; a TOML file is read and checked, [`folder`] is a
//! folder of them, [`units`] derives the units of states, [`attach`]
//! makes candidates of them at the attachments of a study, [`builtin`] has the effects of the program in the same form.

pub mod attach;
pub mod builtin;
pub mod fmu_law;
pub mod folder;
pub mod own;
mod reader;
pub mod units;

pub use own::{Own, PortKind};
