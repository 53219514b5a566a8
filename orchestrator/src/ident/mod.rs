//! System identification: models from data, and how well a model fits data.
//!
//! | module | what |
//! |--------|------|
//! | [`record`] | one experiment: sampled inputs and outputs |
//! | [`model`] | linear discrete-time models: ARX (eq. 6) and state space |
//! | [`fit`] | NRMSE fit (eq. 9) of two signals |
//! | [`score`] | simulated and one-step fit of a model over several records |
//! | [`subspace`] | state-space models by subspace methods |
//! | [`summary`] | what every identification reports, as JSON |
//!
//! Knows no FMUs and nothing of the command line.

pub mod fit;
pub mod model;
pub mod record;
pub mod score;
pub mod subspace;
pub mod summary;
