//! Options of the interface-Jacobian master.

/// Settings with which a coupled component is stepped.
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
