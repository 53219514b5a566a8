//! B and D by linear least squares on the simulated outputs, for given A and C.

use nalgebra::{DMatrix, DVector};

use super::data::{Matrices, Segment};
use airloop_optim::linalg::StreamedQr;
use airloop_optim::linalg::spectral;

/// B, shape \[n, n_u\], and D, shape \[n_y, n_u\] (zeros unless `direct`), that bring the simulated outputs closest to
/// the measured ones, with an initial state of its own for every segment. Everything about them is linear: `y(k) = C
/// A^k x0 + sum over m of C A^(k-1-m) B u(m) + D u(k)`.
///
/// `observer`, shape \[n, n_y\], is for unstable A: the outputs are then those of the predictor `A - L C`.
pub(super) fn input_terms(
    segments: &[Segment],
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    observer: Option<&DMatrix<f64>>,
    direct: bool,
) -> Option<Matrices> {
    let n_u = segments.first()?.u.nrows();
    let (n, n_y) = (a.nrows(), c.nrows());
    let n_d = if direct { n_y * n_u } else { 0 };
    let parameters = n * n_u + n_d;
    let mut all = StreamedQr::new(parameters + 1);
    for segment in segments {
        let own = responses(segment, a, c, observer, direct);
        // The first n columns are the initial state; the rows below do not know it any more.
        for k in n..own.nrows() {
            all.append(1, |column, out| out[0] = own[(k, n + column)]);
        }
    }
    let all = all.finish();
    let r = all.r();
    let regressor = r.view((0, 0), (parameters, parameters)).into_owned();
    let rhs = r.view((0, parameters), (parameters, 1)).column(0).into_owned();
    let theta = solve_scaled(regressor, &rhs)?;
    let b = DMatrix::from_column_slice(n, n_u, &theta.as_slice()[..n * n_u]);
    let d = if direct {
        DMatrix::from_column_slice(n_y, n_u, &theta.as_slice()[n * n_u..])
    } else {
        DMatrix::zeros(n_y, n_u)
    };
    Some(Matrices { a: a.clone(), b, c: c.clone(), d })
}

/// Factor of the columns: initial state, B (column by column), D (column by column), measured output.
fn responses(
    segment: &Segment,
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    observer: Option<&DMatrix<f64>>,
    direct: bool,
) -> DMatrix<f64> {
    let (n, n_y, n_u) = (a.nrows(), c.nrows(), segment.u.nrows());
    let n_d = if direct { n_y * n_u } else { 0 };
    let columns = n + n * n_u + n_d + 1;
    let closed = observer.map_or_else(|| a.clone(), |l| a - l * c);
    // States of all unit responses side by side; with an observer, D and the measured output drive it as well.
    let carried = if observer.is_some() { columns } else { n + n * n_u };
    let mut states = DMatrix::<f64>::zeros(n, carried);
    states.view_mut((0, 0), (n, n)).fill_with_identity();
    let mut next = states.clone();
    let mut outputs = DMatrix::<f64>::zeros(n_y, columns);
    let mut fold = StreamedQr::new(columns);
    for k in 0..segment.len() {
        let (u, y) = (segment.u.column(k), segment.y.column(k));
        outputs.columns_mut(0, carried).gemm(1.0, c, &states, 0.0);
        next.gemm(1.0, &closed, &states, 0.0);
        for j in 0..n_u {
            for l in 0..n {
                next[(l, n + j * n + l)] += u[j];
            }
        }
        for j in 0..n_u * usize::from(direct) {
            for i in 0..n_y {
                let column = n + n * n_u + j * n_y + i;
                if observer.is_none() {
                    outputs.column_mut(column).fill(0.0);
                }
                outputs[(i, column)] += u[j];
            }
        }
        if let Some(observer) = observer {
            for j in 0..n_u * usize::from(direct) {
                for i in 0..n_y {
                    let mut column = next.column_mut(n + n * n_u + j * n_y + i);
                    column.axpy(-u[j], &observer.column(i), 1.0);
                }
            }
            // The last column is measured minus what the outputs of the past account for.
            next.column_mut(columns - 1).gemv(-1.0, observer, &y, 1.0);
        } else {
            outputs.column_mut(columns - 1).fill(0.0);
        }
        for i in 0..n_y {
            outputs[(i, columns - 1)] += y[i];
            fold.append(1, |column, out| out[0] = outputs[(i, column)]);
        }
        std::mem::swap(&mut states, &mut next);
    }
    fold.finish().r().clone()
}

