//! Multipliers as functions of time, so that a solution can start another mesh or transcription.
//!
//! The multiplier of a bound or of a limit along the path is a density times the weight of its point: knots and
//! midpoints get what a quadrature gives them. Costates (multipliers of defects) are not densities.

use super::Error;
use super::layout::Layout;
use super::part::Part;
use super::program::Program;
use super::trajectory::Trajectory;
use airloop_optim::{Multipliers, Nlp, Start};

/// A function of the fraction of the phase: values at increasing places, straight lines between them, zero where there
/// are none.
#[derive(Debug, Clone, PartialEq, Default)]
struct Series(Vec<(f64, f64)>);

impl Series {
    fn at(&self, s: f64) -> f64 {
        let after = self.0.partition_point(|&(place, _)| place < s);
        match (self.0.get(after.wrapping_sub(1)), self.0.get(after)) {
            (Some(a), Some(b)) => a.1 + (s - a.0) / (b.0 - a.0) * (b.1 - a.1),
            (Some(one), None) | (None, Some(one)) => one.1,
            (None, None) => 0.0,
        }
    }
}

/// Multipliers of a phase.
#[derive(Debug, Clone, PartialEq, Default)]
struct PhaseDuals {
    /// Of lower and upper bounds, per argument (duration, states, inputs).
    bounds: [Vec<Series>; 2],
    /// Of the limits, by number; along the path densities.
    limits: Vec<Series>,
    /// Of the defects, per state.
    costates: Vec<Series>,
}

/// Multipliers of a solution as functions of time; [`Program::duals`] makes them, [`Program::warm_start`] uses them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Duals {
    phases: Vec<PhaseDuals>,
    joints: Vec<f64>,
}

/// Weight of node `k` in the time of the phase, 0..1.
fn node_weight(part: &Part, k: usize, argument: usize) -> f64 {
    let (layout, s) = (&part.layout, &part.fractions);
    let before = if k > 0 { s[k] - s[k - 1] } else { 0.0 };
    let after = if k < layout.intervals { s[k + 1] - s[k] } else { 0.0 };
    if layout.held && argument >= layout.free + layout.states {
        after
    } else if layout.midpoint(0, argument).is_some() {
        (before + after) / 6.0
    } else {
        (before + after) / 2.0
    }
}

/// Every variable of a part: argument, fraction of the phase, weight, index.
fn places(part: &Part) -> Vec<(usize, f64, f64, usize)> {
    let layout: &Layout = &part.layout;
    let mut found = Vec::new();
    for k in 0..=layout.intervals {
        for a in layout.free..layout.node_width() {
            let borrowed = layout.held && k == layout.intervals && a >= layout.free + layout.states;
            if !borrowed {
                found.push((a, part.fractions[k], node_weight(part, k, a), layout.point(k, a)));
            }
            let inside = (k < layout.intervals).then(|| layout.midpoint(k, a)).flatten();
            if let Some(variable) = inside.filter(|&variable| variable != layout.point(k, a)) {
                let (left, right) = (part.fractions[k], part.fractions[k + 1]);
                found.push((a, 0.5 * (left + right), (right - left) * 4.0 / 6.0, variable));
            }
        }
    }
    found
}

/// Every constraint of a part that is a limit: number, fraction, weight, index. Limits at an end have weight 1.
fn limits(part: &Part, paths: usize) -> Vec<(usize, f64, f64, usize)> {
    let n = part.layout.intervals;
    let defects = part.scheme.defects(part.layout.states);
    let mut found = Vec::new();
    for k in 0..=n {
        let both = part.scheme.midpoint().is_some();
        for (row, &limit) in part.node_rows[k].iter().enumerate() {
            let plain = node_weight(part, k, 0) * if both { 1.0 / 3.0 } else { 1.0 };
            let weight = if limit < paths { plain } else { 1.0 };
            found.push((limit, part.fractions[k], weight, part.node_constraints[k] + row));
        }
        if k == n {
            break;
        }
        let (left, right) = (part.fractions[k], part.fractions[k + 1]);
        for (row, &limit) in part.middle_rows[k].iter().enumerate() {
            let index = part.interval_constraints[k] + defects + row;
            found.push((limit, 0.5 * (left + right), (right - left) * 4.0 / 6.0, index));
        }
    }
    found
}

