//! Samples of a sensor that no motion explains: detected, named, and bridged by the line between their neighbors.

/// Samples on each side whose median a sample is compared with: runs of up to three samples show as outliers.
const NEIGHBORS: usize = 3;
/// Samples on each side that show the local spread.
const AROUND: usize = 25;
/// Least deviation of an outlier from its neighbors, over the local spread.
const MIN_SPREADS: f64 = 30.0;
/// Least deviation, over the range of the record without its upmost and lowest twentieth. Steps of a command and
/// impacts stay below it: none of 1,762 records of rigs and studies has such a sample.
const MIN_SHARE_OF_RANGE: f64 = 0.5;
/// The same in the first samples: a command that is there from the first sample on may carry a signal from rest to
/// where it stays before the next one, as the current of a motor.
const MIN_SHARE_OF_RANGE_AT_BEGIN: f64 = 10.0;
/// Median of the deviations of normal noise over its standard deviation.
const MEDIAN_OF_NORMAL: f64 = 0.6745;

/// A run of samples that are outliers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlier {
    /// Index of the first.
    pub first: usize,
    /// Samples.
    pub count: usize,
    /// Value that is farthest from the neighbors.
    pub value: f64,
    /// Median of the neighbors there.
    pub neighbors: f64,
}

/// The outliers of a signal.
pub fn find(values: &[f64]) -> Vec<Outlier> {
    let n = values.len();
    if n < 4 * NEIGHBORS {
        return Vec::new();
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let range = sorted[(19 * (n - 1)) / 20] - sorted[(n - 1) / 20];
    let digit = least_gap(&sorted);
    let neighbors = |k: usize| middle(values, k, NEIGHBORS, |j| values[j]);
    let deviation = |k: usize| values[k] - neighbors(k);
    let is_outlier = |k: usize, own: f64| {
        let share = if k < NEIGHBORS { MIN_SHARE_OF_RANGE_AT_BEGIN } else { MIN_SHARE_OF_RANGE };
        if own.abs() <= share * range {
            return false;
        }
        let spread = middle(values, k, AROUND, |j| deviation(j).abs()) / MEDIAN_OF_NORMAL;
        own.abs() > MIN_SPREADS * spread.max(digit)
    };
    let mut outliers: Vec<bool> = (0..n).map(|k| is_outlier(k, deviation(k))).collect();
    // At the ends all neighbors are on one side: what the line through the last two good samples reaches is none.
    let mut end = |order: &mut dyn Iterator<Item = usize>, mut good: [usize; 2]| {
        for k in order {
            let [a, b] = good.map(|k| (k as f64, values[k]));
            let line = b.1 + (k as f64 - b.0) * (b.1 - a.1) / (b.0 - a.0);
            outliers[k] &= is_outlier(k, values[k] - line);
            if !outliers[k] {
                good = [good[1], k];
            }
        }
    };
    end(&mut (n - NEIGHBORS..n), [n - NEIGHBORS - 2, n - NEIGHBORS - 1]);
    end(&mut (0..NEIGHBORS).rev(), [NEIGHBORS + 1, NEIGHBORS]);
    let mut found: Vec<Outlier> = Vec::new();
    for k in (0..n).filter(|&k| outliers[k]) {
        let own = deviation(k);
        match found.last_mut().filter(|last| last.first + last.count == k) {
            Some(last) => {
                last.count += 1;
                if own.abs() > (last.value - last.neighbors).abs() {
                    (last.value, last.neighbors) = (values[k], neighbors(k));
                }
            }
            None => {
                found.push(Outlier { first: k, count: 1, value: values[k], neighbors: neighbors(k) });
            }
        }
    }
    found
}

/// Least distance of two values of a signal; infinite where there is one value.
///
/// At rest the noise of a sensor may be single flickers of its last digit.
pub fn digit(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    least_gap(&sorted)
}

fn least_gap(sorted: &[f64]) -> f64 {
    let gaps = sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 0.0);
    gaps.fold(f64::INFINITY, f64::min)
}

/// Standard deviation of normal samples whose `sizes` have the median that these have.
pub fn scatter(mut sizes: Vec<f64>) -> f64 {
    let half = sizes.len() / 2;
    *sizes.select_nth_unstable_by(half, f64::total_cmp).1 / MEDIAN_OF_NORMAL
}

/// The same of the samples around `k`.
pub fn scatter_around(values: &[f64], k: usize) -> f64 {
    middle(values, k, AROUND, |j| values[j].abs()) / MEDIAN_OF_NORMAL
}

/// Median of `of` over up to `reach` samples on each side of `k`; near an end as many samples, all of them inside.
fn middle(values: &[f64], k: usize, reach: usize, of: impl Fn(usize) -> f64) -> f64 {
    let width = (2 * reach + 1).min(values.len());
    let first = k.saturating_sub(reach).min(values.len() - width);
    let mut window: Vec<f64> = (first..first + width).map(of).collect();
    let (_, median, _) = window.select_nth_unstable_by(width / 2, f64::total_cmp);
    *median
}

/// Puts the line between the samples before and after each outlier in its place.
pub fn bridge(values: &mut [f64], outliers: &[Outlier]) {
    for outlier in outliers {
        let end = outlier.first + outlier.count;
        let before = outlier.first.checked_sub(1).map(|k| values[k]);
        let (Some(from), Some(to)) =
            (before.or(values.get(end).copied()), values.get(end).copied().or(before))
        else {
            continue;
        };
        for (number, value) in values[outlier.first..end].iter_mut().enumerate() {
            let share = (number + 1) as f64 / (outlier.count + 1) as f64;
            *value = from + share * (to - from);
        }
    }
}

