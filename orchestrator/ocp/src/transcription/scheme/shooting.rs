//! Multiple shooting: the states are advanced through the interval by classical Runge-Kutta steps with held inputs, a
//! sampled block exactly from sample to sample.

use super::{Frame, Interval, Scheme, Worker};
use crate::transcription::block::{add, combine, congruence};
use crate::transcription::functions::Functions;
use crate::transcription::layout::Layout;
use airloop_optim::EvaluationError;

/// Part of the step at which the next stage lies, and weight of the stage in sixths.
const STAGES: [(f64, f64); 4] = [(0.5, 1.0), (0.5, 2.0), (1.0, 2.0), (0.0, 1.0)];

/// A sampled block `z(k+1) = Ad z(k) + Bd u(k)`.
#[derive(Debug, Clone, Default)]
pub(in crate::transcription) struct Sample {
    /// States of the block.
    pub states: Vec<usize>,
    /// Rows of `(Ad, Bd)`, over the states of the block, then all inputs.
    pub flow: Vec<Vec<f64>>,
}

#[derive(Debug)]
pub(in crate::transcription) struct MultipleShooting {
    sample: Sample,
    /// States that are integrated.
    integrated: Vec<usize>,
    /// Steps per interval, `[N]`.
    steps: Vec<usize>,
    /// Second derivatives of a step from its middle only.
    simplified: bool,
}

impl MultipleShooting {
    pub fn new(states: usize, sample: Sample, steps: Vec<usize>, simplified: bool) -> Self {
        let integrated = (0..states).filter(|i| !sample.states.contains(i)).collect();
        MultipleShooting { sample, integrated, steps, simplified }
    }

    fn step(&self, frame: &Frame<'_>) -> f64 {
        frame.length / self.steps[frame.k] as f64
    }

    /// The block at the next sample.
    fn advance_block(&self, start: &[f64], inputs: &[f64], end: &mut [f64]) {
        for (&state, flow) in self.sample.states.iter().zip(&self.sample.flow) {
            let (of_states, of_inputs) = flow.split_at(self.sample.states.len());
            let driven: f64 = of_inputs.iter().zip(inputs).map(|(b, u)| b * u).sum();
            end[state] =
                self.sample.states.iter().zip(of_states).map(|(&z, a)| a * start[z]).sum::<f64>() + driven;
        }
    }

    /// Same as [`Self::advance_block`], of the rows of derivatives; those of the inputs begin at column `inputs`.
    fn advance_rows(&self, start: &[f64], inputs: usize, end: &mut [f64], width: usize) {
        for (&state, flow) in self.sample.states.iter().zip(&self.sample.flow) {
            let (of_states, of_inputs) = flow.split_at(self.sample.states.len());
            let row = &mut end[state * width..(state + 1) * width];
            row.fill(0.0);
            for (&z, &a) in self.sample.states.iter().zip(of_states) {
                add(row, a, &start[z * width..(z + 1) * width]);
            }
            add(&mut row[inputs..], 1.0, of_inputs);
        }
    }
}

impl MultipleShooting {
    /// Arguments of stage point `p`: the state where the step began, moved by `reach` along the rates of the stage
    /// before; the block and the inputs as they were.
    fn place(
        &self,
        interval: &mut Interval,
        p: usize,
        (left, start): (&[f64], &[f64]),
        reach: f64,
        functions: &Functions,
    ) {
        let (f, nx) = (functions.free, functions.size.states);
        let points = &mut interval.points;
        points.q_mut(p).copy_from_slice(left);
        points.q_mut(p)[f..f + nx].copy_from_slice(start);
        if reach != 0.0 {
            for &i in &self.integrated {
                let rate = points.values(p - 1)[i];
                points.q_mut(p)[f + i] += reach * rate;
            }
        }
    }

