//! Trapezoidal and Hermite-Simpson collocation (Betts, Practical Methods for Optimal Control, section 4.7).
//!
//! ```text
//! trapezoidal         0 = x' - x - h/2 (F + F')
//! Hermite-Simpson     0 = x' - x - h/6 (F + 4 Fm + F'),   xm = (x + x')/2 + h/8 (F - F'),   Fm = F(xm, um)
//! ```
//!
//! A dash marks the right node. Compressed, xm is a function of the nodes; separated, it is a variable and its equation
//! a second defect.

use super::{Frame, Interval, Points, Scheme, Worker};
use crate::transcription::block::{add, combine, congruence};
use airloop_optim::EvaluationError;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Trapezoidal,
    Compressed,
    Separated,
}

#[derive(Debug)]
pub(in crate::transcription) struct Collocation(Kind);

impl Collocation {
    pub fn trapezoidal() -> Self {
        Collocation(Kind::Trapezoidal)
    }

    pub fn compressed() -> Self {
        Collocation(Kind::Compressed)
    }

    pub fn separated() -> Self {
        Collocation(Kind::Separated)
    }

    /// Weights of the rates, in units of the length: of the ends and of the middle.
    fn weights(&self) -> [f64; 2] {
        if self.0 == Kind::Trapezoidal { [0.5, 0.0] } else { [1.0 / 6.0, 4.0 / 6.0] }
    }

    fn variables(&self, frame: &Frame<'_>) -> usize {
        self.middle(frame.functions.size.states, frame.functions.size.inputs)
    }

    /// State in the middle by Hermite's interpolant.
    fn hermite(frame: &Frame<'_>, i: usize, right: usize) -> f64 {
        let f = frame.functions.free;
        0.5 * (frame.w[f + i] + frame.w[right + i])
            + frame.length / 8.0 * (frame.left.values(0)[i] - frame.right.values(0)[i])
    }

    /// Derivative of the above by the variables of the interval, `factor` times, added to `row`.
    fn add_hermite(frame: &Frame<'_>, i: usize, right: usize, factor: f64, row: &mut [f64]) {
        let (f, nq) = (frame.functions.free, frame.functions.arguments());
        row[f + i] += 0.5 * factor;
        row[right + i] += 0.5 * factor;
        let part = factor * frame.length / 8.0;
        add(&mut row[..nq], part, frame.left.row(0, i));
        add(&mut row[right - f..right - f + nq], -part, frame.right.row(0, i));
    }

    fn place_midpoint(&self, frame: &Frame<'_>, points: &mut Points, right: usize) {
        let (f, nq, nx) = (frame.functions.free, frame.functions.arguments(), frame.functions.size.states);
        points.times[0] = frame.time + 0.5 * frame.seconds;
        let q = points.q_mut(0);
        q[..f].copy_from_slice(&frame.w[..f]);
        let middle = &frame.w[nq..right - f];
        if self.0 == Kind::Separated {
            q[f..].copy_from_slice(middle);
        } else {
            (0..nx).for_each(|i| q[f + i] = Self::hermite(frame, i, right));
            q[f + nx..].copy_from_slice(middle);
        }
    }

    fn midpoint_rows(&self, frame: &Frame<'_>, rows: &mut [f64], width: usize, right: usize) {
        let (f, nq, nx) = (frame.functions.free, frame.functions.arguments(), frame.functions.size.states);
        rows.fill(0.0);
        if f == 1 {
            rows[0] = 1.0;
        }
        let separated = self.0 == Kind::Separated;
        for i in 0..nx {
            let row = &mut rows[(f + i) * width..(f + i + 1) * width];
            if separated {
                row[nq + i] = 1.0;
            } else {
                Self::add_hermite(frame, i, right, 1.0, row);
            }
        }
        let inputs = if separated { nq + nx } else { nq };
        for i in f + nx..nq {
            rows[i * width + inputs + i - f - nx] = 1.0;
        }
    }
}

impl Scheme for Collocation {
    fn middle(&self, states: usize, inputs: usize) -> usize {
        match self.0 {
            Kind::Trapezoidal => 0,
            Kind::Compressed => inputs,
            Kind::Separated => states + inputs,
        }
    }

    fn points(&self, _: usize) -> usize {
        usize::from(self.0 != Kind::Trapezoidal)
    }

    fn midpoint(&self) -> Option<usize> {
        (self.0 != Kind::Trapezoidal).then_some(0)
    }

    fn defects(&self, states: usize) -> usize {
        if self.0 == Kind::Separated { 2 * states } else { states }
    }

