//! Tails of the chi-squared and the normal distribution.

/// Probability that a chi-squared variable with `degrees` degrees of freedom exceeds `x`: 1 for `x <= 0`, NaN for NaN
/// or no degrees of freedom.
///
/// Series below, continued fraction above the middle (Abramowitz and Stegun 6.5.29 and 6.5.31).
pub fn tail(x: f64, degrees: usize) -> f64 {
    if x.is_nan() || degrees == 0 {
        return f64::NAN;
    }
    if x <= 0.0 {
        return 1.0;
    }
    let (a, x) = (0.5 * degrees as f64, 0.5 * x);
    let scale = (a * x.ln() - x - ln_gamma_of_half(degrees)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum) = (1.0 / a, 1.0 / a);
        for n in 1..10_000 {
            term *= x / (a + f64::from(n));
            sum += term;
            if term < sum * 1e-16 {
                break;
            }
        }
        return (1.0 - scale * sum).clamp(0.0, 1.0);
    }
    // Lentz's evaluation of 1/(x+1-a- 1(1-a)/(x+3-a- ..)).
    let mut b = x + 1.0 - a;
    let mut c = 1e300;
    let mut d = 1.0 / b;
    let mut fraction = d;
    for n in 1..10_000 {
        let n = f64::from(n);
        let numerator = -n * (n - a);
        b += 2.0;
        d = 1.0 / (numerator * d + b);
        c = b + numerator / c;
        fraction *= d * c;
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    (scale * fraction).clamp(0.0, 1.0)
}

/// `z` that a standard normal variable exceeds in absolute value with the given probability (between 0 and 1).
pub fn two_sided_normal(probability: f64) -> f64 {
    let (mut low, mut high) = (0.0, 40.0);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if tail(middle * middle, 1) > probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// `ln Gamma(k / 2)`, from `Gamma(1) = 1` or `Gamma(1/2) = sqrt(pi)` by `Gamma(a + 1) = a Gamma(a)`.
fn ln_gamma_of_half(k: usize) -> f64 {
    let start = if k.is_multiple_of(2) { 0.0 } else { 0.5 * std::f64::consts::PI.ln() };
    let first = if k.is_multiple_of(2) { 2 } else { 1 };
    start + (first..k).step_by(2).map(|k| (0.5 * k as f64).ln()).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_are_those_of_tables() {
        // scipy.stats.chi2.sf and norm.isf, tests/reference/identification_diagnostics.py
        for (x, degrees, expected) in [
            (3.841458820694124, 1, 0.05),
            (44.31410489621915, 25, 0.01),
            (20.0, 25, 0.7468253060165366),
            (150.0, 100, 0.0009039320423540184),
        ] {
            assert!((tail(x, degrees) - expected).abs() < 1e-12, "{x} {degrees}: {}", tail(x, degrees));
        }
        assert!((two_sided_normal(0.01) - 2.5758293035489004).abs() < 1e-9);
        assert_eq!(tail(0.0, 3), 1.0);
        assert!(tail(1e5, 10) < 1e-300);
    }
}
