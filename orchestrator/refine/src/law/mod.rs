//! Laws that no list holds: from what is left at a port to a smooth form, and from that to a formula.
//!
//! [`surface`] is the free form, heights at knots over one or two variables of a port. [`surrogate`] fits it in simulation
//! with a penalty that held-out parts choose; around its optimum the error is a quadratic form of the heights. [`grammar`]
//! has the terms of formulas, [`formula`] searches among their sums on that quadratic form, where a fit costs next to nothing;
//! [`study`] compares free forms in short [`windows`] of the records, [`exact`] fits the best formulas in simulation and
//! decides; [`rig`] does so for the rig of the vocabulary.

pub mod exact;
pub mod formula;
pub mod grammar;
pub mod rig;
pub mod study;
pub mod surface;
pub mod surrogate;
pub mod windows;
