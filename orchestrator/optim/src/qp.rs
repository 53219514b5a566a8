//! Convex quadratic programs, solved by Clarabel's interior point method.

use clarabel::algebra::CscMatrix;
use clarabel::solver::SupportedConeT::{NonnegativeConeT, ZeroConeT};
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus};

use super::error::Error;
use super::form::length;
use super::nlp::Bounds;

/// Minimize `1/2 x.P x + q.x` subject to `row_bounds` on `A x` and `bounds` on x.
#[derive(Clone, Debug, PartialEq)]
pub struct Quadratic {
    /// Entries (row, column, value) of one triangle of P, positive semidefinite; repeated entries are added.
    pub hessian: Vec<(usize, usize, f64)>,
    /// q, `[n]`.
    pub gradient: Vec<f64>,
    /// Entries (row, column, value) of A; repeated entries are added.
    pub rows: Vec<(usize, usize, f64)>,
    /// Bounds of `A x`, `[m]`.
    pub row_bounds: Bounds,
    /// Bounds of x, `[n]`.
    pub bounds: Bounds,
}

/// Outcome of a quadratic program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuadraticStatus {
    /// Solved to 1e-9.
    Solved,
    /// Solved to about 1e-4 only.
    Inexact,
    /// No x satisfies the constraints.
    Infeasible,
    /// The objective falls without end.
    Unbounded,
    /// The solver broke off.
    Failed,
}

/// Solution with multipliers; signs as in [`super::Multipliers`].
#[derive(Clone, Debug, PartialEq)]
pub struct QuadraticSolution {
    /// Outcome of the run; the vectors are meaningful when it is solved or inexact.
    pub status: QuadraticStatus,
    /// x, `[n]`.
    pub x: Vec<f64>,
    /// Multipliers of the rows, `[m]`: `P x + q + A^T y - lower + upper = 0`.
    pub y: Vec<f64>,
    /// Multipliers of the lower bounds of x, `[n]`.
    pub lower: Vec<f64>,
    /// Multipliers of the upper bounds of x, `[n]`.
    pub upper: Vec<f64>,
}

/// Meaning of a row of the conic form.
#[derive(Clone, Copy)]
enum Meaning {
    Row(usize, f64),
    Lower(usize),
    Upper(usize),
}

