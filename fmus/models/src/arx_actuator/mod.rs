//! Identified pneumatic actuator: ARX model from force command to force (paper eq. 3, 5-8, 12).
//!
//! [`realization`] has the state forms, [`pressure`] the pressures of eq. 3 and 5.

mod pressure;
mod realization;
#[cfg(test)]
mod tests;

use crate::continuous_form;
use fmi_export::{
    Identity, Integer, Interface, MemoryBlock, Model, Outcome, Real, Refusal, Scalar, Table, Values,
};
use pressure::Pressure;
use realization::{MAX_BLOCKS, MAX_NA, MAX_NB, MAX_NY, MAX_STATES, Recursion, Shape};

/// Longest delay \[samples\].
const MAX_NK: usize = 64;
/// Shortest sample time \[s\].
const SMALLEST_SAMPLE_TIME: f64 = 1e-9;
/// Value of the parameter `realization`.
const CONTINUOUS: i32 = 2;

/// Coefficients of a first-order set with two outputs: A1, B0, B1.
pub(crate) type FirstOrder = ([[f64; 2]; 2], [f64; 2], [f64; 2]);
/// Eq. 8: the actuator of the cart-pole.
pub(crate) const CART_POLE: FirstOrder =
    ([[-1.0144, 0.0216], [-0.0527, -0.9537]], [0.6619, 0.0764], [-0.6557, -0.0847]);
/// Eq. 12: the toe of the walker.
pub(crate) const TOE: FirstOrder =
    ([[-1.0081, 0.0240], [-0.0447, -0.9502]], [0.6297, 0.0503], [-0.6141, -0.0460]);

/// `A(z) y(k) = B(z) u(k - nk)` (paper eq. 6), written out:
/// `y(k) = -A1 y(k-1) - ... + B0 u(k-nk) + B1 u(k-nk-1) + ...`.
///
/// | name | shape | unit | meaning |
/// |---|---|---|---|
/// | `u` | 1 | N | force command |
/// | `F_hat`, `F_act` | `ny` | N | force of the pressure difference, of the load cell with the rod fixed |
/// | `A1[i,j]` ... `A4[i,j]` | `na` of `ny` × `ny` | 1 | on past outputs |
/// | `B0[i]` ... `B4[i]` | `nb` of `ny` | 1 | on commands |
/// | `sample_time` | 1 | s | not given by the paper; 1 ms is assumed |
///
/// Before the start all commands and outputs are zero. With one output, `F_hat` and `F_act` are both that output.
///
/// The *sampled* realization takes sample k at `t = k sample_time` and holds it. The *continuous* one (Model
/// Exchange only) passes through the same values at the samples for every command that is constant between them.
#[allow(non_snake_case)]
pub struct ArxActuator {
    pub(crate) u: Real,
    pub(crate) F_hat: Real,
    pub(crate) F_act: Real,
    pub(crate) pressure: Pressure,
    na: Integer,
    nb: Integer,
    nk: Integer,
    ny: Integer,
    sample_time: Real,
    realization: Integer,
    A: [[[Real; MAX_NY]; MAX_NY]; MAX_NA],
    B: [[Real; MAX_NY]; MAX_NB],
    z: [Real; MAX_STATES],
    der_z: [Real; MAX_STATES],
    /// Outputs of the last sample.
    held: MemoryBlock,
    /// Commands of the last samples, youngest first.
    line: MemoryBlock,
    /// Continuous realization: `Ac` and `Bc`, row by row.
    continuous: MemoryBlock,
}

impl ArxActuator {
    fn is_continuous<S: Scalar>(&self, q: &Values<S>) -> bool {
        q.interface == Interface::ModelExchange && q[self.realization] == CONTINUOUS
    }

    fn shape<S: Scalar>(&self, q: &Values<S>) -> Shape {
        let [na, nb, nk, ny] = [self.na, self.nb, self.nk, self.ny].map(|n| q[n] as usize);
        Shape { na, nb, nk, ny }
    }

