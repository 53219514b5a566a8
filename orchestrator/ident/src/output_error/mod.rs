//! Output error: the parameters with which the free simulation is closest to the measurement.
//!
//! Least squares on `A(z) y = B(z) u + e` puts the noise into the equation; sensors put it on the outputs, and least
//! squares is then biased. Here `y = A(z)^-1 B(z) u + e` is fitted instead, the best estimate for white measurement
//! noise and the best simulation for any other (Ljung, System Identification, 2nd ed., sec. 4.2 and 8.5). Several
//! records, each with its own initial state, which is eliminated exactly (variable projection). Start with [`refine`]
//! for ARX structures, [`refine_state_space`] for state space.

mod arx;
mod denoised;
mod equivalent;
mod levenberg_marquardt;
mod predictor;
mod sensitivity;
mod state_space;
mod tangent;

use nalgebra::DMatrix;
use serde::Serialize;

use super::parameters::Parameters;
pub use super::rational::Error;
use airloop_optim::linalg::triangular;

pub use arx::{OutputError, refine};
pub use state_space::{Criterion, RefinedStateSpace, StateSpaceOptions, refine_state_space};

/// Weights of the outputs against each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Weighting {
    /// Every output by the inverse of its own residual variance: maximum likelihood for independent noise, and robust
    /// when the residuals are model error.
    Diagonal,
    /// By the inverse of the full covariance of the residuals: maximum likelihood for noise that the outputs share.
    Full,
}

/// Settings of the iterations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Most iterations; 50 by default.
    pub iterations: usize,
    /// Ends when the step still to go is below this many standard deviations of the estimate (root mean square over the
    /// parameters); 1e-4 by default.
    pub tolerance: f64,
    /// Weights of the outputs against each other; each by its own noise by default.
    pub weighting: Weighting,
    /// Poles stay within this radius; just below 1 by default.
    pub largest_pole: f64,
}

impl Default for Options {
    fn default() -> Options {
        Options { iterations: 50, tolerance: 1e-4, weighting: Weighting::Diagonal, largest_pole: 1.0 - 1e-6 }
    }
}

/// Outcome of the iterations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// At a minimum.
    Converged,
    /// The error no longer falls, though the parameters still move: the data leave a combination of them open, as a
    /// rule because the order is higher than needed.
    Flat,
    /// No step lowers the error, though this is not a minimum: the border of stability is in the way, or the data do
    /// not determine the parameters.
    Stalled,
    /// [`Options::iterations`] were not enough.
    IterationLimit,
}

impl Outcome {
    /// A sentence for a report.
    pub fn describe(self) -> &'static str {
        match self {
            Outcome::Converged => "the iterations settled at a minimum",
            Outcome::Flat => {
                "the error settled, though the parameters did not: the data leave a combination of them open; a lower order may do as well"
            }
            Outcome::Stalled => {
                "the iterations stopped where no step lowers the error: a pole is at the border of stability, or the data do not determine all parameters; try a lower order"
            }
            Outcome::IterationLimit => {
                "the iterations reached their limit before they settled; allow more, or try a lower order"
            }
        }
    }
}

/// Covariance from the factor of the weighted derivatives, with the condition number of the (column-scaled)
/// derivatives.
fn with_covariance(mut parameters: Parameters, r: &DMatrix<f64>) -> (Parameters, f64) {
    let (covariance, condition) = triangular::covariance(r);
    parameters.covariance = covariance;
    (parameters, condition)
}

#[cfg(test)]
mod tests;
