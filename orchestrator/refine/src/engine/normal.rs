//! A system around a point: residuals, derivatives, normal equations.
//!
//! Derivatives are forward differences: one simulation per parameter. The normal equations have the form of an arrow
//! (local parameters of a record meet only those of the same record and the shared ones), but are small enough to be
//! kept as a whole.

use nalgebra::{DMatrix, DVector};

use super::fit::Free;
use super::system::Job;
use super::{System, parallel};

/// Columns of one record: residuals, derivatives by the shared and by the local parameters.
#[derive(Debug, Clone)]
pub struct Columns {
    /// Residuals.
    pub residuals: Vec<f64>,
    /// d residuals / d parameter, for shared then local parameters.
    pub columns: Vec<Vec<f64>>,
}

/// Residuals and their derivatives of several records; jobs of all of them run side by side.
///
/// Once the search is asked to end, the residuals are still true and derivatives not computed yet are zero: nothing is
/// gained along them, and the uncertainty of the parameter is the largest possible.
///
/// Without `local_columns` the derivatives by local parameters are left out. `known`: residuals that need no
/// simulation.
pub fn columns<S: System + ?Sized>(
    system: &S,
    records: &[usize],
    p: &[f64],
    free: &[Free],
    locals: &[&[f64]],
    local_columns: bool,
    known: Option<Vec<&[f64]>>,
) -> Vec<Columns> {
    let fast = parallel::map(records.len(), |i| system.derivatives(records[i], p, locals[i], free));
    let mut jobs = Vec::new();
    // Record of every job, and place and length of the difference step; none: no step, the record's residuals.
    let mut places = Vec::new();
    // Columns that need no simulation: record, place, derivative; none: of local parameters that act on nothing.
    let mut given = Vec::new();
    for (i, ((&record, own), fast)) in records.iter().zip(locals).zip(fast).enumerate() {
        let job = Job { record, parameters: p.to_vec(), locals: own.to_vec() };
        let (mut shared, begins) = fast.map_or((Vec::new(), None), |own| (own.shared, own.locals));
        if known.is_none() {
            jobs.push(job.clone());
            places.push((i, None));
        }
        for (k, f) in free.iter().enumerate() {
            if let Some(column) = shared.get_mut(k).and_then(Option::take) {
                given.push((i, k, Some(column)));
                continue;
            }
            // A step inwards from the upper bound.
            let step = if p[f.index] + f.step > f.bounds.1 { -f.step } else { f.step };
            let mut moved = job.clone();
            moved.parameters[f.index] += step;
            jobs.push(moved);
            places.push((i, Some((k, step))));
        }
        let mut begins = begins.map(Vec::into_iter);
        for (local, (_, step)) in system.locals(record).into_iter().enumerate().filter(|_| local_columns) {
            let k = free.len() + local;
            let column = begins.as_mut().and_then(Iterator::next);
            if step == 0.0 || column.is_some() {
                given.push((i, k, column.filter(|_| step != 0.0)));
                continue;
            }
            let mut moved = job.clone();
            moved.locals[local] += step;
            jobs.push(moved);
            places.push((i, Some((k, step))));
        }
    }
    let start = |residuals: &[f64]| Columns { residuals: residuals.to_vec(), columns: Vec::new() };
    let mut found: Vec<Columns> = known.unwrap_or_default().into_iter().map(start).collect();
    let simulated = parallel::residuals_until_asked(system, &jobs, |job| places[job].1.is_none());
    let put = |own: &mut Columns, k: usize, column: Vec<f64>| {
        if own.columns.len() <= k {
            own.columns.resize(k + 1, Vec::new());
        }
        own.columns[k] = column;
    };
    for (residuals, (i, step)) in simulated.into_iter().zip(places) {
        let Some((k, step)) = step else {
            found.push(Columns { residuals: residuals.unwrap_or_default(), columns: Vec::new() });
            continue;
        };
        let own = &mut found[i];
        let column = match residuals {
            Some(moved) => moved.iter().zip(&own.residuals).map(|(a, b)| (a - b) / step).collect(),
            None => vec![0.0; own.residuals.len()],
        };
        put(own, k, column);
    }
    for (i, k, column) in given {
        let own = &mut found[i];
        let column = column.unwrap_or_else(|| vec![0.0; own.residuals.len()]);
        put(own, k, column);
    }
    found
}

/// Residuals of the records.
pub fn residuals<S: System + ?Sized>(
    system: &S,
    records: &[usize],
    p: &[f64],
    locals: &[Vec<f64>],
) -> Vec<Vec<f64>> {
    let job =
        |(&record, own): (&usize, &Vec<f64>)| Job { record, parameters: p.to_vec(), locals: own.clone() };
    let jobs: Vec<Job> = records.iter().zip(locals).map(job).collect();
    parallel::residuals(system, &jobs)
}

