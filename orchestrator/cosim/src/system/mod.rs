//! A system of coupled FMUs as data: components, connectors, connections, start values, evaluation order.
//!
//! [`graph::SystemGraph::open`] reads an `.ssd`, an `.ssp` or a single `.fmu`; [`validate`] resolves every name to a
//! variable of an FMU and refuses what cannot be simulated; [`order`] finds the evaluation order. [`write::write`]
//! saves a graph again. No FMU is instantiated here; that is left to `master`.

pub mod error;
pub mod graph;
mod notes;
pub mod order;
mod resize;
pub mod ssp;
pub mod ssv;
mod start;
pub mod validate;
pub mod write;
mod xml;

pub use error::Error;
pub use graph::SystemGraph;
