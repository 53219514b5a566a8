//! A smooth form over one or two variables: heights at knots, cubic between them, straight beyond the ends.

use crate::study::law::{Point, Variable};

/// Knots along one variable at most.
pub const MAX_KNOTS: usize = 40;

/// Knots along each variable; heights stand in the order of the knots, the last variable first.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    /// Variables, one or two.
    pub variables: Vec<Variable>,
    /// Rising knots along each, at least three.
    pub knots: Vec<Vec<f64>>,
    /// Weights along each: below the first knot, from knot to knot, above the last.
    pieces: Vec<Vec<Piece>>,
}

/// Weights of the heights between two knots: those of four neighbors are not zero.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Piece {
    /// Knot from which the place is counted, and the reciprocal of the length in which it is.
    origin: f64,
    rate: f64,
    /// First of the four heights.
    first: usize,
    /// Coefficients of the four weights for the powers 0 to 3 of the place.
    coefficients: [[f64; 4]; 4],
}

impl Piece {
    /// Piece `k` of the knots: 0 below the first knot, their number above the last.
    fn new(knots: &[f64], k: usize) -> Piece {
        let last = knots.len() - 1;
        let left = k.clamp(1, last) - 1;
        let first = left.saturating_sub(1).min(knots.len().saturating_sub(4));
        // Heights at two knots and slopes there as weights of these four.
        let one = |k: usize| std::array::from_fn(|i| f64::from(u8::from(i + first == k)));
        let slope = |k: usize| {
            let middle = k.clamp(1, last - 1);
            let (h0, h1) = (knots[middle] - knots[middle - 1], knots[middle + 1] - knots[middle]);
            let part = match k.cmp(&middle) {
                std::cmp::Ordering::Less => -h0,
                std::cmp::Ordering::Greater => h0 + 2.0 * h1,
                std::cmp::Ordering::Equal => h0,
            } / (h0 + h1);
            // (1 - part) of the left chord, part of the right one.
            let mut own = [0.0; 4];
            own[middle - 1 - first] -= (1.0 - part) / h0;
            own[middle - first] += (1.0 - part) / h0 - part / h1;
            own[middle + 1 - first] += part / h1;
            own
        };
        let of = |terms: [(f64, [f64; 4]); 4]| -> [f64; 4] {
            std::array::from_fn(|i| terms.iter().map(|(factor, own)| factor * own[i]).sum())
        };
        let zero = [0.0; 4];
        if k == 0 || k > last {
            let end = if k == 0 { 0 } else { last };
            let coefficients = [one(end), slope(end), zero, zero];
            return Piece { origin: knots[end], rate: 1.0, first, coefficients };
        }
        // Hermite's cubic.
        let width = knots[k] - knots[k - 1];
        let (y0, y1, m0, m1) = (one(left), one(left + 1), slope(left), slope(left + 1));
        let coefficients = [
            y0,
            m0.map(|own| width * own),
            of([(-3.0, y0), (3.0, y1), (-2.0 * width, m0), (-width, m1)]),
            of([(2.0, y0), (-2.0, y1), (width, m0), (width, m1)]),
        ];
        Piece { origin: knots[left], rate: 1.0 / width, first, coefficients }
    }

    fn weights(&self, at: f64) -> [f64; 4] {
        let place = (at - self.origin) * self.rate;
        let [c0, c1, c2, c3] = &self.coefficients;
        std::array::from_fn(|i| c0[i] + place * (c1[i] + place * (c2[i] + place * c3[i])))
    }
}

impl Surface {
    /// Over one or two `variables`, with rising knots along each, at least three.
    pub fn new(variables: Vec<Variable>, knots: Vec<Vec<f64>>) -> Surface {
        let along = |knots: &Vec<f64>| (0..=knots.len()).map(|k| Piece::new(knots, k)).collect();
        let pieces = knots.iter().map(along).collect();
        Surface { variables, knots, pieces }
    }

