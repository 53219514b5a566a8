//! Explicit one-step methods for the time between communication points.
//!
//! RK4 (Kutta 1901) with a fixed step, and the Dormand-Prince pair 5(4) (Dormand, Prince 1980) with an error
//! estimate. Both work on caller-owned arrays: no allocation in a step.

use crate::model::Outcome;

/// Scratch arrays of one instance.
#[derive(Clone, Debug)]
pub(crate) struct Workspace {
    /// Stage slopes.
    pub k: [Vec<f64>; 7],
    /// Stage state.
    pub stage: Vec<f64>,
    /// State at the start of the inner step.
    pub x0: Vec<f64>,
    /// State at its end.
    pub x1: Vec<f64>,
    /// Event indicators at the start of the inner step.
    pub z0: Vec<f64>,
    /// Event indicators at its end.
    pub z1: Vec<f64>,
    /// Inputs at the communication point.
    pub inputs: Vec<f64>,
}

impl Workspace {
    pub fn new(states: usize, indicators: usize, inputs: usize) -> Self {
        let x = || vec![0.0; states];
        Self {
            k: std::array::from_fn(|_| x()),
            stage: x(),
            x0: x(),
            x1: x(),
            z0: vec![0.0; indicators],
            z1: vec![0.0; indicators],
            inputs: vec![0.0; inputs],
        }
    }
}

/// One RK4 step of length `h` from `(t, x0)`; the result goes to `x1`.
pub(crate) fn rk4(
    mut f: impl FnMut(f64, &[f64], &mut [f64]) -> Outcome,
    t: f64,
    h: f64,
    x0: &[f64],
    x1: &mut [f64],
    k: &mut [Vec<f64>; 7],
    stage: &mut [f64],
) -> Outcome {
    let [k1, k2, k3, k4, ..] = k;
    f(t, x0, k1)?;
    axpy(stage, x0, h / 2.0, k1);
    f(t + h / 2.0, stage, k2)?;
    axpy(stage, x0, h / 2.0, k2);
    f(t + h / 2.0, stage, k3)?;
    axpy(stage, x0, h, k3);
    f(t + h, stage, k4)?;
    for (i, x) in x1.iter_mut().enumerate() {
        *x = x0[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    }
    Ok(())
}

fn axpy(out: &mut [f64], x: &[f64], a: f64, y: &[f64]) {
    for ((out, x), y) in out.iter_mut().zip(x).zip(y) {
        *out = x + a * y;
    }
}

const C: [f64; 7] = [0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0];
const A: [[f64; 6]; 7] = [
    [0.0; 6],
    [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
/// Fifth-order minus fourth-order weights.
const E: [f64; 7] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0];

/// One Dormand-Prince step of length `h`; the fifth-order result goes to `x1`.
///
/// Returns the error estimate relative to `tolerance * max(|x|, 1e-3)`, as root mean square over the states:
/// at most 1 means the step is good.
#[allow(clippy::too_many_arguments)]
pub(crate) fn dopri5(
    mut f: impl FnMut(f64, &[f64], &mut [f64]) -> Outcome,
    t: f64,
    h: f64,
    tolerance: f64,
    x0: &[f64],
    x1: &mut [f64],
    k: &mut [Vec<f64>; 7],
    stage: &mut [f64],
) -> Result<f64, crate::Refusal> {
    for s in 0..7 {
        for (i, x) in stage.iter_mut().enumerate() {
            *x = x0[i] + h * (0..s).map(|j| A[s][j] * k[j][i]).sum::<f64>();
        }
        if s == 6 {
            x1.copy_from_slice(stage); // the last row of A holds the weights: first same as last
        }
        f(t + C[s] * h, stage, &mut k[s])?;
    }
    let sum: f64 = (0..x0.len())
        .map(|i| {
            let error = h * (0..7).map(|s| E[s] * k[s][i]).sum::<f64>();
            let scale = tolerance * x0[i].abs().max(x1[i].abs()).max(1e-3);
            (error / scale).powi(2)
        })
        .sum();
    Ok((sum / x0.len().max(1) as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error_after_one_second(steps: usize, method: &str) -> f64 {
        // dx/dt = x cos t, x(0) = 1: x = exp(sin t)
        let f = |t: f64, x: &[f64], dx: &mut [f64]| {
            dx[0] = x[0] * t.cos();
            Ok(())
        };
        let mut w = Workspace::new(1, 0, 0);
        let (mut x0, mut x1) = (vec![1.0], vec![0.0]);
        let h = 1.0 / steps as f64;
        for i in 0..steps {
            let t = i as f64 * h;
            match method {
                "rk4" => rk4(f, t, h, &x0, &mut x1, &mut w.k, &mut w.stage).unwrap(),
                _ => drop(dopri5(f, t, h, 1e-6, &x0, &mut x1, &mut w.k, &mut w.stage).unwrap()),
            }
            x0.copy_from_slice(&x1);
        }
        (x0[0] - 1f64.sin().exp()).abs()
    }

    #[test]
    fn observed_orders_are_four_and_five() {
        for (method, order) in [("rk4", 4.0), ("dopri5", 5.0)] {
            let ratio = error_after_one_second(10, method) / error_after_one_second(20, method);
            assert!((ratio.log2() - order).abs() < 0.35, "{method}: {}", ratio.log2());
        }
    }

    #[test]
    fn error_estimate_shrinks_with_the_fifth_power_of_the_step() {
        let f = |t: f64, x: &[f64], dx: &mut [f64]| {
            dx[0] = x[0] * t.cos();
            Ok(())
        };
        let mut w = Workspace::new(1, 0, 0);
        let mut x1 = vec![0.0];
        let mut estimate = |h: f64| dopri5(f, 0.3, h, 1e-6, &[1.3], &mut x1, &mut w.k, &mut w.stage).unwrap();
        let order = (estimate(0.1) / estimate(0.05)).log2();
        assert!((order - 5.0).abs() < 0.4, "{order}");
    }
}
