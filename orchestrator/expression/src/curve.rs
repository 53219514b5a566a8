//! A smooth curve through points: cubic pieces whose slopes at the points are those of parabolas through three of them.
//!
//! It is linear in its heights and local: a value takes four of them.

use super::Node;
use super::evaluate::{Number, Point};

/// Points of a curve.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Curve {
    /// Places, rising.
    pub places: Vec<f64>,
    /// Height at each place.
    pub heights: Vec<Node>,
}

impl Curve {
    /// Height at `at`; beyond the ends straight on.
    pub fn height<N: Number>(&self, at: N, point: &Point<'_, N>) -> N {
        let last = self.places.len() - 1;
        let piece = self.places[1..last].iter().take_while(|place| at >= N::from(**place)).count();
        let (left, right) = (self.places[piece], self.places[piece + 1]);
        let height = |k: usize| self.heights[k].evaluate(point);
        let (y0, y1) = (height(piece), height(piece + 1));
        if at < N::from(left) {
            return y0 + self.slope(0, point) * (at - N::from(left));
        }
        if at > N::from(right) {
            return y1 + self.slope(last, point) * (at - N::from(right));
        }
        let (m0, m1) = (self.slope(piece, point), self.slope(piece + 1, point));
        let width = N::from(right - left);
        let s = (at - N::from(left)) / width;
        let (one, two, three) = (N::from(1.0), N::from(2.0), N::from(3.0));
        let rest = one - s;
        // Hermite's cubic.
        y0 * (one + two * s) * rest * rest + m0 * width * s * rest * rest + y1 * s * s * (three - two * s)
            - m1 * width * s * s * rest
    }

    /// Slope at a point: of the parabola through it and its neighbors.
    fn slope<N: Number>(&self, k: usize, point: &Point<'_, N>) -> N {
        let last = self.places.len() - 1;
        let chord = |k: usize| {
            let rise = self.heights[k + 1].evaluate(point) - self.heights[k].evaluate(point);
            rise / N::from(self.places[k + 1] - self.places[k])
        };
        if last == 1 {
            return chord(0);
        }
        let middle = k.clamp(1, last - 1);
        let (h0, h1) =
            (self.places[middle] - self.places[middle - 1], self.places[middle + 1] - self.places[middle]);
        let (d0, d1) = (chord(middle - 1), chord(middle));
        let bend = (d1 - d0) / N::from(h0 + h1);
        let part = if k < middle {
            N::from(-h0)
        } else if k > middle {
            N::from(h0 + 2.0 * h1)
        } else {
            N::from(h0)
        };
        d0 + bend * part
    }
}
