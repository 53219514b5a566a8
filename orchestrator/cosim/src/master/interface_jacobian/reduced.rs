//! The reduced problem of a coupled component: local models of its dynamic FMUs, its static blocks, and the
//! connections between them, as one small differential equation in the changes of the states.

use std::ops::Range;

use super::dense;
use super::local_model::LocalModel;
use super::static_block::Function;
use super::unit::{Feed, Input, Outputs, Unit};
use crate::master::Values;
use crate::master::stop::Stop;

/// A dynamic FMU; ranges in the states, inputs and outputs of the problem.
#[derive(Debug)]
pub(super) struct Dynamic {
    pub unit: usize,
    pub x: Range<usize>,
    pub u: Range<usize>,
    pub y: Range<usize>,
    pub model: LocalModel,
}

/// A static block.
#[derive(Debug)]
pub(super) struct Static {
    pub unit: usize,
    pub u: Range<usize>,
    pub y: Range<usize>,
    pub function: Function,
}

/// Source of an input of the problem.
#[derive(Debug, Clone, Copy)]
pub(super) enum Link {
    /// An output of the problem.
    Inside(usize),
    /// Known over the whole step.
    Outside(Feed),
}

/// Known signals from outside over the present step.
#[derive(Clone, Copy)]
pub(super) struct Surroundings<'a> {
    pub units: &'a [Unit],
    pub outputs: &'a Outputs,
    pub values: &'a Values,
    pub t: f64,
    pub h: f64,
}

/// See the module.
#[derive(Debug)]
pub(super) struct Reduced {
    pub dynamics: Vec<Dynamic>,
    /// In an order in which each one's sources come first, unless there is direct feed-through in a circle.
    pub statics: Vec<Static>,
    pub inputs: Vec<(Link, Input)>,
    /// Whether the inputs follow from the states only by solving equations.
    pub implicit: bool,
    pub nx: usize,
    /// Derivatives `[nx]` and their Jacobian `[nx, nx]` at the last evaluation.
    pub f: Vec<f64>,
    pub jacobian: Vec<f64>,
    /// Inputs `[m]` at the last evaluation.
    pub w: Vec<f64>,
    w_by_x: Vec<f64>,
    y: Vec<f64>,
    y_by_x: Vec<f64>,
    /// Outputs of the dynamic FMUs without direct feed-through.
    base: Vec<f64>,
    gain: Vec<f64>,
    column: Vec<f64>,
    lu: Vec<f64>,
    pivots: Vec<usize>,
    rest: Vec<f64>,
    /// Evaluations of static blocks so far.
    pub evaluations: u64,
}

/// Rounds of Newton's method on the inputs at one instant.
const ROUNDS: usize = 25;

impl Reduced {
    pub fn new(
        dynamics: Vec<Dynamic>,
        statics: Vec<Static>,
        inputs: Vec<(Link, Input)>,
        implicit: bool,
    ) -> Reduced {
        let nx = dynamics.iter().map(|block| block.x.len()).sum();
        let ny: usize = dynamics.iter().map(|block| block.y.len()).sum::<usize>()
            + statics.iter().map(|block| block.y.len()).sum::<usize>();
        let m = inputs.len();
        let zeros = |count: usize| vec![0.0; count];
        let square = if implicit { m * m } else { 0 };
        Reduced {
            dynamics,
            statics,
            inputs,
            implicit,
            nx,
            f: zeros(nx),
            jacobian: zeros(nx * nx),
            w: zeros(m),
            w_by_x: zeros(m * nx),
            y: zeros(ny),
            y_by_x: zeros(ny * nx),
            base: zeros(ny),
            gain: zeros(ny * m),
            column: zeros(ny + m),
            lu: zeros(square),
            pivots: vec![0; m],
            rest: zeros(m),
            evaluations: 0,
        }
    }

