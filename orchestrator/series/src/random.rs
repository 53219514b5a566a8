//! Random numbers that are the same in every version and on every machine.
//!
//! xoshiro256++ by Blackman and Vigna (2019), seeded by SplitMix64 (Steele, Lea, Flood 2014). The algorithms stand
//! here, because crates may change their generators or the way seeds and ranges are used between versions, and a seed
//! in a record has to give the same record for ever. The integers are exact everywhere; normal numbers use logarithm
//! and cosine, whose last bit may differ between systems.

/// A stream of random numbers.
#[derive(Debug, Clone)]
pub struct Random {
    state: [u64; 4],
    /// The second of a pair of normal numbers.
    spare: Option<f64>,
}

impl Random {
    /// The stream of a seed.
    pub fn new(seed: u64) -> Random {
        let mut mixed = seed;
        Random { state: std::array::from_fn(|_| split_mix(&mut mixed)), spare: None }
    }

    /// Another stream of the same seed, for instance one per signal, so that adding a signal leaves the others.
    pub fn stream(seed: u64, name: &str) -> Random {
        // FNV-1a over the name.
        let hash = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        Random::new(name.bytes().fold(seed ^ 0xcbf2_9ce4_8422_2325, hash))
    }

    /// The stream of a number, for instance one per start of a search.
    pub fn numbered(seed: u64, number: u64) -> Random {
        let mut mixed = seed ^ number.wrapping_mul(0xd1b5_4a32_d192_ed03);
        Random::new(split_mix(&mut mixed))
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        let s = &mut self.state;
        let result = s[0].wrapping_add(s[3]).rotate_left(23).wrapping_add(s[0]);
        let shifted = s[1] << 17;
        s[2] ^= s[0];
        s[3] ^= s[1];
        s[1] ^= s[2];
        s[0] ^= s[3];
        s[2] ^= shifted;
        s[3] = s[3].rotate_left(45);
        result
    }

    /// Uniform in 0 <= value < 1, a multiple of 2^-53.
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in -1 <= value < 1, a multiple of 2^-52.
    pub fn symmetric(&mut self) -> f64 {
        2.0 * self.uniform() - 1.0
    }

    /// Normal with mean 0 and standard deviation 1 (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        let angle = std::f64::consts::TAU * self.uniform();
        self.spare = Some(radius * angle.sin());
        radius * angle.cos()
    }
}

fn split_mix(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers that the authors' C programs print.
    #[test]
    fn integers_are_those_of_the_published_generators() {
        let mut state = 0;
        let first: [u64; 3] = std::array::from_fn(|_| split_mix(&mut state));
        assert_eq!(first, [0xe220_a839_7b1d_cdaf, 0x6e78_9e6a_a1b9_65f4, 0x06c4_5d18_8009_454f]);
        let mut random = Random { state: [1, 2, 3, 4], spare: None };
        let first: [u64; 4] = std::array::from_fn(|_| random.bits());
        assert_eq!(first, [41_943_041, 58_720_359, 3_588_806_011_781_223, 3_591_011_842_654_386]);
    }

    #[test]
    fn normal_numbers_have_their_moments() {
        let mut random = Random::new(7);
        let n = 200_000;
        let values: Vec<f64> = (0..n).map(|_| random.normal()).collect();
        let moment = |power| values.iter().map(|v: &f64| v.powi(power)).sum::<f64>() / f64::from(n);
        // Four standard deviations of the sample moments: sqrt(1/n), sqrt(2/n), sqrt(15/n), sqrt(96/n).
        for (power, expected, spread) in [(1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)] {
            let allowed = 4.0 * f64::sqrt(spread / f64::from(n));
            assert!((moment(power) - expected).abs() < allowed, "moment {power}: {}", moment(power));
        }
    }

    #[test]
    fn streams_of_one_seed_differ() {
        let first = |name| Random::stream(1, name).bits();
        assert_ne!(first("F_p"), first("F_hat"));
        assert_eq!(first("F_p"), first("F_p"));
        let numbered = |seed, number| Random::numbered(seed, number).bits();
        assert_ne!(numbered(0, 1), numbered(0, 2));
        assert_ne!(numbered(0, 1), numbered(1, 1));
        assert_eq!(numbered(3, 4), numbered(3, 4));
    }

    #[test]
    fn symmetric_numbers_fill_their_range_evenly() {
        let mut random = Random::numbered(3, 4);
        let values: Vec<f64> = (0..1000).map(|_| random.symmetric()).collect();
        // Five standard deviations of the mean of 1000 numbers: 5 / sqrt(3 * 1000).
        let mean = values.iter().sum::<f64>() / 1000.0;
        assert!(values.iter().all(|v| (-1.0..1.0).contains(v)) && mean.abs() < 0.092, "{mean}");
        assert!(values.iter().any(|v| *v < -0.9) && values.iter().any(|v| *v > 0.9));
    }
}
