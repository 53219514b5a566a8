//! The continuous form of a sampled linear system: the same states at the samples, for inputs held between them.

use crate::matrix::{Complex, Matrix, NoLogarithm};
use fmi_export::{Enumeration, Scalar, Table};

/// The choice between the sampled and the continuous form.
pub fn declare_realization(t: &mut Table) -> Enumeration {
    t.enumeration(
        "Realization",
        &[
            ("sampled", "samples at multiples of sample_time, held between"),
            ("continuous", "differential equation with the same values at the samples"),
        ],
    )
}

/// `[[Ac, Bc], [0, 0]]` with `exp` of it times `sample_time` \[s\] equal to the transition `[[Ad, Bd], [0, I]]` over
/// one sample; `Ad` has `states` rows.
///
/// One logarithm of the augmented matrix; the usual `Bc = Ac (Ad - I)⁻¹ Bd` has no value for a pole at 1.
///
/// # Errors
/// The pole for which there is no logarithm.
pub fn of<S: Scalar, const MAX: usize>(
    transition: &Matrix<S, MAX>,
    states: usize,
    sample_time: S,
) -> Result<Matrix<S, MAX>, NoContinuous> {
    let mut log = transition.logarithm().map_err(|why| {
        // Closer to the axis than this the logarithm exists but has no correct digits.
        const MIN_DISTANCE_FROM_NEGATIVE_AXIS: f64 = 1e-4;
        let poles = Matrix::leading(transition, states).poles();
        let on_axis = |p: &Complex| p.0 <= 0.0 && p.1.abs() <= MIN_DISTANCE_FROM_NEGATIVE_AXIS * p.0.abs();
        poles.into_iter().find(on_axis).map_or(NoContinuous::Numerical(why), NoContinuous::Pole)
    })?;
    for i in 0..states {
        for j in 0..transition.dimension() {
            log.set(i, j, log.at(i, j) / sample_time);
        }
    }
    Ok(log)
}

/// Reason why a recursion has no continuous form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NoContinuous {
    /// A pole at zero or on the negative real axis.
    Pole(Complex),
    /// The logarithm was not found.
    Numerical(NoLogarithm),
}

impl std::fmt::Display for NoContinuous {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Pole((re, im)) if im.abs() < 1e-9 => write!(f, "the recursion has a pole at {re:.6}"),
            Self::Pole((re, im)) => write!(f, "the recursion has a pole at {re:.6} {im:+.2e}i"),
            Self::Numerical(NoLogarithm::Singular) => write!(f, "the recursion has a pole at 0"),
            Self::Numerical(NoLogarithm::NoSquareRoot) => {
                write!(f, "the recursion has a pole too close to the negative real axis")
            }
        }
    }
}
