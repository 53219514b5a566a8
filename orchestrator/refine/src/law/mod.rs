//! Laws that no list holds: from the residual at a port to a smooth free form, and from that to a formula.
//!
//! [`surface`] is the free form, heights at knots over one or two variables of a port. [`surrogate`] fits it in
//! simulation with a penalty chosen by held-out folds; around its optimum the error is a quadratic form of the heights.
//! [`grammar`] lists the terms of formulas, [`formula`] searches among their sums on that quadratic form, where a fit
//! costs next to nothing. [`study`] compares free forms in short [`windows`] of the records, `crossed` those over the
//! motion at other ports and `observed` those over other measured signals, both by `elsewhere`, `weighed` those beside
//! declared parameters that are off. [`exact`] fits the best
//! formulas in simulation and decides; [`rig`] does so for the rig of the vocabulary, which [`rig_whole`] holds against
//! whole records. [`written`] turns a formula into an effect of one's own, [`found`] is the answer; [`listed`] asks
//! whether effects of the list do as well.

pub mod beside;
mod crossed;
mod elsewhere;
pub mod exact;
pub(crate) mod extent;
mod finder;
pub mod formula;
pub mod found;
mod free_form;
pub mod grammar;
pub mod listed;
mod observed;
mod place;
pub mod rig;
pub mod rig_whole;
pub mod study;
pub mod surface;
pub mod surrogate;
mod terms;
mod weighed;
pub mod windows;
pub mod written;
