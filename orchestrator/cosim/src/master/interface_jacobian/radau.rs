//! Integration of the reduced problem over a communication step: Radau IIA of order 5 (three stages, L-stable; Hairer
//! and Wanner, Solving Ordinary Differential Equations II, sections IV.5 and IV.8) with error control, and the moments
//! of every input on the way.
//!
//! The integration stops where a signal from outside jumps, so that no jump is smoothed.

use super::dense;
use super::reduced::{Link, Reduced, Surroundings};
use super::signal::{SAME_TIME, first_moment};
use super::unit::Feed;
use crate::master::stop::Stop;

const STAGES: usize = 3;
/// sqrt(6)
const S6: f64 = 2.449_489_742_783_178;
const NODES: [f64; STAGES] = [(4.0 - S6) / 10.0, (4.0 + S6) / 10.0, 1.0];
const WEIGHTS: [[f64; STAGES]; STAGES] = [
    [(88.0 - 7.0 * S6) / 360.0, (296.0 - 169.0 * S6) / 1800.0, (-2.0 + 3.0 * S6) / 225.0],
    [(296.0 + 169.0 * S6) / 1800.0, (88.0 + 7.0 * S6) / 360.0, (-2.0 - 3.0 * S6) / 225.0],
    [(16.0 - S6) / 36.0, (16.0 + S6) / 36.0, 1.0 / 9.0],
];
/// Weights of the stages in the error estimate, and the real eigenvalue of the inverse of `WEIGHTS` (Hairer and
/// Wanner, Solving Ordinary Differential Equations II, section IV.8).
const ERROR: [f64; STAGES] = [-(13.0 + 7.0 * S6) / 3.0, (-13.0 + 7.0 * S6) / 3.0, -1.0 / 3.0];
const EIGENVALUE: f64 = 3.637_834_252_744_496;
/// Rounds of Newton's method on the stages.
const ROUNDS: usize = 10;
/// Newton's method ends at this part of the change of a state.
const NEWTON_TOLERANCE: f64 = 1e-9;
/// Error allowed per step, as a part of the change of a state (the estimate is of a lower order than the method).
const TOLERANCE: f64 = 1e-3;
/// The same as a part of the nominal value.
const ERROR_FLOOR: f64 = 1e-7;
/// Smallest step as a part of the communication step.
const MIN_RELATIVE_STEP: f64 = 1e-6;

/// Workspace.
#[derive(Debug)]
pub(super) struct Radau {
    n: usize,
    cuts: Vec<f64>,
    /// Change of the states at the present time.
    x: Vec<f64>,
    /// States, derivatives `[3, n]` and inputs `[3, m]` of the stages.
    stages: Vec<f64>,
    f: Vec<f64>,
    w: Vec<f64>,
    slope: Vec<f64>,
    f0: Vec<f64>,
    matrix: Vec<f64>,
    rest: Vec<f64>,
    pivots: Vec<usize>,
    error_matrix: Vec<f64>,
    error: Vec<f64>,
    /// Longest step that was accepted lately \[s\].
    step: f64,
    /// Mean and first moment of every input of the problem over the communication step.
    pub moments: Vec<[f64; 2]>,
    /// Rounds of Newton's method so far.
    pub rounds: u64,
}

/// Outcome of a step.
enum Outcome {
    /// With its error as a part of what is allowed.
    Done(f64),
    /// State that moved most in the last round, and by how much.
    Failed(usize, f64),
}

/// The problem cannot be solved at this point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unsolved {
    pub state: usize,
    pub rest: f64,
    /// Time inside the communication step, 0..1.
    pub r: f64,
}

impl Radau {
    /// Shows what the next integration begins from.
    pub fn carry(&mut self, each: &mut dyn FnMut(&mut f64)) {
        each(&mut self.step);
    }

