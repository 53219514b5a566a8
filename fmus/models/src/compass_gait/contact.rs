//! Motion and impact with a set of feet on the ground.
//!
//! The constraint is kept on the level of accelerations, exactly: `J q'' + J' q' = 0`, with no feedback of position
//! or velocity errors.

use super::body::{Body, N, Pose, Vector};
use super::feet::Feet;
use super::ldl::Ldl;
use fmi_export::{Refusal, Scalar};

/// Forces or impulses of the ground on both feet, `[foot][tangential, normal]` \[N or N s\]; 0 for a foot in the air.
pub type OnFeet<S> = [[S; 2]; 2];

/// A position with its factorized mass matrix.
pub struct Mechanics<S> {
    body: Body<S>,
    pose: Pose<S>,
    /// Kinetic and potential energy \[J\].
    pub energy: S,
    factors: Ldl<S, N>,
}

impl<S: Scalar> Mechanics<S> {
    /// Factorizes the mass matrix.
    ///
    /// # Errors
    /// When it is not positive definite.
    #[inline]
    pub fn new(body: Body<S>, pose: Pose<S>) -> Result<Self, Refusal> {
        let mass = body.mass_matrix(&pose);
        let energy = body.energy(&pose, &mass);
        match Ldl::of(mass) {
            Ok(factors) => Ok(Self { body, pose, energy, factors }),
            Err(row) => Err(Refusal::Discard(format!(
                "the mass matrix is not positive definite at {} with l1 = {} m, l2 = {} m; check masses and inertias",
                ["x", "y", "th1", "th2", "l1", "l2"][row],
                pose.q[4].value(),
                pose.q[5].value()
            ))),
        }
    }

    /// Accelerations and ground forces under the generalized forces of `tau`, `F1`, `F2`:
    /// `H q'' + C q' + G = B u + J^T f`, `J q'' + J' q' = 0`.
    ///
    /// # Errors
    /// When the feet's constraints depend on each other.
    pub fn motion(&self, [tau, f1, f2]: [S; 3], feet: Feet) -> Result<(Vector<S>, OnFeet<S>), Refusal> {
        let (c, g) = (self.body.coriolis(&self.pose), self.body.gravity(&self.pose));
        let applied = [S::zero(), S::zero(), -tau, tau, f1, f2];
        let mut accelerations: Vector<S> = std::array::from_fn(|i| applied[i] - c[i] - g[i]);
        self.factors.solve(&mut accelerations);
        let forces = self.hold(feet, &mut accelerations, |pose, i| pose.foot_drift(i))?;
        Ok((accelerations, forces))
    }

    /// Velocities after an inelastic impact of `feet`, and the impulses: `H (v+ - v) = J^T L`, `J v+ = 0`.
    ///
    /// # Errors
    /// When the feet's constraints depend on each other.
    pub fn impact(&self, feet: Feet) -> Result<(Vector<S>, OnFeet<S>), Refusal> {
        let mut v = self.pose.v;
        let impulses = self.hold(feet, &mut v, |_, _| [S::zero(); 2])?;
        Ok((v, impulses))
    }

    /// Moves `w` to where `J w + offset = 0` and gives what the ground adds for it.
    fn hold(
        &self,
        feet: Feet,
        w: &mut Vector<S>,
        offset: impl Fn(&Pose<S>, usize) -> [S; 2],
    ) -> Result<OnFeet<S>, Refusal> {
        match feet {
            Feet::NONE => Ok([[S::zero(); 2]; 2]),
            Feet::BOTH => self.hold_rows::<4>(feet, w, offset),
            _ => self.hold_rows::<2>(feet, w, offset),
        }
    }

    /// Same as above with the number of rows of J: two per foot.
    fn hold_rows<const R: usize>(
        &self,
        feet: Feet,
        w: &mut Vector<S>,
        offset: impl Fn(&Pose<S>, usize) -> [S; 2],
    ) -> Result<OnFeet<S>, Refusal> {
        // H^-1 J^T by columns.
        let mut responses = [[S::zero(); N]; R];
        let mut needed = [S::zero(); R];
        for (k, i) in feet.iter().enumerate() {
            let (rate, offset) = (self.pose.foot_rate(i, w), offset(&self.pose, i));
            for (row, jacobian) in self.pose.foot_jacobian(i).into_iter().enumerate() {
                needed[2 * k + row] = -(rate[row] + offset[row]);
                responses[2 * k + row] = jacobian;
                self.factors.solve(&mut responses[2 * k + row]);
            }
        }
        // J H^-1 J^T, symmetric: the velocity that each response gives each foot.
        let mut inverse_inertia = [[S::zero(); R]; R];
        for (column, response) in responses.iter().enumerate() {
            for (k, i) in feet.iter().enumerate() {
                let [x, y] = self.pose.foot_rate(i, response);
                inverse_inertia[2 * k][column] = x;
                inverse_inertia[2 * k + 1][column] = y;
            }
        }
        let factors = Ldl::of(inverse_inertia).map_err(|_| {
            Refusal::Discard(format!(
                "the contact of {} is singular at l1 = {} m, l2 = {} m: a leg without length cannot hold its foot",
                if feet == Feet::BOTH { "both feet" } else { "one foot" },
                self.pose.q[4].value(),
                self.pose.q[5].value()
            ))
        })?;
        factors.solve(&mut needed);
        let mut on_feet = [[S::zero(); 2]; 2];
        for (k, i) in feet.iter().enumerate() {
            on_feet[i] = [needed[2 * k], needed[2 * k + 1]];
            for (push, response) in on_feet[i].iter().zip(&responses[2 * k..]) {
                w.iter_mut().zip(response).for_each(|(w, response)| *w += *response * *push);
            }
        }
        Ok(on_feet)
    }
}
