//! The functions of a phase at one point: rates, outputs and costs as functions of `q = (T, x, u)`.
//!
//! Where the duration T is free, time is normalized: the rates are `T f` and the cost under the integral is `T
//! L`, so that a transcription sees a mesh of fixed intervals and T as one more argument. Where it is fixed, q is `(x,
//! u)`, the rates are f, and intervals count in seconds.
//!
//! | values | |
//! |---|---|
//! | `0..n_x` | rates |
//! | `n_x..n_x + n_g` | outputs |
//! | [`Functions::running`] | cost under the integral |
//! | [`Functions::ending`] | cost at the end |

use super::dynamics::{Dynamics, Entry, Point, Size, Structure};
use super::problem::{Cost, Quantity, Variable};
use airloop_optim::EvaluationError;

/// A linear combination of arguments and values.
#[derive(Debug, Clone, Default)]
pub(super) struct Combination {
    pub arguments: Vec<(usize, f64)>,
    pub values: Vec<(usize, f64)>,
}

impl Combination {
    pub fn value(&self, q: &[f64], values: &[f64]) -> f64 {
        let of = |terms: &[(usize, f64)], at: &[f64]| terms.iter().map(|&(i, c)| c * at[i]).sum::<f64>();
        of(&self.arguments, q) + of(&self.values, values)
    }

    /// Gradient by q, `[n_q]`.
    pub fn gradient(&self, jacobian: &[f64], gradient: &mut [f64]) {
        let n = gradient.len();
        gradient.fill(0.0);
        self.arguments.iter().for_each(|&(i, c)| gradient[i] += c);
        for &(row, c) in &self.values {
            super::block::add(gradient, c, &jacobian[row * n..(row + 1) * n]);
        }
    }
}

#[derive(Debug, Clone)]
struct Square {
    combination: Combination,
    reference: f64,
    weight: f64,
}

/// Memory of one thread for [`Functions`].
#[derive(Debug, Default, Clone)]
pub(super) struct Scratch {
    jacobian: Vec<f64>,
    weights: Vec<f64>,
    gradient: Vec<f64>,
}

/// A point with what is known there.
#[derive(Clone, Copy)]
pub(super) struct At<'a> {
    pub time: f64,
    pub q: &'a [f64],
    pub values: &'a [f64],
    pub jacobian: &'a [f64],
}

#[derive(Debug)]
pub(super) struct Functions {
    pub size: Size,
    /// 1 where the duration is an argument, else 0.
    pub free: usize,
    squares: [Vec<Square>; 2],
    /// Columns of the Jacobian that are not always zero, for every value.
    pub columns: Vec<Vec<usize>>,
    /// Arguments with which an argument may have a second derivative.
    pub partners: Vec<Vec<usize>>,
}

impl Functions {
    pub fn new(structure: &Structure, size: Size, free: bool, costs: [&[Cost]; 2]) -> Functions {
        let free = usize::from(free);
        let mut functions =
            Functions { size, free, squares: Default::default(), columns: Vec::new(), partners: Vec::new() };
        for (squares, costs) in functions.squares.iter_mut().zip(costs) {
            *squares = costs
                .iter()
                .map(|cost| Square {
                    combination: combination(&cost.quantity, size, free),
                    reference: cost.reference,
                    weight: cost.weight,
                })
                .collect();
        }
        functions.find_structure(structure);
        functions
    }

    /// Arguments n_q.
    pub fn arguments(&self) -> usize {
        self.free + self.size.arguments()
    }

    /// Values n_v.
    pub fn values(&self) -> usize {
        self.size.values() + 2
    }

    /// Value that is the cost under the integral.
    pub fn running(&self) -> usize {
        self.size.values()
    }

    /// Value that is the cost at the end.
    pub fn ending(&self) -> usize {
        self.size.values() + 1
    }

    pub fn has_ending(&self) -> bool {
        !self.squares[1].is_empty()
    }

    pub fn combination(&self, quantity: &Quantity) -> Combination {
        combination(quantity, self.size, self.free)
    }

