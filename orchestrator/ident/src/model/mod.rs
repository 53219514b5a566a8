//! Linear discrete-time models.
//!
//! All of them work about an operating point: `u - input_offset` goes in, `output_offset` is added to what comes out.

pub mod arx;
pub mod file;
pub mod state_space;

use nalgebra::Complex;

use airloop_optim::linalg::spectral;

pub use arx::Arx;
pub use file::{Linear, NamedModel};
pub use state_space::StateSpace;

use super::record::Record;

/// Common interface of all identified models.
///
/// Shapes: inputs \[n_u\]\[n\], outputs \[n_y\]\[n\], as in [`Record`].
pub trait Model {
    /// Number of inputs.
    fn n_u(&self) -> usize;
    /// Number of outputs.
    fn n_y(&self) -> usize;
    /// Sample time \[s\].
    fn sample_time(&self) -> f64;
    /// Outputs of a free simulation from the inputs of the record, shape \[n_y\]\[n\]. The model may use measured
    /// outputs to find its initial state only. Samples of an unstable model may be infinite or NaN.
    fn simulate(&self, record: &Record) -> Vec<Vec<f64>>;
    /// One-step prediction `y(k | k-1)` from measured inputs and outputs, shape \[n_y\]\[n\].
    fn one_step(&self, record: &Record) -> Vec<Vec<f64>>;
    /// First samples that are taken from the measurement in [`Model::simulate`] and [`Model::one_step`] and say nothing
    /// of the model; fits leave them out.
    fn warm_up(&self) -> usize;
    /// The same model in state-space form.
    fn to_state_space(&self) -> StateSpace;
    /// Poles in the z plane.
    fn poles(&self) -> Vec<Complex<f64>> {
        let a = self.to_state_space().a;
        // A model without memory has no poles.
        if a.is_empty() { Vec::new() } else { spectral::eigenvalues(&a) }
    }
    /// Whether all poles are inside the unit circle.
    fn is_stable(&self) -> bool {
        self.poles().iter().all(|pole| pole.norm() < 1.0)
    }
}
