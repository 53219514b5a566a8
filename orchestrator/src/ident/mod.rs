//! System identification: models from data, and how well a model fits data.
//!
//! | module | what |
//! |--------|------|
//! | [`record`] | one experiment: sampled inputs and outputs, read and checked |
//! | [`source`] | an experiment in blocks, from memory or from a file |
//! | [`structure`] | orders and delays |
//! | [`regressor`] | the regression of an ARX model, folded into a triangle |
//! | [`arx`] | least squares of ARX models |
//! | [`model`] | linear discrete-time models: ARX (eq. 6) and state space |
//! | [`fit`] | NRMSE fit (eq. 9) of two signals |
//! | [`responses`] | measured, simulated and predicted outputs side by side |
//! | [`score`] | simulated and one-step fit of a model over several records |
//! | [`subspace`] | state-space models by subspace methods |
//! | [`output_error`] | refinement: the parameters with the best free simulation |
//! | [`instrumental_variables`] | estimates without bias from noisy outputs |
//! | [`parameters`] | estimates with their uncertainty |
//! | [`summary`] | what every identification reports, as JSON |
//!
//! Knows no FMUs and nothing of the command line.

pub mod arx;
pub mod fit;
pub mod friction;
pub mod fold;
pub mod instrumental_variables;
pub mod model;
pub mod output_error;
pub mod parameters;
pub mod rational;
pub mod record;
pub mod regressor;
pub mod responses;
pub mod score;
pub mod subspace;
pub mod source;
pub mod structure;
pub mod summary;
#[cfg(test)]
pub mod synthetic;
