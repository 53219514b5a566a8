//! The swing-up over the trait is the same nonlinear program as the one typed by hand.

use airloop_ocp::transcription::{Discretization, Program, Transcription};
use airloop_optim::Nlp;

use crate::cart_pole::swing_up;
use crate::problem::{self, SwingUp};

pub const PAIRS: [(Transcription, problem::Transcription); 4] = [
    (Transcription::HermiteSimpson, problem::Transcription::HermiteSimpson),
    (Transcription::Trapezoidal, problem::Transcription::Trapezoidal),
    (Transcription::MultipleShooting, problem::Transcription::MultipleShooting),
    (Transcription::ShootingCollocation, problem::Transcription::ShootingCollocation),
];

/// Dense matrix of summed entries.
fn dense(rows: usize, columns: usize, places: &[(usize, usize)], values: &[f64]) -> Vec<f64> {
    let mut matrix = vec![0.0; rows * columns];
    places.iter().zip(values).for_each(|(&(i, j), value)| matrix[i * columns + j] += value);
    matrix
}

fn gap(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).fold(0.0, |m, (a, b)| m.max((a - b).abs() / (1.0 + b.abs())))
}

/// Objective, gradient, constraints, Jacobian, Hessian (one triangle mirrored).
fn everything(nlp: &mut dyn Nlp, x: &[f64], y: &[f64]) -> [Vec<f64>; 5] {
    let (n, m) = (nlp.variables(), nlp.constraints());
    let (jp, hp) = (nlp.jacobian_pattern(), nlp.hessian_pattern());
    let (mut gradient, mut values) = (vec![0.0; n], vec![0.0; m]);
    let (mut jacobian, mut hessian) = (vec![0.0; jp.len()], vec![0.0; hp.len()]);
    let objective = nlp.objective(x).unwrap();
    nlp.gradient(x, &mut gradient).unwrap();
    nlp.constraint_values(x, &mut values).unwrap();
    nlp.jacobian(x, &mut jacobian).unwrap();
    nlp.hessian(x, 0.7, y, &mut hessian).unwrap();
    let lower: Vec<_> = hp.iter().map(|&(i, j)| (i.max(j), i.min(j))).collect();
    let (jacobian, hessian) = (dense(m, n, &jp, &jacobian), dense(n, n, &lower, &hessian));
    [vec![objective], gradient, values, jacobian, hessian]
}

#[test]
fn every_function_equals_the_one_typed_by_hand() {
    for (transcription, typed) in PAIRS {
        let mut typed = SwingUp::new(typed, 25);
        let mut problem = swing_up(1);
        let mut program = Program::new(&mut problem, &Discretization::uniform(transcription, &[25])).unwrap();
        assert_eq!(program.variables(), typed.variables());
        assert_eq!(program.constraints(), typed.constraints());
        assert_eq!(program.variable_bounds(), typed.variable_bounds());
        assert_eq!(program.constraint_bounds(), typed.constraint_bounds());
        let x: Vec<f64> = (0..typed.variables()).map(|i| 0.3 * (1.7 * i as f64).sin()).collect();
        let y: Vec<f64> = (0..typed.constraints()).map(|i| (0.9 * i as f64).cos()).collect();
        let (found, expected) = (everything(&mut program, &x, &y), everything(&mut typed, &x, &y));
        // Rounding: sums of some hundred terms, 40 Runge-Kutta steps per interval for multiple shooting.
        for (what, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let gap = gap(found, expected);
            assert!(gap < 1e-12, "{transcription:?}: function {what} differs by {gap:e}");
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    for (transcription, _) in PAIRS {
        let outcome = |threads: usize| {
            let mut problem = swing_up(threads);
            let mut program =
                Program::new(&mut problem, &Discretization::uniform(transcription, &[10])).unwrap();
            let x: Vec<f64> = (0..program.variables()).map(|i| 0.3 * (1.7 * i as f64).sin()).collect();
            let y: Vec<f64> = (0..program.constraints()).map(|i| (0.9 * i as f64).cos()).collect();
            everything(&mut program, &x, &y)
        };
        let one = outcome(1);
        assert!(outcome(3) == one && outcome(16) == one, "{transcription:?}");
    }
}
