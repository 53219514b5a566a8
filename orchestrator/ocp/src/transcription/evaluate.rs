//! Evaluation of a phase at the variables: nodes first, then the intervals between them; for the Hessian the other way
//! round. Items are spread over threads in contiguous runs; every result depends on its item alone.

use rayon::prelude::*;

use super::functions::Functions;
use super::layout::Layout;
use super::part::Part;
use super::scheme::{Frame, Interval, Points, Worker};
use airloop_optim::EvaluationError;

/// A node with the constraints there.
#[derive(Debug, Clone)]
pub(super) struct Node {
    pub points: Points,
    pub values: Vec<f64>,
    /// `[constraints, n_q]`.
    pub jacobian: Vec<f64>,
    weights: Vec<f64>,
    /// Hessian, `[n_q, n_q]`.
    pub block: Vec<f64>,
}

/// Values computed for a phase.
#[derive(Debug, Clone)]
pub(super) struct Data {
    pub nodes: Vec<Node>,
    pub intervals: Vec<Interval>,
}

impl Data {
    pub fn new(part: &Part) -> Data {
        let functions = &part.functions;
        let (nq, nv) = (functions.arguments(), functions.values());
        let node = |rows: &Vec<usize>| Node {
            points: Points::new(1, functions),
            values: vec![0.0; rows.len()],
            jacobian: vec![0.0; rows.len() * nq],
            weights: vec![0.0; nv],
            block: vec![0.0; nq * nq],
        };
        let interval = |k: usize| {
            let width = part.layout.interval(k).len();
            let rows = part.scheme.row_width(&part.layout, k);
            let constraints = part.interval_rows(k);
            let mut interval = Interval::new(width, part.scheme.points(k), rows, constraints, functions);
            let first = constraints - part.linear_rows[k].len();
            for (row, linear) in part.linear_rows[k].iter().enumerate() {
                let row = &mut interval.jacobian[(first + row) * width..(first + row + 1) * width];
                linear.terms.iter().for_each(|&(j, factor)| row[j] += factor);
            }
            interval
        };
        Data {
            nodes: part.node_rows.iter().map(node).collect(),
            intervals: (0..part.layout.intervals).map(interval).collect(),
        }
    }
}

/// Widest block of the part, for the memory of a worker.
pub(super) fn widest(layout: &Layout) -> usize {
    layout.stride() + layout.node_width()
}

/// Applies `work` to every item with its number; the error of the first item that fails.
fn spread<T: Send>(
    workers: &mut [Worker<'_>],
    items: &mut [T],
    work: impl Fn(&mut Worker<'_>, usize, &mut T) -> Result<(), EvaluationError> + Sync,
) -> Result<(), EvaluationError> {
    let run = |worker: &mut Worker<'_>, first: usize, items: &mut [T]| {
        items.iter_mut().enumerate().try_for_each(|(i, item)| work(worker, first + i, item))
    };
    let count = workers.len().min(items.len());
    if count <= 1 {
        return run(&mut workers[0], 0, items);
    }
    let length = items.len().div_ceil(count);
    let outcomes: Vec<_> = items
        .par_chunks_mut(length)
        .zip(workers)
        .enumerate()
        .map(|(i, (items, worker))| run(worker, i * length, items))
        .collect();
    outcomes.into_iter().collect()
}

/// Says in which phase and when an evaluation failed.
fn placed(error: EvaluationError, part: &Part, time: f64) -> EvaluationError {
    let EvaluationError { function, reason } = error;
    EvaluationError { function: format!("{function} in phase `{}` at t = {time:.6} s", part.name), reason }
}

fn frame<'a>(part: &'a Part, nodes: &'a [Node], x: &'a [f64], begin: f64, k: usize) -> Frame<'a> {
    let duration = part.duration_at(x);
    Frame {
        functions: &part.functions,
        k,
        time: begin + part.fractions[k] * duration,
        seconds: (part.fractions[k + 1] - part.fractions[k]) * duration,
        length: part.length(k),
        w: &x[part.layout.interval(k)],
        left: &nodes[k].points,
        right: &nodes[k + 1].points,
    }
}

