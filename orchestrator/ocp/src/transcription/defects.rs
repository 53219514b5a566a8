//! Error of a trajectory in its dynamics between the knots.
//!
//! ```text
//! e_i = integral over the interval of |dx_i/dt - f_i(t, x(t), u(t))|
//! ```
//!
//! with the interpolants of states and inputs, by Gauss quadrature on both halves (Betts, Practical Methods for Optimal
//! Control, section 4.7.4). The relative error divides by the largest magnitude of the state or of its rate, plus one
//! nominal value. Where states of a sampled block are held, this compares with the continuous model all the same.

use super::dynamics::{Dynamics, Point};
use super::trajectory::{PhaseTrajectory, Trajectory};
use super::{Error, Problem};
use airloop_optim::EvaluationError;

/// Gauss points with four nodes on 0..1: half of them, with their weights; the others lie symmetrically.
const GAUSS: [(f64, f64); 2] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
];

/// Errors of a phase between its knots.
#[derive(Debug, Clone, PartialEq)]
pub struct IntervalErrors {
    /// Per interval and state, in units of the state, `[N][n_x]`.
    pub absolute: Vec<Vec<f64>>,
    /// Largest relative error of every interval, `[N]`.
    pub relative: Vec<f64>,
}

impl IntervalErrors {
    /// Largest relative error over all intervals and states.
    pub fn largest(&self) -> f64 {
        self.relative.iter().copied().fold(0.0, f64::max)
    }
}

/// Errors of every phase.
///
/// # Errors
/// [`Error::Trajectory`] when the phases do not fit the problem; where the dynamics have no value.
pub fn interval_errors(problem: &mut Problem, trajectory: &Trajectory) -> Result<Vec<IntervalErrors>, Error> {
    if problem.phases.len() != trajectory.phases.len() {
        let (found, needed) = (trajectory.phases.len(), problem.phases.len());
        return Err(Error::Trajectory(format!("it has {found} phases, the problem {needed}")));
    }
    problem
        .phases
        .iter_mut()
        .zip(&trajectory.phases)
        .map(|(phase, trajectory)| match phase.dynamics.first_mut() {
            Some(dynamics) => Ok(of_phase(dynamics.as_mut(), trajectory)?),
            None => Err(Error::NoDynamics { phase: phase.name.clone() }),
        })
        .collect()
}

fn of_phase(dynamics: &mut dyn Dynamics, phase: &PhaseTrajectory) -> Result<IntervalErrors, EvaluationError> {
    let size = dynamics.size();
    let nominals = dynamics.nominals();
    let mut values = vec![0.0; size.values()];
    let mut largest: Vec<f64> =
        (0..size.states).map(|i| phase.states.iter().fold(0.0, |m: f64, x| m.max(x[i].abs()))).collect();
    let mut absolute = vec![vec![0.0; size.states]; phase.intervals()];
    for (k, errors) in absolute.iter_mut().enumerate() {
        let length = phase.times[k + 1] - phase.times[k];
        for half in [0.0, 0.5] {
            for (place, weight) in GAUSS.into_iter().flat_map(|(p, w)| [(p, w), (1.0 - p, w)]) {
                let s = half + 0.5 * place;
                let (states, inputs) = (phase.states_in(k, s), phase.inputs_in(k, s));
                let time = phase.times[k] + s * length;
                dynamics.evaluate(Point { time, states: &states, inputs: &inputs }, &mut values)?;
                for (i, slope) in phase.slopes_in(k, s).into_iter().enumerate() {
                    errors[i] += 0.5 * weight * length * (slope - values[i]).abs();
                    largest[i] = largest[i].max(values[i].abs());
                }
            }
        }
    }
    let scales: Vec<f64> =
        largest.iter().zip(&nominals).map(|(largest, nominal)| largest + nominal).collect();
    let relative = absolute
        .iter()
        .map(|errors| errors.iter().zip(&scales).fold(0.0, |m: f64, (e, scale)| m.max(e / scale)))
        .collect();
    Ok(IntervalErrors { absolute, relative })
}
