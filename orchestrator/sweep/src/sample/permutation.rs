//! A random order of `0..count` of which any place can be asked without the others.

use airloop_series::random::Random;

/// Rounds of the Feistel network; four make a pseudo-random permutation (Luby and Rackoff 1988).
const ROUNDS: usize = 4;

/// A permutation of `0..count` that belongs to a seed.
#[derive(Debug, Clone)]
pub struct Permutation {
    count: u64,
    /// Bits of each half.
    half: u32,
    keys: [u64; ROUNDS],
}

impl Permutation {
    /// The permutation of a seed.
    pub fn new(count: u64, seed: u64) -> Permutation {
        let mut random = Random::new(seed);
        let bits = u64::BITS - count.saturating_sub(1).leading_zeros();
        Permutation { count, half: bits.div_ceil(2).max(1), keys: std::array::from_fn(|_| random.bits()) }
    }

    /// Number at a place below `count`.
    pub fn at(&self, place: u64) -> u64 {
        // Numbers outside of the range are permuted on until they fall into it.
        let mut number = self.scramble(place);
        while number >= self.count {
            number = self.scramble(number);
        }
        number
    }

    fn scramble(&self, number: u64) -> u64 {
        let mask = (1 << self.half) - 1;
        let (left, right) =
            self.keys.iter().fold((number >> self.half, number & mask), |(left, right), key| {
                (right, left ^ (Random::numbered(*key, right).bits() & mask))
            });
        (left << self.half) | right
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_comes_once() {
        for count in [1, 2, 3, 10, 64, 1000] {
            let order = Permutation::new(count, 7);
            let mut all: Vec<u64> = (0..count).map(|place| order.at(place)).collect();
            all.sort_unstable();
            assert_eq!(all, (0..count).collect::<Vec<_>>());
        }
    }
}