/// Values of everything at `x`, which begins at time `begin`; with `derivatives` also their Jacobians.
pub(super) fn evaluate(
    part: &Part,
    workers: &mut [Worker<'_>],
    data: &mut Data,
    x: &[f64],
    begin: f64,
    derivatives: bool,
) -> Result<(), EvaluationError> {
    let functions = &part.functions;
    let nq = functions.arguments();
    let duration = part.duration_at(x);
    spread(workers, &mut data.nodes, |worker, k, node| {
        let time = begin + part.fractions[k] * duration;
        node.points.times[0] = time;
        (0..nq).for_each(|a| node.points.q[a] = x[part.layout.point(k, a)]);
        if part.evaluated[k] {
            let outcome = node.points.evaluate(0, worker, functions, derivatives);
            outcome.map_err(|error| placed(error, part, time))?;
        }
        for (row, &limit) in part.node_rows[k].iter().enumerate() {
            let combination = &part.combinations[limit];
            node.values[row] = combination.value(&node.points.q, &node.points.values);
            if derivatives {
                let gradient = &mut node.jacobian[row * nq..(row + 1) * nq];
                combination.gradient(&node.points.jacobian, gradient);
            }
        }
        Ok(())
    })?;
    let nodes = &data.nodes;
    spread(workers, &mut data.intervals, |worker, k, interval| {
        let frame = frame(part, nodes, x, begin, k);
        let outcome = part.scheme.evaluate(worker, frame, interval, derivatives);
        outcome.map_err(|error| placed(error, part, frame.time))?;
        further_rows(part, worker, frame, interval, derivatives);
        Ok(())
    })
}

/// Constraints of an interval other than its defects.
fn further_rows(
    part: &Part,
    worker: &mut Worker<'_>,
    frame: Frame<'_>,
    interval: &mut Interval,
    derivatives: bool,
) {
    let (k, width, nq) = (frame.k, interval.width, part.functions.arguments());
    let mut next = part.scheme.defects(part.layout.states);
    if let Some(middle) = part.scheme.midpoint() {
        for &limit in &part.middle_rows[k] {
            let combination = &part.combinations[limit];
            let points = &interval.points;
            interval.values[next] = combination.value(points.q(middle), points.values(middle));
            if derivatives {
                let gradient = &mut worker.adjoint[..nq];
                combination.gradient(points.jacobian(middle), gradient);
                let row = &mut interval.jacobian[next * width..(next + 1) * width];
                row.fill(0.0);
                let rows = &interval.rows[middle * nq * width..(middle + 1) * nq * width];
                for (g, of_argument) in gradient.iter().zip(rows.chunks_exact(width)) {
                    if *g != 0.0 {
                        super::block::add(row, *g, of_argument);
                    }
                }
            }
            next += 1;
        }
    }
    for linear in &part.linear_rows[k] {
        interval.values[next] = linear.terms.iter().map(|&(j, factor)| factor * frame.w[j]).sum();
        next += 1;
    }
}

/// Blocks of the Hessian at the point of the last evaluation with derivatives; `multipliers` of the whole problem.
pub(super) fn curvature(
    part: &Part,
    workers: &mut [Worker<'_>],
    data: &mut Data,
    x: &[f64],
    (factor, multipliers): (f64, &[f64]),
    begin: f64,
) -> Result<(), EvaluationError> {
    let functions = &part.functions;
    let nodes = &data.nodes;
    let defects = part.scheme.defects(part.layout.states);
    spread(workers, &mut data.intervals, |worker, k, interval| {
        let frame = frame(part, nodes, x, begin, k);
        let own = &multipliers[part.interval_constraints[k]..];
        interval.on_values.fill(0.0);
        interval.on_arguments.fill(0.0);
        for (&limit, m) in part.middle_rows[k].iter().zip(&own[defects..]) {
            let combination = &part.combinations[limit];
            combination.values.iter().for_each(|&(i, c)| interval.on_values[i] += m * c);
            combination.arguments.iter().for_each(|&(i, c)| interval.on_arguments[i] += m * c);
        }
        let outcome = part.scheme.adjoint(worker, frame, interval, &own[..defects], factor);
        outcome.map_err(|error| placed(error, part, frame.time))
    })?;
    let intervals = &data.intervals;
    let weights = part.scheme.end_weights();
    spread(workers, &mut data.nodes, |worker, k, node| {
        if !part.evaluated[k] {
            return Ok(());
        }
        node_weights(part, functions, intervals, k, &mut node.weights, weights, factor);
        for (&limit, m) in part.node_rows[k].iter().zip(&multipliers[part.node_constraints[k]..]) {
            part.combinations[limit].values.iter().for_each(|&(i, c)| node.weights[i] += m * c);
        }
        worker.weights.copy_from_slice(&node.weights);
        let outcome = worker.curvature(&node.points, 0, functions);
        outcome.map_err(|error| placed(error, part, node.points.times[0]))?;
        node.block.copy_from_slice(&worker.hessian);
        Ok(())
    })
}

/// Weights on the functions at a node: from the intervals at both sides, and of the costs.
fn node_weights(
    part: &Part,
    functions: &Functions,
    intervals: &[Interval],
    k: usize,
    target: &mut [f64],
    costs: [f64; 2],
    factor: f64,
) {
    target.fill(0.0);
    if k > 0 {
        super::block::add(target, 1.0, &intervals[k - 1].ends[1]);
    }
    if k < intervals.len() {
        super::block::add(target, 1.0, &intervals[k].ends[0]);
    } else {
        target[functions.ending()] += factor;
    }
    target[functions.running()] += factor * node_cost(part, k, costs);
}

/// Weight of the cost under the integral at a node.
pub(super) fn node_cost(part: &Part, k: usize, [left, right]: [f64; 2]) -> f64 {
    let n = part.layout.intervals;
    let of = |at: Option<usize>, weight: f64| at.filter(|k| *k < n).map_or(0.0, |k| weight * part.length(k));
    of(Some(k), left) + of(k.checked_sub(1), right)
}
