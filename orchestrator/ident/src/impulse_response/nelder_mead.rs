//! Minimum of a function of few variables without derivatives (Nelder and Mead, 1965).

/// Smallest value found and where, from a simplex of edge `size` around `start`, within `evaluations` evaluations or
/// until the values of the simplex differ by less than `tolerance`.
pub(super) fn minimize(
    of: impl Fn(&[f64]) -> f64,
    start: &[f64],
    size: f64,
    tolerance: f64,
    evaluations: usize,
) -> (Vec<f64>, f64) {
    let n = start.len();
    let value = |x: &[f64]| Some(of(x)).filter(|value| value.is_finite()).unwrap_or(f64::MAX);
    let mut simplex: Vec<(f64, Vec<f64>)> = (0..=n)
        .map(|corner| {
            let x: Vec<f64> = (0..n).map(|i| start[i] + if i + 1 == corner { size } else { 0.0 }).collect();
            (value(&x), x)
        })
        .collect();
    let mut used = n + 1;
    while used < evaluations {
        simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
        if simplex[n].0 - simplex[0].0 < tolerance {
            break;
        }
        let center: Vec<f64> =
            (0..n).map(|i| simplex[..n].iter().map(|(_, x)| x[i]).sum::<f64>() / n as f64).collect();
        let along = |factor: f64| -> (f64, Vec<f64>) {
            let x: Vec<f64> = (0..n).map(|i| center[i] + factor * (simplex[n].1[i] - center[i])).collect();
            (value(&x), x)
        };
        let reflected = along(-1.0);
        used += 1;
        let next = if reflected.0 < simplex[0].0 {
            used += 1;
            Some(along(-2.0)).filter(|further| further.0 < reflected.0).unwrap_or(reflected)
        } else if reflected.0 < simplex[n - 1].0 {
            reflected
        } else {
            used += 1;
            along(if reflected.0 < simplex[n].0 { -0.5 } else { 0.5 })
        };
        if next.0 < simplex[n].0 {
            simplex[n] = next;
            continue;
        }
        let best = simplex[0].1.clone();
        for (at, x) in simplex.iter_mut().skip(1) {
            x.iter_mut().zip(&best).for_each(|(x, best)| *x = 0.5 * (*x + best));
            *at = value(x);
        }
        used += n;
    }
    simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (at, x) = simplex.swap_remove(0);
    (x, at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_valley_of_rosenbrock_is_followed_to_its_end() {
        let of = |x: &[f64]| (1.0 - x[0]).powi(2) + 100.0 * (x[1] - x[0] * x[0]).powi(2);
        let (x, value) = minimize(of, &[-1.2, 1.0], 0.5, 1e-14, 1000);
        assert!(value < 1e-10 && (x[0] - 1.0).abs() < 1e-4, "{x:?}");
    }
}
