//! Noise that a seed determines.

use std::sync::LazyLock;

/// A deterministic source of normal numbers (xorshift64* and the ziggurat of Marsaglia and Tsang).
#[derive(Debug, Clone)]
pub struct Noise(u64);

/// Layers of the ziggurat.
const LAYERS: usize = 256;
/// Where its tail begins, and the area of a layer.
const TAIL: f64 = 3.654_152_885_361_009;
/// See [`TAIL`].
const AREA: f64 = 0.004_928_673_233_99;

/// Right ends of the layers and the density there.
static ZIGGURAT: LazyLock<([f64; LAYERS + 1], [f64; LAYERS + 1])> = LazyLock::new(|| {
    let density = |x: f64| (-0.5 * x * x).exp();
    let mut ends = [0.0; LAYERS + 1];
    (ends[0], ends[1]) = (AREA / density(TAIL), TAIL);
    for i in 2..LAYERS {
        ends[i] = (-2.0 * (AREA / ends[i - 1] + density(ends[i - 1])).ln()).sqrt();
    }
    (ends, ends.map(density))
});

impl Noise {
    /// The stream `stream` of a seed.
    pub fn new(seed: u64, stream: u64) -> Noise {
        // SplitMix64 separates neighboring seeds.
        let mut z = seed.wrapping_add(stream.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        Noise((z ^ (z >> 31)) | 1)
    }

    #[inline]
    fn bits(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    /// Uniform in (0, 1).
    pub fn uniform(&mut self) -> f64 {
        fraction(self.bits())
    }

    /// Standard normal.
    #[inline]
    pub fn normal(&mut self) -> f64 {
        let (ends, density) = &*ZIGGURAT;
        loop {
            let bits = self.bits();
            // The lowest bits of this generator are its weakest and serve neither for the layer nor for the place in
            // it.
            let layer = (bits >> 3) as usize % LAYERS;
            let x = (2.0 * fraction(bits) - 1.0) * ends[layer];
            if x.abs() < ends[layer + 1] {
                return x;
            }
            if layer == 0 {
                return self.tail().copysign(x);
            }
            let height = density[layer] + self.uniform() * (density[layer + 1] - density[layer]);
            if height < (-0.5 * x * x).exp() {
                return x;
            }
        }
    }

    /// Magnitude of a normal number known to lie in the tail.
    fn tail(&mut self) -> f64 {
        loop {
            let (x, y) = (-self.uniform().ln() / TAIL, -self.uniform().ln());
            if 2.0 * y > x * x {
                return TAIL + x;
            }
        }
    }
}

fn fraction(bits: u64) -> f64 {
    ((bits >> 11) as f64 + 0.5) / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_have_the_moments_of_the_normal_law() {
        let mut noise = Noise::new(1, 2);
        let n = 200_000;
        let values: Vec<f64> = (0..n).map(|_| noise.normal()).collect();
        let moment = |power: i32| values.iter().map(|v| v.powi(power)).sum::<f64>() / n as f64;
        // Standard errors are sqrt(1/n), sqrt(2/n) and sqrt(96/n); five of them.
        assert!(
            moment(1).abs() < 0.0112 && (moment(2) - 1.0).abs() < 0.0158 && (moment(4) - 3.0).abs() < 0.11
        );
    }

    #[test]
    fn as_many_numbers_lie_in_the_tail_as_the_normal_law_says() {
        let mut noise = Noise::new(4, 1);
        let n = 2_000_000;
        let count = |limit: f64, values: &[f64]| values.iter().filter(|v| v.abs() > limit).count() as f64;
        let values: Vec<f64> = (0..n).map(|_| noise.normal()).collect();
        // Two-sided probabilities of the normal law; five standard errors of a count.
        for (limit, probability) in [(0.5, 0.617_075), (2.0, 0.045_500_3), (3.7, 2.156_01e-4)] {
            let expected = probability * f64::from(n);
            assert!((count(limit, &values) - expected).abs() < 5.0 * expected.sqrt(), "{limit}");
        }
    }
}