    /// Derivatives of the first stage point of a step by the left node.
    fn place_rows(&self, rows: &mut [f64], start: &[f64], functions: &Functions) {
        let (f, nq, nx) = (functions.free, functions.arguments(), functions.size.states);
        rows.fill(0.0);
        rows[f * nq..(f + nx) * nq].copy_from_slice(start);
        (0..f).chain(f + nx..nq).for_each(|a| rows[a * nq + a] = 1.0);
    }

    /// Derivatives of the rates at stage point `p`: added to those of the end of the step with the weight `part`, and
    /// with `reach` those of the next stage point, where there is one.
    fn carry_rows(
        &self,
        interval: &mut Interval,
        p: usize,
        [part, reach]: [f64; 2],
        (start, end): (&[f64], &mut [f64]),
        functions: &Functions,
        product: &mut [f64],
    ) {
        let (f, nq) = (functions.free, functions.arguments());
        let (done, rest) = interval.rows.split_at_mut((p + 1) * nq * nq);
        let rows = &done[p * nq * nq..];
        let mut next = if reach == 0.0 { None } else { Some(&mut rest[..nq * nq]) };
        if let Some(next) = &mut next {
            next.copy_from_slice(rows);
        }
        for &i in &self.integrated {
            combine(product, interval.points.row(p, i), &functions.columns[i], rows, nq);
            add(&mut end[i * nq..(i + 1) * nq], part, product);
            if let Some(next) = &mut next {
                let row = &mut next[(f + i) * nq..(f + i + 1) * nq];
                row.copy_from_slice(&start[i * nq..(i + 1) * nq]);
                add(row, reach, product);
            }
        }
        let running = functions.running();
        let columns = &functions.columns[running];
        if !columns.is_empty() {
            combine(product, interval.points.row(p, running), columns, rows, nq);
            add(&mut interval.gradient[..nq], part, product);
        }
    }
}

impl Scheme for MultipleShooting {
    fn middle(&self, _: usize, _: usize) -> usize {
        0
    }

    fn held(&self) -> bool {
        true
    }

    fn points(&self, k: usize) -> usize {
        4 * self.steps[k]
    }

    /// Everything within depends on the left node only.
    fn row_width(&self, layout: &Layout, _: usize) -> usize {
        layout.node_width()
    }

    fn needs_nodes(&self) -> [bool; 2] {
        [false, false]
    }

