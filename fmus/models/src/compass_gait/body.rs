//! Rigid-body terms of the walker with a floating base: `H(q)`, `C(q, q') q'`, `G(q)`, energy, feet.
//!
//! `q = [x, y, th1, th2, l1, l2]`: hip, leg angles (positive: the foot is ahead of the hip), leg lengths from hip to
//! tip. The trunk bisects the legs: `th3 = (th1 + th2) / 2`.

use fmi_export::Scalar;

/// Number of coordinates.
pub const N: usize = 6;
/// One number per coordinate.
pub type Vector<S> = [S; N];
/// Index of the angle and of the length of leg 1; those of leg 2 follow each.
const TH: usize = 2;
const L: usize = 4;

/// Masses and lengths.
///
/// | name | unit | meaning |
/// |---|---|---|
/// | `m3`, `d`, `i3` | kg, m, kg m² | trunk: mass, center above the hip, inertia about its center |
/// | `mu`, `a`, `iu` | kg, m, kg m² | upper leg: mass, center below the hip, inertia |
/// | `mt`, `c`, `it` | kg, m, kg m² | toe: mass, center above the tip, inertia |
/// | `ir` | kg m² | reflected inertia of the hip motor's rotor, on `th2' - th1'` |
/// | `g` | m/s² | gravity |
#[allow(missing_docs)]
#[derive(Clone, Copy, Debug)]
pub struct Body<S> {
    pub m3: S,
    pub d: S,
    pub i3: S,
    pub mu: S,
    pub a: S,
    pub iu: S,
    pub mt: S,
    pub c: S,
    pub it: S,
    pub ir: S,
    pub g: S,
}

/// A body in one position, with its rates.
#[derive(Clone, Copy, Debug)]
pub struct Pose<S> {
    /// Coordinates \[m, rad\].
    pub q: Vector<S>,
    /// Rates \[m/s, rad/s\].
    pub v: Vector<S>,
    sin: [S; 2],
    cos: [S; 2],
    sin3: S,
    cos3: S,
}

impl<S: Scalar> Pose<S> {
    /// Sines and cosines are computed here, once.
    pub fn new(q: Vector<S>, v: Vector<S>) -> Self {
        let th3 = (q[TH] + q[TH + 1]) * 0.5;
        Self {
            q,
            v,
            sin: [q[TH].sin(), q[TH + 1].sin()],
            cos: [q[TH].cos(), q[TH + 1].cos()],
            sin3: th3.sin(),
            cos3: th3.cos(),
        }
    }

    /// Tip of foot `i` \[m\].
    pub fn foot(&self, i: usize) -> [S; 2] {
        let (q, l) = (&self.q, self.q[L + i]);
        [q[0] + l * self.sin[i], q[1] - l * self.cos[i]]
    }

    /// `J_i w`: velocity of foot `i` \[m/s\] where the coordinates move with `w`.
    pub fn foot_rate(&self, i: usize, w: &Vector<S>) -> [S; 2] {
        let (l, s, c) = (self.q[L + i], self.sin[i], self.cos[i]);
        let (turn, stretch) = (l * w[TH + i], w[L + i]);
        [w[0] + turn * c + stretch * s, w[1] + turn * s - stretch * c]
    }

    /// `J_i' v`: acceleration of foot `i` \[m/s²\] where the coordinates have none.
    pub fn foot_drift(&self, i: usize) -> [S; 2] {
        let (l, s, c) = (self.q[L + i], self.sin[i], self.cos[i]);
        let (turn, stretch) = (self.v[TH + i], self.v[L + i]);
        let (coriolis, centripetal) = (turn * stretch * 2.0, l * turn * turn);
        [coriolis * c - centripetal * s, coriolis * s + centripetal * c]
    }

    /// Rows of `J_i`: derivatives of the foot's x and y by the coordinates.
    pub fn foot_jacobian(&self, i: usize) -> [Vector<S>; 2] {
        let (l, s, c) = (self.q[L + i], self.sin[i], self.cos[i]);
        let mut rows = [[S::zero(); N]; 2];
        rows[0][0] = S::from(1.0);
        rows[1][1] = S::from(1.0);
        rows[0][TH + i] = l * c;
        rows[0][L + i] = s;
        rows[1][TH + i] = l * s;
        rows[1][L + i] = -c;
        rows
    }
}

