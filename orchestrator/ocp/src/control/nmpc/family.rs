//! A plant with uncertain parameters: one [`Dynamics`] as declared, and some with one parameter moved.
//!
//! No parameter of a [`Dynamics`] can be changed, so the rates between the members are interpolated: by a parabola
//! through three members per parameter, or by the straight line through two where the parabola is one.

use crate::transcription::{Dynamics, Point, Size};
use airloop_optim::EvaluationError;

/// Largest distance of a parameter from its declared value, in widths: the parabola is not trusted beyond it.
pub const MAX_PART: f64 = 1.5;

/// A parameter that the estimator follows.
pub struct Member {
    /// The plant with the parameter one width above its declared value.
    pub high: Box<dyn Dynamics>,
    /// The plant with the parameter one width below; none where the rates are linear in it.
    pub low: Option<Box<dyn Dynamics>>,
}

/// The plant `x' = f(t, x, u, p)`; p `[n_p]` counts in widths from the declared values.
pub struct Family {
    size: Size,
    nominal: Box<dyn Dynamics>,
    members: Vec<Member>,
    values: Vec<f64>,
    jacobian: Vec<f64>,
    other: Vec<f64>,
    other_jacobian: Vec<f64>,
}

impl Family {
    /// Of the plant as declared and its members.
    pub fn new(nominal: Box<dyn Dynamics>, members: Vec<Member>) -> Family {
        let size = nominal.size();
        let (values, jacobian) = (vec![0.0; size.values()], vec![0.0; size.values() * size.arguments()]);
        let (other, other_jacobian) = (values.clone(), jacobian.clone());
        Family { size, nominal, members, values, jacobian, other, other_jacobian }
    }

    /// Numbers of states, inputs and outputs.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        self.members.len()
    }

    /// The plant as declared.
    pub fn nominal(&mut self) -> &mut dyn Dynamics {
        self.nominal.as_mut()
    }

    /// Rates and outputs `[n_x + n_g]`, and their derivatives by states and inputs `[n_x + n_g, n_x + n_u]`, at `p`
    /// `[n_p]`; `by_parameters` `[n_x, n_p]` receives those of the rates by the parameters, where it is not empty.
    ///
    /// # Errors
    /// Functions without a value.
    pub fn evaluate(
        &mut self,
        at: Point<'_>,
        p: &[f64],
        by_parameters: &mut [f64],
    ) -> Result<(&[f64], &[f64]), EvaluationError> {
        let Family { nominal, members, values, jacobian, other, other_jacobian, size } = self;
        nominal.jacobian(at, values, jacobian)?;
        let (n, np) = (size.states, p.len());
        if members.is_empty() {
            return Ok((&self.values, &self.jacobian));
        }
        let own: f64 = members
            .iter()
            .zip(p)
            .map(|(member, p)| if member.low.is_some() { -p * p } else { -p })
            .sum::<f64>()
            + 1.0;
        let slopes = !by_parameters.is_empty();
        if slopes {
            for (j, member) in members.iter().enumerate() {
                let part = if member.low.is_some() { -2.0 * p[j] } else { -1.0 };
                (0..n).for_each(|i| by_parameters[i * np + j] = part * values[i]);
            }
        }
        values.iter_mut().for_each(|value| *value *= own);
        jacobian.iter_mut().for_each(|value| *value *= own);
        for (j, (member, &p)) in members.iter_mut().zip(p).enumerate() {
            // Weights of the member above and below, and their slopes.
            let (above, below) = match member.low {
                Some(_) => ((0.5 * (p * p + p), p + 0.5), (0.5 * (p * p - p), p - 0.5)),
                None => ((p, 1.0), (0.0, 0.0)),
            };
            for (plant, (weight, slope)) in
                std::iter::once((&mut member.high, above)).chain(member.low.as_mut().map(|low| (low, below)))
            {
                if weight == 0.0 && !slopes {
                    continue;
                }
                plant.jacobian(at, other, other_jacobian)?;
                values.iter_mut().zip(other.iter()).for_each(|(sum, value)| *sum += weight * value);
                jacobian.iter_mut().zip(other_jacobian.iter()).for_each(|(sum, one)| *sum += weight * one);
                if slopes {
                    (0..n).for_each(|i| by_parameters[i * np + j] += slope * other[i]);
                }
            }
        }
        Ok((&self.values, &self.jacobian))
    }
}