    pub fn new(problem: &Reduced, cuts: usize) -> Radau {
        let (n, m) = (problem.nx, problem.inputs.len());
        let zeros = |count: usize| vec![0.0; count];
        Radau {
            n,
            cuts: Vec::with_capacity(cuts),
            x: zeros(n),
            stages: zeros(STAGES * n),
            f: zeros(STAGES * n),
            w: zeros(STAGES * m),
            slope: zeros(n),
            f0: zeros(n),
            matrix: zeros(STAGES * n * STAGES * n),
            rest: zeros(STAGES * n),
            pivots: vec![0; STAGES * n],
            error_matrix: zeros(n * n),
            error: zeros(n),
            step: f64::INFINITY,
            moments: vec![[0.0; 2]; m],
            rounds: 0,
        }
    }

    /// Solves the problem over the communication step; the answer is in `moments`.
    pub fn integrate(
        &mut self,
        problem: &mut Reduced,
        around: &Surroundings,
        nominal: &[f64],
    ) -> Result<Result<(), Unsolved>, Stop> {
        self.lay_out(problem, around);
        self.x.fill(0.0);
        self.slope.fill(0.0);
        self.moments.fill([0.0; 2]);
        for piece in 0..self.cuts.len() - 1 {
            let (mut at, end) = (self.cuts[piece], self.cuts[piece + 1]);
            while at < end {
                let wanted = self.step / around.h;
                let to = if at + 1.01 * wanted >= end { end } else { at + wanted };
                match self.step(problem, around, nominal, at, to)? {
                    Outcome::Done(error) if error <= 1.0 => {
                        self.accept(problem, at, to, around.h);
                        if error < 0.02 {
                            self.step = self.step.max(2.0 * (to - at) * around.h);
                        }
                        at = to;
                    }
                    outcome => {
                        let part = match outcome {
                            Outcome::Done(error) => (0.8 * error.powf(-0.25)).clamp(0.1, 0.8),
                            Outcome::Failed(..) => 0.25,
                        };
                        self.step = part * (to - at) * around.h;
                        self.slope.fill(0.0);
                        if self.step < MIN_RELATIVE_STEP * around.h {
                            let (state, rest) = match outcome {
                                Outcome::Failed(state, rest) => (state, rest),
                                Outcome::Done(error) => (0, error),
                            };
                            self.step = f64::INFINITY;
                            return Ok(Err(Unsolved { state, rest, r: at }));
                        }
                    }
                }
            }
        }
        Ok(Ok(()))
    }

    fn lay_out(&mut self, problem: &Reduced, around: &Surroundings) {
        self.cuts.clear();
        self.cuts.push(0.0);
        for (link, _) in &problem.inputs {
            let Link::Outside(Feed::Signal(output)) = *link else { continue };
            for at in around.outputs.signals[output].breaks() {
                if self.cuts.len() + 1 < self.cuts.capacity()
                    && self.cuts.iter().all(|cut| (cut - at).abs() > SAME_TIME)
                {
                    self.cuts.push(at);
                }
            }
        }
        self.cuts.push(1.0);
        self.cuts.sort_unstable_by(f64::total_cmp);
    }

