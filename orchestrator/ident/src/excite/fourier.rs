//! Fast Fourier transform for lengths that are powers of two.

use std::f64::consts::TAU;

/// Transforms in place: `X(k) = sum_n x(n) exp(-+ 2 pi i k n / N)`, with a plus in the exponent for `inverse`, without
/// a factor 1/N. Real and imaginary parts, shape \[N\] each.
///
/// # Panics
/// If the shapes differ or N is not a power of two.
pub fn transform(re: &mut [f64], im: &mut [f64], inverse: bool) {
    let n = re.len();
    assert!(n.is_power_of_two() && im.len() == n, "lengths {n} and {} must be one power of two", im.len());
    let shift = usize::BITS - n.trailing_zeros();
    for i in 0..n {
        let j = if n > 1 { i.reverse_bits() >> shift } else { 0 };
        if i < j {
            re.swap(i, j);
            im.swap(i, j);
        }
    }
    let sign = if inverse { 1.0 } else { -1.0 };
    let mut half = 1;
    while half < n {
        let turn: Vec<(f64, f64)> =
            (0..half).map(|k| (sign * TAU * k as f64 / (2 * half) as f64).sin_cos()).collect();
        for block in (0..n).step_by(2 * half) {
            for (k, (sin, cos)) in turn.iter().enumerate() {
                let (a, b) = (block + k, block + k + half);
                let (r, i) = (re[b] * cos - im[b] * sin, re[b] * sin + im[b] * cos);
                (re[b], im[b]) = (re[a] - r, im[a] - i);
                (re[a], im[a]) = (re[a] + r, im[a] + i);
            }
        }
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transform_is_the_sum_of_its_definition() {
        let n = 16;
        let x: Vec<(f64, f64)> = (0..n).map(|k| ((k * k % 7) as f64, (k % 5) as f64 - 1.0)).collect();
        for inverse in [false, true] {
            let (mut re, mut im): (Vec<f64>, Vec<f64>) = x.iter().copied().unzip();
            transform(&mut re, &mut im, inverse);
            for k in 0..n {
                let sign = if inverse { 1.0 } else { -1.0 };
                let (mut a, mut b) = (0.0, 0.0);
                for (m, (r, i)) in x.iter().enumerate() {
                    let (sin, cos) = (sign * TAU * (k * m) as f64 / n as f64).sin_cos();
                    a += r * cos - i * sin;
                    b += r * sin + i * cos;
                }
                assert!((re[k] - a).abs() < 1e-12 && (im[k] - b).abs() < 1e-12, "{k}");
            }
        }
    }
}
