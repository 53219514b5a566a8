//! Test whether a residual is noise: sums of squares over blocks of several lengths against their distribution under
//! the null.
//!
//! Blocks of one sample see the power of the residual, longer blocks its slow part, which a small power can hide in.
//! The null is simulated: the predicted signals plus sensor noise, rounded as the records are.

use super::noise::Noise;
use super::{System, parallel};

/// Block lengths \[samples\].
pub const BLOCKS: [usize; 3] = [1, 8, 64];

/// Sum over blocks of (sum of the block)^2 / length, for each of [`BLOCKS`].
pub fn powers(residuals: &[f64]) -> [f64; 3] {
    BLOCKS.map(|length| {
        residuals.chunks_exact(length).map(|block| block.iter().sum::<f64>().powi(2) / length as f64).sum()
    })
}

/// Distribution of the powers of every signal under the null.
#[derive(Debug, Clone)]
pub struct Null {
    /// Signals, in order.
    pub signals: Vec<String>,
    mean: Vec<[f64; 3]>,
    deviation: Vec<[f64; 3]>,
    /// Standard deviation of the powers of white noise of unit variance.
    white: Vec<[f64; 3]>,
    /// Powers up to which a signal is noise whose level is known roughly.
    tolerated: Vec<[f64; 3]>,
    /// Largest normalized power that noise alone gives (of the draws not used for the scale).
    pub quantile: f64,
    /// Draws made.
    pub draws: usize,
}

/// Sums of the powers over records, by signal.
pub fn pooled<S: System + ?Sized>(
    system: &S,
    records: &[usize],
    residuals: &[Vec<f64>],
) -> Vec<(String, [f64; 3])> {
    let mut found: Vec<(String, [f64; 3])> = Vec::new();
    for (residual, &record) in residuals.iter().zip(records) {
        for span in system.signals(record) {
            let own = powers(&residual[span.range.clone()]);
            match found.iter_mut().find(|(name, _)| *name == span.signal) {
                Some((_, sum)) => (0..3).for_each(|i| sum[i] += own[i]),
                None => found.push((span.signal, own)),
            }
        }
    }
    found
}

impl Null {
    /// Simulates the null: half of the draws give mean and scale, the other half the quantile.
    pub fn simulate<S: System + ?Sized>(
        system: &S,
        records: &[usize],
        parameters: &[f64],
        locals: &[Vec<f64>],
        draws: usize,
        seed: u64,
    ) -> Null {
        let predicted = parallel::map(records.len(), |i| system.predict(records[i], parameters, &locals[i]));
        let samples = parallel::map(draws, |draw| {
            let residuals: Vec<Vec<f64>> = records
                .iter()
                .enumerate()
                .map(|(i, &record)| {
                    let mut noise = Noise::new(seed, (draw * records.len() + i) as u64);
                    system.redraw(record, &predicted[i], &mut noise)
                })
                .collect();
            pooled(system, records, &residuals)
        });
        let signals: Vec<String> = samples
            .first()
            .map(|first| first.iter().map(|(name, _)| name.clone()).collect())
            .unwrap_or_default();
        let half = draws / 2;
        let of = |signal: usize, i: usize| samples[..half].iter().map(move |draw| draw[signal].1[i]);
        let mean: Vec<[f64; 3]> = (0..signals.len())
            .map(|s| std::array::from_fn(|i| of(s, i).sum::<f64>() / half as f64))
            .collect();
        let deviation: Vec<[f64; 3]> = (0..signals.len())
            .map(|s| {
                std::array::from_fn(|i| {
                    (of(s, i).map(|v| (v - mean[s][i]).powi(2)).sum::<f64>() / half as f64).sqrt()
                })
            })
            .collect();
        let mut samples_of = vec![0usize; signals.len()];
        for &record in records {
            for span in system.signals(record) {
                if let Some(s) = signals.iter().position(|name| *name == span.signal) {
                    samples_of[s] += span.range.len();
                }
            }
        }
        let white = samples_of
            .iter()
            .map(|&n| BLOCKS.map(|length| (2.0 * n as f64 / length as f64).sqrt()))
            .collect();
        let tolerated = vec![[0.0; 3]; mean.len()];
        let mut null = Null { signals, mean, deviation, white, tolerated, quantile: 0.0, draws };
        let worst = |draw: &Vec<(String, [f64; 3])>| {
            null.normalized(draw).into_iter().map(|(_, z)| z).fold(f64::MIN, f64::max)
        };
        null.quantile = samples[half..].iter().map(worst).fold(0.0, f64::max);
        null
    }

    /// The same where a signal all of whose powers are at most `powers` is noise.
    pub fn tolerating(&self, powers: Vec<[f64; 3]>) -> Null {
        Null { tolerated: powers, ..self.clone() }
    }

    /// Mean powers of every signal for each of [`BLOCKS`].
    pub fn means(&self) -> &[[f64; 3]] {
        &self.mean
    }

    /// Largest normalized power of every signal: about normal under the null.
    pub fn normalized(&self, powers: &[(String, [f64; 3])]) -> Vec<(String, f64)> {
        powers
            .iter()
            .enumerate()
            .map(|(s, (name, power))| {
                // Rounding noise of a moving encoder cancels in long blocks, so that its powers hardly vary; an error
                // of some percent of the noise must not count there. White noise is the yardstick.
                let z =
                    (0..3).map(|i| (power[i] - self.mean[s][i]) / self.deviation[s][i].max(self.white[s][i]));
                // A simulation that ran away leaves no number.
                let worst =
                    z.fold(f64::MIN, |worst, z| if z.is_nan() { f64::INFINITY } else { worst.max(z) });
                let near = power.iter().zip(&self.tolerated[s]).all(|(own, most)| own <= most);
                (name.clone(), if near { worst.min(0.0) } else { worst })
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::system::testing::Lines;

    #[test]
    fn what_ran_away_is_no_noise_and_what_is_tolerated_is() {
        let system = Lines::new(0.0, 0.0);
        let null = Null::simulate(&system, &[0], &[0.0, 0.0], &[vec![0.0]], 200, 1);
        let worst = |null: &Null, power: f64| null.normalized(&[("y".into(), [power; 3])])[0].1;
        assert_eq!(worst(&null, f64::NAN), f64::INFINITY);
        assert!(worst(&null, 1e4) > null.quantile);
        let tolerant = null.tolerating(vec![[2e4; 3]]);
        assert!(worst(&tolerant, 1e4) <= 0.0 && worst(&tolerant, 3e4) > null.quantile);
    }

    #[test]
    fn long_blocks_see_a_slow_error_that_the_power_hides() {
        let system = Lines::new(0.0, 0.0);
        let null = Null::simulate(&system, &[0], &[0.0, 0.0], &[vec![0.0]], 200, 1);
        let mut noise = Noise::new(3, 0);
        let white: Vec<f64> = (0..512).map(|_| noise.normal()).collect();
        let biased: Vec<f64> = white.iter().map(|value| value + 0.45).collect();
        let worst = |r: &[f64]| null.normalized(&[("y".into(), powers(r))])[0].1;
        assert!(worst(&white) < null.quantile + 1.0);
        assert!(worst(&biased) > null.quantile + 8.0);
        let power_alone = (powers(&biased)[0] - 512.0) / 1024f64.sqrt();
        assert!(power_alone < 6.0);
    }
}
