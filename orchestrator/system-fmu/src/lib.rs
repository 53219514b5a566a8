//! A whole system of FMUs as one FMU 2.0, Co-Simulation and Model Exchange.
//!
//! [`write()`] makes the archive from a [`SystemGraph`](airloop_cosim::system::SystemGraph) and the library of this
//! crate; the same library, inside the archive, opens the system again and runs it under an importer (`abi`,
//! `instance`).
//! With [`Nmpc`] in its [`Recipe`] the FMU is a controller that predicts with the system (`predictive`).
//! With rates in its recipe it is a single FMU that has inputs at rates of its states, which it lacked.
//! Both sides find the same variables (`table`), because both derive them from the system. This is the one crate that
//! knows FMUs as importer and as exporter.

mod abi;
mod archive;
mod description;
mod instance;
mod predictive;
mod recipe;
mod state;
mod table;

pub use archive::{Error, write};
pub use recipe::{Master, Nmpc, Parameter, Recipe, added_to};

/// Name of the archive with the libraries of this crate among the templates.
pub const TEMPLATE: &str = "template/airloop-system";

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
