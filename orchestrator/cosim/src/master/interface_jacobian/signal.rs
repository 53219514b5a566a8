//! An output over one communication step as a piecewise cubic, and what an FMU is given in its place: the straight
//! line with the same mean and the same first moment.
//!
//! Time inside the step is r = (t' - t) / H in 0..1.

/// Two times closer than this (as a part of the step) are one.
pub(super) const SAME_TIME: f64 = 1e-9;
/// Nodes and weights of Gauss-Legendre quadrature on 0..1, exact for the product of a cubic and the first moment.
const GAUSS: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 4.0 / 9.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// A cubic between two times.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Piece {
    begin: f64,
    end: f64,
    /// Coefficients in z = (r - begin) / (end - begin).
    c: [f64; 4],
}

impl Piece {
    fn at(&self, r: f64) -> f64 {
        let z = (r - self.begin) / (self.end - self.begin);
        self.c[0] + z * (self.c[1] + z * (self.c[2] + z * self.c[3]))
    }
}

/// An output over the present communication step.
#[derive(Debug, Clone, Default)]
pub(in crate::master) struct Signal {
    pieces: Vec<Piece>,
}

impl Signal {
    /// A signal with room for this many pieces.
    pub fn with_room(pieces: usize) -> Signal {
        Signal { pieces: Vec::with_capacity(pieces) }
    }

    pub fn clear(&mut self) {
        self.pieces.clear();
    }

    /// Adds a constant piece.
    pub fn hold(&mut self, begin: f64, end: f64, value: f64) {
        self.pieces.push(Piece { begin, end, c: [value, 0.0, 0.0, 0.0] });
    }

    /// Adds a straight line.
    pub fn line(&mut self, begin: f64, end: f64, from: f64, to: f64) {
        self.pieces.push(Piece { begin, end, c: [from, to - from, 0.0, 0.0] });
    }

    /// Adds the cubic with these values and time derivatives at its ends; it lasts `h` \[s\].
    pub fn hermite(&mut self, (begin, end): (f64, f64), from: [f64; 2], to: [f64; 2], h: f64) {
        let ([y0, d0], [y1, d1]) = (from, to);
        let (d0, d1) = (d0 * h, d1 * h);
        let c = [y0, d0, 3.0 * (y1 - y0) - 2.0 * d0 - d1, 2.0 * (y0 - y1) + d0 + d1];
        self.pieces.push(Piece { begin, end, c });
    }

    /// Adds a rise to the last piece, from 0 at its beginning to `change` at its end.
    pub fn move_end(&mut self, change: f64) {
        if let Some(piece) = self.pieces.last_mut() {
            piece.c[1] += change;
        }
    }

    /// Value at `r`; where a piece ends and the next begins, that of the end.
    pub fn left(&self, r: f64) -> f64 {
        let piece = self.pieces.iter().find(|piece| r <= piece.end + SAME_TIME).or(self.pieces.last());
        piece.map_or(0.0, |piece| piece.at(r))
    }

    /// Value at `r`; where a piece ends and the next begins, that of the beginning.
    pub fn right(&self, r: f64) -> f64 {
        let piece = self.pieces.iter().find(|piece| r < piece.end - SAME_TIME).or(self.pieces.last());
        piece.map_or(0.0, |piece| piece.at(r))
    }

    /// Times at which one piece ends and the next begins.
    pub fn breaks(&self) -> impl Iterator<Item = f64> + '_ {
        self.pieces.iter().skip(1).map(|piece| piece.begin)
    }

    /// Mean, and mean of value times P1(z) = 2 z - 1, between two times.
    pub fn moments(&self, begin: f64, end: f64) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for piece in &self.pieces {
            let (a, b) = (piece.begin.max(begin), piece.end.min(end));
            if b <= a {
                continue;
            }
            for (node, weight) in GAUSS {
                let r = a + node * (b - a);
                let share = weight * (b - a) / (end - begin) * piece.at(r);
                sum[0] += share;
                sum[1] += share * first_moment((r - begin) / (end - begin));
            }
        }
        sum
    }
}

/// Shifted Legendre polynomial of degree 1.
pub(super) fn first_moment(z: f64) -> f64 {
    2.0 * z - 1.0
}

/// Start value and total rise of the line with these moments.
pub(super) fn line_of([mean, first]: [f64; 2]) -> [f64; 2] {
    [mean - 3.0 * first, 6.0 * first]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_of_a_line_is_the_line_itself() {
        let mut signal = Signal::default();
        signal.line(0.0, 1.0, 2.0, -3.0);
        let [from, rise] = line_of(signal.moments(0.0, 1.0));
        assert!((from - 2.0).abs() < 1e-14 && (rise + 5.0).abs() < 1e-13);
        // Between 0.2 and 0.6 it goes from 1 to -1.
        let [from, rise] = line_of(signal.moments(0.2, 0.6));
        assert!((from - 1.0).abs() < 1e-13 && (rise + 2.0).abs() < 1e-12);
    }

    #[test]
    fn moments_of_a_cubic_are_its_integrals() {
        // y = r^3: mean 1/4, first moment 2/5 - 1/4.
        let mut signal = Signal::default();
        signal.hermite((0.0, 1.0), [0.0, 0.0], [1.0, 1500.0], 2e-3);
        assert!((signal.left(0.5) - 0.125).abs() < 1e-15);
        let [mean, first] = signal.moments(0.0, 1.0);
        assert!((mean - 0.25).abs() < 1e-15 && (first - 0.15).abs() < 1e-15);
    }

    #[test]
    fn a_moved_end_leaves_the_beginning() {
        let mut signal = Signal::default();
        signal.hermite((0.0, 1.0), [1.0, 2.0], [3.0, -1.0], 0.1);
        signal.move_end(0.5);
        assert!((signal.right(0.0) - 1.0).abs() < 1e-15 && (signal.left(1.0) - 3.5).abs() < 1e-15);
    }

    #[test]
    fn a_jump_belongs_to_both_sides() {
        let mut signal = Signal::default();
        signal.hold(0.0, 0.5, 1.0);
        signal.hold(0.5, 1.0, 3.0);
        assert_eq!((signal.left(0.5), signal.right(0.5)), (1.0, 3.0));
        assert_eq!((signal.left(1.0), signal.right(1.0), signal.right(0.0)), (3.0, 3.0, 1.0));
        assert_eq!(signal.breaks().collect::<Vec<_>>(), [0.5]);
        let [mean, first] = signal.moments(0.0, 1.0);
        assert!((mean - 2.0).abs() < 1e-15 && (first - 0.5).abs() < 1e-15);
    }
}
