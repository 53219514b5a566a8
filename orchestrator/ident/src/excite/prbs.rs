//! Pseudo-random binary sequences of maximal length (Ljung, System Identification, section 13.3).

use super::{Error, check};
use airloop_series::random::Random;

/// Orders that are offered.
pub const ORDERS: std::ops::RangeInclusive<u32> = 2..=20;

/// Taps of a primitive polynomial of each order from 2 on: bits whose sum modulo 2 is fed back, the oldest first.
const TAPS: [&[u32]; 19] = [
    &[2, 1],
    &[3, 2],
    &[4, 3],
    &[5, 3],
    &[6, 5],
    &[7, 6],
    &[8, 6, 5, 4],
    &[9, 5],
    &[10, 7],
    &[11, 9],
    &[12, 11, 10, 4],
    &[13, 12, 11, 8],
    &[14, 13, 12, 2],
    &[15, 14],
    &[16, 15, 13, 4],
    &[17, 14],
    &[18, 11],
    &[19, 18, 17, 14],
    &[20, 17],
];

/// `n` samples of levels -1 and 1, each clock time `clock` samples long; the seed chooses where the sequence begins.
pub(super) fn samples(clock: usize, order: u32, n: usize, seed: u64) -> Result<Vec<f64>, Error> {
    check("the order of the sequence", f64::from(order), "", ORDERS.contains(&order), || {
        format!("orders {} to {} are offered", ORDERS.start(), ORDERS.end())
    })?;
    let taps = TAPS[(order - ORDERS.start()) as usize];
    let mask = (1u64 << order) - 1;
    let mut register = Random::new(seed).bits() & mask;
    if register == 0 {
        register = mask; // all zeros would stay all zeros
    }
    let mut next = || {
        let out = (register >> (order - 1)) & 1;
        let feedback = taps.iter().fold(0, |sum, tap| sum ^ (register >> (tap - 1)) & 1);
        register = ((register << 1) | feedback) & mask;
        if out == 1 { 1.0 } else { -1.0 }
    };
    let mut samples = Vec::with_capacity(n);
    while samples.len() < n {
        let level = next();
        samples.extend(std::iter::repeat_n(level, clock.min(n - samples.len())));
    }
    Ok(samples)
}

/// Clock time \[s\] and order for a band \[Hz\]: the spectrum falls by 3 dB at 0.44 / clock and its lines are
/// 1 / (clock (2^n - 1)) apart.
pub fn for_band(band: &super::Band, sample_time: f64) -> (f64, u32) {
    let clock = sample_time * (0.44 / band.end / sample_time).floor().max(1.0);
    let periods = |order: u32| clock * ((1u64 << order) - 1) as f64;
    let order = ORDERS.into_iter().find(|&order| periods(order) * band.start >= 1.0);
    (clock, order.unwrap_or(*ORDERS.end()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_order_has_the_autocorrelation_of_a_sequence_of_maximal_length() {
        for order in ORDERS {
            let period = (1usize << order) - 1;
            let samples = samples(1, order, 2 * period, 11).unwrap();
            assert!((0..period).all(|k| samples[k] == samples[k + period]), "order {order}");
            // One more 1 than -1, and -1 at every shift: the definition.
            assert_eq!(samples[..period].iter().sum::<f64>().abs(), 1.0, "order {order}");
            for shift in [1, 2, 3, period / 2].into_iter().filter(|shift| *shift % period != 0) {
                let sum: f64 = (0..period).map(|k| samples[k] * samples[k + shift]).sum();
                assert_eq!(sum, -1.0, "order {order}, shift {shift}");
            }
        }
    }

    #[test]
    fn the_clock_follows_the_band() {
        let (clock, order) = for_band(&(0.1..12.0), 1e-3);
        assert!((clock - 0.036).abs() < 1e-12, "{clock}");
        assert_eq!(order, 9); // 511 * 36 ms = 18.4 s is the first period of at least 10 s
        assert!(samples(1, 40, 10, 1).is_err());
    }
}