    fn end_weights(&self) -> [f64; 2] {
        [0.0; 2]
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
        let (running, right) = (functions.running(), frame.right_states(0));
        let step = self.step(&frame);
        let seconds = frame.seconds / self.steps[frame.k] as f64;
        let (left, inputs) = (&frame.w[..nq], f + nx);
        // Values and derivatives where the step began, and on the way to its end.
        let mut memory = [std::mem::take(&mut worker.adjoint), std::mem::take(&mut worker.rows)];
        let [states, rows] = &mut memory;
        let (start, end) = states[..2 * nx].split_at_mut(nx);
        let (start_rows, end_rows) = rows[..2 * nx * nq].split_at_mut(nx * nq);
        end.copy_from_slice(&left[f..f + nx]);
        end_rows.fill(0.0);
        (0..nx).for_each(|i| end_rows[i * nq + f + i] = 1.0);
        interval.cost = 0.0;
        interval.gradient.fill(0.0);
        let mut outcome = Ok(());
        'steps: for number in 0..self.steps[frame.k] {
            start.copy_from_slice(end);
            start_rows.copy_from_slice(end_rows);
            let mut reach = 0.0;
            for (stage, (part, weight)) in STAGES.into_iter().enumerate() {
                let p = 4 * number + stage;
                self.place(interval, p, (left, &*start), step * reach, functions);
                interval.points.times[p] = frame.time + (number as f64 + reach) * seconds;
                reach = part;
                outcome = interval.points.evaluate(p, worker, functions, derivatives);
                if outcome.is_err() {
                    break 'steps;
                }
                let part = step / 6.0 * weight;
                let values = interval.points.values(p);
                interval.cost += part * values[running];
                self.integrated.iter().for_each(|&i| end[i] += part * values[i]);
                if derivatives {
                    if stage == 0 {
                        let rows = &mut interval.rows[p * nq * nq..(p + 1) * nq * nq];
                        self.place_rows(rows, start_rows, functions);
                    }
                    let ends = (&*start_rows, &mut *end_rows);
                    let product = &mut worker.product[..nq];
                    self.carry_rows(interval, p, [part, step * reach], ends, functions, product);
                }
            }
            self.advance_block(start, &left[inputs..], end);
            if derivatives {
                self.advance_rows(start_rows, inputs, end_rows, nq);
            }
        }
        for i in 0..nx {
            interval.values[i] = frame.w[right + i] - end[i];
            if !derivatives {
                continue;
            }
            let row = &mut interval.jacobian[i * interval.width..(i + 1) * interval.width];
            row.fill(0.0);
            add(&mut row[..nq], -1.0, &end_rows[i * nq..(i + 1) * nq]);
            row[right + i] = 1.0;
        }
        let [states, rows] = memory;
        (worker.adjoint, worker.rows) = (states, rows);
        outcome
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
        let (f, nq, nx) = (functions.free, functions.arguments(), functions.size.states);
        let step = self.step(&frame);
        interval.ends.iter_mut().for_each(|end| end.fill(0.0));
        interval.block.fill(0.0);
        let mut memory = std::mem::take(&mut worker.adjoint);
        memory.fill(0.0);
        // Adjoints of the state at the end of the step, at its start, and where the following stage was evaluated.
        let (end, rest) = memory.split_at_mut(nq);
        let (state, rest) = rest.split_at_mut(nq);
        let (later, now) = rest.split_at_mut(nq);
        end[..nx].iter_mut().zip(multipliers).for_each(|(adjoint, m)| *adjoint = -m);
        let mut outcome = Ok(());
        'steps: for number in (0..self.steps[frame.k]).rev() {
            state.fill(0.0);
            later.fill(0.0);
            self.integrated.iter().for_each(|&i| state[i] = end[i]);
            for (stage, (part, weight)) in STAGES.into_iter().enumerate().rev() {
                let p = 4 * number + stage;
                worker.weights.fill(0.0);
                for &i in &self.integrated {
                    worker.weights[i] = step / 6.0 * weight * end[i] + step * part * later[i];
                }
                worker.weights[functions.running()] = step / 6.0 * weight * factor;
                now[..nq].fill(0.0);
                for (value, &weight) in worker.weights.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                    let row = interval.points.row(p, value);
                    functions.columns[value].iter().for_each(|&a| now[a] += weight * row[a]);
                }
                (0..nx).for_each(|i| state[i] += now[f + i]);
                self.integrated.iter().for_each(|&i| later[i] = now[f + i]);
                let bent = match (self.simplified, stage) {
                    (false, _) => Some(p),
                    // All weights of the step, summed where those of a midpoint would be, at its second point, which
                    // lies in its middle.
                    (true, 0) => {
                        add(&mut worker.weights, 1.0, &interval.on_values);
                        Some(p + 1)
                    }
                    (true, stage) => {
                        if stage + 1 == STAGES.len() {
                            interval.on_values.fill(0.0);
                        }
                        add(&mut interval.on_values, 1.0, &worker.weights);
                        None
                    }
                };
                let Some(p) = bent else { continue };
                outcome = worker.curvature(&interval.points, p, functions);
                if outcome.is_err() {
                    break 'steps;
                }
                congruence(
                    &mut interval.block,
                    interval.width,
                    &worker.hessian,
                    &functions.partners,
                    &interval.rows[p * nq * nq..(p + 1) * nq * nq],
                    nq,
                    &mut worker.product,
                );
            }
            for (&z, flow) in self.sample.states.iter().zip(&self.sample.flow) {
                for (&before, a) in self.sample.states.iter().zip(flow) {
                    state[before] += a * end[z];
                }
            }
            end.copy_from_slice(state);
        }
        worker.adjoint = memory;
        outcome
    }
}
