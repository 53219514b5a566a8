//! Random levels, each held for a random time.

use std::ops::Range;

use airloop_series::random::Random;

/// `n` samples of levels uniform in -1..1, held for times uniform in `hold` \[s\].
pub(super) fn samples(hold: &Range<f64>, n: usize, sample_time: f64, seed: u64) -> Vec<f64> {
    let mut random = Random::new(seed);
    let mut samples = Vec::with_capacity(n);
    while samples.len() < n {
        let level = 2.0 * random.uniform() - 1.0;
        let time = hold.start + random.uniform() * (hold.end - hold.start);
        let held = ((time / sample_time).round() as usize).max(1);
        samples.extend(std::iter::repeat_n(level, held.min(n - samples.len())));
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_held_for_the_times_wanted_and_fill_the_range() {
        let samples = samples(&(0.1..0.4), 100_000, 1e-3, 5);
        let mut lengths: Vec<usize> = samples.chunk_by(|a, b| a == b).map(<[f64]>::len).collect();
        lengths.pop(); // cut off by the end
        assert!(lengths.iter().all(|held| (100..=400).contains(held)));
        assert!(lengths.len() > 300);
        let highest = samples.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let lowest = samples.iter().copied().fold(f64::INFINITY, f64::min);
        assert!((0.97..=1.0).contains(&highest) && (-1.0..=-0.97).contains(&lowest));
    }
}
