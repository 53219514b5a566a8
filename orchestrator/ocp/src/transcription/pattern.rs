//! Entries of the blocks of a phase that are not always zero, and their places in the whole problem.

use super::evaluate::{Data, curvature, evaluate, widest};
use super::part::Part;
use super::probe::Probe;
use super::scheme::Worker;
use airloop_optim::EvaluationError;

/// Entries of a phase, in the order: node 0, interval 0, node 1, ..., node N.
#[derive(Debug, Default)]
pub(super) struct Pattern {
    /// Places in the Jacobian blocks of the nodes, `[N + 1]`, and of the intervals, `[N]`.
    node_jacobian: Vec<Vec<u32>>,
    interval_jacobian: Vec<Vec<u32>>,
    /// Places in the Hessian block of every node that is evaluated, and in the blocks of the intervals, `[N]`.
    node_hessian: Vec<u32>,
    interval_hessian: Vec<Vec<u32>>,
    pub jacobian_entries: usize,
    pub hessian_entries: usize,
}

fn there(block: &[f64], lower: Option<usize>) -> Vec<u32> {
    let inside = |i: usize| lower.is_none_or(|width| i % width <= i / width);
    (0..block.len()).filter(|&i| block[i] != 0.0 && inside(i)).map(|i| i as u32).collect()
}

impl Pattern {
    pub fn new(part: &Part, probe: &mut Probe) -> Result<Pattern, EvaluationError> {
        let mut data = Data::new(part);
        let end = part.layout.first + part.layout.variables();
        let x: Vec<f64> = (0..end).map(|_| probe.number()).collect();
        let multipliers: Vec<f64> = (0..part.end_constraint).map(|_| probe.number()).collect();
        let mut workers = [Worker::new(Box::new(probe), &part.functions, widest(&part.layout))];
        evaluate(part, &mut workers, &mut data, &x, 0.0, true)?;
        curvature(part, &mut workers, &mut data, &x, (1.0, &multipliers), 0.0)?;
        let partners = part.functions.partners.iter().enumerate();
        let nq = part.functions.arguments();
        let node_hessian = partners.flat_map(|(a, others)| {
            others.iter().filter(move |&&b| b <= a).map(move |&b| (a * nq + b) as u32)
        });
        let mut pattern = Pattern {
            node_jacobian: data.nodes.iter().map(|node| there(&node.jacobian, None)).collect(),
            interval_jacobian: data.intervals.iter().map(|i| there(&i.jacobian, None)).collect(),
            node_hessian: node_hessian.collect(),
            interval_hessian: data.intervals.iter().map(|i| there(&i.block, Some(i.width))).collect(),
            ..Pattern::default()
        };
        let count = |lists: &[Vec<u32>]| lists.iter().map(Vec::len).sum::<usize>();
        pattern.jacobian_entries = count(&pattern.node_jacobian) + count(&pattern.interval_jacobian);
        let nodes = part.evaluated.iter().filter(|evaluated| **evaluated).count();
        pattern.hessian_entries = nodes * pattern.node_hessian.len() + count(&pattern.interval_hessian);
        Ok(pattern)
    }

    /// Appends (constraint, variable) of every entry of the Jacobian.
    pub fn jacobian_places(&self, part: &Part, places: &mut Vec<(usize, usize)>) {
        let nq = part.functions.arguments();
        for k in 0..=part.layout.intervals {
            let first = part.node_constraints[k];
            let node = self.node_jacobian[k].iter().map(|&i| i as usize);
            places.extend(node.map(|i| (first + i / nq, part.layout.point(k, i % nq))));
            if k < part.layout.intervals {
                let (first, range) = (part.interval_constraints[k], part.layout.interval(k));
                let interval = self.interval_jacobian[k].iter().map(|&i| i as usize);
                places.extend(interval.map(|i| (first + i / range.len(), range.start + i % range.len())));
            }
        }
    }

    pub fn jacobian_values(&self, data: &Data, values: &mut [f64]) {
        let mut values = values.iter_mut();
        for k in 0..data.nodes.len() {
            gather(&self.node_jacobian[k], &data.nodes[k].jacobian, &mut values);
            if k < data.intervals.len() {
                gather(&self.interval_jacobian[k], &data.intervals[k].jacobian, &mut values);
            }
        }
    }

    /// Appends the two variables of every entry of the Hessian.
    pub fn hessian_places(&self, part: &Part, places: &mut Vec<(usize, usize)>) {
        let nq = part.functions.arguments();
        for k in 0..=part.layout.intervals {
            if part.evaluated[k] {
                let node = self.node_hessian.iter().map(|&i| i as usize);
                places.extend(node.map(|i| (part.layout.point(k, i / nq), part.layout.point(k, i % nq))));
            }
            if k < part.layout.intervals {
                let range = part.layout.interval(k);
                let interval = self.interval_hessian[k].iter().map(|&i| i as usize);
                places
                    .extend(interval.map(|i| (range.start + i / range.len(), range.start + i % range.len())));
            }
        }
    }

    pub fn hessian_values(&self, part: &Part, data: &Data, values: &mut [f64]) {
        let mut values = values.iter_mut();
        for k in 0..data.nodes.len() {
            if part.evaluated[k] {
                gather(&self.node_hessian, &data.nodes[k].block, &mut values);
            }
            if k < data.intervals.len() {
                gather(&self.interval_hessian[k], &data.intervals[k].block, &mut values);
            }
        }
    }
}

fn gather(places: &[u32], block: &[f64], values: &mut std::slice::IterMut<'_, f64>) {
    places.iter().zip(values).for_each(|(&place, value)| *value = block[place as usize]);
}
