//! The swing-up as a nonlinear program: transcriptions, guesses, patterns.

use std::f64::consts::PI;
use std::time::{Duration, Instant};

use airloop_optim::{Bounds, EvaluationError, Nlp, Stages};

use crate::interval::{Collocation, Interval, Row, Shooting, WIDTH};

/// Largest command, N.
pub const U_MAX: f64 = 0.5e6 * PI * 0.02 * 0.02 / 4.0;
/// Half stroke, m.
pub const STROKE: f64 = 0.15;
/// Duration, s.
pub const DURATION: f64 = 2.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transcription {
    HermiteSimpson,
    Trapezoidal,
    MultipleShooting,
    ShootingCollocation,
}

impl Transcription {
    pub const ALL: [Self; 4] =
        [Self::HermiteSimpson, Self::Trapezoidal, Self::MultipleShooting, Self::ShootingCollocation];

    /// Short name of the problem statement.
    pub fn name(self) -> &'static str {
        match self {
            Self::HermiteSimpson => "hs",
            Self::Trapezoidal => "trap",
            Self::MultipleShooting => "ms",
            Self::ShootingCollocation => "sc",
        }
    }
}

pub struct SwingUp {
    transcription: Transcription,
    intervals: usize,
    interval: Box<dyn Interval>,
    /// Half stroke, m; smaller ones make the problem infeasible.
    pub stroke: f64,
    /// Whether the stages are told to the solver.
    pub staged: bool,
    /// Time spent in the functions.
    pub elapsed: Duration,
    /// Entries of one interval that are not always zero.
    jacobian: Vec<(usize, usize)>,
    hessian: Vec<(usize, usize)>,
}

impl SwingUp {
    pub fn new(transcription: Transcription, intervals: usize) -> Self {
        let h = DURATION / intervals as f64;
        let interval: Box<dyn Interval> = match transcription {
            Transcription::HermiteSimpson => Box::new(Collocation::of_actuator(h, true)),
            Transcription::Trapezoidal => Box::new(Collocation::of_actuator(h, false)),
            Transcription::ShootingCollocation => Box::new(Collocation::of_mechanics(h)),
            Transcription::MultipleShooting => Box::new(Shooting::new((h / 1e-3).round() as usize)),
        };
        let mut jacobian = vec![false; 6 * WIDTH];
        let mut hessian = vec![false; WIDTH * WIDTH];
        for probe in 1..4 {
            // Small values: the frictions saturate beyond some 0.1 m/s, and their curvature is lost there.
            let point: Row = std::array::from_fn(|i| 0.02 * ((i * i + 3 * probe) as f64).sin());
            let mut rows = [[0.0; WIDTH]; 6];
            interval.defects(&point, Some(&mut rows));
            let curvature = interval.hessian(&point, std::array::from_fn(|i| 1.0 + (i * probe) as f64));
            let flat = rows.iter().flatten().map(|v| *v != 0.0);
            jacobian.iter_mut().zip(flat).for_each(|(there, now)| *there |= now);
            for i in 0..WIDTH {
                for j in 0..=i {
                    hessian[i * WIDTH + j] |= curvature[i][j] != 0.0;
                }
            }
        }
        let entries = |there: &[bool]| {
            there.iter().enumerate().filter(|(_, t)| **t).map(|(at, _)| (at / WIDTH, at % WIDTH)).collect()
        };
        let (jacobian, hessian) = (entries(&jacobian), entries(&hessian));
        Self {
            transcription,
            intervals,
            interval,
            stroke: STROKE,
            staged: true,
            elapsed: Duration::ZERO,
            jacobian,
            hessian,
        }
    }

    /// Variables per node.
    pub fn stride(&self) -> usize {
        if self.transcription == Transcription::HermiteSimpson { 8 } else { 7 }
    }

    fn held(&self) -> bool {
        matches!(self.transcription, Transcription::MultipleShooting | Transcription::ShootingCollocation)
    }

    fn step(&self) -> f64 {
        DURATION / self.intervals as f64
    }

    fn local(&self, x: &[f64], k: usize) -> Row {
        let mut row = [0.0; WIDTH];
        let begin = k * self.stride();
        let count = WIDTH.min(x.len() - begin);
        row[..count].copy_from_slice(&x[begin..begin + count]);
        row
    }

    /// Weight of u^2 of every command in the objective.
    fn weights(&self) -> Vec<(usize, f64)> {
        let (h, s, n) = (self.step(), self.stride(), self.intervals);
        let end = |k: usize| if k == 0 || k == n { 1.0 } else { 2.0 };
        match self.transcription {
            Transcription::HermiteSimpson => (0..=n)
                .map(|k| (k * s + 6, h / 6.0 * end(k)))
                .chain((0..n).map(|k| (k * s + 7, 4.0 * h / 6.0)))
                .collect(),
            Transcription::Trapezoidal => (0..=n).map(|k| (k * s + 6, h / 2.0 * end(k))).collect(),
            _ => (0..n).map(|k| (k * s + 6, h)).collect(),
        }
    }