    /// First height that counts along a variable, and the weights of four.
    fn weights(&self, variable: usize, point: &Point) -> (usize, [f64; 4]) {
        let at = point.of(self.variables[variable]);
        let piece = &self.pieces[variable][self.knots[variable].partition_point(|knot| at >= *knot)];
        (piece.first, piece.weights(at))
    }

    /// Number of heights.
    pub fn heights(&self) -> usize {
        self.knots.iter().map(Vec::len).product()
    }

    /// Value at a point for heights of shape [`Surface::heights`].
    pub fn value(&self, heights: &[f64], point: &Point) -> f64 {
        let (first, own) = self.weights(0, point);
        let used = |count: usize| count.min(4);
        match self.knots.get(1) {
            None => (0..used(self.knots[0].len())).map(|i| own[i] * heights[first + i]).sum(),
            Some(other) => {
                let (second, across) = self.weights(1, point);
                let row = |i: usize| {
                    let begin = (first + i) * other.len() + second;
                    (0..used(other.len())).map(|j| across[j] * heights[begin + j]).sum::<f64>()
                };
                (0..used(self.knots[0].len())).map(|i| own[i] * row(i)).sum()
            }
        }
    }

    /// Gives the number and the weight of every height that counts at a point.
    pub fn each_weight(&self, point: &Point, mut give: impl FnMut(usize, f64)) {
        let (first, own) = self.weights(0, point);
        let rows = own.iter().take(self.knots[0].len()).enumerate();
        match self.knots.get(1) {
            None => rows.for_each(|(i, weight)| give(first + i, *weight)),
            Some(other) => {
                let (second, across) = self.weights(1, point);
                for (i, weight) in rows {
                    let begin = (first + i) * other.len() + second;
                    let row = across.iter().take(other.len()).enumerate();
                    row.for_each(|(j, own)| give(begin + j, weight * own));
                }
            }
        }
    }

    /// Values of a function at the knots, in the order of the heights.
    pub fn heights_of(&self, f: impl Fn(&[f64]) -> f64) -> Vec<f64> {
        match self.knots.get(1) {
            None => self.knots[0].iter().map(|x| f(&[*x])).collect(),
            Some(other) => self.knots[0]
                .iter()
                .flat_map(|x| other.iter().map(|y| f(&[*x, *y])).collect::<Vec<_>>())
                .collect(),
        }
    }

    /// Rows of the roughness of the heights: second divided differences along each variable, per knot, without unit.
    pub fn roughness(&self) -> Vec<Vec<(usize, f64)>> {
        let stride = |i: usize| if i == 0 { self.knots.get(1).map_or(1, Vec::len) } else { 1 };
        let mut rows = Vec::new();
        for (i, knots) in self.knots.iter().enumerate() {
            let span = (knots[knots.len() - 1] - knots[0]) / (knots.len() - 1) as f64;
            let others = self.heights() / knots.len();
            for other in 0..others {
                let base = if i == 0 { other } else { other * knots.len() };
                for k in 1..knots.len() - 1 {
                    let (h0, h1) = ((knots[k] - knots[k - 1]) / span, (knots[k + 1] - knots[k]) / span);
                    let place = |k: usize| base + k * stride(i);
                    let weight = (0.5 * (h0 + h1)).sqrt() * 2.0 / (h0 + h1);
                    rows.push(vec![
                        (place(k - 1), weight / h0),
                        (place(k), -weight / h0 - weight / h1),
                        (place(k + 1), weight / h1),
                    ]);
                }
            }
        }
        rows
    }
}

