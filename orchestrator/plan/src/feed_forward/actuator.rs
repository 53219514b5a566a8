//! A sampled linear actuator with one command and one output that matters.

use super::Error;
use nalgebra::{DMatrix, DVector};

/// `x(k+1) = A x(k) + B u(k)`, `y(k) = C x(k) + D u(k)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Actuator {
    a: Vec<f64>,
    b: Vec<f64>,
    c: Vec<f64>,
    d: f64,
}

impl Actuator {
    /// Of the sampled matrices.
    ///
    /// | name | shape |
    /// |------|-------|
    /// | `a` | \[n, n\], row-major |
    /// | `b` | \[n\] |
    /// | `c` | \[n\] |
    ///
    /// # Errors
    /// [`Error::Shape`] where they do not belong together.
    pub fn new(a: Vec<f64>, b: Vec<f64>, c: Vec<f64>, d: f64) -> Result<Self, Error> {
        let states = b.len();
        for (matrix, found, wanted) in [("A", a.len(), states * states), ("C", c.len(), states)] {
            if found != wanted {
                return Err(Error::Shape { states, matrix, found });
            }
        }
        Ok(Self { a, b, c, d })
    }

    /// Of a continuous model `dx/dt = A x + B u` whose command is held over `sample_time` \[s\]: exact at the samples.
    ///
    /// Shapes as in [`Actuator::new`].
    ///
    /// # Errors
    /// [`Error::Shape`] where the matrices do not belong together, [`Error::Setting`] for the sample time.
    pub fn sampled(a: &[f64], b: &[f64], c: Vec<f64>, d: f64, sample_time: f64) -> Result<Self, Error> {
        let n = b.len();
        if a.len() != n * n {
            return Err(Error::Shape { states: n, matrix: "A", found: a.len() });
        }
        if !(sample_time > 0.0 && sample_time.is_finite()) {
            let (name, value) = ("sample_time", sample_time);
            return Err(Error::Setting { name, value, allowed: "positive and finite" });
        }
        // exp of [[A, B], [0, 0]] Ts holds both sampled matrices.
        let mut joint = DMatrix::zeros(n + 1, n + 1);
        for i in 0..n {
            (0..n).for_each(|j| joint[(i, j)] = a[i * n + j] * sample_time);
            joint[(i, n)] = b[i] * sample_time;
        }
        let joint = joint.exp();
        let rows = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
        let a = rows.map(|at| joint[at]).collect();
        Self::new(a, (0..n).map(|i| joint[(i, n)]).collect(), c, d)
    }

    /// Number of states n.
    pub fn states(&self) -> usize {
        self.b.len()
    }

    /// A, `[n, n]`, row-major.
    pub fn a(&self) -> &[f64] {
        &self.a
    }

    /// B, `[n]`.
    pub fn b(&self) -> &[f64] {
        &self.b
    }

    /// C, `[n]`.
    pub fn c(&self) -> &[f64] {
        &self.c
    }

    /// D, the answer within the sample.
    pub fn d(&self) -> f64 {
        self.d
    }

    /// Output per constant command in the end.
    ///
    /// # Errors
    /// [`Error::NoSteadyState`] with a pole at 1, or where the output does not answer a constant command.
    pub fn gain(&self) -> Result<f64, Error> {
        let state = self.steady_state(1.0)?;
        let gain = self.output(&state, 1.0);
        if gain == 0.0 {
            return Err(Error::NoSteadyState { reason: "its gain is 0" });
        }
        Ok(gain)
    }

    /// State at rest under a constant command, `[n]`.
    ///
    /// # Errors
    /// [`Error::NoSteadyState`] with a pole at 1.
    pub fn steady_state(&self, command: f64) -> Result<Vec<f64>, Error> {
        let n = self.states();
        let matrix = DMatrix::identity(n, n) - DMatrix::from_row_slice(n, n, &self.a);
        let right = DVector::from_column_slice(&self.b) * command;
        let state = matrix.lu().solve(&right).filter(|x| x.iter().all(|x| x.is_finite()));
        let state = state.ok_or(Error::NoSteadyState { reason: "it integrates (a pole at 1)" })?;
        Ok(state.iter().copied().collect())
    }

    /// Outputs under the commands from `state`, `[n]` for `[n]`.
    pub fn simulate(&self, mut state: Vec<f64>, commands: &[f64]) -> Vec<f64> {
        let (n, mut next) = (self.states(), vec![0.0; self.states()]);
        let step = |u: &f64| {
            let y = self.output(&state, *u);
            for (i, next) in next.iter_mut().enumerate() {
                let row = &self.a[i * n..(i + 1) * n];
                *next = row.iter().zip(&state).map(|(a, x)| a * x).sum::<f64>() + self.b[i] * u;
            }
            std::mem::swap(&mut state, &mut next);
            y
        };
        commands.iter().map(step).collect()
    }

    fn output(&self, state: &[f64], command: f64) -> f64 {
        self.c.iter().zip(state).map(|(c, x)| c * x).sum::<f64>() + self.d * command
    }
}
