//! System identification: models from data, and how well a model fits data.
//!
//! | module | content |
//! |--------|------|
//! | [`record`] | one experiment: sampled inputs and outputs, read and checked |
//! | [`source`] | an experiment in blocks, from memory or from a file |
//! | [`structure`] | orders and delays |
//! | [`regressor`] | the regression of an ARX model, folded into a triangle |
//! | [`excitation`] | what the inputs can teach |
//! | [`arx`] | least squares of ARX models |
//! | [`model`] | linear discrete-time models: ARX (eq. 6) and state space |
//! | [`fit`] | NRMSE fit (eq. 9) of two signals |
//! | [`playback`] | responses of an ARX model, block by block |
//! | [`responses`] | measured, simulated and predicted outputs side by side |
//! | [`order_search`] | many ARX structures, ranked by simulated fit |
//! | [`score`] | simulated and one-step fit of a model over several records |
//! | [`compare`] | ARX and state space of rising order side by side |
//! | [`subspace`] | state-space models by subspace methods |
//! | [`output_error`] | refinement: the parameters with the best free simulation |
//! | [`instrumental_variables`] | estimates without bias from noisy outputs |
//! | [`parameters`] | estimates with their uncertainty |
//! | [`impulse_response`] | regularized FIR: evidence for delay and order before any structure is chosen |
//! | [`diagnostics`] | residual tests, poles and zeros, responses with their uncertainty, a verdict |
//! | [`summary`] | what every identification reports, as JSON |
//!
//! Plain equation numbers (eq. 2, 3, 6, 9) are those of *Model-based Trajectory Control of Robots with Pneumatic
//! Actuator Dynamics*, "the paper". Knows no FMUs and nothing of the command line.

pub mod arx;
pub mod compare;
pub mod diagnostics;
pub mod excitation;
pub mod excite;
pub mod fit;
pub mod friction;
pub mod impulse_response;
pub mod instrumental_variables;
pub mod model;
pub mod order_search;
pub mod output_error;
pub mod parameters;
pub mod playback;
pub mod rational;
pub mod record;
pub mod regressor;
pub mod responses;
pub mod score;
pub mod source;
pub mod structure;
pub mod subspace;
pub mod summary;
#[cfg(test)]
pub mod synthetic;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