/// Longest run of samples that counts as a failure of a sensor.
const MAX_RUN: usize = 50;
/// Runs of a record up to which they are failures: a signal that jumps again and again means it.
const MAX_RUNS: usize = 3;
/// Jump to a run and back, over all steps but the largest of [`SHARE_OF_STEPS`].
const MIN_JUMP_OVER_STEPS: f64 = 10.0;
const SHARE_OF_STEPS: f64 = 0.99;
/// The same over the range of the signal.
const MIN_JUMP_OVER_RANGE: f64 = 0.3;
/// Difference of the jumps there and back, over the jump.
const MAX_DIFFERENCE_OF_JUMPS: f64 = 0.3;

/// Runs of samples to which a signal jumps, and from which it jumps back: longer than those that [`find`] sees.
pub fn failures(values: &[f64]) -> Vec<std::ops::Range<usize>> {
    let steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sizes: Vec<f64> = steps.iter().map(|step| step.abs()).collect();
    let mut levels = values.to_vec();
    if values.len() < 4 * MAX_RUN {
        return Vec::new();
    }
    sizes.sort_by(f64::total_cmp);
    levels.sort_by(f64::total_cmp);
    let part = |sorted: &[f64], share: f64| sorted[(share * (sorted.len() - 1) as f64) as usize];
    let range = part(&levels, 0.95) - part(&levels, 0.05);
    let least = (MIN_JUMP_OVER_STEPS * part(&sizes, SHARE_OF_STEPS)).max(MIN_JUMP_OVER_RANGE * range);
    let jumps: Vec<usize> = (0..steps.len()).filter(|&k| steps[k].abs() > least).collect();
    let mut found = Vec::new();
    for pair in jumps.windows(2) {
        let (there, back) = (pair[0], pair[1]);
        let differ = (steps[there] + steps[back]).abs() > MAX_DIFFERENCE_OF_JUMPS * steps[there].abs();
        if !differ && back - there <= MAX_RUN {
            found.push(there + 1..back + 1);
        }
    }
    if found.len() > MAX_RUNS || 2 * found.len() < jumps.len() { Vec::new() } else { found }
}

#[cfg(test)]
mod tests {
    use super::*;
    use airloop_series::random::Random;

    /// A swing with noise of 1e-3.
    fn swing() -> Vec<f64> {
        let mut random = Random::new(1);
        (0..1000).map(|k| 0.1 * (0.02 * f64::from(k)).sin() + 1e-3 * random.normal()).collect()
    }

    #[test]
    fn single_samples_and_short_runs_are_found_wherever_they_are() {
        for (first, count) in [(0, 1), (0, 3), (400, 1), (400, 3), (997, 3), (999, 1)] {
            let clean = swing();
            let mut values = clean.clone();
            values[first..first + count].fill(5.0);
            let found = find(&values);
            assert_eq!(found.len(), 1, "{first}, {count}: {found:?}");
            assert_eq!((found[0].first, found[0].count, found[0].value), (first, count, 5.0));
            bridge(&mut values, &found);
            let off = values.iter().zip(&clean).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            // Noise of the neighbors and the way of the swing over four samples.
            assert!(off < 0.02, "{first}, {count}: {off}");
        }
    }

    #[test]
    fn a_record_may_end_in_the_middle_of_a_fast_motion() {
        // 100 samples a second of a swing with 5 Hz that grows, to the digits of a file.
        let swing = |k: usize| (1e-3 * k as f64).powi(4) * (0.31 * k as f64).sin();
        for end in 940..1000 {
            let mut values: Vec<f64> = (0..end).map(|k| (1e5 * swing(k)).round() / 1e5).collect();
            assert_eq!(find(&values), [], "{end}");
            values.reverse();
            assert_eq!(find(&values), [], "{end} reversed");
        }
    }

    #[test]
    fn a_signal_may_jump_behind_its_first_sample() {
        // A motor at rest, whose current follows its voltage within a sample.
        let mut values: Vec<f64> = swing().iter().map(|own| 0.4 + own).collect();
        values[0] = 0.0;
        assert_eq!(find(&values), []);
        values[0] = -2.0;
        assert_eq!(find(&values).len(), 1);
    }

    #[test]
    fn a_sensor_that_fails_for_a_while_is_found_and_a_signal_that_jumps_is_not() {
        let mut values = swing();
        values[400..430].fill(0.5);
        let found = failures(&values);
        assert_eq!((found.len(), found[0].clone()), (1, 400..430));
        assert_eq!(failures(&swing()), []);
        let pulses: Vec<f64> = (0..1000).map(|k| f64::from(u8::from(k % 100 < 20))).collect();
        assert_eq!(failures(&pulses), []);
        let step: Vec<f64> = (0..1000).map(|k| f64::from(u8::from(k > 500))).collect();
        assert_eq!(failures(&step), []);
    }

    #[test]
    fn noise_steps_pulses_of_a_command_and_quantized_rest_are_none() {
        assert_eq!(find(&swing()), []);
        let steps: Vec<f64> = (0..1000).map(|k| f64::from((k / 37) % 5)).collect();
        assert_eq!(find(&steps), []);
        let rest: Vec<f64> =
            (0..1000).map(|k| if k % 211 == 0 { 1e-3 } else { 0.0 } + 1e-4 * f64::from(k / 3)).collect();
        assert_eq!(find(&rest), []);
        let flicker: Vec<f64> = (0..1000).map(|k| if k % 211 == 0 { 1e-3 } else { 0.0 }).collect();
        assert_eq!(find(&flicker), []);
    }
}