/// Normal equations of a fit.
pub struct Normal {
    columns: Vec<Columns>,
    /// Shape \[free + locals, free + locals\], priors included.
    pub matrix: DMatrix<f64>,
    /// Shape \[free + locals\].
    pub right: DVector<f64>,
    /// Sum of squares, priors included.
    pub chi2: f64,
}

/// Equations of the linear step over new columns and those that are known around a model.
pub struct Joint {
    /// Shape \[new + shared + locals\]\[new + shared + locals\].
    pub matrix: DMatrix<f64>,
    /// Shape \[new + shared + locals\].
    pub right: DVector<f64>,
    /// Sum of squared residuals.
    pub chi2: f64,
}

impl Joint {
    /// Of records with the residuals and columns `new`, each \[new\]\[samples\], and the columns `known`, each
    /// \[shared + locals of the record\]\[samples\].
    pub fn new(new: &[Columns], known: &[Columns], shared: usize) -> Joint {
        let first_local = new.first().map_or(0, |own| own.columns.len()) + shared;
        let locals: usize = known.iter().map(|own| own.columns.len() - shared).sum();
        let size = first_local + locals;
        let (mut matrix, mut right, mut chi2) = (DMatrix::zeros(size, size), DVector::zeros(size), 0.0);
        let mut offset = first_local;
        for (new, known) in new.iter().zip(known) {
            let all: Vec<&Vec<f64>> = new.columns.iter().chain(&known.columns).collect();
            let place = |a: usize| if a < first_local { a } else { offset + a - first_local };
            for (a, column) in all.iter().enumerate() {
                right[place(a)] -= dot(column, &new.residuals);
                for (b, other) in all.iter().enumerate().skip(a) {
                    let value = dot(column, other);
                    matrix[(place(a), place(b))] += value;
                    if a != b {
                        matrix[(place(b), place(a))] += value;
                    }
                }
            }
            offset += all.len() - first_local;
            chi2 += dot(&new.residuals, &new.residuals);
        }
        Joint { matrix, right, chi2 }
    }

    /// Predicted fall of the sum of squares for a step, shape \[new + shared + locals\].
    pub fn gain(&self, step: &DVector<f64>) -> f64 {
        2.0 * step.dot(&self.right) - (&self.matrix * step).dot(step)
    }
}

impl Normal {
    /// At the point `p`, `locals`.
    pub fn new<S: System + ?Sized>(
        system: &S,
        records: &[usize],
        p: &[f64],
        free: &[Free],
        locals: &[Vec<f64>],
    ) -> Normal {
        let starts: Vec<&[f64]> = locals.iter().map(Vec::as_slice).collect();
        Normal::of(columns(system, records, p, free, &starts, true, None), p, free, locals)
    }

    /// With derivatives of a point nearby and the residuals of this one.
    pub fn near(
        mut columns: Vec<Columns>,
        p: &[f64],
        free: &[Free],
        locals: &[Vec<f64>],
        residuals: Vec<Vec<f64>>,
    ) -> Normal {
        columns.iter_mut().zip(residuals).for_each(|(own, residuals)| own.residuals = residuals);
        Normal::of(columns, p, free, locals)
    }

    fn of(columns: Vec<Columns>, p: &[f64], free: &[Free], locals: &[Vec<f64>]) -> Normal {
        let parts = parallel::map(columns.len(), |i| {
            let own = &columns[i].columns;
            let product = |a: usize, b: usize| if a <= b { dot(&own[a], &own[b]) } else { 0.0 };
            DMatrix::from_fn(own.len(), own.len(), product)
        });
        let ng = free.len();
        let size = ng + locals.iter().map(Vec::len).sum::<usize>();
        let mut matrix = DMatrix::zeros(size, size);
        let mut offset = ng;
        for part in parts {
            let place = |a: usize| if a < ng { a } else { offset + a - ng };
            for a in 0..part.nrows() {
                for b in a..part.nrows() {
                    matrix[(place(a), place(b))] += part[(a, b)];
                    if a != b {
                        matrix[(place(b), place(a))] += part[(a, b)];
                    }
                }
            }
            offset += part.nrows() - ng;
        }
        for (a, f) in free.iter().enumerate() {
            matrix[(a, a)] += f.prior.map_or(0.0, |prior| prior.powi(-2));
        }
        let mut found = Normal { columns, matrix, right: DVector::zeros(size), chi2: 0.0 };
        found.sums(p, free);
        found
    }

    /// The same derivatives with the residuals of another point nearby.
    pub fn moved(&mut self, p: &[f64], free: &[Free], residuals: Vec<Vec<f64>>) {
        for (own, new) in self.columns.iter_mut().zip(residuals) {
            own.residuals = new;
        }
        self.sums(p, free);
    }

