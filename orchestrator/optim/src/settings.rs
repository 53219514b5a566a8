//! Settings of the solver, with their defaults.

use super::error::Error;

/// Method by which steps are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Primal-dual interior point: robust from afar.
    #[default]
    InteriorPoint,
    /// Sequential quadratic programming: fast from a good start, keeps the active set of a warm start.
    Sqp,
}

/// Settings of [`super::solve`].
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Method; interior point.
    pub method: Method,
    /// Scaled KKT error at which the problem counts as solved; 1e-8.
    pub tolerance: f64,
    /// Largest violation of a constraint or bound in its own unit when solved; 1e-8.
    pub violation_tolerance: f64,
    /// KKT error with which a run that cannot go on still counts as acceptable; 1e-6.
    pub acceptable_tolerance: f64,
    /// Iterations before giving up; 500. Those of the feasibility restoration count.
    pub max_iterations: usize,
    /// Barrier parameter of the first iteration of the interior point method; 0.1.
    pub initial_barrier: f64,
    /// Gradients at the start are scaled down to this largest entry; 100. That of the objective is scaled up to a tenth
    /// of it where it is smaller, by 10000 at most. Infinite: no scaling.
    pub scaling_gradient: f64,
    /// A variable beyond this magnitude counts as diverging; 1e20.
    pub diverging: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            method: Method::InteriorPoint,
            tolerance: 1e-8,
            violation_tolerance: 1e-8,
            acceptable_tolerance: 1e-6,
            max_iterations: 500,
            initial_barrier: 0.1,
            scaling_gradient: 100.0,
            diverging: 1e20,
        }
    }
}

impl Settings {
    /// Checks every range.
    ///
    /// # Errors
    /// [`Error::Setting`] names the first setting out of its range.
    pub fn validate(&self) -> Result<(), Error> {
        let positive = [
            ("tolerance", self.tolerance),
            ("violation_tolerance", self.violation_tolerance),
            ("acceptable_tolerance", self.acceptable_tolerance),
            ("initial_barrier", self.initial_barrier),
            ("scaling_gradient", self.scaling_gradient),
            ("diverging", self.diverging),
        ];
        for (setting, value) in positive {
            if value.is_nan() || value <= 0.0 {
                return Err(Error::Setting { setting, value, allowed: "a positive number" });
            }
        }
        if self.tolerance >= 1.0 {
            return Err(Error::Setting { setting: "tolerance", value: self.tolerance, allowed: "below 1" });
        }
        Ok(())
    }
}