    /// Guess with theta piecewise linear through knots (t / T, theta) and x a sum of sines.
    pub fn guess(&self, knots: &[(f64, f64)], sines: [f64; 3]) -> Vec<f64> {
        let mut x = vec![0.0; self.variables()];
        for k in 0..=self.intervals {
            let t = k as f64 / self.intervals as f64;
            let at = knots.windows(2).find(|pair| t <= pair[1].0).unwrap_or(&knots[knots.len() - 2..]);
            let part = (t - at[0].0) / (at[1].0 - at[0].0);
            x[k * self.stride() + 1] = at[0].1 + part * (at[1].1 - at[0].1);
            x[k * self.stride()] =
                sines.iter().enumerate().map(|(i, a)| a * (PI * (i + 1) as f64 * t).sin()).sum();
        }
        x
    }

    /// G2: pumping.
    pub fn pump(&self) -> Vec<f64> {
        self.guess(&PUMP, [0.0; 3])
    }
}

/// Knots of G2: (t / T, theta).
pub const PUMP: [(f64, f64); 6] =
    [(0.0, 0.0), (0.13, -0.3), (0.30, 0.7), (0.53, -1.3), (0.75, 2.0), (1.0, PI)];

impl Nlp for SwingUp {
    fn variables(&self) -> usize {
        self.intervals * self.stride() + if self.held() { 6 } else { 7 }
    }

    fn constraints(&self) -> usize {
        6 * self.intervals
    }

    fn variable_bounds(&self) -> Bounds {
        let (n, s) = (self.variables(), self.stride());
        let mut bounds = Bounds::free(n);
        let mut set = |i: usize, lower: f64, upper: f64| (bounds.lower[i], bounds.upper[i]) = (lower, upper);
        for i in 0..n {
            match i % s {
                0 => set(i, -self.stroke, self.stroke),
                6 | 7 => set(i, -U_MAX, U_MAX),
                _ => {}
            }
        }
        (0..6).for_each(|i| set(i, 0.0, 0.0));
        let end = self.intervals * s;
        [0.0, PI, 0.0, 0.0].iter().enumerate().for_each(|(i, &y)| set(end + i, y, y));
        bounds
    }

    fn constraint_bounds(&self) -> Bounds {
        Bounds::zero(self.constraints())
    }

    fn objective(&mut self, x: &[f64]) -> Result<f64, EvaluationError> {
        Ok(self.weights().iter().map(|&(i, w)| w * x[i] * x[i]).sum())
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> Result<(), EvaluationError> {
        gradient.fill(0.0);
        self.weights().iter().for_each(|&(i, w)| gradient[i] = 2.0 * w * x[i]);
        Ok(())
    }

    fn constraint_values(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        let begin = Instant::now();
        for (k, chunk) in values.chunks_mut(6).enumerate() {
            chunk.copy_from_slice(&self.interval.defects(&self.local(x, k), None));
        }
        self.elapsed += begin.elapsed();
        Ok(())
    }

    fn jacobian_pattern(&self) -> Vec<(usize, usize)> {
        let place = |k: usize| self.jacobian.iter().map(move |&(i, j)| (6 * k + i, self.stride() * k + j));
        (0..self.intervals).flat_map(place).collect()
    }

    fn jacobian(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        let begin = Instant::now();
        let mut rows = [[0.0; WIDTH]; 6];
        for (k, chunk) in values.chunks_mut(self.jacobian.len()).enumerate() {
            self.interval.defects(&self.local(x, k), Some(&mut rows));
            chunk.iter_mut().zip(&self.jacobian).for_each(|(value, &(i, j))| *value = rows[i][j]);
        }
        self.elapsed += begin.elapsed();
        Ok(())
    }

    fn hessian_pattern(&self) -> Vec<(usize, usize)> {
        let s = self.stride();
        let place = |k: usize| self.hessian.iter().map(move |&(i, j)| (s * k + i, s * k + j));
        (0..self.intervals).flat_map(place).chain(self.weights().iter().map(|&(i, _)| (i, i))).collect()
    }

    fn hessian(
        &mut self,
        x: &[f64],
        objective_factor: f64,
        multipliers: &[f64],
        values: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let begin = Instant::now();
        let (curvature, of_objective) = values.split_at_mut(self.intervals * self.hessian.len());
        for (k, chunk) in curvature.chunks_mut(self.hessian.len()).enumerate() {
            let weight = std::array::from_fn(|i| multipliers[6 * k + i]);
            let h = self.interval.hessian(&self.local(x, k), weight);
            chunk.iter_mut().zip(&self.hessian).for_each(|(value, &(i, j))| *value = h[i][j]);
        }
        of_objective.iter_mut().zip(self.weights()).for_each(|(h, (_, w))| *h = 2.0 * w * objective_factor);
        self.elapsed += begin.elapsed();
        Ok(())
    }

    fn stages(&self) -> Option<Stages> {
        let s = self.stride();
        self.staged.then(|| Stages {
            variables: (0..self.variables()).map(|i| i / s).collect(),
            constraints: (0..self.constraints()).map(|i| i / 6 + 1).collect(),
        })
    }

    fn variable_name(&self, variable: usize) -> String {
        let name = ["x", "theta", "v", "w", "z1", "z2", "u", "um"][variable % self.stride()];
        format!("{name} at t = {:.4} s", (variable / self.stride()) as f64 * self.step())
    }

    fn constraint_name(&self, constraint: usize) -> String {
        let name = ["x", "theta", "v", "w", "z1", "z2"][constraint % 6];
        format!("defect of {name} after t = {:.4} s", (constraint / 6) as f64 * self.step())
    }
}