impl<S: Scalar> Body<S> {
    /// Total mass \[kg\].
    pub fn mass(&self) -> S {
        self.m3 + (self.mu + self.mt) * 2.0
    }

    /// First moment of leg `i` about the hip \[kg m\].
    fn moment(&self, p: &Pose<S>, i: usize) -> S {
        self.mu * self.a + self.mt * (p.q[L + i] - self.c)
    }

    /// Half the trunk's first moment about the hip \[kg m\]: each leg turns the trunk by half its own angle.
    fn half_trunk(&self) -> S {
        self.m3 * self.d * 0.5
    }

    /// Mass matrix `H(q)` (eq. 1), all entries.
    pub fn mass_matrix(&self, p: &Pose<S>) -> [Vector<S>; N] {
        let mut h = [[S::zero(); N]; N];
        let k3 = (self.m3 * self.d * self.d + self.i3) * 0.25;
        h[0][0] = self.mass();
        h[1][1] = h[0][0];
        for i in 0..2 {
            let (s, c) = (p.sin[i], p.cos[i]);
            let (si, toe) = (self.moment(p, i), p.q[L + i] - self.c);
            let mut set = |row: usize, column: usize, value: S| {
                h[row][column] = value;
                h[column][row] = value;
            };
            set(TH + i, 0, si * c - self.half_trunk() * p.cos3);
            set(TH + i, 1, si * s - self.half_trunk() * p.sin3);
            set(L + i, 0, self.mt * s);
            set(L + i, 1, -self.mt * c);
            let leg = self.mu * self.a * self.a + self.mt * toe * toe + self.iu + self.it;
            set(TH + i, TH + i, leg + k3 + self.ir);
            set(L + i, L + i, self.mt);
        }
        h[TH][TH + 1] = k3 - self.ir;
        h[TH + 1][TH] = h[TH][TH + 1];
        h
    }

    /// `C(q, q') q'` (eq. 1).
    pub fn coriolis(&self, p: &Pose<S>) -> Vector<S> {
        let th3_rate = (p.v[TH] + p.v[TH + 1]) * 0.5;
        let trunk = self.m3 * self.d * th3_rate * th3_rate;
        let mut out = [S::zero(); N];
        out[0] = trunk * p.sin3;
        out[1] = -trunk * p.cos3;
        for i in 0..2 {
            let (s, c) = (p.sin[i], p.cos[i]);
            let (turn, stretch) = (p.v[TH + i], p.v[L + i]);
            let (toe, si) = (p.q[L + i] - self.c, self.moment(p, i));
            let (centripetal, cross) = (si * turn * turn, self.mt * turn * stretch * 2.0);
            out[0] += cross * c - centripetal * s;
            out[1] += cross * s + centripetal * c;
            out[TH + i] = cross * toe;
            out[L + i] = -self.mt * toe * turn * turn;
        }
        out
    }

    /// `G(q)` (eq. 1).
    pub fn gravity(&self, p: &Pose<S>) -> Vector<S> {
        let mut out = [S::zero(); N];
        out[1] = self.mass() * self.g;
        for i in 0..2 {
            out[TH + i] = (self.moment(p, i) * p.sin[i] - self.half_trunk() * p.sin3) * self.g;
            out[L + i] = -self.mt * self.g * p.cos[i];
        }
        out
    }

    /// Kinetic energy, and potential energy with all masses at height 0 as its zero \[J\].
    pub fn energy(&self, p: &Pose<S>, h: &[Vector<S>; N]) -> S {
        let mut twice_kinetic = S::zero();
        for (i, row) in h.iter().enumerate() {
            let mut momentum = row[i] * p.v[i];
            for (entry, v) in row.iter().zip(&p.v).take(i) {
                momentum += *entry * *v * 2.0;
            }
            twice_kinetic += momentum * p.v[i];
        }
        let mut moment = self.mass() * p.q[1] + self.half_trunk() * p.cos3 * 2.0;
        for i in 0..2 {
            moment -= self.moment(p, i) * p.cos[i];
        }
        twice_kinetic * 0.5 + moment * self.g
    }
}
