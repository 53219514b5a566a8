//! Small dense blocks, row-major: rows of derivatives, and congruences.

/// `target += factor row`.
pub(super) fn add(target: &mut [f64], factor: f64, row: &[f64]) {
    target.iter_mut().zip(row).for_each(|(t, r)| *t += factor * r);
}

/// `target = sum of row[j] rows[j]` over the columns j of a sparse row.
pub(super) fn combine(target: &mut [f64], row: &[f64], columns: &[usize], rows: &[f64], width: usize) {
    target.fill(0.0);
    for &j in columns {
        add(target, row[j], &rows[j * width..j * width + width]);
    }
}

/// Adds the lower triangle of `R^T H R` to `sum`, `[.., stride]`. H `[n, n]` is symmetric, with entries in the columns
/// `partners[i]` of row i only; R `[n, width]`.
pub(super) fn congruence(
    sum: &mut [f64],
    stride: usize,
    hessian: &[f64],
    partners: &[Vec<usize>],
    rows: &[f64],
    width: usize,
    product: &mut [f64],
) {
    let n = partners.len();
    let product = &mut product[..width];
    for (i, columns) in partners.iter().enumerate() {
        if columns.is_empty() {
            continue;
        }
        combine(product, &hessian[i * n..(i + 1) * n], columns, rows, width);
        for (a, &r) in rows[i * width..(i + 1) * width].iter().enumerate() {
            if r != 0.0 {
                add(&mut sum[a * stride..=a * stride + a], r, &product[..=a]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_congruence_is_that_of_dense_matrices() {
        let (n, width, stride) = (3, 4, 5);
        let h = [2.0, 0.5, 0.0, 0.5, -1.0, 0.0, 0.0, 0.0, 0.0];
        let rows: Vec<f64> = (0..n * width).map(|i| (i as f64 * 0.7).sin()).collect();
        let partners = [vec![0, 1], vec![0, 1], vec![]];
        let mut sum = vec![0.0; width * stride];
        congruence(&mut sum, stride, &h, &partners, &rows, width, &mut [0.0; 8]);
        for a in 0..width {
            for b in 0..width {
                let dense: f64 = (0..n)
                    .flat_map(|i| (0..n).map(move |j| (i, j)))
                    .map(|(i, j)| rows[i * width + a] * h[i * n + j] * rows[j * width + b])
                    .sum();
                let expected = if b <= a { dense } else { 0.0 };
                assert!((sum[a * stride + b] - expected).abs() < 1e-15);
            }
        }
    }
}
