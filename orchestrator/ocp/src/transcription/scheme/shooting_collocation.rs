//! Shooting plus collocation: states that form a linear system driven by held inputs are advanced exactly over the
//! interval, the others are collocated by Hermite-Simpson with the linear ones known in the middle and at the end.

use super::{Frame, Interval, Sample, Scheme, Worker};
use crate::transcription::block::{add, combine, congruence};
use crate::transcription::functions::Functions;
use airloop_optim::EvaluationError;

/// Inner points: the middle, and the end with the input of the interval.
const MIDDLE: usize = 0;
const END: usize = 1;

#[derive(Debug)]
pub(in crate::transcription) struct ShootingCollocation {
    linear: Vec<usize>,
    collocated: Vec<usize>,
    /// The linear states after half and the whole of every interval, `[N]`.
    flows: Vec<[Sample; 2]>,
}

impl ShootingCollocation {
    pub fn new(states: usize, linear: Vec<usize>, flows: Vec<[Sample; 2]>) -> Self {
        let collocated = (0..states).filter(|i| !linear.contains(i)).collect();
        ShootingCollocation { linear, collocated, flows }
    }

    /// Arguments of an inner point but for the collocated states.
    fn place_linear(&self, frame: &Frame<'_>, half: usize, q: &mut [f64]) {
        let (f, nx, nq) = (frame.functions.free, frame.functions.size.states, frame.functions.arguments());
        q.copy_from_slice(&frame.w[..nq]);
        for (&state, flow) in self.linear.iter().zip(&self.flows[frame.k][half].flow) {
            let (of_states, of_inputs) = flow.split_at(self.linear.len());
            let inputs = &frame.w[f + nx..nq];
            q[f + state] = self.linear.iter().zip(of_states).map(|(&z, a)| a * frame.w[f + z]).sum::<f64>()
                + of_inputs.iter().zip(inputs).map(|(b, u)| b * u).sum::<f64>();
        }
    }

    fn linear_rows(&self, frame: &Frame<'_>, half: usize, rows: &mut [f64], width: usize) {
        let (f, nx, nq) = (frame.functions.free, frame.functions.size.states, frame.functions.arguments());
        rows.fill(0.0);
        (0..f).chain(f + nx..nq).for_each(|a| rows[a * width + a] = 1.0);
        for (&state, flow) in self.linear.iter().zip(&self.flows[frame.k][half].flow) {
            let (of_states, of_inputs) = flow.split_at(self.linear.len());
            let row = &mut rows[(f + state) * width..(f + state + 1) * width];
            self.linear.iter().zip(of_states).for_each(|(&z, a)| row[f + z] = *a);
            row[f + nx..nq].copy_from_slice(of_inputs);
        }
    }

    fn middle_state(&self, frame: &Frame<'_>, interval: &Interval, i: usize, right: usize) -> f64 {
        0.5 * (frame.w[frame.functions.free + i] + frame.w[right + i])
            + frame.length / 8.0 * (frame.left.values(0)[i] - interval.points.values(END)[i])
    }

    fn fill_rows(&self, frame: &Frame<'_>, interval: &mut Interval, right: usize, product: &mut [f64]) {
        let functions = frame.functions;
        let (f, nq, width) = (functions.free, functions.arguments(), interval.width);
        let (middle, end) = interval.rows.split_at_mut(nq * width);
        self.linear_rows(frame, 0, middle, width);
        self.linear_rows(frame, 1, end, width);
        self.collocated.iter().for_each(|&i| end[(f + i) * width + right + i] = 1.0);
        let part = frame.length / 8.0;
        for &i in &self.collocated {
            combine(product, interval.points.row(END, i), &functions.columns[i], end, width);
            let row = &mut middle[(f + i) * width..(f + i + 1) * width];
            row[f + i] += 0.5;
            row[right + i] += 0.5;
            add(&mut row[..nq], part, frame.left.row(0, i));
            add(row, -part, product);
        }
    }
}

/// Adds the derivatives of the weighted values of a point to `sum`, `[n_w]`.
fn add_value(
    (sum, factor): (&mut [f64], f64),
    interval: (&super::Points, &[f64]),
    (p, value): (usize, usize),
    functions: &Functions,
    width: usize,
) {
    let (points, rows) = interval;
    let nq = functions.arguments();
    let row = points.row(p, value);
    for &a in &functions.columns[value] {
        add(sum, factor * row[a], &rows[(p * nq + a) * width..(p * nq + a + 1) * width]);
    }
}

impl Scheme for ShootingCollocation {
    fn middle(&self, _: usize, _: usize) -> usize {
        0
    }

    fn held(&self) -> bool {
        true
    }