    fn recursion<S: Scalar>(&self, q: &Values<S>) -> Recursion<S> {
        let shape = self.shape(q);
        let mut r = Recursion::zero(shape);
        for i in 0..shape.na {
            for j in 0..shape.ny {
                for l in 0..shape.ny {
                    r.A[i][j][l] = q[self.A[i][j][l]];
                }
            }
        }
        let delay = shape.nk - shape.line();
        for i in 0..shape.nb {
            for j in 0..shape.ny {
                r.C[delay + i][j] = q[self.B[i][j]];
            }
        }
        r
    }

    /// The command behind the delay line.
    fn delayed<S: Scalar>(&self, q: &Values<S>, shape: Shape) -> S {
        match shape.line() {
            0 => q[self.u],
            n => q[self.line.at(n - 1)],
        }
    }

    fn write_outputs<S: Scalar>(&self, q: &mut Values<S>, y: [S; MAX_NY]) {
        let two = q[self.ny] == 2;
        q[self.F_hat] = y[0];
        q[self.F_act] = if two { y[1] } else { y[0] };
    }
}

impl Model for ArxActuator {
    const IDENTITY: Identity = Identity {
        model_identifier: "arx_actuator",
        model_name: "arx-actuator",
        description: "Pneumatic actuator identified as an ARX model from force command to force",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 1.0,
        step_size: 0.001,
    };

