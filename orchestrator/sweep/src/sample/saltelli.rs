//! The arrangement of Sobol' points from which first-order and total indices are estimated.
//!
//! Source: A. Saltelli et al., "Variance based sensitivity analysis of model output", Computer Physics Communications
//! 181 (2010). A point of `2 d` coordinates is two points of `d`: a row of the matrix A and one of the matrix B. Its
//! tasks are A, B, and for each factor A with the coordinate of B.

use super::sobol;

/// Tasks that belong to one point.
pub fn tasks_per_point(factors: usize) -> u64 {
    factors as u64 + 2
}

/// Coordinate of a task, in \[0, 1), for one of `factors` dimensions and `points` points.
pub fn coordinate(task: u64, dimension: usize, factors: usize, points: u64) -> f64 {
    let (point, own) = (task / tasks_per_point(factors), task % tasks_per_point(factors));
    let of_b = own == 1 || own == dimension as u64 + 2;
    // The first points are the same in A and in B; those from a power of two on are as even as these.
    let index = points.next_power_of_two() + point;
    sobol::coordinate(index, if of_b { factors + dimension } else { dimension })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_task_takes_one_coordinate_of_b_at_most_or_all() {
        let (factors, points) = (3, 8);
        for point in 0..points {
            let at = |own: u64| -> Vec<f64> {
                (0..factors).map(|k| coordinate(5 * point + own, k, factors, points)).collect()
            };
            let (a, b) = (at(0), at(1));
            assert!(a.iter().zip(&b).all(|(a, b)| a != b), "{a:?} {b:?}");
            for factor in 0..factors {
                let mut expected = a.clone();
                expected[factor] = b[factor];
                assert_eq!(at(2 + factor as u64), expected);
            }
        }
    }
}