/// Knots over the range of values: half of them evenly, half where the data are; for a velocity through zero they are
/// narrow about zero, where friction changes.
pub fn knots(variable: Variable, values: &[f64], count: usize) -> Option<Vec<f64>> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let (low, high) = (*sorted.first()?, *sorted.last()?);
    if high - low <= 1e-12 * high.abs().max(low.abs()) {
        return None;
    }
    let quantile =
        |part: f64| sorted[((part * (sorted.len() - 1) as f64).round() as usize).min(sorted.len() - 1)];
    let part = |k: usize| k as f64 / (count - 1) as f64;
    if variable == Variable::Velocity && low < 0.0 && high > 0.0 {
        // sinh spreads them: the innermost at two hundredths of the largest.
        let half = count / 2;
        let place = |k: usize| ((k as f64 + 0.5) / (half as f64 - 0.5) * 3.5).sinh() / 3.5f64.sinh();
        let mut found: Vec<f64> = (0..half).rev().map(|k| low * place(k)).collect();
        found.extend((0..half).map(|k| high * place(k)));
        return Some(found);
    }
    let mut found: Vec<f64> =
        (0..count).map(|k| 0.5 * (low + part(k) * (high - low)) + 0.5 * quantile(part(k))).collect();
    if variable == Variable::Time {
        found = (0..count).map(|k| low + part(k) * (high - low)).collect();
    }
    let least = 0.2 * (high - low) / count as f64;
    found.dedup_by(|b, a| *b - *a < least);
    if found.len() < 3 {
        return None;
    }
    let end = found.len() - 1;
    (found[0], found[end]) = (low, high);
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parabolas_are_met_exactly_between_knots_and_continue_straight() {
        let knots = vec![-1.0, -0.4, 0.1, 0.5, 1.2, 2.0];
        let surface = Surface::new(vec![Variable::Position], vec![knots]);
        let f = |x: f64| 1.0 + 2.0 * x - 3.0 * x * x;
        let heights = surface.heights_of(|x| f(x[0]));
        let value = |x: f64| surface.value(&heights, &Point { position: x, ..Point::default() });
        for k in -10..=20 {
            let x = 0.1 * f64::from(k);
            assert!((value(x) - f(x)).abs() < 1e-12, "{x}");
        }
        assert!((value(-1.5) + 8.0).abs() < 1e-12 && (value(3.0) + 17.0).abs() < 1e-12);
    }

    #[test]
    fn products_over_two_variables_are_met_at_their_knots_and_between() {
        let knots = vec![vec![-1.0, 0.0, 0.5, 1.0], vec![-2.0, -1.0, 1.0, 2.0, 4.0]];
        let surface = Surface::new(vec![Variable::Position, Variable::Velocity], knots);
        let heights = surface.heights_of(|at| at[0] * at[0] * (1.0 + at[1]));
        for (x, v) in [(-1.0, 4.0), (0.3, -0.7), (0.9, 3.1)] {
            let found = surface.value(&heights, &Point { position: x, velocity: v, ..Point::default() });
            assert!((found - x * x * (1.0 + v)).abs() < 1e-12, "{x} {v} {found}");
        }
    }

    #[test]
    fn three_knots_are_a_parabola_and_lines_have_no_roughness() {
        let surface = Surface::new(vec![Variable::Position], vec![vec![0.0, 1.0, 3.0]]);
        let heights = surface.heights_of(|x| x[0] * x[0]);
        let value = |x: f64| surface.value(&heights, &Point { position: x, ..Point::default() });
        assert!((value(2.0) - 4.0).abs() < 1e-12);
        let line = surface.heights_of(|x| 3.0 - 2.0 * x[0]);
        for row in surface.roughness() {
            assert!(row.iter().map(|(k, w)| w * line[*k]).sum::<f64>().abs() < 1e-12);
        }
    }

    #[test]
    fn knots_of_a_velocity_are_narrow_about_zero() {
        let values: Vec<f64> = (0..=100).map(|k| 0.02 * f64::from(k) - 1.0).collect();
        let found = knots(Variable::Velocity, &values, 14).expect("a range");
        assert_eq!((found[0], found[13], found.len()), (-1.0, 1.0, 14));
        assert!(found[7] < 0.05 && found[6] == -found[7]);
        assert_eq!(knots(Variable::Position, &[2.0; 9], 10), None);
    }
}