    #[allow(non_snake_case)]
    fn declare(t: &mut Table) -> Self {
        let realization = continuous_form::declare_realization(t);
        let u = t.input("u").unit("N").about("force command").nominal(100.0).real(0.0);
        let measured = pressure::declare_inputs(t);
        let mut force = |name: &'static str, about: &'static str| {
            t.output(name).unit("N").about(about).nominal(100.0).discrete().computed()
        };
        let F_hat = force("F_hat", "force of the pressure difference (first output)");
        let F_act = force("F_act", "force on a fixed rod (last output)");
        let pressure = Pressure::declare(t, measured);
        let mut order = |name: &'static str, about: &'static str, low: usize, high: usize, start: i32| {
            t.parameter(name).about(about).range(low as f64, high as f64).integer(start)
        };
        let na = order("na", "number of matrices on past outputs: A1 .. A4", 1, MAX_NA, 1);
        let nb = order("nb", "number of coefficients on commands: B0 .. B4", 1, MAX_NB, 2);
        let nk = order("nk", "delay of the command in samples", 0, MAX_NK, 0);
        let ny = order("ny", "number of outputs", 1, MAX_NY, 2);
        let sample_time = t
            .parameter("sample_time")
            .unit("s")
            .about("sample time of the recursion")
            .min(SMALLEST_SAMPLE_TIME)
            .nominal(0.001)
            .real(0.001);
        let realization = t
            .parameter("realization")
            .about("form of the model in Model Exchange; Co-Simulation is always sampled")
            .enumeration_of(realization, 1);
        let (A1, B0, B1) = CART_POLE;
        let A = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                std::array::from_fn(|l| {
                    t.parameter(format!("A{}[{},{}]", i + 1, j + 1, l + 1))
                        .about(format!(
                            "coefficient of output {} at sample k-{} in output {}",
                            l + 1,
                            i + 1,
                            j + 1
                        ))
                        .real(if i == 0 { A1[j][l] } else { 0.0 })
                })
            })
        });
        let B = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                t.parameter(format!("B{}[{}]", i, j + 1))
                    .about(format!("coefficient of the command at sample k-nk-{} in output {}", i, j + 1))
                    .real([B0, B1].get(i).map_or(0.0, |b| b[j]))
            })
        });
        let z: [Real; MAX_STATES] = std::array::from_fn(|i| {
            t.state(format!("z[{}]", i + 1))
                .unit("N")
                .about(format!("state {} of the observer form", i + 1))
                .nominal(100.0)
                .reinit()
                .real(0.0)
        });
        let der_z = std::array::from_fn(|i| {
            t.derivative(format!("der(z[{}])", i + 1), z[i])
                .unit("N/s")
                .about(format!("rate of z[{}], 0 in the sampled realization", i + 1))
                .nominal(1000.0)
                .computed()
        });
        Self {
            u,
            F_hat,
            F_act,
            pressure,
            na,
            nb,
            nk,
            ny,
            sample_time,
            realization,
            A,
            B,
            z,
            der_z,
            held: t.memory(MAX_NY),
            line: t.memory(MAX_NK + MAX_NB - 1 - MAX_BLOCKS),
            continuous: t.memory(MAX_STATES * (MAX_STATES + 1)),
        }
    }

    fn prepare<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        self.pressure.prepare(q);
        if !self.is_continuous(q) {
            return Ok(());
        }
        let recursion = self.recursion(q);
        let form = recursion.continuous(q[self.sample_time]).map_err(|why| {
            Refusal::Error(format!(
                "realization = continuous does not exist for these parameters: {why}; the matrix logarithm needs \
                 every pole away from zero and from the negative real axis. Use realization = sampled, or change \
                 the coefficients"
            ))
        })?;
        let n = recursion.shape.states();
        for i in 0..n {
            for j in 0..=n {
                q[self.continuous.at(i * (n + 1) + j)] = form.at(i, j);
            }
        }
        Ok(())
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        let u = q[self.u];
        self.pressure.equations(q, u);
        let continuous = self.is_continuous(q);
        for derivative in self.der_z {
            q[derivative] = S::zero();
        }
        if !continuous && !q.at_sample {
            let held = [q[self.held.at(0)], q[self.held.at(1)]];
            self.write_outputs(q, held);
            return Ok(());
        }
        let recursion = self.recursion(q);
        let z = self.z.map(|z| q[z]);
        let w = self.delayed(q, recursion.shape);
        self.write_outputs(q, recursion.output(&z, w)); // eq. 6
        if continuous {
            let n = recursion.shape.states();
            for i in 0..n {
                let coefficient = |j: usize| q[self.continuous.at(i * (n + 1) + j)];
                let rate = (0..n).fold(coefficient(n) * u, |sum, j| sum + coefficient(j) * z[j]);
                q[self.der_z[i]] = rate; // dz/dt = Ac z + Bc u
            }
        }
        Ok(())
    }

    fn sample_period(&self, q: &Values<f64>) -> Option<f64> {
        (!self.is_continuous(q)).then_some(q[self.sample_time])
    }

    fn sample(&self, q: &mut Values<f64>) {
        let recursion = self.recursion(q);
        let z = self.z.map(|z| q[z]);
        let w = self.delayed(q, recursion.shape);
        let y = recursion.output(&z, w);
        let next = recursion.advance(&z, w);
        for i in (1..recursion.shape.line()).rev() {
            q[self.line.at(i)] = q[self.line.at(i - 1)];
        }
        if recursion.shape.line() > 0 {
            q[self.line.at(0)] = q[self.u];
        }
        for (memory, y) in (0..MAX_NY).map(|j| self.held.at(j)).zip(y) {
            q[memory] = y;
        }
        for (state, next) in self.z.iter().zip(next) {
            q[*state] = next;
        }
    }

    /// Draws in both realizations, with the largest and with smaller orders, with real poles in (0, 1).
    fn probe(&self, draw: usize, table: &Table, q: &mut Values<f64>) {
        table.spread(draw, q);
        let [na, nb, nk, ny] = [[4, 5, 0, 2], [3, 4, 0, 1], [4, 4, 0, 2], [3, 3, 1, 2]][draw % 4];
        (q[self.na], q[self.nb], q[self.nk], q[self.ny]) = (na, nb, nk, ny);
        q[self.realization] = if draw.is_multiple_of(2) { CONTINUOUS } else { 1 };
        if draw.is_multiple_of(2) {
            q[self.pressure.F_eq] = 0.0;
        }
        // (1 - p1 z⁻¹)(1 - p2 z⁻¹) ... on the diagonal, a little of everything besides.
        let mut polynomial = [0.0; MAX_NA + 1];
        polynomial[0] = 1.0;
        for (k, pole) in [0.9, 0.6, 0.4, 0.2].into_iter().take(na as usize).enumerate() {
            for i in (0..=k).rev() {
                polynomial[i + 1] -= pole * polynomial[i];
            }
        }
        for (i, block) in self.A.iter().enumerate() {
            for (j, row) in block.iter().enumerate() {
                for (l, a) in row.iter().enumerate() {
                    let diagonal = if j == l { polynomial[i + 1] } else { 0.0 };
                    q[*a] = diagonal + 0.005 * (q[*a] + 0.1);
                }
            }
        }
    }
}