    /// Evaluates derivatives, Jacobian and inputs at the change `x` of the states and the time r; where a signal
    /// from outside jumps, its value before (`right`: after) the jump counts. False if no inputs fit together.
    pub fn evaluate(&mut self, around: &Surroundings, r: f64, right: bool, x: &[f64]) -> Result<bool, Stop> {
        self.predict_dynamics(around, r, x);
        if self.implicit {
            if !self.solve_inputs(around, r, right)? {
                return Ok(false);
            }
        } else {
            for block in 0..self.statics.len() {
                let (u, y) = (self.statics[block].u.clone(), self.statics[block].y.clone());
                u.clone().for_each(|input| self.link(around, r, right, input));
                self.evaluate_static(around, r, block)?;
                self.chain(u, y);
            }
            for block in 0..self.dynamics.len() {
                let u = self.dynamics[block].u.clone();
                u.for_each(|input| self.link(around, r, right, input));
            }
        }
        self.derive(x);
        Ok(self.f.iter().all(|f| f.is_finite()))
    }

    /// Outputs of the dynamic FMUs without direct feed-through.
    fn predict_dynamics(&mut self, around: &Surroundings, r: f64, x: &[f64]) {
        let nx = self.nx;
        self.y_by_x.fill(0.0);
        for block in &self.dynamics {
            for (k, q) in block.y.clone().enumerate() {
                self.y[q] = block.model.output(k, &x[block.x.clone()], r, around.h);
                let count = block.x.len();
                self.y_by_x[q * nx + block.x.start..][..count]
                    .copy_from_slice(&block.model.c[k * count..(k + 1) * count]);
            }
        }
    }

    /// Takes over an input from its source.
    fn link(&mut self, around: &Surroundings, r: f64, right: bool, input: usize) {
        let nx = self.nx;
        let (link, Input { conversion, .. }) = self.inputs[input];
        match link {
            Link::Outside(feed) => {
                self.w[input] = conversion.apply(feed.at(around.outputs, around.values, r, right));
                self.w_by_x[input * nx..(input + 1) * nx].fill(0.0);
            }
            Link::Inside(q) => {
                self.w[input] = conversion.apply(self.y[q]);
                for k in 0..nx {
                    self.w_by_x[input * nx + k] = conversion.factor * self.y_by_x[q * nx + k];
                }
            }
        }
    }

    /// Outputs and gains of a static block at its inputs.
    fn evaluate_static(&mut self, around: &Surroundings, r: f64, block: usize) -> Result<(), Stop> {
        let Static { unit, u, y, function } = &mut self.statics[block];
        let (nu, m) = (u.len(), self.inputs.len());
        let gain = &mut self.gain[y.start * m..y.start * m + y.len() * nu];
        let (t, unit) = (around.t + r * around.h, &around.units[*unit]);
        let (u, y) = (&self.w[u.clone()], &mut self.y[y.clone()]);
        function.evaluate(unit, t, u, y, gain, &mut self.column)?;
        self.evaluations += 1;
        Ok(())
    }

    /// Derivatives of outputs by the states, through the inputs of their block.
    fn chain(&mut self, u: Range<usize>, y: Range<usize>) {
        let (nx, m) = (self.nx, self.inputs.len());
        for (row, q) in y.clone().enumerate() {
            for k in 0..nx {
                let gain = &self.gain[y.start * m + row * u.len()..][..u.len()];
                let sum = gain.iter().zip(u.clone()).map(|(gain, i)| gain * self.w_by_x[i * nx + k]).sum();
                self.y_by_x[q * nx + k] = sum;
            }
        }
    }

