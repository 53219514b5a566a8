//! Effects that are written as formulas: those of one's own, and laws that a search has found.
//!
//! [`own`] reads and checks a TOML file, [`folder`] a folder of them, [`units`] derives the units of states, [`attach`]
//! makes candidates of them at the attachments of a study, [`builtin`] has the effects of the program in the same form.

pub mod attach;
pub mod builtin;
pub mod folder;
pub mod own;
pub mod units;

pub use own::{Own, PortKind};
