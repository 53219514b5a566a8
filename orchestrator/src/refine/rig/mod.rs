//! The rig of the case folders as a [`System`](crate::refine::engine::System): actuator, friction, cart and pole, with every effect that may be missing.

pub mod catalogue;
pub mod coupled;
pub mod record;
pub mod parameters;
pub mod plant;
