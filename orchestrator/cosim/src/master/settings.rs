//! Settings of all masters.

use super::{Error, Grid};
use crate::system::SystemGraph;

/// Highest order of [`Settings::extrapolation`].
pub(super) const MAX_ORDER: u32 = 2;
/// Default of [`Adaptive::tolerance`].
const DEFAULT_STEP_TOLERANCE: f64 = 1e-4;
/// Default limits of adaptive steps, relative to the first.
const DEFAULT_STEP_LIMITS: (f64, f64) = (1e-6, 10.0);

/// Order in which slaves step and exchange values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Algorithm {
    /// Serial: in evaluation order, each slave gets the newest outputs of those before it.
    #[default]
    GaussSeidel,
    /// Parallel: all slaves get the outputs at the communication point, then all step.
    Jacobi,
    /// Linearly implicit: strongly coupled components are solved in the master before their slaves step.
    InterfaceJacobian,
    /// All components as one differential equation through Model Exchange, with error control and no coupling error;
    /// for [`super::simulate::run`] only.
    Monolithic,
}

impl Algorithm {
    /// Whether an output as it is in a row belongs to the interval before that row, and is written to the start of it.
    ///
    /// After a step, that is a sampled output ([`SystemGraph::stands_at_step_start`]). The monolithic master reads
    /// before the events of a time, so that there every discrete output is the one of the interval that ends.
    pub fn stands_at_start(self, graph: &SystemGraph, component: usize, variable: usize) -> bool {
        match self {
            Algorithm::Monolithic => graph.is_held(component, variable),
            _ => graph.stands_at_step_start(component, variable),
        }
    }
}

impl std::fmt::Display for Algorithm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Algorithm::GaussSeidel => "gauss-seidel",
            Algorithm::Jacobi => "jacobi",
            Algorithm::InterfaceJacobian => "interface-jacobian",
            Algorithm::Monolithic => "monolithic",
        })
    }
}

/// Settings of a master.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Start time \[s\]; default 0.
    pub start_time: f64,
    /// Stop time \[s\], reached exactly; default 1.
    pub stop_time: f64,
    /// Communication step size \[s\], positive; default 1 ms. The last step is shortened to meet the stop time.
    pub step_size: f64,
    /// Coupling of the components; default Gauss-Seidel.
    pub algorithm: Algorithm,
    /// Options of the interface-Jacobian master.
    pub coupling: Coupling,
    /// Order (0 to 2) of the polynomials that inputs follow inside a step of Gauss-Seidel or Jacobi; default 0, held.
    pub extrapolation: u32,
    /// Relative tolerance for the slaves, in (0, 1); default: each slave uses its own. Also that of the monolithic
    /// integrator, default [`super::monolithic::DEFAULT_TOLERANCE`].
    pub tolerance: Option<f64>,
    /// Adaptive communication steps, for [`super::simulate::run`]; default: none, all steps are of
    /// [`Settings::step_size`].
    pub adaptive: Option<Adaptive>,
    /// Read all outputs at every communication point (default), or only those that are connected.
    pub read_all_outputs: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            start_time: 0.0,
            stop_time: 1.0,
            step_size: 1e-3,
            algorithm: Algorithm::GaussSeidel,
            coupling: Coupling::default(),
            extrapolation: 0,
            tolerance: None,
            adaptive: None,
            read_all_outputs: true,
        }
    }
}

impl Settings {
    /// Checks the settings and lays out the communication points.
    ///
    /// # Errors
    /// [`Error::Setting`] names the setting, its value and what is allowed.
    pub fn validate(&self) -> Result<Grid, Error> {
        if let Some(tolerance) = self.tolerance.filter(|tolerance| !(*tolerance > 0.0 && *tolerance < 1.0)) {
            return Err(Error::Setting { name: "tolerance", value: tolerance, allowed: "between 0 and 1" });
        }
        if self.extrapolation > MAX_ORDER {
            let value = f64::from(self.extrapolation);
            return Err(Error::Setting { name: "extrapolation", value, allowed: "0, 1 or 2" });
        }
        let iterate = self.coupling.tolerance.filter(|tolerance| !(*tolerance > 0.0 && *tolerance < 1.0));
        if let Some(tolerance) = iterate {
            return Err(Error::Setting { name: "iterate", value: tolerance, allowed: "between 0 and 1" });
        }
        Grid::new(self.start_time, self.stop_time, self.step_size)
    }
}

/// Settings with which the interface-Jacobian master steps a coupled component.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coupling {
    /// Steps repeated after a rollback; default 1. 0: the prediction is kept, no state is restored.
    pub corrections: u32,
    /// Correct until the outputs change by less than this, relative to the larger of value and nominal value;
    /// replaces `corrections`.
    pub tolerance: Option<f64>,
    /// Inputs run along straight lines over the step (default) instead of being held.
    pub ramped: bool,
}

impl Coupling {
    /// Whether steps are repeated, so that states have to be saved.
    pub fn repeats(&self) -> bool {
        self.corrections > 0 || self.tolerance.is_some()
    }
}

impl Default for Coupling {
    fn default() -> Self {
        Coupling { corrections: 1, tolerance: None, ramped: true }
    }
}

/// Settings of adaptive communication steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Adaptive {
    /// Error of one step, relative to the largest absolute value of the signal so far (at least a hundredth of its
    /// nominal value); in (0, 1), default 1e-4.
    pub tolerance: f64,
    /// Shortest communication step \[s\]; default: a millionth of [`Settings::step_size`], which is the first step.
    pub min_step: Option<f64>,
    /// Longest communication step \[s\]; default: ten times [`Settings::step_size`].
    pub max_step: Option<f64>,
}

impl Default for Adaptive {
    fn default() -> Self {
        Adaptive { tolerance: DEFAULT_STEP_TOLERANCE, min_step: None, max_step: None }
    }
}

impl Adaptive {
    /// Shortest and longest communication step \[s\] of a run whose first step is `first` \[s\] long.
    ///
    /// # Errors
    /// [`Error::Setting`] names what is out of range.
    pub fn limits(&self, first: f64) -> Result<(f64, f64), Error> {
        let wrong = |name, value, allowed| Err(Error::Setting { name, value, allowed });
        if !(self.tolerance > 0.0 && self.tolerance < 1.0) {
            return wrong("step-tolerance", self.tolerance, "between 0 and 1");
        }
        let max = self.max_step.unwrap_or((DEFAULT_STEP_LIMITS.1 * first).max(self.min_step.unwrap_or(0.0)));
        if !(max.is_finite() && max > 0.0) {
            return wrong("max-step", max, "positive");
        }
        let min = self.min_step.unwrap_or((DEFAULT_STEP_LIMITS.0 * first).min(max));
        if !(min > 0.0 && min <= max) {
            return wrong("min-step", min, "positive and not above the longest step (--max-step)");
        }
        Ok((min, max))
    }
}