/// Solves a convex quadratic program; P is not checked for convexity.
///
/// # Errors
/// [`Error::Length`] and [`Error::Entry`] where the parts do not fit, [`Error::Bounds`] where bounds contradict.
pub fn solve_quadratic(problem: &Quadratic) -> Result<QuadraticSolution, Error> {
    let n = problem.gradient.len();
    let m = problem.row_bounds.lower.len();
    check(problem, n, m)?;
    // Zero cone first: equalities, then b - a x >= 0 for every one-sided bound.
    let (mut meanings, mut right) = (Vec::new(), Vec::new());
    let sides = |bounds: &Bounds, i: usize| (bounds.lower[i], bounds.upper[i]);
    for i in 0..m {
        let (l, u) = sides(&problem.row_bounds, i);
        if l == u {
            meanings.push(Meaning::Row(i, 1.0));
            right.push(u);
        }
    }
    for j in 0..n {
        let (l, u) = sides(&problem.bounds, j);
        if l == u {
            meanings.push(Meaning::Upper(j));
            right.push(u);
        }
    }
    let equalities = meanings.len();
    for i in 0..m {
        let (l, u) = sides(&problem.row_bounds, i);
        for (sign, bound) in [(1.0, u), (-1.0, -l)] {
            if l != u && bound < f64::INFINITY {
                meanings.push(Meaning::Row(i, sign));
                right.push(bound);
            }
        }
    }
    for j in 0..n {
        let (l, u) = sides(&problem.bounds, j);
        if l != u && u < f64::INFINITY {
            meanings.push(Meaning::Upper(j));
            right.push(u);
        }
        if l != u && l > f64::NEG_INFINITY {
            meanings.push(Meaning::Lower(j));
            right.push(-l);
        }
    }
    let mut of_row = vec![Vec::new(); m];
    let mut entries = Vec::new();
    for (at, meaning) in meanings.iter().enumerate() {
        match *meaning {
            Meaning::Row(i, sign) => of_row[i].push((at, sign)),
            Meaning::Upper(j) => entries.push((at, j, 1.0)),
            Meaning::Lower(j) => entries.push((at, j, -1.0)),
        }
    }
    for &(i, j, value) in &problem.rows {
        entries.extend(of_row[i].iter().map(|&(at, sign)| (at, j, sign * value)));
    }
    let upper: Vec<_> = problem.hessian.iter().map(|&(i, j, v)| (i.min(j), i.max(j), v)).collect();
    let p = compressed(n, n, upper);
    let a = compressed(meanings.len(), n, entries);
    let mut cones = Vec::new();
    if equalities > 0 {
        cones.push(ZeroConeT(equalities));
    }
    if meanings.len() > equalities {
        cones.push(NonnegativeConeT(meanings.len() - equalities));
    }
    let settings = DefaultSettings {
        verbose: false,
        max_threads: 1,
        presolve_enable: false,
        direct_solve_method: "qdldl".to_owned(),
        tol_gap_abs: 1e-9,
        tol_gap_rel: 1e-9,
        tol_feas: 1e-9,
        ..DefaultSettings::default()
    };
    let mut solution = QuadraticSolution {
        status: QuadraticStatus::Failed,
        x: vec![0.0; n],
        y: vec![0.0; m],
        lower: vec![0.0; n],
        upper: vec![0.0; n],
    };
    let Ok(mut solver) = DefaultSolver::new(&p, &problem.gradient, &a, &right, &cones, settings) else {
        return Ok(solution);
    };
    solver.solve();
    let found = &solver.solution;
    solution.status = match found.status {
        SolverStatus::Solved => QuadraticStatus::Solved,
        SolverStatus::AlmostSolved => QuadraticStatus::Inexact,
        SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => QuadraticStatus::Infeasible,
        SolverStatus::DualInfeasible | SolverStatus::AlmostDualInfeasible => QuadraticStatus::Unbounded,
        _ => QuadraticStatus::Failed,
    };
    solution.x.copy_from_slice(&found.x);
    for (at, (meaning, &z)) in meanings.iter().zip(&found.z).enumerate() {
        match *meaning {
            Meaning::Row(i, sign) => solution.y[i] += sign * z,
            Meaning::Lower(j) => solution.lower[j] = z,
            // A fixed variable has one multiplier of either sign.
            Meaning::Upper(j) if at < equalities && z < 0.0 => solution.lower[j] = -z,
            Meaning::Upper(j) => solution.upper[j] = z,
        }
    }
    Ok(solution)
}

fn check(problem: &Quadratic, n: usize, m: usize) -> Result<(), Error> {
    length("lower bounds of the rows", problem.row_bounds.lower.len(), m)?;
    length("upper bounds of the rows", problem.row_bounds.upper.len(), m)?;
    length("lower bounds", problem.bounds.lower.len(), n)?;
    length("upper bounds", problem.bounds.upper.len(), n)?;
    for (matrix, entries, rows) in [("Hessian", &problem.hessian, n), ("Jacobian", &problem.rows, m)] {
        if let Some(entry) = entries.iter().position(|&(i, j, _)| i >= rows || j >= n) {
            let (row, column, _) = entries[entry];
            return Err(Error::Entry { matrix, entry, row, column, rows, columns: n });
        }
    }
    for (what, bounds) in [("x", &problem.bounds), ("row", &problem.row_bounds)] {
        for (i, (&lower, &upper)) in bounds.lower.iter().zip(&bounds.upper).enumerate() {
            if lower > upper || lower.is_nan() || upper.is_nan() {
                return Err(Error::Bounds { name: format!("{what}[{i}]"), lower, upper });
            }
        }
    }
    Ok(())
}

/// Compressed columns of a matrix, repeated entries added.
fn compressed(rows: usize, columns: usize, mut entries: Vec<(usize, usize, f64)>) -> CscMatrix<f64> {
    entries.sort_by_key(|&(i, j, _)| (j, i));
    entries.dedup_by(|next, kept| {
        let same = (next.0, next.1) == (kept.0, kept.1);
        if same {
            kept.2 += next.2;
        }
        same
    });
    let mut starts = vec![0; columns + 1];
    entries.iter().for_each(|&(_, j, _)| starts[j + 1] += 1);
    (0..columns).for_each(|j| starts[j + 1] += starts[j]);
    let index = entries.iter().map(|e| e.0).collect();
    let values = entries.iter().map(|e| e.2).collect();
    CscMatrix::new(rows, columns, starts, index, values)
}