    fn find_structure(&mut self, structure: &Structure) {
        let (na, free) = (self.size.arguments(), self.free);
        let nq = self.arguments();
        let mut second = vec![false; nq * nq];
        for value in 0..self.size.values() {
            let of = |kind: fn(Entry) -> bool| -> Vec<usize> {
                (0..na).filter(|&a| kind(structure.entry(value, a))).map(|a| a + free).collect()
            };
            let varying = of(|entry| entry == Entry::Varying);
            varying.iter().for_each(|&a| varying.iter().for_each(|&b| second[a * nq + b] = true));
            let mut columns = of(|entry| entry != Entry::Zero);
            if free == 1 && value < self.size.states {
                columns.iter().for_each(|&a| (second[a * nq], second[a]) = (true, true));
                columns.insert(0, 0);
            }
            self.columns.push(columns);
        }
        for (which, squares) in self.squares.iter().enumerate() {
            let mut all = vec![false; nq];
            for square in squares {
                let mut own = vec![false; nq];
                square.combination.arguments.iter().for_each(|&(a, _)| own[a] = true);
                for &(value, _) in &square.combination.values {
                    self.columns[value].iter().for_each(|&a| own[a] = true);
                }
                for a in (0..nq).filter(|&a| own[a]) {
                    all[a] = true;
                    (0..nq).filter(|&b| own[b]).for_each(|b| second[a * nq + b] = true);
                    if free == 1 && which == 0 {
                        (second[a * nq], second[a]) = (true, true);
                    }
                }
            }
            if free == 1 && which == 0 && !squares.is_empty() {
                all[0] = true;
            }
            self.columns.push((0..nq).filter(|&a| all[a]).collect());
        }
        // The duration enters everything linearly.
        second[0] &= free == 0;
        self.partners = (0..nq).map(|a| (0..nq).filter(|&b| second[a * nq + b]).collect()).collect();
    }

