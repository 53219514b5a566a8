//! Import of units of FMI 2.0 and 3.0: archive, model description, library, instances.
//!
//! [`Fmu::open`] checks and unpacks an archive and reads its model description; [`Slave`] is a Co-Simulation
//! instance, [`Model`] a Model Exchange instance. Connections between instances, stepping order and results are left to
//! the modules above. An FMU of FMI 3.0 looks like one of 2.0 from here on (module `fmi3`). Start reading at [`Fmu`],
//! then [`Instance`], which holds what both interfaces share. Section numbers are those of the FMI standard, version
//! 2.0.5.

mod archive;
mod arrays;
pub mod check;
pub mod derive;
pub mod description;
mod error;
mod feed_through;
mod fmi3;
mod functions;
mod instance;
pub mod isolate;
pub mod last_words;
mod library;
mod loading;
mod log;
mod model;
mod open;
mod package;
mod signals;
mod slave;
mod surroundings;
pub mod template_folder;
pub mod terminals;
pub mod trace;
pub mod xml;

pub use archive::{ArchiveError, Limits};
pub use description::{
    Causality, DefaultExperiment, Dependency, DependencyKind, DescriptionError, Initial, Interface,
    LogCategory, ModelDescription, NamingConvention, RealAttributes, TypeDefinition, UnitDefinition, Unknown,
    UnreadVariable, Variability, Variable, VariableKind,
};
pub use error::{CallError, Error, LostError, Status};
pub use instance::{Instance, StateHandle};
pub use log::LogMessage;
pub use model::{EventInfo, Model, StepEvent};
pub use open::{Fmu, InterfaceKind};
pub use package::unpack_package;
pub use slave::{Slave, StepStatus};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