impl Program<'_> {
    /// The multipliers of a solution as functions of time.
    pub fn duals(&self, multipliers: &Multipliers) -> Duals {
        let phases = self.parts.iter().map(|part| {
            let layout = &part.layout;
            let empty = vec![Series::default(); layout.node_width()];
            let mut duals = PhaseDuals {
                bounds: [empty.clone(), empty],
                limits: vec![Series::default(); part.limits.len()],
                costates: vec![Series::default(); layout.states],
            };
            for (argument, s, weight, variable) in places(part) {
                for (side, z) in [&multipliers.lower, &multipliers.upper].into_iter().enumerate() {
                    duals.bounds[side][argument].0.push((s, z[variable] / weight));
                }
            }
            for (limit, s, weight, row) in limits(part, part.paths) {
                duals.limits[limit].0.push((s, multipliers.constraints[row] / weight));
            }
            for (k, &first) in part.interval_constraints.iter().enumerate() {
                let s = 0.5 * (part.fractions[k] + part.fractions[k + 1]);
                for (i, series) in duals.costates.iter_mut().enumerate() {
                    series.0.push((s, multipliers.constraints[first + i]));
                }
            }
            duals
        });
        let joints = self.joints.iter().flat_map(|joint| {
            multipliers.constraints[joint.first..joint.first + joint.constraints()].iter().copied()
        });
        Duals { phases: phases.collect(), joints: joints.collect() }
    }

    /// A start along a trajectory with multipliers of an earlier solution of the same problem, on any mesh.
    ///
    /// # Errors
    /// [`Error::Trajectory`] where trajectory or multipliers do not fit the problem.
    pub fn warm_start(&self, trajectory: &Trajectory, duals: &Duals) -> Result<Start, Error> {
        let x = self.vector(trajectory)?;
        let joints: usize = self.joints.iter().map(|joint| joint.constraints()).sum();
        let fits = |(part, duals): (&Part, &PhaseDuals)| {
            duals.costates.len() == part.layout.states
                && duals.limits.len() == part.limits.len()
                && duals.bounds[0].len() == part.layout.node_width()
        };
        if duals.phases.len() != self.parts.len()
            || duals.joints.len() != joints
            || !self.parts.iter().zip(&duals.phases).all(fits)
        {
            return Err(Error::Trajectory("the multipliers are those of another problem".to_owned()));
        }
        let mut multipliers = Multipliers {
            constraints: vec![0.0; self.constraints()],
            lower: vec![0.0; self.variables],
            upper: vec![0.0; self.variables],
        };
        for (part, duals) in self.parts.iter().zip(&duals.phases) {
            for (argument, s, weight, variable) in places(part) {
                multipliers.lower[variable] = weight * duals.bounds[0][argument].at(s);
                multipliers.upper[variable] = weight * duals.bounds[1][argument].at(s);
            }
            for (limit, s, weight, row) in limits(part, part.paths) {
                multipliers.constraints[row] = weight * duals.limits[limit].at(s);
            }
            for (k, &first) in part.interval_constraints.iter().enumerate() {
                let s = 0.5 * (part.fractions[k] + part.fractions[k + 1]);
                for (i, series) in duals.costates.iter().enumerate() {
                    multipliers.constraints[first + i] = series.at(s);
                }
            }
        }
        let mut values = duals.joints.iter();
        for joint in &self.joints {
            let own = &mut multipliers.constraints[joint.first..joint.first + joint.constraints()];
            own.iter_mut().zip(&mut values).for_each(|(m, value)| *m = *value);
        }
        Ok(Start { x, multipliers: Some(multipliers), barrier: None })
    }
}