    fn point<'a>(&self, time: f64, q: &'a [f64]) -> Point<'a> {
        let (states, inputs) = q[self.free..].split_at(self.size.states);
        Point { time, states, inputs }
    }

    fn duration(&self, q: &[f64]) -> f64 {
        if self.free == 1 { q[0] } else { 1.0 }
    }

    /// Values at q, `[n_v]`.
    pub fn evaluate(
        &self,
        dynamics: &mut dyn Dynamics,
        time: f64,
        q: &[f64],
        values: &mut [f64],
    ) -> Result<(), EvaluationError> {
        dynamics.evaluate(self.point(time, q), &mut values[..self.size.values()])?;
        self.finish(q, values);
        Ok(())
    }

    /// Costs from the outputs, and rates in normalized time.
    fn finish(&self, q: &[f64], values: &mut [f64]) {
        let sum = |squares: &[Square], values: &[f64]| {
            let of = |s: &Square| s.weight * (s.combination.value(q, values) - s.reference).powi(2);
            squares.iter().map(of).sum::<f64>()
        };
        let costs = [sum(&self.squares[0], values), sum(&self.squares[1], values)];
        let duration = self.duration(q);
        values[self.running()] = duration * costs[0];
        values[self.ending()] = costs[1];
        if self.free == 1 {
            values[..self.size.states].iter_mut().for_each(|rate| *rate *= duration);
        }
    }

    /// Values `[n_v]` and Jacobian `[n_v, n_q]` at q.
    pub fn jacobian(
        &self,
        dynamics: &mut dyn Dynamics,
        scratch: &mut Scratch,
        time: f64,
        q: &[f64],
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let (nr, na, nq) = (self.size.values(), self.size.arguments(), self.arguments());
        let duration = self.duration(q);
        if self.free == 0 {
            dynamics.jacobian(self.point(time, q), &mut values[..nr], &mut jacobian[..nr * na])?;
        } else {
            scratch.jacobian.resize(nr * na, 0.0);
            dynamics.jacobian(self.point(time, q), &mut values[..nr], &mut scratch.jacobian)?;
            for (i, row) in jacobian.chunks_exact_mut(nq).take(nr).enumerate() {
                let factor = if i < self.size.states { duration } else { 1.0 };
                row[0] = if i < self.size.states { values[i] } else { 0.0 };
                let raw = &scratch.jacobian[i * na..(i + 1) * na];
                row[1..].iter_mut().zip(raw).for_each(|(j, r)| *j = factor * r);
            }
        }
        self.finish(q, values);
        let (raw, costs) = jacobian.split_at_mut(nr * nq);
        costs.fill(0.0);
        scratch.gradient.resize(nq, 0.0);
        for (which, row) in costs.chunks_exact_mut(nq).enumerate() {
            let factor = if which == 0 { duration } else { 1.0 };
            for square in &self.squares[which] {
                let gap = square.combination.value(q, values) - square.reference;
                square.combination.gradient(raw, &mut scratch.gradient);
                super::block::add(row, 2.0 * square.weight * factor * gap, &scratch.gradient);
            }
            if self.free == 1 && which == 0 {
                row[0] = values[self.running()] / duration;
            }
        }
        Ok(())
    }

    /// Hessian `[n_q, n_q]` of `weights . values`; entries outside those of `partners` are not meaningful.
    pub fn hessian(
        &self,
        dynamics: &mut dyn Dynamics,
        scratch: &mut Scratch,
        at: At<'_>,
        weights: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let (nr, na, nq, nx) =
            (self.size.values(), self.size.arguments(), self.arguments(), self.size.states);
        let duration = self.duration(at.q);
        let costs = [weights[self.running()] * duration, weights[self.ending()]];
        scratch.weights.clear();
        scratch.weights.extend_from_slice(&weights[..nr]);
        scratch.weights[..nx].iter_mut().for_each(|weight| *weight *= duration);
        for (squares, cost) in self.squares.iter().zip(costs) {
            for square in squares.iter().filter(|_| cost != 0.0) {
                let gap = square.combination.value(at.q, at.values) - square.reference;
                let factor = 2.0 * cost * square.weight * gap;
                square.combination.values.iter().for_each(|&(value, c)| scratch.weights[value] += factor * c);
            }
        }
        if self.free == 0 {
            dynamics.hessian(self.point(at.time, at.q), &scratch.weights, hessian)?;
        } else {
            scratch.jacobian.resize((na * na).max(nr * na), 0.0);
            let raw = &mut scratch.jacobian[..na * na];
            dynamics.hessian(self.point(at.time, at.q), &scratch.weights, raw)?;
            hessian.fill(0.0);
            for (a, row) in raw.chunks_exact(na).enumerate() {
                hessian[(a + 1) * nq + 1..(a + 2) * nq].copy_from_slice(row);
            }
            // d/dT of the gradients of T f and T L is the gradient of f and L.
            let scaled = (0..nx).chain([self.running()]);
            for value in scaled {
                let row = &at.jacobian[value * nq..(value + 1) * nq];
                for a in 1..nq {
                    let term = weights[value] * row[a] / duration;
                    hessian[a] += term;
                    hessian[a * nq] += term;
                }
            }
        }
        scratch.gradient.resize(nq, 0.0);
        for (squares, cost) in self.squares.iter().zip(costs) {
            for square in squares.iter().filter(|_| cost != 0.0) {
                square.combination.gradient(at.jacobian, &mut scratch.gradient);
                let gradient = &mut scratch.gradient;
                for (row, &of_row) in hessian.chunks_exact_mut(nq).zip(gradient.iter()) {
                    if of_row != 0.0 {
                        super::block::add(row, 2.0 * cost * square.weight * of_row, gradient);
                    }
                }
            }
        }
        Ok(())
    }
}

fn combination(quantity: &Quantity, size: Size, free: usize) -> Combination {
    let mut found = Combination::default();
    let mut put = |list: usize, at: usize, factor: f64| {
        let terms = if list == 0 { &mut found.arguments } else { &mut found.values };
        match terms.iter_mut().find(|(i, _)| *i == at) {
            Some((_, sum)) => *sum += factor,
            None => terms.push((at, factor)),
        }
    };
    for &(variable, factor) in &quantity.terms {
        match variable {
            Variable::State(i) => put(0, free + i, factor),
            Variable::Input(i) => put(0, free + size.states + i, factor),
            Variable::Output(i) => put(1, size.states + i, factor),
        }
    }
    found
}
