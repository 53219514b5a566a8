//! The problem file: TOML with named variables and units, read with the line and column of everything.
//!
//! [`read()`] gives a [`Statement`]; what its names and units mean in a system is left to [`crate::task`].

pub mod balance;
pub mod feed_forward;
pub mod quantity;
mod read;
mod read_phase;
pub mod source;
pub mod statement;
mod stick_figure;
pub mod table;

pub use quantity::Quantity;
pub use read::{parameters, parse, read, variant};
pub use source::{Place, Source};
pub use statement::{Statement, TRANSCRIPTIONS, transcription_name};
pub use stick_figure::{Length, Rod, StickFigure};
pub use table::Text;

/// JSON schema of the problem file, for editors that complete and check TOML.
pub const SCHEMA: &str = include_str!("schema.json");

#[cfg(test)]
mod tests;
