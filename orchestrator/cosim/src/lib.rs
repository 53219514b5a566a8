//! Systems of FMUs: descriptions, masters that step them, and the coupled right-hand side.
//!
//! [`system`] reads and writes SSP descriptions and checks their connections; [`master`] owns the instances and steps
//! them; [`coupled`] offers the same system as [`Dynamics`](airloop_dynamics::Dynamics) with derivatives; [`results`]
//! records a run. Start with [`system::SystemGraph::open`] and [`master::simulate::run`].

pub mod coupled;
pub mod master;
pub mod results;
pub mod system;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
