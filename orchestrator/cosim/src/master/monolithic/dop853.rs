//! One step of the explicit Runge-Kutta pair of order 8 with error estimates of orders 5 and 3 (DOP853).
//!
//! Coefficients of Dormand and Prince in the form of Hairer, Nørsett and Wanner, Solving Ordinary Differential
//! Equations I, section II.10. Choosing steps and finding events is left to [`super::integrate`].

/// Evaluations of the right-hand side inside a step; the first is that at the end of the step before.
pub(super) const STAGES: usize = 12;

/// Nodes.
const C: [f64; STAGES] = [
    0.0,
    0.05260015195876773,
    0.0789002279381516,
    0.1183503419072274,
    0.2816496580927726,
    0.3333333333333333,
    0.25,
    0.3076923076923077,
    0.6512820512820513,
    0.6,
    0.8571428571428571,
    1.0,
];

/// Rows of the coefficient matrix, below the diagonal.
const A: [&[f64]; STAGES] = [
    &[],
    &[0.05260015195876773],
    &[0.0197250569845379, 0.0591751709536137],
    &[0.02958758547680685, 0.0, 0.08876275643042054],
    &[0.2413651341592667, 0.0, -0.8845494793282861, 0.924834003261792],
    &[0.037037037037037035, 0.0, 0.0, 0.17082860872947386, 0.12546768756682242],
    &[0.037109375, 0.0, 0.0, 0.17025221101954405, 0.06021653898045596, -0.017578125],
    &[
        0.03709200011850479,
        0.0,
        0.0,
        0.17038392571223998,
        0.10726203044637328,
        -0.015319437748624402,
        0.008273789163814023,
    ],
    &[
        0.6241109587160757,
        0.0,
        0.0,
        -3.3608926294469414,
        -0.868219346841726,
        27.59209969944671,
        20.154067550477894,
        -43.48988418106996,
    ],
    &[
        0.47766253643826434,
        0.0,
        0.0,
        -2.4881146199716677,
        -0.590290826836843,
        21.230051448181193,
        15.279233632882423,
        -33.28821096898486,
        -0.020331201708508627,
    ],
    &[
        -0.9371424300859873,
        0.0,
        0.0,
        5.186372428844064,
        1.0914373489967295,
        -8.149787010746927,
        -18.52006565999696,
        22.739487099350505,
        2.4936055526796523,
        -3.0467644718982196,
    ],
    &[
        2.273310147516538,
        0.0,
        0.0,
        -10.53449546673725,
        -2.0008720582248625,
        -17.9589318631188,
        27.94888452941996,
        -2.8589982771350235,
        -8.87285693353063,
        12.360567175794303,
        0.6433927460157636,
    ],
];

/// Weights of the solution.
const B: [f64; STAGES] = [
    0.054293734116568765,
    0.0,
    0.0,
    0.0,
    0.0,
    4.450312892752409,
    1.8915178993145003,
    -5.801203960010585,
    0.3111643669578199,
    -0.1521609496625161,
    0.20136540080403034,
    0.04471061572777259,
];

/// Weights of the error of order 3.
const E3: [f64; STAGES] = [
    -0.18980075407240762,
    0.0,
    0.0,
    0.0,
    0.0,
    4.450312892752409,
    1.8915178993145003,
    -5.801203960010585,
    -0.4226823213237919,
    -0.1521609496625161,
    0.20136540080403034,
    0.02265179219836082,
];

/// Weights of the error of order 5.
const E5: [f64; STAGES] = [
    0.01312004499419488,
    0.0,
    0.0,
    0.0,
    0.0,
    -1.2251564463762044,
    -0.4957589496572502,
    1.6643771824549864,
    -0.35032884874997366,
    0.3341791187130175,
    0.08192320648511571,
    -0.022355307863886294,
];

/// Memory of a step for `n` states.
#[derive(Debug, Clone)]
pub(super) struct Step {
    /// Right-hand side at each stage; the first is given by the caller.
    pub k: [Vec<f64>; STAGES],
    /// States at the end of the step.
    pub end: Vec<f64>,
}

