//! Steps of integration that blocks need which are faster than the system: a tank that is full to its brim stays so
//! within no time.

use super::integration::MAX_STABLE_SUBSTEPS;
use super::law::Law;
use super::model::{Action, Study};
use super::simulate::View;

/// Rate of a block times a step at most, well within the stability of the Runge-Kutta methods of order 2 and 4 (2.0 and
/// 2.8).
const MAX_RATE_TIMES_STEP: f64 = 1.0;

/// Rate \[1/s\] of the level behind an overflow with coefficient 1 at a tap; none where it is not known.
fn rate_of_level(study: &Study, tap: usize) -> Option<f64> {
    let slope = study.taps[tap].attachment.port?.slope.abs();
    (slope > 0.0).then_some(slope)
}

/// Largest coefficient of an overflow that can be integrated on the records of a study: faster ones are the same.
pub(super) fn largest_coefficient(study: &Study, tap: usize) -> f64 {
    let longest = study.records.iter().map(|record| record.step).fold(0.0, f64::max);
    match rate_of_level(study, tap) {
        Some(rate) if longest > 0.0 => MAX_RATE_TIMES_STEP * MAX_STABLE_SUBSTEPS as f64 / (rate * longest),
        _ => f64::INFINITY,
    }
}

impl View<'_> {
    /// Runge-Kutta steps per sample of `step` \[s\] with the parameters `p`: a power of two, so that they seldom change
    /// from one parameter vector to the next.
    pub(super) fn substeps_with(&self, p: &[f64], step: f64) -> usize {
        let needed = |&c: &usize| {
            let own = &self.study.candidates[c];
            let Action::Block { law: Law::Overflow | Law::CaughtOverflow, tap } = own.action else {
                return 1;
            };
            let rate = rate_of_level(self.study, tap).unwrap_or(0.0) * p[own.entries.start].abs();
            let count = (rate * step / MAX_RATE_TIMES_STEP).ceil().min(MAX_STABLE_SUBSTEPS as f64);
            (count as usize).max(1).next_power_of_two()
        };
        self.active.iter().map(needed).fold(self.substeps, usize::max)
    }
}