    fn points(&self, _: usize) -> usize {
        2
    }

    fn midpoint(&self) -> Option<usize> {
        Some(MIDDLE)
    }

    fn needs_nodes(&self) -> [bool; 2] {
        [true, false]
    }

    fn end_weights(&self) -> [f64; 2] {
        [1.0 / 6.0, 0.0]
    }

    fn evaluate(
        &self,
        worker: &mut Worker<'_>,
        frame: Frame<'_>,
        interval: &mut Interval,
        derivatives: bool,
    ) -> Result<(), EvaluationError> {
        let functions = frame.functions;
        let (f, running) = (functions.free, functions.running());
        let right = frame.right_states(0);
        let [we, wm] = [frame.length / 6.0, 4.0 * frame.length / 6.0];
        let (w, width) = (frame.w, interval.width);
        self.place_linear(&frame, 1, interval.points.q_mut(END));
        self.collocated.iter().for_each(|&i| interval.points.q_mut(END)[f + i] = w[right + i]);
        interval.points.times[END] = frame.time + frame.seconds;
        for &z in &self.linear {
            interval.values[z] = w[right + z] - interval.points.q(END)[f + z];
        }
        interval.points.evaluate(END, worker, functions, derivatives)?;
        self.place_linear(&frame, 0, interval.points.q_mut(MIDDLE));
        for &i in &self.collocated {
            let state = self.middle_state(&frame, interval, i, right);
            interval.points.q_mut(MIDDLE)[f + i] = state;
        }
        interval.points.times[MIDDLE] = frame.time + 0.5 * frame.seconds;
        interval.points.evaluate(MIDDLE, worker, functions, derivatives)?;
        let (middle, end) = (interval.points.values(MIDDLE), interval.points.values(END));
        interval.cost = wm * middle[running] + we * end[running];
        for &i in &self.collocated {
            let rates = we * (frame.left.values(0)[i] + end[i]) + wm * middle[i];
            interval.values[i] = w[right + i] - w[f + i] - rates;
        }
        if !derivatives {
            return Ok(());
        }
        self.fill_rows(&frame, interval, right, &mut worker.product[..width]);
        let inner = (&interval.points, &interval.rows[..]);
        interval.gradient.fill(0.0);
        add_value((&mut interval.gradient, wm), inner, (MIDDLE, running), functions, width);
        add_value((&mut interval.gradient, we), inner, (END, running), functions, width);
        let nq = functions.arguments();
        for &z in &self.linear {
            let row = &mut interval.jacobian[z * width..(z + 1) * width];
            row.fill(0.0);
            add(row, -1.0, &interval.rows[(nq + f + z) * width..(nq + f + z + 1) * width]);
            row[right + z] += 1.0;
        }
        for &i in &self.collocated {
            let row = &mut interval.jacobian[i * width..(i + 1) * width];
            row.fill(0.0);
            add_value((row, -wm), inner, (MIDDLE, i), functions, width);
            add_value((row, -we), inner, (END, i), functions, width);
            add(&mut row[..nq], -we, frame.left.row(0, i));
            row[f + i] -= 1.0;
            row[right + i] += 1.0;
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
        let (f, nq, width) = (functions.free, functions.arguments(), interval.width);
        let [we, wm] = [frame.length / 6.0, 4.0 * frame.length / 6.0];
        interval.ends.iter_mut().for_each(|end| end.fill(0.0));
        interval.block.fill(0.0);
        worker.weights.copy_from_slice(&interval.on_values);
        self.collocated.iter().for_each(|&i| worker.weights[i] -= wm * multipliers[i]);
        worker.weights[functions.running()] += wm * factor;
        for p in [MIDDLE, END] {
            worker.curvature(&interval.points, p, functions)?;
            congruence(
                &mut interval.block,
                width,
                &worker.hessian,
                &functions.partners,
                &interval.rows[p * nq * width..(p + 1) * nq * width],
                width,
                &mut worker.product,
            );
            if p == END {
                continue;
            }
            // Adjoint of the state in the middle, through which the rates at the ends enter.
            let adjoint = &mut worker.adjoint[..nq];
            adjoint.copy_from_slice(&interval.on_arguments);
            for (value, &weight) in worker.weights.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                let row = interval.points.row(MIDDLE, value);
                functions.columns[value].iter().for_each(|&a| adjoint[a] += weight * row[a]);
            }
            worker.weights.fill(0.0);
            worker.weights[functions.running()] = we * factor;
            for &i in &self.collocated {
                let part = frame.length / 8.0 * adjoint[f + i];
                interval.ends[0][i] = part - we * multipliers[i];
                worker.weights[i] = -part - we * multipliers[i];
            }
        }
        Ok(())
    }
}