impl Step {
    pub fn new(n: usize) -> Step {
        Step { k: std::array::from_fn(|_| vec![0.0; n]), end: vec![0.0; n] }
    }

    /// From `x` at `t` over `h` \[s\] to [`Step::end`]; `k[0]` holds the right-hand side at the start.
    ///
    /// # Errors
    /// Those of the right-hand side.
    pub fn take<E>(
        &mut self,
        mut f: impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), E>,
        t: f64,
        h: f64,
        x: &[f64],
    ) -> Result<(), E> {
        if x.is_empty() {
            return Ok(());
        }
        for stage in 1..STAGES {
            let (known, new) = self.k.split_at_mut(stage);
            combine(&mut self.end, x, h, A[stage], known);
            f(t + C[stage] * h, &self.end, &mut new[0])?;
        }
        combine(&mut self.end, x, h, &B, &self.k);
        Ok(())
    }

    /// Estimated error of the step in units of `scale` (Euclidean norm), and the state that errs most.
    pub fn error(&self, h: f64, scale: impl Fn(usize) -> f64) -> (f64, usize) {
        let (mut fifth, mut third, mut largest) = (0.0, 0.0, (0.0, 0));
        for i in 0..self.end.len() {
            let sum = |weights: &[f64; STAGES]| -> f64 {
                weights.iter().zip(&self.k).map(|(weight, k)| weight * k[i]).sum::<f64>() / scale(i)
            };
            let (five, three) = (sum(&E5), sum(&E3));
            // The largest one, and the first that is not a number at all.
            if five.abs() > largest.0 || five.is_nan() {
                largest = (if five.is_nan() { f64::INFINITY } else { five.abs() }, i);
            }
            fifth += five * five;
            third += three * three;
        }
        if fifth == 0.0 && third == 0.0 {
            return (0.0, 0);
        }
        (h.abs() * fifth / (fifth + 0.01 * third).sqrt(), largest.1)
    }
}

/// `sum = x + h (weights . k)`.
fn combine(sum: &mut [f64], x: &[f64], h: f64, weights: &[f64], k: &[Vec<f64>]) {
    sum.fill(0.0);
    for (weight, k) in weights.iter().zip(k).filter(|(weight, _)| **weight != 0.0) {
        sum.iter_mut().zip(k).for_each(|(sum, k)| *sum += weight * k);
    }
    sum.iter_mut().zip(x).for_each(|(sum, x)| *sum = x + h * *sum);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_coefficients_meet_the_quadrature_conditions() {
        for (row, c) in A.iter().zip(C) {
            assert!((row.iter().sum::<f64>() - c).abs() < 1e-14, "{c}");
        }
        for power in 0..8 {
            let sum: f64 = B.iter().zip(C).map(|(b, c)| b * c.powi(power)).sum();
            assert!((sum - 1.0 / f64::from(power + 1)).abs() < 1e-13, "{power}: {sum}");
        }
        for weights in [E3, E5] {
            assert!(weights.iter().sum::<f64>().abs() < 1e-13);
        }
    }

    /// Error at t = 2 of an oscillator with a factor that depends on time, against its closed form.
    fn error(steps: u32) -> f64 {
        // x' = -2 t y, y' = 2 t x: x = cos t^2, y = sin t^2.
        let f = |t: f64, x: &[f64], dx: &mut [f64]| {
            (dx[0], dx[1]) = (-2.0 * t * x[1], 2.0 * t * x[0]);
            Ok::<(), ()>(())
        };
        let (mut step, mut x, h) = (Step::new(2), vec![1.0, 0.0], 2.0 / f64::from(steps));
        for k in 0..steps {
            let t = f64::from(k) * h;
            f(t, &x, &mut step.k[0]).unwrap();
            step.take(f, t, h, &x).unwrap();
            x.clone_from(&step.end);
        }
        (x[0] - 4f64.cos()).hypot(x[1] - 4f64.sin())
    }

    #[test]
    fn the_error_falls_with_the_eighth_power_of_the_step() {
        let order = (error(10) / error(20)).log2();
        assert!((7.5..9.5).contains(&order), "{order}");
    }
}