    fn needs_nodes(&self) -> [bool; 2] {
        [true, true]
    }

    fn end_weights(&self) -> [f64; 2] {
        [self.weights()[0]; 2]
    }

    fn evaluate(
        &self,
        worker: &mut Worker<'_>,
        frame: Frame<'_>,
        interval: &mut Interval,
        derivatives: bool,
    ) -> Result<(), EvaluationError> {
        let functions = frame.functions;
        let (f, nq, nx) = (functions.free, functions.arguments(), functions.size.states);
        let right = frame.right_states(self.variables(&frame));
        let [we, wm] = self.weights().map(|weight| weight * frame.length);
        let (w, width) = (frame.w, interval.width);
        let simpson = self.0 != Kind::Trapezoidal;
        if simpson {
            self.place_midpoint(&frame, &mut interval.points, right);
            interval.points.evaluate(0, worker, functions, derivatives)?;
            interval.cost = wm * interval.points.values(0)[functions.running()];
        }
        for i in 0..nx {
            let ends = frame.left.values(0)[i] + frame.right.values(0)[i];
            let middle = if simpson { wm * interval.points.values(0)[i] } else { 0.0 };
            interval.values[i] = w[right + i] - w[f + i] - we * ends - middle;
            if self.0 == Kind::Separated {
                interval.values[nx + i] = w[nq + i] - Self::hermite(&frame, i, right);
            }
        }
        if !derivatives {
            return Ok(());
        }
        if simpson {
            self.midpoint_rows(&frame, &mut interval.rows, width, right);
            let running = functions.running();
            let (row, columns) = (interval.points.row(0, running), &functions.columns[running]);
            combine(&mut interval.gradient, row, columns, &interval.rows, width);
            interval.gradient.iter_mut().for_each(|g| *g *= wm);
        }
        for i in 0..nx {
            let row = &mut interval.jacobian[i * width..(i + 1) * width];
            row.fill(0.0);
            if simpson {
                combine(row, interval.points.row(0, i), &functions.columns[i], &interval.rows, width);
                row.iter_mut().for_each(|value| *value *= -wm);
            }
            row[f + i] -= 1.0;
            row[right + i] += 1.0;
            add(&mut row[..nq], -we, frame.left.row(0, i));
            add(&mut row[right - f..right - f + nq], -we, frame.right.row(0, i));
        }
        if self.0 == Kind::Separated {
            for i in 0..nx {
                let row = &mut interval.jacobian[(nx + i) * width..(nx + i + 1) * width];
                row.fill(0.0);
                row[nq + i] = 1.0;
                Self::add_hermite(&frame, i, right, -1.0, row);
            }
        }
        Ok(())
    }

    fn adjoint(
        &self,
        worker: &mut Worker<'_>,
        frame: Frame<'_>,
        interval: &mut Interval,
        multipliers: &[f64],
        factor: f64,
    ) -> Result<(), EvaluationError> {
        let functions = frame.functions;
        let (f, nx) = (functions.free, functions.size.states);
        let [we, wm] = self.weights().map(|weight| weight * frame.length);
        for end in &mut interval.ends {
            end.fill(0.0);
            end[..nx].iter_mut().zip(multipliers).for_each(|(weight, m)| *weight = -we * m);
        }
        if self.0 == Kind::Trapezoidal {
            return Ok(());
        }
        worker.weights.copy_from_slice(&interval.on_values);
        worker.weights[..nx].iter_mut().zip(multipliers).for_each(|(weight, m)| *weight -= wm * m);
        worker.weights[functions.running()] += wm * factor;
        worker.curvature(&interval.points, 0, functions)?;
        let width = interval.width;
        interval.block.fill(0.0);
        congruence(
            &mut interval.block,
            width,
            &worker.hessian,
            &functions.partners,
            &interval.rows,
            width,
            &mut worker.product,
        );
        let part = frame.length / 8.0;
        for i in 0..nx {
            // Adjoint of the state in the middle, through which the rates at the ends enter.
            let adjoint =
                if self.0 == Kind::Separated { -multipliers[nx + i] } else { interval.on_arguments[f + i] };
            interval.ends[0][i] += part * adjoint;
            interval.ends[1][i] -= part * adjoint;
        }
        if self.0 == Kind::Compressed {
            for (value, &weight) in worker.weights.iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
                for &a in functions.columns[value].iter().filter(|&&a| (f..f + nx).contains(&a)) {
                    let term = part * weight * interval.points.row(0, value)[a];
                    interval.ends[0][a - f] += term;
                    interval.ends[1][a - f] -= term;
                }
            }
        }
        Ok(())
    }
}