    fn sums(&mut self, p: &[f64], free: &[Free]) {
        let parts: Vec<Vec<f64>> = parallel::map(self.columns.len(), |i| {
            let own = &self.columns[i];
            own.columns.iter().map(|column| -dot(column, &own.residuals)).collect()
        });
        let ng = free.len();
        let mut offset = ng;
        self.right.fill(0.0);
        for part in parts {
            for (a, value) in part.iter().enumerate() {
                self.right[if a < ng { a } else { offset + a - ng }] += value;
            }
            offset += part.len() - ng;
        }
        for (a, f) in free.iter().enumerate() {
            self.right[a] -= f.prior.map_or(0.0, |prior| p[f.index] * prior.powi(-2));
        }
        self.chi2 = self.columns.iter().map(|own| dot(&own.residuals, &own.residuals)).sum::<f64>()
            + surprise(p, free);
    }
}

/// Half the gradient of the sum of squares by the shared parameters, of every record.
pub fn gradients<S: System + ?Sized>(
    system: &S,
    records: &[usize],
    p: &[f64],
    free: &[Free],
    locals: &[Vec<f64>],
) -> Vec<DVector<f64>> {
    let starts: Vec<&[f64]> = locals.iter().map(Vec::as_slice).collect();
    let one = |own: Columns| DVector::from_fn(own.columns.len(), |a, _| dot(&own.columns[a], &own.residuals));
    columns(system, records, p, free, &starts, false, None).into_iter().map(one).collect()
}

/// Sum of squares of the priors: `(p / prior)^2` summed over free parameters with a known tolerance.
fn surprise(p: &[f64], free: &[Free]) -> f64 {
    free.iter().map(|f| f.prior.map_or(0.0, |prior| (p[f.index] / prior).powi(2))).sum()
}

/// Sum of squares of residuals, priors included.
pub fn cost(p: &[f64], free: &[Free], residuals: &[Vec<f64>]) -> f64 {
    residuals.iter().map(|own| dot(own, own)).sum::<f64>() + surprise(p, free)
}

/// Scalar product, summed in eight strands.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut strands = [0.0; 8];
    let (mut left, mut right) = (a.chunks_exact(8), b.chunks_exact(8));
    for (x, y) in left.by_ref().zip(right.by_ref()) {
        for i in 0..8 {
            strands[i] += x[i] * y[i];
        }
    }
    let rest: f64 = left.remainder().iter().zip(right.remainder()).map(|(a, b)| a * b).sum();
    strands.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;
    use crate::engine::Span;

    /// `y(k) = p + 2 local`, and a second local parameter that acts on nothing.
    struct Line(AtomicUsize);

    impl System for Line {
        fn records(&self) -> usize {
            1
        }
        fn estimation(&self, _: usize) -> bool {
            true
        }
        fn locals(&self, _: usize) -> Vec<(f64, f64)> {
            vec![(0.0, 0.0), (0.0, 0.5)]
        }
        fn signals(&self, _: usize) -> Vec<Span> {
            vec![Span { signal: "y".into(), range: 0..3, noise: 1.0 }]
        }
        fn predict(&self, _: usize, parameters: &[f64], locals: &[f64]) -> Vec<f64> {
            self.0.fetch_add(1, Ordering::Relaxed);
            vec![parameters[0] + 2.0 * locals[1]; 3]
        }
        fn measured(&self, _: usize) -> Vec<f64> {
            vec![0.0; 3]
        }
        fn whiten(&self, _: usize, predicted: &[f64]) -> Vec<f64> {
            predicted.iter().map(|y| -y).collect()
        }
        fn redraw(&self, _: usize, predicted: &[f64], _: &mut crate::engine::noise::Noise) -> Vec<f64> {
            predicted.to_vec()
        }
    }

    #[test]
    fn a_local_parameter_that_acts_on_nothing_costs_no_simulation_and_has_a_column_of_zeros() {
        let line = Line(AtomicUsize::new(0));
        let free = Free { index: 0, step: 1e-3, bounds: (-1.0, 1.0), prior: None };
        let found = columns(&line, &[0], &[0.1], &[free], &[&[0.0, 0.0]], true, None);
        assert_eq!(line.0.load(Ordering::Relaxed), 3);
        let slopes: Vec<f64> = found[0].columns.iter().map(|column| column[2]).collect();
        assert_eq!(slopes.len(), 3);
        assert!(
            (slopes[0] + 1.0).abs() < 1e-9 && slopes[1] == 0.0 && (slopes[2] + 2.0).abs() < 1e-9,
            "{slopes:?}"
        );
    }
}
