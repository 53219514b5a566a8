//! FMI 2.0 and 3.0 export for Rust: write one model, get FMUs with Co-Simulation and Model Exchange.
//!
//! A model author implements [`Model`]: a variable table, equations generic over [`Scalar`], and where the model
//! has them a sampled update, event indicators and events. One line, `fmi_export::export_fmu!(MyModel);`, in a
//! `cdylib` crate gives the shared library; [`description`] gives `modelDescription.xml`.
//!
//! Start reading at [`Model`], then [`Table`].
#![warn(missing_docs)]

pub mod abi;
mod co_simulation;
mod columns;
pub mod ctypes;
mod declaration;
mod definition;
pub mod description;
mod directional;
mod dual;
mod export;
mod export_fmi3;
pub mod fmi3;
mod fmu_state;
mod inner_solver;
mod input_ramp;
mod instance;
mod integrator;
mod logger;
mod model;
mod model_exchange;
mod resources;
mod scalar;
mod shared_description;
mod spread;
pub mod start_values;
pub mod state_machine;
pub mod structure;
mod table;
pub mod units;
mod values;
mod variables;
mod xml;

pub use declaration::{Declaration, Enumeration};
pub use definition::{Definition, fingerprint};
pub use dual::Dual;
pub use logger::CATEGORIES as LOG_CATEGORIES;
pub use model::{Event, Identity, Model, Outcome, Refusal};
pub use scalar::Scalar;
pub use table::{Causality, EnumerationType, Initial, Kind, Table, Variability, Variable};
pub use values::{Boolean, Integer, Interface, Memory, MemoryBlock, Real, Text, Values};
