//! Candidate effects as the engine sees them: names, free parameters and points to start a fit from; no physics.

use super::fit::Free;

/// A candidate effect: which parameters it has and where to start looking for them.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Id of the effect (`cart.spring`); sensors carry the signal as well.
    pub id: &'static str,
    /// Channel of the effect.
    pub channel: &'static str,
    /// Measured signal of a sensor effect.
    pub signal: Option<&'static str>,
    /// Its parameters, all fitted in the end.
    pub free: Vec<Free>,
    /// Points to start from. Effects that are nonlinear in their parameters have several.
    pub starts: Vec<Start>,
    /// Place of the effect among those with the same id.
    pub place: usize,
    /// Id of the candidate at the same place that this one contains as a special case.
    pub contains: Option<&'static str>,
}

/// A point to start from.
#[derive(Debug, Clone)]
pub struct Start {
    /// Values set there: index, value.
    pub values: Vec<(usize, f64)>,
    /// Positions in [`Candidate::free`] of the parameters that the linear step from here finds.
    pub open: Vec<usize>,
    /// Whether `values` change nothing as long as the open parameters are neutral.
    pub idle: bool,
}

impl Candidate {
    /// Whether this one only adds freedom to another: a lag with a time of its own for each direction to a lag.
    pub fn adds_to(&self, other: &Candidate) -> bool {
        self.contains == Some(other.id) && self.place == other.place
    }

    /// Unique name: id, with the signal for sensors.
    pub fn name(&self) -> String {
        self.signal.map_or_else(|| self.id.to_owned(), |signal| format!("{}({signal})", self.id))
    }
}
