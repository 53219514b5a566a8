//! Effects that a declared model may lack, as blocks in series with it.
//!
//! | block | where | what |
//! |---|---|---|
//! | [`force`] | on the way of a force | friction, springs, end stops, cogging, tilt |
//! | [`torque`] | on the way of a torque | bearing friction, air drag, tilt |
//! | [`port`] | at a port of any unit | all of these without sampling: forces, gains, limits, lags, leakage |
//! | [`signal`] | on the way of a command, or behind a sampled force | delay, play, dead band, limits, gains |
//! | [`sensor`] | behind any signal | offset, gain, delay |
//! | [`expression`] | on the way of any value | a formula |
//!
//! Every effect is off at its start values, so that a block with one effect is the template with a few parameters set.
//! Which blocks go where is left to whoever amends a system.

pub mod expression;
pub mod force;
pub mod port;
pub mod sensor;
pub mod signal;
pub mod torque;

pub use expression::ExpressionEffect;
pub use force::ForceEffect;
pub use port::PortEffect;
pub use sensor::SensorEffect;
pub use signal::SignalEffect;
pub use torque::TorqueEffect;
