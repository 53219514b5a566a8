//! One sample of the plant with its derivatives.
//!
//! Sampled states are advanced exactly, as a linear system with held input, and seen by the others as they were at the
//! sample: the order of co-simulation at the actuator's rate. The other states are advanced by classical Runge-Kutta
//! steps, whose derivatives are those of the same steps.

use nalgebra::{DMatrix, DVector};

use super::Error;
use crate::transcription::{Dynamics, Point, Size};
use airloop_optim::linalg::spectral;

/// A sample with its derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct Linearization {
    /// States one sample later, `[n_x]`.
    pub next: Vec<f64>,
    /// Derivatives by the states, `[n_x, n_x]`.
    pub a: DMatrix<f64>,
    /// Derivatives by the inputs, `[n_x, n_u]`.
    pub b: DMatrix<f64>,
}

/// A plant that is advanced sample by sample with held inputs.
pub struct Sampled<'a> {
    dynamics: &'a mut dyn Dynamics,
    size: Size,
    /// Time between samples \[s\].
    sample_time: f64,
    /// Runge-Kutta steps per sample.
    steps: usize,
    /// Sampled states.
    held: Vec<usize>,
    /// `[[A, B], [0, 0]]` of the sampled states, continuous.
    block: DMatrix<f64>,
    /// Its exponential over one sample.
    transition: DMatrix<f64>,
}

