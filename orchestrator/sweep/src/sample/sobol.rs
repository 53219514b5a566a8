//! Sobol' points: the coordinates of a point from its number alone.

use std::sync::LazyLock;

/// Number of dimensions of the table.
pub const MAX_DIMENSIONS: usize = 64;
/// Bits of a coordinate, so that there are 2^32 points.
const BITS: usize = 32;

/// Direction numbers `[dimension][bit]`, each a fraction of 2^32.
static DIRECTIONS: LazyLock<Vec<[u32; BITS]>> = LazyLock::new(|| {
    let table = include_str!("joe_kuo.txt").lines().filter(|line| !line.starts_with('#'));
    let first = std::array::from_fn(|bit| 1 << (BITS - 1 - bit));
    let rest = table.map(|line| {
        let numbers: Vec<u32> =
            line.split(' ').map(|word| word.parse().expect("the table is ours")).collect();
        directions(numbers[1] as usize, numbers[2], &numbers[3..])
    });
    std::iter::once(first).chain(rest).collect()
});

/// Recurrence of a primitive polynomial of `degree` with inner coefficients `a` and initial numbers `m`.
fn directions(degree: usize, a: u32, m: &[u32]) -> [u32; BITS] {
    let mut v = [0_u32; BITS];
    for bit in 0..BITS {
        v[bit] = match bit < degree {
            true => m[bit] << (BITS - 1 - bit),
            false => {
                let inner = (1..degree).filter(|k| (a >> (degree - 1 - k)) & 1 == 1);
                inner.fold(v[bit - degree] ^ (v[bit - degree] >> degree), |sum, k| sum ^ v[bit - k])
            }
        };
    }
    v
}

/// Coordinate of a point, in \[0, 1), in the order of the Gray code as in Joe and Kuo's program.
pub fn coordinate(index: u64, dimension: usize) -> f64 {
    let gray = index ^ (index >> 1);
    let set = (0..BITS).filter(|bit| (gray >> bit) & 1 == 1);
    let sum = set.fold(0, |sum, bit| sum ^ DIRECTIONS[dimension][bit]);
    f64::from(sum) / (1_u64 << BITS) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_points_are_those_of_scipy() {
        // scipy.stats.qmc.Sobol(4, scramble=False).random(9), and dimension 64 by the same with d=64.
        let truth = [
            [0.0, 0.0, 0.0, 0.0],
            [0.5, 0.5, 0.5, 0.5],
            [0.75, 0.25, 0.25, 0.25],
            [0.25, 0.75, 0.75, 0.75],
            [0.375, 0.375, 0.625, 0.875],
            [0.875, 0.875, 0.125, 0.375],
            [0.625, 0.125, 0.875, 0.625],
            [0.125, 0.625, 0.375, 0.125],
            [0.1875, 0.3125, 0.9375, 0.4375],
        ];
        for (index, point) in truth.iter().enumerate() {
            for (dimension, &value) in point.iter().enumerate() {
                assert_eq!(
                    coordinate(index as u64, dimension),
                    value,
                    "point {index}, dimension {dimension}"
                );
            }
        }
    }

    #[test]
    fn every_dimension_has_one_point_in_each_of_1024_cells() {
        for dimension in 0..MAX_DIMENSIONS {
            let mut seen = vec![false; 1024];
            (0..1024).for_each(|index| seen[(coordinate(index, dimension) * 1024.0) as usize] = true);
            assert!(seen.iter().all(|seen| *seen), "dimension {dimension}");
        }
    }
}
