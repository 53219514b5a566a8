//! Linear system in state-space form, sampled or continuous, as identification gives it.

#[cfg(test)]
mod tests;

use crate::arx_actuator::CART_POLE;
use crate::continuous_form;
use crate::matrix::Matrix;
use fmi_export::{
    Identity, Integer, Interface, MemoryBlock, Model, Outcome, Real, Refusal, Scalar, Table, Values,
};

/// Most states.
const MAX_NX: usize = 12;
/// Most inputs.
const MAX_NU: usize = 4;
/// Most outputs.
const MAX_NY: usize = 4;
/// Longest delay \[samples\].
const MAX_NK: usize = 64;
/// Shortest sample time \[s\].
const SMALLEST_SAMPLE_TIME: f64 = 1e-9;
/// Value of the parameter `realization`.
const CONTINUOUS: i32 = 2;
/// States and inputs.
const MAX: usize = MAX_NX + MAX_NU;

/// `x(k+1) = A x(k) + B w(k)`, `y(k) = C x(k) + D w(k) + y_offset` with `w_i(k) = u_i(k - nk_i) - u_offset_i`.
///
/// | name | shape | meaning |
/// |---|---|---|
/// | `u[i]`, `y[j]` | `n_u` ≤ 4, `n_y` ≤ 4 | inputs, outputs, in whatever unit the data had |
/// | `A`, `B`, `C`, `D` | `n_x` × `n_x` (≤ 12), `n_x` × `n_u`, `n_y` × `n_x`, `n_y` × `n_u` | matrices |
/// | `x[i]` | `n_x` | states; their start values are the initial state |
/// | `nk[i]` | `n_u` | delay of each input \[samples\] |
/// | `sample_time` | 1 | \[s\] |
///
/// Before the start every input stands at its offset. The two realizations are those of `arx-actuator`; the
/// continuous one has no delays.
#[allow(non_snake_case)]
pub struct LinearStateSpace {
    u: [Real; MAX_NU],
    y: [Real; MAX_NY],
    n_x: Integer,
    n_u: Integer,
    n_y: Integer,
    nk: [Integer; MAX_NU],
    sample_time: Real,
    realization: Integer,
    A: [[Real; MAX_NX]; MAX_NX],
    B: [[Real; MAX_NU]; MAX_NX],
    C: [[Real; MAX_NX]; MAX_NY],
    D: [[Real; MAX_NU]; MAX_NY],
    u_offset: [Real; MAX_NU],
    y_offset: [Real; MAX_NY],
    x: [Real; MAX_NX],
    der_x: [Real; MAX_NX],
    /// Outputs of the last sample.
    held: MemoryBlock,
    /// Inputs of the last samples less their offsets, youngest first.
    line: [MemoryBlock; MAX_NU],
    /// Continuous realization: `Ac` and `Bc`, row by row.
    continuous: MemoryBlock,
}

/// Numbers of states, inputs and outputs in use.
#[derive(Clone, Copy)]
struct Shape {
    nx: usize,
    nu: usize,
    ny: usize,
}

impl LinearStateSpace {
    fn is_continuous<S: Scalar>(&self, q: &Values<S>) -> bool {
        q.interface == Interface::ModelExchange && q[self.realization] == CONTINUOUS
    }

    fn shape<S: Scalar>(&self, q: &Values<S>) -> Shape {
        let [nx, nu, ny] = [self.n_x, self.n_u, self.n_y].map(|n| q[n] as usize);
        Shape { nx, nu, ny }
    }

    /// Inputs less their offsets.
    fn deviation<S: Scalar>(&self, q: &Values<S>, shape: Shape) -> [S; MAX_NU] {
        let mut w = [S::zero(); MAX_NU];
        for (i, w) in w.iter_mut().enumerate().take(shape.nu) {
            *w = q[self.u[i]] - q[self.u_offset[i]];
        }
        w
    }

    /// The same behind the delays.
    fn delayed<S: Scalar>(&self, q: &Values<S>, shape: Shape) -> [S; MAX_NU] {
        let mut w = self.deviation(q, shape);
        for (i, w) in w.iter_mut().enumerate().take(shape.nu) {
            let nk = q[self.nk[i]] as usize;
            if nk > 0 {
                *w = q[self.line[i].at(nk - 1)];
            }
        }
        w
    }

    /// `C x + D w + y_offset`; 0 beyond `n_y`.
    fn output<S: Scalar>(&self, q: &Values<S>, shape: Shape, w: &[S; MAX_NU]) -> [S; MAX_NY] {
        let mut y = [S::zero(); MAX_NY];
        for (j, y) in y.iter_mut().enumerate().take(shape.ny) {
            let of_states = (0..shape.nx).fold(S::zero(), |sum, i| sum + q[self.C[j][i]] * q[self.x[i]]);
            let of_both = (0..shape.nu).fold(of_states, |sum, i| sum + q[self.D[j][i]] * w[i]);
            *y = of_both + q[self.y_offset[j]];
        }
        y
    }