impl<'a> Sampled<'a> {
    /// Of `dynamics` with the sampled states `held`, samples of `sample_time` \[s\], and `steps` Runge-Kutta steps per
    /// sample for the other states; `at` is any point where the functions have values.
    ///
    /// # Errors
    /// [`Error::NotLinear`], [`Error::Setting`], or functions without a value at `at`.
    pub fn new(
        dynamics: &'a mut dyn Dynamics,
        held: &[usize],
        sample_time: f64,
        steps: usize,
        at: Point<'_>,
    ) -> Result<Sampled<'a>, Error> {
        if !(sample_time > 0.0 && sample_time.is_finite()) {
            let (what, allowed) = ("sample time [s]".into(), "a positive number");
            return Err(Error::Setting { what, value: sample_time, allowed });
        }
        if steps == 0 {
            let (what, allowed) = ("Runge-Kutta steps per sample".into(), "at least 1");
            return Err(Error::Setting { what, value: 0.0, allowed });
        }
        let size = dynamics.size();
        let linear = dynamics.structure().linear_states(held);
        if let Some(&state) = held.iter().find(|state| !linear.contains(state)) {
            return Err(Error::NotLinear { state: dynamics.names()[state].clone() });
        }
        let mut values = vec![0.0; size.values()];
        let mut jacobian = vec![0.0; size.values() * size.arguments()];
        dynamics.jacobian(at, &mut values, &mut jacobian).map_err(Error::at(at.time))?;
        let (n, m) = (held.len(), size.inputs);
        let mut block = DMatrix::zeros(n + m, n + m);
        let arguments: Vec<usize> = held.iter().copied().chain(size.states..size.arguments()).collect();
        for (i, &state) in held.iter().enumerate() {
            for (j, &argument) in arguments.iter().enumerate() {
                block[(i, j)] = jacobian[state * size.arguments() + argument];
            }
        }
        let transition = exponential(&(&block * sample_time));
        Ok(Sampled { dynamics, size, sample_time, steps, held: held.to_vec(), block, transition })
    }

    /// Time between samples \[s\].
    pub fn sample_time(&self) -> f64 {
        self.sample_time
    }

    /// Sampled states.
    pub fn held(&self) -> &[usize] {
        &self.held
    }

    /// The inputs `[m]` nearest to `inputs` `[m]` that take the sampled states from `from` as near as possible to `to`
    /// (both `[n]`) in one sample.
    pub fn inputs_between(&self, from: &[f64], to: &[f64], inputs: &[f64]) -> Vec<f64> {
        let n = self.held.len();
        let at = Point { time: 0.0, states: from, inputs };
        let mut reached = from.to_vec();
        self.held_states(&self.transition, at, &mut reached);
        let missing = DVector::from_iterator(n, self.held.iter().map(|&i| to[i] - reached[i]));
        let by_inputs = self.transition.view((0, n), (n, inputs.len())).into_owned();
        match spectral::svd(by_inputs, true, true).solve(&missing, 1e-12) {
            Ok(step) if n > 0 => inputs.iter().zip(&step).map(|(u, step)| u + step).collect(),
            _ => inputs.to_vec(),
        }
    }

    /// The plant.
    pub fn dynamics(&mut self) -> &mut dyn Dynamics {
        self.dynamics
    }

    /// States `duration` \[s\] after `at`, inputs held.
    ///
    /// # Errors
    /// Functions without a value.
    pub fn advance(&mut self, at: Point<'_>, duration: f64) -> Result<Vec<f64>, Error> {
        let h = duration / self.steps as f64;
        let mut x = at.states.to_vec();
        let mut values = vec![0.0; self.size.values()];
        for step in 0..self.steps {
            let t = at.time + step as f64 * h;
            let start = x.clone();
            let mut stage = x.clone();
            for (node, weight, next) in RUNGE_KUTTA {
                let point = Point { time: t + node * h, states: &stage, inputs: at.inputs };
                self.dynamics.evaluate(point, &mut values).map_err(Error::at(point.time))?;
                self.held.iter().for_each(|&state| values[state] = 0.0);
                for i in 0..x.len() {
                    x[i] += h * weight * values[i];
                    stage[i] = start[i] + next * h * values[i];
                }
            }
        }
        let exact;
        let transition = if duration == self.sample_time {
            &self.transition
        } else {
            exact = exponential(&(&self.block * duration));
            &exact
        };
        self.held_states(transition, at, &mut x);
        Ok(x)
    }

    /// One sample from `at` with its derivatives.
    ///
    /// # Errors
    /// Functions without a value.
    pub fn linearize(&mut self, at: Point<'_>) -> Result<Linearization, Error> {
        let mut sample = self.flow(at, self.sample_time)?;
        self.hold(at, &mut sample);
        Ok(sample)
    }

    /// States `duration` \[s\] after `at` with their derivatives, sampled states left as they are.
    ///
    /// # Errors
    /// Functions without a value.
    pub fn flow(&mut self, at: Point<'_>, duration: f64) -> Result<Linearization, Error> {
        let (n, arguments) = (self.size.states, self.size.arguments());
        let h = duration / self.steps as f64;
        let mut x = at.states.to_vec();
        let mut slopes = DMatrix::<f64>::identity(n, arguments);
        let mut values = vec![0.0; self.size.values()];
        let mut jacobian = vec![0.0; self.size.values() * arguments];
        for step in 0..self.steps {
            let t = at.time + step as f64 * h;
            let (start, start_slopes) = (x.clone(), slopes.clone());
            let (mut stage, mut stage_slopes) = (x.clone(), slopes.clone());
            for (node, weight, next) in RUNGE_KUTTA {
                let point = Point { time: t + node * h, states: &stage, inputs: at.inputs };
                self.dynamics.jacobian(point, &mut values, &mut jacobian).map_err(Error::at(point.time))?;
                let by_states = DMatrix::from_fn(n, n, |i, j| jacobian[i * arguments + j]);
                let mut rate_slopes = by_states * &stage_slopes;
                for i in 0..n {
                    for j in n..arguments {
                        rate_slopes[(i, j)] += jacobian[i * arguments + j];
                    }
                }
                for &state in &self.held {
                    values[state] = 0.0;
                    rate_slopes.row_mut(state).fill(0.0);
                }
                for i in 0..n {
                    x[i] += h * weight * values[i];
                    stage[i] = start[i] + next * h * values[i];
                }
                slopes += &rate_slopes * (h * weight);
                stage_slopes = &start_slopes + rate_slopes * (next * h);
            }
        }
        let a = slopes.columns(0, n).into_owned();
        let b = slopes.columns(n, self.size.inputs).into_owned();
        Ok(Linearization { next: x, a, b })
    }

    /// Advances the sampled states of a sample that began at `at`.
    pub fn hold(&self, at: Point<'_>, sample: &mut Linearization) {
        self.held_states(&self.transition, at, &mut sample.next);
        for (i, &state) in self.held.iter().enumerate() {
            sample.a.row_mut(state).fill(0.0);
            for (j, &other) in self.held.iter().enumerate() {
                sample.a[(state, other)] = self.transition[(i, j)];
            }
            for j in 0..self.size.inputs {
                sample.b[(state, j)] = self.transition[(i, self.held.len() + j)];
            }
        }
    }

    fn held_states(&self, transition: &DMatrix<f64>, at: Point<'_>, x: &mut [f64]) {
        let n = self.held.len();
        for (i, &state) in self.held.iter().enumerate() {
            let of_states = self.held.iter().enumerate().map(|(j, &k)| transition[(i, j)] * at.states[k]);
            let of_inputs = at.inputs.iter().enumerate().map(|(j, u)| transition[(i, n + j)] * u);
            x[state] = of_states.chain(of_inputs).sum();
        }
    }
}

/// Stages of the classical Runge-Kutta method: node, weight, and how far its rate carries to the next stage.
const RUNGE_KUTTA: [(f64, f64, f64); 4] =
    [(0.0, 1.0 / 6.0, 0.5), (0.5, 1.0 / 3.0, 0.5), (0.5, 1.0 / 3.0, 1.0), (1.0, 1.0 / 6.0, 0.0)];

/// Matrix exponential.
fn exponential(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    if matrix.is_empty() { matrix.clone() } else { matrix.exp() }
}
