//! Derivatives of measured signals on a uniform grid.

use airloop_ident::friction::LowPass;

/// Derivative by a local parabola over `points` samples (Savitzky and Golay 1964); shorter spans at both ends are those
/// of the parabola there.
pub fn savitzky_golay(values: &[f64], points: usize, step: f64) -> Vec<f64> {
    let (n, half) = (values.len(), (points / 2).max(1));
    if n < 2 * half + 1 {
        return central(values, step);
    }
    let m = half as f64;
    let count = 2.0 * m + 1.0;
    let s2 = m * (m + 1.0) * count / 3.0;
    let s4 = s2 * (3.0 * m * m + 3.0 * m - 1.0) / 5.0;
    (0..n)
        .map(|i| {
            let centre = i.clamp(half, n - 1 - half);
            let (mut y0, mut y1, mut y2) = (0.0, 0.0, 0.0);
            for (j, value) in values[centre - half..=centre + half].iter().enumerate() {
                let k = j as f64 - m;
                y0 += value;
                y1 += k * value;
                y2 += k * k * value;
            }
            let curvature = (count * y2 - s2 * y0) / (count * s4 - s2 * s2);
            (y1 / s2 + 2.0 * curvature * (i as f64 - centre as f64)) / step
        })
        .collect()
}

/// Central differences, one-sided at the ends.
pub fn central(values: &[f64], step: f64) -> Vec<f64> {
    let n = values.len();
    (0..n)
        .map(|i| {
            let (a, b) = (i.saturating_sub(1), (i + 1).min(n - 1));
            if b > a { (values[b] - values[a]) / ((b - a) as f64 * step) } else { 0.0 }
        })
        .collect()
}

/// Zero-phase low-pass of order 4; as it is where the corner is not below half the sample rate.
pub fn low_pass(values: &[f64], corner: Option<f64>, step: f64) -> Vec<f64> {
    let mut filtered = values.to_vec();
    if let Some(filter) = corner.and_then(|corner| LowPass::new(corner, step)) {
        filter.both_ways(&mut filtered);
    }
    filtered
}

/// Rms of what changes from sample to sample: the least of third, fifth and seventh differences, in which smooth motion all
/// but vanishes, the faster the motion against the sampling the higher the order it takes; jumps, as at reversals, do not
/// count.
pub fn scatter(values: &[f64]) -> f64 {
    let mut differences = values.to_vec();
    let mut least = f64::INFINITY;
    for order in 1..=7u32 {
        differences = differences.windows(2).map(|pair| pair[1] - pair[0]).collect();
        if order < 3 || order.is_multiple_of(2) {
            continue;
        }
        let mut sizes: Vec<f64> = differences.iter().map(|difference| difference.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        // 68.27 % of the normal distribution lie within its standard deviation; the squares of the coefficients, those
        // of binomials, have the sum (2 n)! / n!^2.
        let sum = (1..=order).map(|k| f64::from(order + k) / f64::from(k)).product::<f64>();
        let size = sizes.get((0.6827 * sizes.len() as f64) as usize).copied();
        least = least.min(size.unwrap_or(0.0) / sum.sqrt());
    }
    least
}

/// Typical size of what a zero-phase low-pass takes away, as the rms of noise: the lower quartile over spans of a fortieth
/// of the record, so that jumps do not count, and the ends of a record neither.
pub fn above(values: &[f64], corner: f64, step: f64) -> f64 {
    let smooth = low_pass(values, Some(corner), step);
    let rest: Vec<f64> = values.iter().zip(&smooth).map(|(a, b)| (a - b).powi(2)).collect();
    let length = (values.len() / 40).max(16);
    let mean = |span: &[f64]| span.iter().sum::<f64>() / span.len() as f64;
    let mut powers: Vec<f64> = rest.chunks_exact(length).map(mean).collect();
    powers.sort_by(f64::total_cmp);
    powers.get(powers.len() / 4).copied().unwrap_or(0.0).sqrt()
}

/// Smallest step of a column: that of which all its changes are multiples; 0 where there is none.
pub fn quantum(values: &[f64]) -> f64 {
    let mut levels = values.to_vec();
    levels.sort_by(f64::total_cmp);
    let size = values.iter().fold(0.0f64, |a, b| a.max(b.abs()));
    let steps = levels.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 1e-12 * size);
    let mut steps: Vec<f64> = steps.collect();
    steps.sort_by(f64::total_cmp);
    let Some(&step) = steps.first() else { return 0.0 };
    // Means of neighbours sharpen what rounding of the text has left of the step.
    let near: Vec<f64> = steps.iter().copied().take_while(|other| *other < 1.2 * step).collect();
    let step = near.iter().sum::<f64>() / near.len() as f64;
    let whole = |change: &&f64| (*change / step - (*change / step).round()).abs() < 0.05;
    let short: Vec<f64> = steps.into_iter().filter(|change| *change < 6.0 * step).collect();
    let fits = short.iter().filter(whole).count();
    if 10 * fits >= 9 * short.len() { step } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_has_its_exact_derivative_up_to_the_ends() {
        let values: Vec<f64> = (0..30).map(|k| 0.1 * f64::from(k)).map(|t| 2.0 - t + 3.0 * t * t).collect();
        for (k, slope) in savitzky_golay(&values, 7, 0.1).iter().enumerate() {
            assert!((slope - (-1.0 + 0.6 * k as f64)).abs() < 1e-10, "{k}: {slope}");
        }
    }

    #[test]
    fn what_lies_above_a_corner_is_its_share_of_white_noise() {
        let mut noise = crate::engine::noise::Noise::new(2, 0);
        let values: Vec<f64> =
            (0..20_000).map(|k| (0.003 * f64::from(k)).sin() + 0.02 * noise.normal()).collect();
        // 92 % of the band of 500 Hz lies above 40 Hz.
        assert!((above(&values, 40.0, 1e-3) / (0.02 * 0.92f64.sqrt()) - 1.0).abs() < 0.03);
    }

    #[test]
    fn the_step_of_an_encoder_is_found_and_a_smooth_column_has_none() {
        let smooth: Vec<f64> = (0..3000).map(|k| (0.01 * f64::from(k)).sin()).collect();
        let rounded: Vec<f64> = smooth.iter().map(|y| (y / 1.57e-4).round() * 1.57e-4).collect();
        assert!((quantum(&rounded) / 1.57e-4 - 1.0).abs() < 1e-6);
        assert_eq!(quantum(&smooth), 0.0);
    }

    #[test]
    fn scatter_of_noise_is_its_rms_and_smooth_motion_does_not_count() {
        let mut noise = crate::engine::noise::Noise::new(1, 0);
        let values: Vec<f64> =
            (0..20_000).map(|k| (0.01 * f64::from(k)).sin() + 0.02 * noise.normal()).collect();
        // Standard error of a standard deviation of 20000 overlapping differences: about 1 %.
        assert!((scatter(&values) / 0.02 - 1.0).abs() < 0.04, "{}", scatter(&values));
        let jumps: Vec<f64> =
            values.iter().enumerate().map(|(k, y)| y + 3.0 * ((k / 500) % 2) as f64).collect();
        assert!((scatter(&jumps) / 0.02 - 1.0).abs() < 0.06, "{}", scatter(&jumps));
        // A swing of forty samples a period.
        let fast: Vec<f64> =
            (0..20_000).map(|k| (0.157 * f64::from(k)).sin() + 1e-4 * noise.normal()).collect();
        assert!((scatter(&fast) / 1e-4 - 1.0).abs() < 0.06, "{}", scatter(&fast));
    }
}
