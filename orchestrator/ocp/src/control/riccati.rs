//! Riccati equations of regulator and estimator, in discrete time.

use nalgebra::DMatrix;

use airloop_optim::linalg::spectral;

/// Doublings of the horizon; each squares the error.
const DOUBLINGS: usize = 60;

/// Stabilizing solution of `P = A' P A - A' P B (R + B' P B)^-1 B' P A + Q` by the structure-preserving doubling
/// algorithm (Chu, Fan, Lin and Wang, Int. J. Control 77, 2004); A `[n, n]`, B `[n, m]`, Q and R symmetric, R
/// positive definite. `None` where the closed loop would not be stable.
pub fn steady(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let n = a.nrows();
    let unit = DMatrix::<f64>::identity(n, n);
    let mut left = a.clone();
    let mut g = symmetric(b * r.clone().cholesky()?.inverse() * b.transpose());
    let mut p = symmetric(q.clone());
    for _ in 0..DOUBLINGS {
        let w = (&unit + &g * &p).try_inverse()?;
        let next_g = symmetric(&g + &left * &w * &g * left.transpose());
        let change = symmetric(left.transpose() * &p * &w * &left);
        p += &change;
        left = &left * &w * &left;
        g = next_g;
        if !p.iter().all(|value| value.is_finite()) {
            return None;
        }
        if change.norm() <= 1e-14 * p.norm() {
            break;
        }
    }
    let closed = a - b * gain(a, b, &p, r)?;
    let radius = spectral::eigenvalues(&closed).iter().map(|pole| pole.norm()).fold(0.0, f64::max);
    (radius < 1.0).then_some(p)
}

/// The cost that far \[samples\] before an end with the cost Q, at most; sooner where it no longer changes. `None` if
/// it grows beyond all bounds.
pub fn far(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    (q, r): (&DMatrix<f64>, &DMatrix<f64>),
    samples: usize,
) -> Option<DMatrix<f64>> {
    let mut p = symmetric(q.clone());
    for _ in 0..samples {
        let before = cost_before((a, b), &gain(a, b, &p, r)?, &p, (q, r));
        let change = (&before - &p).norm();
        p = before;
        if change <= 1e-14 * p.norm() {
            break;
        }
    }
    p.iter().all(|value| value.is_finite()).then_some(p)
}

/// `K = (R + B' P B)^-1 B' P A`, `[m, n]`: feedback before the cost P. `None` if R + B' P B is not positive definite.
pub fn gain(a: &DMatrix<f64>, b: &DMatrix<f64>, p: &DMatrix<f64>, r: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let weighted = b.transpose() * p;
    let gain = symmetric(r + &weighted * b).cholesky()?.solve(&(weighted * a));
    gain.iter().all(|value| value.is_finite()).then_some(gain)
}

/// Cost before a sample with feedback K: `Q + K' R K + (A - B K)' P (A - B K)`, which stays symmetric and positive;
/// shape `[n, n]`, with A `[n, n]`, B `[n, m]`, K `[m, n]`, Q `[n, n]`, R `[m, m]`.
pub fn cost_before(
    (a, b): (&DMatrix<f64>, &DMatrix<f64>),
    gain: &DMatrix<f64>,
    p: &DMatrix<f64>,
    (q, r): (&DMatrix<f64>, &DMatrix<f64>),
) -> DMatrix<f64> {
    let closed = a - b * gain;
    symmetric(q + gain.transpose() * r * gain + closed.transpose() * p * closed)
}

/// Gain of the measurement update `L = P C' (C P C' + R)^-1`, `[n, p]`. `None` if that matrix is not positive definite.
pub fn correction(p: &DMatrix<f64>, c: &DMatrix<f64>, r: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let seen = c * p;
    let gain = symmetric(&seen * c.transpose() + r).cholesky()?.solve(&seen).transpose();
    gain.iter().all(|value| value.is_finite()).then_some(gain)
}

/// Covariance after the measurement, in Joseph's form: `(I - L C) P (I - L C)' + L R L'`, `[n, n]`, with L `[n, p]`,
/// C `[p, n]`, R `[p, p]`.
pub fn corrected(p: &DMatrix<f64>, l: &DMatrix<f64>, c: &DMatrix<f64>, r: &DMatrix<f64>) -> DMatrix<f64> {
    let kept = DMatrix::identity(p.nrows(), p.nrows()) - l * c;
    symmetric(&kept * p * kept.transpose() + l * r * l.transpose())
}

/// Covariance one sample later: `A P A' + Q`, `[n, n]`.
pub fn predicted(p: &DMatrix<f64>, a: &DMatrix<f64>, q: &DMatrix<f64>) -> DMatrix<f64> {
    symmetric(a * p * a.transpose() + q)
}

fn symmetric(matrix: DMatrix<f64>) -> DMatrix<f64> {
    (&matrix + matrix.transpose()) * 0.5
}