    /// Newton's method on all inputs at one instant: w = what the outputs at w give.
    fn solve_inputs(&mut self, around: &Surroundings, r: f64, right: bool) -> Result<bool, Stop> {
        let (nx, m) = (self.nx, self.inputs.len());
        self.base.copy_from_slice(&self.y);
        let mut solved = false;
        for _ in 0..ROUNDS {
            for block in &self.dynamics {
                let model = &block.model;
                let nu = model.nu;
                for (row, q) in block.y.clone().enumerate() {
                    let d = &model.d[row * nu..(row + 1) * nu];
                    let du = block.u.clone().zip(&model.u0).zip(d);
                    let through: f64 = du.map(|((i, u0), d)| d * (self.w[i] - u0)).sum();
                    self.y[q] = self.base[q] + through;
                }
                let start = block.y.start * m;
                self.gain[start..start + model.d.len()].copy_from_slice(&model.d);
            }
            for block in 0..self.statics.len() {
                self.evaluate_static(around, r, block)?;
            }
            self.lu.fill(0.0);
            for i in 0..m {
                self.lu[i * m + i] = 1.0;
                let (link, Input { conversion, .. }) = self.inputs[i];
                match link {
                    Link::Outside(feed) => {
                        let value = feed.at(around.outputs, around.values, r, right);
                        self.rest[i] = self.w[i] - conversion.apply(value);
                        self.w_by_x[i * nx..(i + 1) * nx].fill(0.0);
                    }
                    Link::Inside(q) => {
                        self.rest[i] = self.w[i] - conversion.apply(self.y[q]);
                        let (u, y) = self.block_of(q);
                        for (k, column) in u.clone().enumerate() {
                            let gain = self.gain[y.start * m + (q - y.start) * u.len() + k];
                            self.lu[i * m + column] -= conversion.factor * gain;
                        }
                        for k in 0..nx {
                            // Rows of static outputs are zero: they depend on the states through inputs only.
                            self.w_by_x[i * nx + k] = conversion.factor * self.y_by_x[q * nx + k];
                        }
                    }
                }
            }
            if !dense::factor(&mut self.lu, &mut self.pivots, m) {
                return Ok(false);
            }
            dense::solve(&self.lu, &self.pivots, m, &mut self.rest, 1);
            let mut settled = true;
            for i in 0..m {
                self.w[i] -= self.rest[i];
                let scale = self.w[i].abs().max(self.inputs[i].1.nominal);
                settled &= self.rest[i].abs() <= 1e-11 * scale;
            }
            if settled {
                solved = true;
                break;
            }
        }
        if !solved || self.w.iter().any(|w| !w.is_finite()) {
            self.w.fill(0.0);
            return Ok(false);
        }
        dense::solve(&self.lu, &self.pivots, m, &mut self.w_by_x, nx);
        Ok(true)
    }

    /// Inputs and outputs of the block with output `q`.
    fn block_of(&self, q: usize) -> (Range<usize>, Range<usize>) {
        let dynamic = self.dynamics.iter().map(|block| (&block.u, &block.y));
        let all = dynamic.chain(self.statics.iter().map(|block| (&block.u, &block.y)));
        let mut found = all.filter(|(_, y)| y.contains(&q));
        found.next().map_or((0..0, q..q + 1), |(u, y)| (u.clone(), y.clone()))
    }

    /// Derivatives of the states and their Jacobian, from the inputs.
    fn derive(&mut self, x: &[f64]) {
        let nx = self.nx;
        self.jacobian.fill(0.0);
        for block in &self.dynamics {
            let model = &block.model;
            let (n, nu) = (model.nx, model.nu);
            for row in 0..n {
                let (a, b) = (&model.a[row * n..(row + 1) * n], &model.b[row * nu..(row + 1) * nu]);
                let at = block.x.start + row;
                let own: f64 = a.iter().zip(&x[block.x.clone()]).map(|(a, x)| a * x).sum();
                let du = block.u.clone().zip(&model.u0).zip(b);
                let driven: f64 = du.map(|((i, u0), b)| b * (self.w[i] - u0)).sum();
                self.f[at] = model.xdot[row] + own + driven;
                let jacobian = &mut self.jacobian[at * nx..(at + 1) * nx];
                for (b, i) in b.iter().zip(block.u.clone()) {
                    for k in 0..nx {
                        jacobian[k] += b * self.w_by_x[i * nx + k];
                    }
                }
                for (k, a) in a.iter().enumerate() {
                    jacobian[block.x.start + k] += a;
                }
            }
        }
    }
}