    /// `[[A, B], [0, I]]`: one sample with the inputs held.
    fn transition<S: Scalar>(&self, q: &Values<S>, shape: Shape) -> Matrix<S, MAX> {
        let mut m = Matrix::identity(shape.nx + shape.nu);
        for i in 0..shape.nx {
            (0..shape.nx).for_each(|j| m.set(i, j, q[self.A[i][j]]));
            (0..shape.nu).for_each(|j| m.set(i, shape.nx + j, q[self.B[i][j]]));
        }
        m
    }
}

impl Model for LinearStateSpace {
    const IDENTITY: Identity = Identity {
        model_identifier: "linear_state_space",
        model_name: "linear-state-space",
        description: "Linear system in state-space form with up to 12 states, 4 inputs and 4 outputs",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 1.0,
        step_size: 0.001,
    };

    #[allow(non_snake_case)]
    fn declare(t: &mut Table) -> Self {
        use std::array::from_fn;
        let realization = continuous_form::declare_realization(t);
        let start = Start::of_cart_pole();
        let u = from_fn(|i| t.input(format!("u[{}]", i + 1)).about(format!("input {}", i + 1)).real(0.0));
        let y = from_fn(|j| {
            let about = format!("output {}; 0 beyond n_y", j + 1);
            t.output(format!("y[{}]", j + 1)).about(about).discrete().computed()
        });
        let mut number = |name: &'static str, about: &'static str, high: usize, start: i32| {
            t.parameter(name).about(about).range(1.0, high as f64).integer(start)
        };
        let n_x = number("n_x", "number of states", MAX_NX, 2);
        let n_u = number("n_u", "number of inputs", MAX_NU, 1);
        let n_y = number("n_y", "number of outputs", MAX_NY, 2);
        let nk = from_fn(|i| {
            let about = format!("delay of input {} in samples", i + 1);
            t.parameter(format!("nk[{}]", i + 1)).about(about).range(0.0, MAX_NK as f64).integer(0)
        });
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
        let mut entry = |name: &str, i: usize, j: usize, about: String, start: f64| {
            t.parameter(format!("{name}[{},{}]", i + 1, j + 1)).about(about).real(start)
        };
        let A = from_fn(|i| {
            from_fn(|j| {
                entry("A", i, j, format!("state {} in the next state {}", j + 1, i + 1), start.A(i, j))
            })
        });
        let B = from_fn(|i| {
            from_fn(|j| {
                entry("B", i, j, format!("input {} in the next state {}", j + 1, i + 1), start.B(i, j))
            })
        });
        let C = from_fn(|i| {
            from_fn(|j| entry("C", i, j, format!("state {} in output {}", j + 1, i + 1), start.C(i, j)))
        });
        let D = from_fn(|i| {
            from_fn(|j| entry("D", i, j, format!("input {} in output {}", j + 1, i + 1), start.D(i, j)))
        });
        let u_offset = from_fn(|i| {
            let about = format!("value of input {} that leaves the states at rest at 0", i + 1);
            t.parameter(format!("u_offset[{}]", i + 1)).about(about).real(0.0)
        });
        let y_offset = from_fn(|j| {
            let about = format!("value of output {} at rest", j + 1);
            t.parameter(format!("y_offset[{}]", j + 1)).about(about).real(0.0)
        });
        let x: [Real; MAX_NX] = from_fn(|i| {
            let about = format!("state {}; its start value is the initial state", i + 1);
            t.state(format!("x[{}]", i + 1)).about(about).reinit().real(0.0)
        });
        let der_x = from_fn(|i| {
            let about = format!("rate of x[{}], 0 in the sampled realization", i + 1);
            t.derivative(format!("der(x[{}])", i + 1), x[i]).about(about).computed()
        });
        let held = t.memory(MAX_NY);
        let line = from_fn(|_| t.memory(MAX_NK));
        let continuous = t.memory(MAX_NX * MAX);
        Self {
            u,
            y,
            n_x,
            n_u,
            n_y,
            nk,
            sample_time,
            realization,
            A,
            B,
            C,
            D,
            u_offset,
            y_offset,
            x,
            der_x,
            held,
            line,
            continuous,
        }
    }

