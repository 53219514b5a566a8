//! System identification: models from data, and how well a model fits data.
//!
//! | module | what |
//! |--------|------|
//! | [`record`] | one experiment: sampled inputs and outputs |
//! | [`model`] | linear discrete-time models: ARX (eq. 6) and state space |
//! | [`fit`] | NRMSE fit (eq. 9) of two signals |
//! | [`score`] | simulated and one-step fit of a model over several records |
//! | [`output_error`] | refinement: the parameters with the best free simulation |
//! | [`instrumental_variables`] | estimates without bias from noisy outputs |
//! | [`parameters`] | estimates with their uncertainty |
//! | [`impulse_response`] | regularised FIR: evidence for delay and order before any structure is chosen |
//! | [`diagnostics`] | residual tests, poles and zeros, responses with their uncertainty, a verdict |
//! | [`summary`] | what every identification reports, as JSON |
//!
//! Knows no FMUs and nothing of the command line.

pub mod diagnostics;
pub mod fit;
pub mod fold;
pub mod impulse_response;
pub mod instrumental_variables;
pub mod model;
pub mod output_error;
pub mod parameters;
pub mod rational;
pub mod record;
pub mod score;
pub mod summary;
#[cfg(test)]
pub mod synthetic;
