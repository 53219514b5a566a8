//! Extended Kalman filter of states, disturbances of the inputs, and parameters.

use super::Plant;
use super::family::{Family, MAX_PART};
use super::step::{Next, Stepper};
use crate::control::Measured;
use crate::transcription::Point;
use airloop_optim::EvaluationError;

/// The estimate `[states, disturbances of the inputs, parameters]` with its covariance.
pub struct Estimator {
    n: usize,
    m: usize,
    np: usize,
    /// `[n + m + n_p]`.
    pub estimate: Vec<f64>,
    covariance: Vec<f64>,
    /// Growth of the covariance over a sample, `[n + m + n_p]`.
    growth: Vec<f64>,
    measured: Vec<Measured>,
    variance: Vec<f64>,
    stepper: Stepper,
    next: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
    g: Vec<f64>,
    inputs: Vec<f64>,
    transition: Vec<f64>,
    work: Vec<f64>,
}

impl Estimator {
    /// Begins at `states` `[n]`.
    pub fn new(family: &Family, plant: &Plant, states: &[f64]) -> Estimator {
        let (size, np) = (family.size(), family.parameters());
        let (n, m) = (size.states, size.inputs);
        let nz = n + m + np;
        let mut covariance = vec![0.0; nz * nz];
        let deviations = [&plant.initial[..], &plant.input_drift, &plant.parameter_deviation].concat();
        deviations.iter().enumerate().for_each(|(i, one)| covariance[i * nz + i] = one * one);
        let drifts = [&plant.state_drift[..], &plant.input_drift, &plant.parameter_drift].concat();
        let mut estimate = states.to_vec();
        estimate.resize(nz, 0.0);
        Estimator {
            n,
            m,
            np,
            estimate,
            covariance,
            growth: drifts.iter().map(|one| one * one * plant.sample_time).collect(),
            measured: plant.measured.clone(),
            variance: plant.noise.iter().map(|one| one * one).collect(),
            stepper: Stepper::new(family),
            next: vec![0.0; n],
            a: vec![0.0; n * n],
            b: vec![0.0; n * m],
            g: vec![0.0; n * np],
            inputs: vec![0.0; m],
            transition: vec![0.0; nz * nz],
            work: vec![0.0; nz * nz],
        }
    }

    /// States, `[n]`.
    pub fn states(&self) -> &[f64] {
        &self.estimate[..self.n]
    }

    /// Disturbances of the inputs, `[m]`.
    pub fn disturbances(&self) -> &[f64] {
        &self.estimate[self.n..][..self.m]
    }

    /// Parameters in widths from their declared values, `[n_p]`.
    pub fn parameters(&self) -> &[f64] {
        &self.estimate[self.n + self.m..]
    }

    /// Takes measured signals `[p]` in, one after the other.
    ///
    /// # Errors
    /// Outputs without a value.
    pub fn correct(
        &mut self,
        family: &mut Family,
        time: f64,
        measured: &[f64],
    ) -> Result<(), EvaluationError> {
        let (n, nz) = (self.n, self.estimate.len());
        for (signal, (&y, &variance)) in measured.iter().zip(&self.variance).enumerate() {
            // Row of the derivatives by the states in `next`.
            let expected = match self.measured[signal] {
                Measured::State(state) => {
                    self.next.fill(0.0);
                    self.next[state] = 1.0;
                    self.estimate[state]
                }
                Measured::Output(output) => {
                    let at = Point { time, states: &self.estimate[..n], inputs: &self.inputs };
                    let (values, jacobian) = family.evaluate(at, &self.estimate[n + self.m..], &mut [])?;
                    self.next.copy_from_slice(&jacobian[(n + output) * (n + self.m)..][..n]);
                    values[n + output]
                }
            };
            let covariance = &mut self.covariance;
            let seen = &mut self.work[..nz];
            for (i, seen) in seen.iter_mut().enumerate() {
                *seen = self.next.iter().enumerate().map(|(j, c)| c * covariance[i * nz + j]).sum();
            }
            let total = variance + self.next.iter().zip(&*seen).map(|(c, s)| c * s).sum::<f64>();
            for (i, estimate) in self.estimate.iter_mut().enumerate() {
                *estimate += seen[i] * (y - expected) / total;
            }
            for i in 0..nz {
                (0..nz).for_each(|j| covariance[i * nz + j] -= seen[i] * seen[j] / total);
            }
        }
        let parameters = &mut self.estimate[n + self.m..];
        parameters.iter_mut().for_each(|p| *p = p.clamp(-MAX_PART, MAX_PART));
        Ok(())
    }

    /// Goes on by a sample of `h` \[s\] under `inputs` `[m]`.
    ///
    /// # Errors
    /// Functions without a value.
    pub fn predict(
        &mut self,
        family: &mut Family,
        (time, h): (f64, f64),
        inputs: &[f64],
    ) -> Result<(), EvaluationError> {
        let (n, m, np, nz) = (self.n, self.m, self.np, self.estimate.len());
        for (j, input) in self.inputs.iter_mut().enumerate() {
            *input = inputs[j] + self.estimate[n + j];
        }
        let at = Point { time, states: &self.estimate[..n], inputs: &self.inputs };
        let next = Next { x: &mut self.next, a: &mut self.a, b: &mut self.b, g: &mut self.g };
        self.stepper.step(family, (at, &self.estimate[n + m..]), h, next)?;
        if !self.next.iter().all(|x| x.is_finite()) {
            let (function, reason) = ("prediction of the states".into(), "it is not finite".into());
            return Err(EvaluationError { function, reason });
        }
        self.estimate[..n].copy_from_slice(&self.next);
        let f = &mut self.transition;
        f.fill(0.0);
        for i in 0..nz {
            if i >= n {
                f[i * nz + i] = 1.0;
                continue;
            }
            f[i * nz..][..n].copy_from_slice(&self.a[i * n..][..n]);
            f[i * nz + n..][..m].copy_from_slice(&self.b[i * m..][..m]);
            f[i * nz + n + m..][..np].copy_from_slice(&self.g[i * np..][..np]);
        }
        // F P F' + Q; F is the identity below the states.
        for i in 0..nz {
            for j in 0..nz {
                self.work[i * nz + j] = (0..nz).map(|k| f[i * nz + k] * self.covariance[k * nz + j]).sum();
            }
        }
        for i in 0..nz {
            for j in 0..=i {
                let value: f64 = (0..nz).map(|k| self.work[i * nz + k] * f[j * nz + k]).sum();
                self.covariance[i * nz + j] = value;
                self.covariance[j * nz + i] = value;
            }
            self.covariance[i * nz + i] += self.growth[i];
        }
        Ok(())
    }
}
