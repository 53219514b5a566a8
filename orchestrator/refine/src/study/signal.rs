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
            let center = i.clamp(half, n - 1 - half);
            let (mut y0, mut y1, mut y2) = (0.0, 0.0, 0.0);
            for (j, value) in values[center - half..=center + half].iter().enumerate() {
                let k = j as f64 - m;
                y0 += value;
                y1 += k * value;
                y2 += k * k * value;
            }
            let curvature = (count * y2 - s2 * y0) / (count * s4 - s2 * s2);
            (y1 / s2 + 2.0 * curvature * (i as f64 - center as f64)) / step
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

/// Integral by the trapezoidal rule, zero at the first sample.
pub fn integral(values: &[f64], step: f64) -> Vec<f64> {
    let (mut sum, mut before) = (0.0, values.first().copied().unwrap_or(0.0));
    let one = |value: &f64| {
        sum += 0.5 * step * (before + value);
        before = *value;
        sum
    };
    let mut found: Vec<f64> = values.iter().skip(1).map(one).collect();
    found.insert(0, 0.0);
    found.truncate(values.len());
    found
}

/// Zero-phase low-pass of order 4; as it is where the corner is not below half the sample rate.
pub fn low_pass(values: &[f64], corner: Option<f64>, step: f64) -> Vec<f64> {
    let mut filtered = values.to_vec();
    if let Some(filter) = corner.and_then(|corner| LowPass::new(corner, step)) {
        filter.both_ways(&mut filtered);
    }
    filtered
}

/// Orders of differences in which slow motion all but vanishes.
const ORDERS: [u32; 3] = [3, 5, 7];
/// Orders that show ever less of the band below half the sample rate, for motion that fills most of it.
const ORDERS_OF_FAST_MOTION: [u32; 4] = [11, 17, 25, 37];
/// Ratio of the scatter of one order to that of the order before from which on both see the same white noise.
const MIN_RATIO_OF_WHITE: f64 = 0.9;
/// Samples per order that differences of fast motion need.
const MIN_SAMPLES_PER_ORDER: usize = 40;

/// Rms of what changes from sample to sample: the least of third, fifth and seventh differences, in which smooth motion
/// all but vanishes, the faster the motion against the sampling the higher the order it takes; jumps, as at reversals,
/// do not count. Motion that fills most of the band shows in these; where differences of higher orders reach a level
/// that the next order keeps, as white noise alone does, it is that level.
pub fn scatter(values: &[f64]) -> f64 {
    let mut differences = Differences { values: values.to_vec(), order: 0 };
    let least = ORDERS.map(|order| differences.scatter(order)).into_iter().fold(f64::INFINITY, f64::min);
    let mut before = least;
    for (step, order) in ORDERS_OF_FAST_MOTION.into_iter().enumerate() {
        if values.len() < MIN_SAMPLES_PER_ORDER * order as usize {
            break;
        }
        let own = differences.scatter(order);
        if own > MIN_RATIO_OF_WHITE * before {
            return if step == 0 { least } else { own.min(before) };
        }
        before = own;
    }
    least
}

/// Differences of an order between neighbors.
struct Differences {
    values: Vec<f64>,
    order: u32,
}

impl Differences {
    /// Rms of white noise by the differences of an order, not lower than that reached.
    fn scatter(&mut self, order: u32) -> f64 {
        while self.order < order {
            self.values = self.values.windows(2).map(|pair| pair[1] - pair[0]).collect();
            self.order += 1;
        }
        let mut sizes: Vec<f64> = self.values.iter().map(|difference| difference.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        // 68.27 % of the normal distribution lie within its standard deviation; the squares of the coefficients, those
        // of binomials, have the sum (2 n)! / n!^2.
        let sum = (1..=order).map(|k| f64::from(order + k) / f64::from(k)).product::<f64>();
        sizes.get((0.6827 * sizes.len() as f64) as usize).map_or(0.0, |size| size / sum.sqrt())
    }
}

/// Typical size of what a zero-phase low-pass takes away, as the rms of noise: the lower quartile over spans of a
/// fortieth of the record, so that jumps do not count, and the ends of a record neither.
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
    // Means of neighbors sharpen the step that rounding of the text has left.
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
    fn the_integral_of_a_line_is_its_parabola() {
        let line: Vec<f64> = (0..30).map(|k| 2.0 - 0.6 * f64::from(k)).collect();
        for (k, sum) in integral(&line, 0.1).iter().enumerate() {
            let t = 0.1 * k as f64;
            assert!((sum - (2.0 * t - 3.0 * t * t)).abs() < 1e-12, "{k}: {sum}");
        }
        assert!(integral(&[], 0.1).is_empty());
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

    #[test]
    fn motion_that_fills_two_thirds_of_the_band_is_no_noise_and_without_noise_there_is_no_floor() {
        let mut noise = crate::engine::noise::Noise::new(3, 0);
        let phases: Vec<f64> = (0..400).map(|_| 6.0 * noise.normal()).collect();
        // Sines up to 0.66 of half the sample rate, the lower the larger.
        let motion = |k: usize| -> f64 {
            let one = |(i, phase): (usize, &f64)| {
                let w = 0.66 * std::f64::consts::PI * (i + 1) as f64 / 400.0;
                (w * k as f64 + phase).sin() / (1.0 + (w / 0.7).powi(2))
            };
            1e-3 * phases.iter().enumerate().map(one).sum::<f64>()
        };
        let clean: Vec<f64> = (0..8000).map(motion).collect();
        let noisy: Vec<f64> = clean.iter().map(|y| y + 4e-4 * noise.normal()).collect();
        assert!((scatter(&noisy) / 4e-4 - 1.0).abs() < 0.1, "{}", scatter(&noisy));
        // Differences of ever higher orders fall on and on: none of them is noise.
        assert_eq!(scatter(&clean), {
            let mut differences = Differences { values: clean.clone(), order: 0 };
            ORDERS.map(|order| differences.scatter(order)).into_iter().fold(f64::INFINITY, f64::min)
        });
    }
}