/// Least-squares solution of a triangular factor, its columns scaled to one; directions that the data do not show are
/// left at zero. `None` for values that are not finite.
fn solve_scaled(mut r: DMatrix<f64>, rhs: &DVector<f64>) -> Option<DVector<f64>> {
    let scale: Vec<f64> = r.column_iter().map(|column| column.norm().max(f64::MIN_POSITIVE)).collect();
    for (mut column, scale) in r.column_iter_mut().zip(&scale) {
        column /= *scale;
    }
    if !r.iter().chain(rhs).all(|value| value.is_finite()) {
        return None;
    }
    let svd = spectral::svd(r, true, true);
    let tolerance = 1e-12 * svd.singular_values.max();
    let mut solution = svd.solve(rhs, tolerance).ok()?;
    solution.iter_mut().zip(&scale).for_each(|(value, scale)| *value /= scale);
    Some(solution)
}

/// Sum of squared simulation errors of every output, shape \[n_y\], the initial state of every segment fitted.
pub(super) fn simulation_error(segments: &[Segment], model: &Matrices) -> Vec<f64> {
    let (n, n_y) = (model.a.nrows(), model.c.nrows());
    let mut errors = vec![0.0; n_y];
    for segment in segments {
        let mut rest = segment.y.clone();
        subtract_response(&mut rest, &DVector::zeros(n), model, Some(segment));
        let x0 = initial_state(&rest, model);
        subtract_response(&mut rest, &x0, model, None);
        for (error, row) in errors.iter_mut().zip(rest.row_iter()) {
            *error += row.iter().map(|value| value * value).sum::<f64>();
        }
    }
    errors
}

/// Initial state of the simulation that is closest to the measured outputs.
pub(super) fn free_initial_state(segment: &Segment, model: &Matrices) -> DVector<f64> {
    let mut rest = segment.y.clone();
    subtract_response(&mut rest, &DVector::zeros(model.a.nrows()), model, Some(segment));
    initial_state(&rest, model)
}

/// Takes the response to the initial state and, if given, to the inputs from `rest`.
fn subtract_response(rest: &mut DMatrix<f64>, x0: &DVector<f64>, model: &Matrices, input: Option<&Segment>) {
    let (mut x, mut next) = (x0.clone(), x0.clone());
    for k in 0..rest.ncols() {
        let mut y = rest.column_mut(k);
        y.gemv(-1.0, &model.c, &x, 1.0);
        next.gemv(1.0, &model.a, &x, 0.0);
        if let Some(segment) = input {
            y.gemv(-1.0, &model.d, &segment.u.column(k), 1.0);
            next.gemv(1.0, &model.b, &segment.u.column(k), 1.0);
        } else if next.amax() < 1e-14 {
            break;
        }
        std::mem::swap(&mut x, &mut next);
    }
}

/// Initial state whose free response is closest to `rest`, shape \[n_y, n\].
fn initial_state(rest: &DMatrix<f64>, model: &Matrices) -> DVector<f64> {
    let n = model.a.nrows();
    let mut fold = StreamedQr::new(n + 1);
    let mut free = model.c.clone();
    for column in rest.column_iter() {
        for (i, value) in column.iter().enumerate() {
            fold.append(1, |column, out| out[0] = if column < n { free[(i, column)] } else { *value });
        }
        free = &free * &model.a;
        if free.amax() < 1e-12 {
            break;
        }
    }
    let triangle = fold.finish();
    let r = triangle.r();
    solve_scaled(r.view((0, 0), (n, n)).into_owned(), &r.view((0, n), (n, 1)).column(0).into_owned())
        .unwrap_or_else(|| DVector::zeros(n))
}