    /// One step of the method from r = `from` to `to`.
    fn step(
        &mut self,
        problem: &mut Reduced,
        around: &Surroundings,
        nominal: &[f64],
        from: f64,
        to: f64,
    ) -> Result<Outcome, Stop> {
        let (n, m, h) = (self.n, problem.inputs.len(), (to - from) * around.h);
        if !problem.evaluate(around, from, true, &self.x)? {
            return Ok(Outcome::Failed(0, f64::NAN));
        }
        self.f0.copy_from_slice(&problem.f);
        self.error_matrix.iter_mut().zip(&problem.jacobian).for_each(|(e, j)| *e = -j);
        (0..n).for_each(|k| self.error_matrix[k * n + k] += EIGENVALUE / h);
        for stage in 0..STAGES {
            for k in 0..n {
                self.stages[stage * n + k] = self.x[k] + NODES[stage] * h * self.slope[k];
            }
        }
        let mut worst = (0, f64::NAN);
        for round in 0.. {
            if round == ROUNDS {
                return Ok(Outcome::Failed(worst.0, worst.1));
            }
            self.rounds += 1;
            self.matrix.fill(0.0);
            for stage in 0..STAGES {
                let r = from + NODES[stage] * (to - from);
                if !problem.evaluate(around, r, false, &self.stages[stage * n..(stage + 1) * n])? {
                    return Ok(Outcome::Failed(0, f64::NAN));
                }
                self.f[stage * n..(stage + 1) * n].copy_from_slice(&problem.f);
                self.w[stage * m..(stage + 1) * m].copy_from_slice(&problem.w);
                for (row, weights) in WEIGHTS.iter().enumerate() {
                    for k in 0..n {
                        let line = (row * n + k) * STAGES * n + stage * n;
                        for j in 0..n {
                            self.matrix[line + j] = -h * weights[stage] * problem.jacobian[k * n + j];
                        }
                    }
                }
            }
            (0..STAGES * n).for_each(|k| self.matrix[k * STAGES * n + k] += 1.0);
            for stage in 0..STAGES {
                for k in 0..n {
                    let sum: f64 = (0..STAGES).map(|j| WEIGHTS[stage][j] * self.f[j * n + k]).sum();
                    self.rest[stage * n + k] = self.stages[stage * n + k] - self.x[k] - h * sum;
                }
            }
            if !dense::factor(&mut self.matrix, &mut self.pivots, STAGES * n) {
                return Ok(Outcome::Failed(0, f64::INFINITY));
            }
            dense::solve(&self.matrix, &self.pivots, STAGES * n, &mut self.rest, 1);
            let mut settled = true;
            worst = (0, 0.0);
            for k in 0..n {
                let (mut moved, mut size) = (0.0f64, 0.0f64);
                for stage in 0..STAGES {
                    let at = stage * n + k;
                    self.stages[at] -= self.rest[at];
                    moved = moved.max(self.rest[at].abs());
                    size = size.max(self.stages[at].abs());
                }
                settled &= moved <= NEWTON_TOLERANCE * size + 1e-12 * nominal[k];
                if moved / nominal[k] > worst.1 {
                    worst = (k, moved / nominal[k]);
                }
            }
            if settled {
                break;
            }
        }
        Ok(Outcome::Done(self.estimate(nominal, h)))
    }

    /// Error of the step as a part of what is allowed.
    fn estimate(&mut self, nominal: &[f64], h: f64) -> f64 {
        let n = self.n;
        for k in 0..n {
            let sum: f64 = (0..STAGES).map(|i| ERROR[i] * (self.stages[i * n + k] - self.x[k])).sum();
            self.error[k] = self.f0[k] + sum / h;
        }
        if !dense::factor(&mut self.error_matrix, &mut self.pivots, n) {
            return f64::INFINITY;
        }
        dense::solve(&self.error_matrix, &self.pivots, n, &mut self.error, 1);
        let last = (STAGES - 1) * n;
        (0..n)
            .map(|k| {
                let change = (self.stages[last + k] - self.x[k]).abs();
                self.error[k].abs() / (TOLERANCE * change + ERROR_FLOOR * nominal[k])
            })
            .fold(0.0, f64::max)
    }

    /// Adds the step to the moments and goes on from its end.
    fn accept(&mut self, problem: &Reduced, from: f64, to: f64, h: f64) {
        let (n, m) = (self.n, problem.inputs.len());
        for stage in 0..STAGES {
            let share = WEIGHTS[STAGES - 1][stage] * (to - from);
            let first = first_moment(from + NODES[stage] * (to - from));
            for (moments, w) in self.moments.iter_mut().zip(&self.w[stage * m..]) {
                moments[0] += share * w;
                moments[1] += share * first * w;
            }
        }
        let last = &self.stages[(STAGES - 1) * n..];
        for k in 0..n {
            self.slope[k] = (last[k] - self.x[k]) / ((to - from) * h);
            self.x[k] = last[k];
        }
    }
}
