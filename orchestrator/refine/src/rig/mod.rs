//! The rig of the case folders as a [`System`](crate::engine::System): actuator, friction, cart and pole, with
//! every effect that may be missing.
//!
//! The equations stand here as plain code and not as FMUs: a case needs some thousand simulations of all its records,
//! and a call through FMI costs as much as the whole right-hand side. What is added in the end are FMUs.

pub mod answer;
pub mod catalog;
pub mod corrections;
pub mod coupled;
pub mod cylinder;
pub mod driven;
pub mod extra;
pub mod lanes;
pub mod localize;
pub mod motion;
pub mod observer;
pub mod open;
pub mod parameters;
pub mod physical;
pub mod plant;
pub mod port;
pub mod record;
pub mod replay;
pub mod sense;
pub mod sweep;
#[cfg(test)]
pub mod testing;
pub mod windowed;