    fn prepare<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        if !self.is_continuous(q) {
            return Ok(());
        }
        let refused = |why: String| {
            Err(Refusal::Error(format!(
                "realization = continuous does not exist for these parameters: {why}. Use realization = sampled, or \
                 change the model"
            )))
        };
        let shape = self.shape(q);
        if let Some(i) = (0..shape.nu).find(|i| q[self.nk[*i]] > 0) {
            let (i, nk) = (i + 1, q[self.nk[i]]);
            return refused(format!("nk[{i}] = {nk}, and a differential equation has no delay by samples"));
        }
        let form = match continuous_form::of(&self.transition(q, shape), shape.nx, q[self.sample_time]) {
            Ok(form) => form,
            Err(why) => {
                return refused(format!(
                    "{why}; the matrix logarithm needs every pole away from zero and from the negative real axis"
                ));
            }
        };
        let width = shape.nx + shape.nu;
        for i in 0..shape.nx {
            (0..width).for_each(|j| q[self.continuous.at(i * width + j)] = form.at(i, j));
        }
        Ok(())
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        for derivative in self.der_x {
            q[derivative] = S::zero();
        }
        let continuous = self.is_continuous(q);
        if !continuous && !q.at_sample {
            for (j, y) in self.y.iter().enumerate() {
                q[*y] = q[self.held.at(j)];
            }
            return Ok(());
        }
        let shape = self.shape(q);
        let w = if continuous { self.deviation(q, shape) } else { self.delayed(q, shape) };
        let y = self.output(q, shape, &w);
        for (variable, y) in self.y.iter().zip(y) {
            q[*variable] = y;
        }
        if continuous {
            let width = shape.nx + shape.nu;
            for i in 0..shape.nx {
                let row = |j: usize| q[self.continuous.at(i * width + j)];
                let of_states = (0..shape.nx).fold(S::zero(), |sum, j| sum + row(j) * q[self.x[j]]);
                let rate = (0..shape.nu).fold(of_states, |sum, j| sum + row(shape.nx + j) * w[j]);
                q[self.der_x[i]] = rate; // dx/dt = Ac x + Bc w
            }
        }
        Ok(())
    }

    fn sample_period(&self, q: &Values<f64>) -> Option<f64> {
        (!self.is_continuous(q)).then_some(q[self.sample_time])
    }

    fn sample(&self, q: &mut Values<f64>) {
        let shape = self.shape(q);
        let w = self.delayed(q, shape);
        let y = self.output(q, shape, &w);
        let mut next = [0.0; MAX_NX];
        for (i, next) in next.iter_mut().enumerate().take(shape.nx) {
            let of_states: f64 = (0..shape.nx).map(|j| q[self.A[i][j]] * q[self.x[j]]).sum();
            *next = (0..shape.nu).fold(of_states, |sum, j| sum + q[self.B[i][j]] * w[j]);
        }
        let now = self.deviation(q, shape);
        for i in 0..shape.nu {
            let nk = q[self.nk[i]] as usize;
            for k in (1..nk).rev() {
                q[self.line[i].at(k)] = q[self.line[i].at(k - 1)];
            }
            if nk > 0 {
                q[self.line[i].at(0)] = now[i];
            }
        }
        for (j, y) in y.into_iter().enumerate() {
            q[self.held.at(j)] = y;
        }
        for (state, next) in self.x.iter().zip(next).take(shape.nx) {
            q[*state] = next;
        }
    }

    /// One draw in the continuous realization, with poles in (0, 1), and sampled ones of all sizes; every draw of the
    /// former costs a logarithm for each of some 300 parameters.
    fn probe(&self, draw: usize, table: &Table, q: &mut Values<f64>) {
        table.spread(draw, q);
        let (nx, nu, ny) = [(12, 4, 4), (7, 3, 4), (12, 4, 4), (5, 4, 1)][draw % 4];
        (q[self.n_x], q[self.n_u], q[self.n_y]) = (nx, nu, ny);
        q[self.realization] = if draw.is_multiple_of(4) { CONTINUOUS } else { 1 };
        for (i, nk) in self.nk.iter().enumerate() {
            q[*nk] = if draw % 4 == 3 { 1 + i as i32 } else { 0 };
        }
        for (i, row) in self.A.iter().enumerate() {
            for (j, a) in row.iter().enumerate() {
                let diagonal = if i == j { 0.3 + 0.05 * i as f64 } else { 0.0 };
                q[*a] = diagonal + 0.01 * (q[*a] + 0.1);
            }
        }
    }
}

/// Start values: the actuator of the cart-pole (paper eq. 8), `x+ = -A1 x + (B1 - A1 B0) u`, `y = x + B0 u`.
struct Start {
    a1: [[f64; 2]; 2],
    b0: [f64; 2],
    b: [f64; 2],
}

#[allow(non_snake_case)]
impl Start {
    fn of_cart_pole() -> Self {
        let (a1, b0, b1) = CART_POLE;
        let b = std::array::from_fn(|i| b1[i] - a1[i][0] * b0[0] - a1[i][1] * b0[1]);
        Self { a1, b0, b }
    }
    fn A(&self, i: usize, j: usize) -> f64 {
        if i < 2 && j < 2 { -self.a1[i][j] } else { 0.0 }
    }
    fn B(&self, i: usize, j: usize) -> f64 {
        if i < 2 && j == 0 { self.b[i] } else { 0.0 }
    }
    fn C(&self, i: usize, j: usize) -> f64 {
        if i == j && i < 2 { 1.0 } else { 0.0 }
    }
    fn D(&self, i: usize, j: usize) -> f64 {
        if i < 2 && j == 0 { self.b0[i] } else { 0.0 }
    }
}
