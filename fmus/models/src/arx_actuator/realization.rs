//! State forms of the recursion: sampled (observer form) and continuous (its zero-order-hold equivalent).

use crate::continuous_form::{self, NoContinuous};
use fmi_export::Scalar;

/// Most coefficients on past outputs.
pub const MAX_NA: usize = 4;
/// Most coefficients on commands.
pub const MAX_NB: usize = 5;
/// Most outputs.
pub const MAX_NY: usize = 2;
/// Most blocks of states; what of the delay does not fit goes through the delay line.
pub const MAX_BLOCKS: usize = 4;
/// Most continuous states.
pub const MAX_STATES: usize = MAX_BLOCKS * MAX_NY;

/// States and command.
pub type Matrix<S> = crate::matrix::Matrix<S, { MAX_STATES + 1 }>;

/// The orders of eq. 6.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Number of coefficients on past outputs, 1 to 4.
    pub na: usize,
    /// Number of coefficients on commands, 1 to 5.
    pub nb: usize,
    /// Delay of the command in samples.
    pub nk: usize,
    /// Number of outputs, 1 or 2.
    pub ny: usize,
}

impl Shape {
    /// Samples of delay in the delay line, before the states.
    pub fn line(self) -> usize {
        (self.nk + self.nb - 1).saturating_sub(MAX_BLOCKS)
    }

    /// Number of blocks of `ny` states.
    pub fn blocks(self) -> usize {
        self.na.max(self.nk - self.line() + self.nb - 1)
    }

    /// Number of states in use.
    pub fn states(self) -> usize {
        self.blocks() * self.ny
    }
}

/// The recursion (eq. 6): `y(k) = -A1 y(k-1) - A2 y(k-2) ... + C0 w(k) + C1 w(k-1) ...`, where `w` is the
/// command behind the delay line.
///
/// In observer form, block by block: `y = z1 + C0 w`, `zi+ = z(i+1) - Ai y + Ci w`. For one block this is
/// `z+ = Ad z + Bd u` with `Ad = -A1`, `Bd = B1 - A1 B0`.
#[allow(non_snake_case)]
#[derive(Clone, Copy, Debug)]
pub struct Recursion<S> {
    pub shape: Shape,
    /// `A[i][j][l]`: coefficient of output `l` at `k - 1 - i` in output `j`; zero from `na` on.
    pub A: [[[S; MAX_NY]; MAX_NY]; MAX_NA],
    /// `C[i][j]`: coefficient of `w(k - i)` in output `j`: `B` behind what is left of the delay.
    pub C: [[S; MAX_NY]; MAX_NB],
}

impl<S: Scalar> Recursion<S> {
    /// All coefficients zero.
    pub fn zero(shape: Shape) -> Self {
        Self { shape, A: [[[S::zero(); MAX_NY]; MAX_NY]; MAX_NA], C: [[S::zero(); MAX_NY]; MAX_NB] }
    }

    /// Outputs at a sample: `y = z1 + C0 w`.
    pub fn output(&self, z: &[S; MAX_STATES], w: S) -> [S; MAX_NY] {
        let mut y = [S::zero(); MAX_NY];
        for j in 0..self.shape.ny {
            y[j] = z[j] + self.C[0][j] * w;
        }
        y
    }

    /// States at the next sample.
    pub fn advance(&self, z: &[S; MAX_STATES], w: S) -> [S; MAX_STATES] {
        let (ny, blocks) = (self.shape.ny, self.shape.blocks());
        let y = self.output(z, w);
        let mut next = [S::zero(); MAX_STATES];
        for i in 0..blocks {
            for j in 0..ny {
                let mut sum = self.C[i + 1][j] * w;
                if i + 1 < blocks {
                    sum += z[(i + 1) * ny + j];
                }
                for (l, y) in y.iter().enumerate().take(ny) {
                    sum -= self.A[i][j][l] * *y;
                }
                next[i * ny + j] = sum;
            }
        }
        next
    }

    /// `[[Ad, Bd], [0, 1]]`: one sample with the command held.
    pub fn transition(&self) -> Matrix<S> {
        let (ny, n) = (self.shape.ny, self.shape.states());
        let mut m = Matrix::zero(n + 1);
        for i in 0..self.shape.blocks() {
            for j in 0..ny {
                let row = i * ny + j;
                let mut b = self.C[i + 1][j];
                for l in 0..ny {
                    m.set(row, l, -self.A[i][j][l]);
                    b -= self.A[i][j][l] * self.C[0][l];
                }
                if row + ny < n {
                    m.set(row, row + ny, m.at(row, row + ny) + S::from(1.0));
                }
                m.set(row, n, b);
            }
        }
        m.set(n, n, S::from(1.0));
        m
    }

    /// `[[Ac, Bc], [0, 0]]` with `exp` of it times `sample_time` \[s\] equal to [`Recursion::transition`].
    ///
    /// One logarithm of the augmented matrix; the usual `Bc = Ac (Ad - I)⁻¹ Bd` has no value for a pole at 1.
    ///
    /// # Errors
    /// The pole for which there is no logarithm.
    pub fn continuous(&self, sample_time: S) -> Result<Matrix<S>, NoContinuousForm> {
        let delay = self.shape.nk + self.shape.nb - 1;
        if delay > self.shape.na {
            return Err(NoContinuousForm::Delay { delay, na: self.shape.na });
        }
        let transition = self.transition();
        Ok(continuous_form::of(&transition, self.shape.states(), sample_time)?)
    }
}

/// Reason why a recursion has no continuous equivalent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NoContinuousForm {
    /// The command reaches further back than the outputs: poles at zero.
    Delay { delay: usize, na: usize },
    /// The matrix of one sample has no logarithm.
    Transition(NoContinuous),
}

impl From<NoContinuous> for NoContinuousForm {
    fn from(why: NoContinuous) -> Self {
        Self::Transition(why)
    }
}

impl std::fmt::Display for NoContinuousForm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Delay { delay, na } => write!(
                f,
                "the recursion has a pole at 0, because the oldest command in it (nk + nb - 1 = {delay} samples \
                 back) is older than the oldest output (na = {na} samples back)"
            ),
            Self::Transition(why) => write!(f, "{why}"),
        }
    }
}
