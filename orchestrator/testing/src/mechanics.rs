//! Cart-pole with frictions and pneumatic actuator, typed from the problem statement, with first and second derivatives
//! of the accelerations in closed form. Equation numbers are those of *Model-based Trajectory Control of Robots with
//! Pneumatic Actuator Dynamics*.

pub const GRAVITY: f64 = 9.81;
const CART: f64 = 0.399;
const POLE: f64 = 0.1;
const LENGTH: f64 = 0.2;
const BEARING: f64 = 0.0006;
/// Direct feed-through of the command to the force.
pub const FEED: f64 = 0.0764;
pub const SAMPLE: f64 = 1e-3;
pub const AD: [[f64; 2]; 2] = [[1.0144, -0.0216], [0.0527, 0.9537]];
pub const BD: [f64; 2] = [0.014_081_120_000_000_058, 0.023_044_81];

/// Friction force, its slope and curvature over the velocity (equations 10 and 11).
fn friction(v: f64) -> [f64; 3] {
    let (mut force, mut slope, mut curvature) = (49.2734 * v - 2.3170, 49.2734, 0.0);
    for (height, steepness, offset) in [(1.5145, 40.8926, 0.0), (5.7910, 63.7045, 0.0064)] {
        let t = (steepness * (v - offset)).tanh();
        let s = 1.0 - t * t;
        force += height * t;
        slope += height * steepness * s;
        curvature -= 2.0 * height * steepness * steepness * t * s;
    }
    [force, slope, curvature]
}

/// Accelerations (cart, pole) at q = (theta, v, w, force) with their gradients, `[2][4]`.
pub struct Accelerations {
    pub value: [f64; 2],
    pub gradient: [[f64; 4]; 2],
    inverse: [f64; 3],
    parts: [f64; 4],
    curvature: f64,
    w: f64,
}

/// Equation 4, solved for the accelerations.
pub fn accelerations([theta, v, w, force]: [f64; 4]) -> Accelerations {
    let (s, c) = theta.sin_cos();
    let ml = POLE * LENGTH;
    let (a, b, d) = (CART + POLE, ml * c, ml * LENGTH);
    let determinant = a * d - b * b;
    let inverse = [d / determinant, -b / determinant, a / determinant];
    let apply = |r: [f64; 2]| [inverse[0] * r[0] + inverse[1] * r[1], inverse[1] * r[0] + inverse[2] * r[1]];
    let [drag, slope, curvature] = friction(v);
    let value = apply([force - drag + ml * w * w * s, -BEARING * w - ml * GRAVITY * s]);
    // The mass matrix depends on theta through its off-diagonal entry, with slope -ml sin(theta).
    let columns = [
        apply([ml * w * w * c + ml * s * value[1], -ml * GRAVITY * c + ml * s * value[0]]),
        apply([-slope, 0.0]),
        apply([2.0 * ml * w * s, -BEARING]),
        apply([1.0, 0.0]),
    ];
    let gradient = [columns.map(|column| column[0]), columns.map(|column| column[1])];
    Accelerations { value, gradient, inverse, parts: [s, c, ml, ml * GRAVITY], curvature, w }
}

impl Accelerations {
    /// Hessian of `weight . accelerations` in q.
    pub fn hessian(&self, weight: [f64; 2]) -> [[f64; 4]; 4] {
        let [p, q, r] = self.inverse;
        let mu = [p * weight[0] + q * weight[1], q * weight[0] + r * weight[1]];
        let [s, c, ml, mgl] = self.parts;
        let w = self.w;
        let mut h = [[0.0; 4]; 4];
        h[0][0] = mu[0] * -ml * w * w * s + mu[1] * mgl * s;
        h[0][2] = mu[0] * 2.0 * ml * w * c;
        h[1][1] = mu[0] * -self.curvature;
        h[2][2] = mu[0] * 2.0 * ml * s;
        h[2][0] = h[0][2];
        // -mu . M_theta a_j, and -mu . M_theta_theta a.
        let terms: [f64; 4] =
            std::array::from_fn(|j| ml * s * (mu[0] * self.gradient[1][j] + mu[1] * self.gradient[0][j]));
        for (j, term) in terms.into_iter().enumerate() {
            h[0][j] += term;
            h[j][0] += term;
        }
        h[0][0] += ml * c * (mu[0] * self.value[1] + mu[1] * self.value[0]);
        h
    }
}

/// Continuous realization of the actuator: Ac = log(Ad) / Ts and Bc = Ac (Ad - I)^-1 Bd.
pub fn continuous_actuator() -> ([[f64; 2]; 2], [f64; 2]) {
    // Eigenvalues alpha +- i beta: log(Ad) = ln|lambda| I + angle / beta (Ad - alpha I).
    let alpha = 0.5 * (AD[0][0] + AD[1][1]);
    let determinant = AD[0][0] * AD[1][1] - AD[0][1] * AD[1][0];
    let beta = (determinant - alpha * alpha).sqrt();
    let (radius, angle) = (0.5 * determinant.ln(), beta.atan2(alpha));
    let mut ac = [[0.0; 2]; 2];
    for i in 0..2 {
        for j in 0..2 {
            let one = f64::from(u8::from(i == j));
            ac[i][j] = (radius * one + angle / beta * (AD[i][j] - alpha * one)) / SAMPLE;
        }
    }
    let [[a, b], [c, d]] = [[AD[0][0] - 1.0, AD[0][1]], [AD[1][0], AD[1][1] - 1.0]];
    let det = a * d - b * c;
    let y = [(d * BD[0] - b * BD[1]) / det, (a * BD[1] - c * BD[0]) / det];
    (ac, [0, 1].map(|i| ac[i][0] * y[0] + ac[i][1] * y[1]))
}

/// z(t) as a linear function of (z1, z2, u): the first two rows of expm([[Ac, Bc], [0, 0]] t).
pub fn actuator_flow(t: f64) -> [[f64; 3]; 2] {
    let (ac, bc) = continuous_actuator();
    let halvings = 10;
    let step = t / f64::from(1 << halvings);
    let matrix = [[ac[0][0], ac[0][1], bc[0]], [ac[1][0], ac[1][1], bc[1]], [0.0; 3]];
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let product = |a: [[f64; 3]; 3], b: [[f64; 3]; 3]| {
        let entry = |i: usize, j: usize| (0..3).map(|k| a[i][k] * b[k][j]).sum::<f64>();
        [0, 1, 2].map(|i| [0, 1, 2].map(|j| entry(i, j)))
    };
    // Horner's form of the exponential series, then squaring.
    let mut flow = identity;
    for order in (1..=12).rev() {
        let next = product(matrix, flow);
        for i in 0..3 {
            for j in 0..3 {
                flow[i][j] = identity[i][j] + next[i][j] * step / f64::from(order);
            }
        }
    }
    for _ in 0..halvings {
        flow = product(flow, flow);
    }
    [flow[0], flow[1]]
}
