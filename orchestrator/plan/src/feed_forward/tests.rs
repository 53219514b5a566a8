use super::*;
use nalgebra::{DMatrix, DVector};

/// Toe of the walker (eq. 12): y(k) + A1 y(k-1) = B0 u(k) + B1 u(k-1), state s = y - B0 u; the second output counts.
fn toe() -> Actuator {
    let (a1, b0, b1) = ([[-1.0081, 0.0240], [-0.0447, -0.9502]], [0.6297, 0.0503], [-0.6141, -0.0460]);
    let a: Vec<f64> = a1.iter().flatten().map(|a| -a).collect();
    let b = (0..2).map(|i| b1[i] - (a1[i][0] * b0[0] + a1[i][1] * b0[1])).collect();
    Actuator::new(a, b, vec![0.0, 1.0], b0[1]).expect("shapes agree")
}

const LIMIT: f64 = 527.7876;

fn settings(smoothness: f64) -> Settings {
    Settings { lower: -LIMIT, upper: LIMIT, scale: LIMIT, smoothness }
}

/// A force that rises and falls within half a second.
fn plan(n: usize) -> Vec<f64> {
    (0..n).map(|k| 70.0 - 75.0 * (std::f64::consts::PI * k as f64 / 500.0).sin().powi(2)).collect()
}

#[test]
fn steady_gain_and_step_response_are_those_of_eq_12() {
    let toe = toe();
    assert!((toe.gain().expect("stable") - 0.98965).abs() < 5e-6);
    // Eq. 12 written out, from rest.
    let (mut y, mut u_before) = ([0.0, 0.0], 0.0);
    let commands: Vec<f64> = (0..60).map(|k| (0.3 * f64::from(k)).sin()).collect();
    let simulated = toe.simulate(vec![0.0; 2], &commands);
    for (u, simulated) in commands.iter().zip(simulated) {
        y = [
            1.0081 * y[0] - 0.0240 * y[1] + 0.6297 * u - 0.6141 * u_before,
            0.0447 * y[0] + 0.9502 * y[1] + 0.0503 * u - 0.0460 * u_before,
        ];
        u_before = *u;
        assert!((simulated - y[1]).abs() < 1e-13);
    }
}

#[test]
fn without_active_bounds_the_command_is_the_least_squares_solution() {
    // Response of y to every command in one dense matrix, solved by QR.
    let (toe, plan, weight) = (toe(), plan(80), 1e-2f64);
    let n = plan.len();
    let (state, before) = start(&toe, &plan, settings(weight)).expect("within reach");
    let free = toe.simulate(state, &vec![0.0; n]);
    let mut matrix = DMatrix::zeros(2 * n, n);
    let mut right = DVector::zeros(2 * n);
    for k in 0..n {
        let mut pulse = vec![0.0; n];
        pulse[k] = 1.0;
        let column = toe.simulate(vec![0.0; 2], &pulse);
        (0..n).for_each(|i| matrix[(i, k)] = column[i]);
        matrix[(n + k, k)] = weight.sqrt();
        if k > 0 {
            matrix[(n + k, k - 1)] = -weight.sqrt();
        }
        right[k] = plan[k] - free[k];
    }
    right[n] = weight.sqrt() * before;
    let qr = matrix.qr();
    let expected = qr.r().solve_upper_triangular(&(qr.q().transpose() * right)).expect("full rank");
    let command = invert(&toe, &plan, settings(weight)).expect("solved");
    for (u, expected) in command.u.iter().zip(expected.iter()) {
        // The solver stops at 1e-9 of the scale.
        assert!((u - expected).abs() < 1e-5 * LIMIT, "{u} {expected}");
    }
}

#[test]
fn commands_at_a_bound_press_against_it() {
    // The gradient of the objective by every command, by differences: 0 inside, outward at a bound.
    let toe = toe();
    let plan: Vec<f64> =
        (0..500).map(|k| 30.0 * (2.0 * std::f64::consts::PI * f64::from(k) / 500.0).sin()).collect();
    let tight = Settings { lower: -25.0, upper: 25.0, ..settings(1e-2) };
    let command = invert(&toe, &plan, tight).expect("solved");
    let (state, before) = start(&toe, &plan, tight).expect("within reach");
    let objective = |u: &[f64]| -> f64 {
        let y = toe.simulate(state.clone(), u);
        let errors: f64 = y.iter().zip(&plan).map(|(y, p)| ((y - p) / LIMIT).powi(2)).sum();
        let changes = std::iter::once(&before).chain(u).zip(u).map(|(a, b)| ((b - a) / LIMIT).powi(2));
        errors + 1e-2 * changes.sum::<f64>()
    };
    let mut met = [0; 3];
    for k in (0..500).step_by(7) {
        let mut moved = command.u.clone();
        moved[k] += 0.5;
        let above = objective(&moved);
        moved[k] -= 1.0;
        let slope = above - objective(&moved); // exact for a quadratic
        let u = command.u[k];
        let side = if u < -25.0 + 1e-3 {
            0
        } else if u > 25.0 - 1e-3 {
            2
        } else {
            1
        };
        met[side] += 1;
        match side {
            0 => assert!(slope > -1e-9, "{k}: {slope}"),
            2 => assert!(slope < 1e-9, "{k}: {slope}"),
            _ => assert!(slope.abs() < 1e-8, "{k}: {slope}"),
        }
    }
    assert!(met.iter().all(|m| *m > 0), "{met:?}");
}

#[test]
fn inverted_command_fits_where_the_direct_one_is_late() {
    let (toe, plan) = (toe(), plan(500));
    let inverted = invert(&toe, &plan, settings(1e-2)).expect("solved");
    let direct = direct(&toe, &plan, settings(1e-2)).expect("within reach");
    let percent = |command: &Command| command.fit.nrmse_percent.expect("the plan moves");
    assert!(percent(&inverted) > 99.0, "{}", percent(&inverted));
    assert!(percent(&direct) < 80.0, "{}", percent(&direct));
    // Delay of the actuator at low frequency: minus the slope of its phase, from the transfer function.
    let phase = |w: f64| {
        use nalgebra::Complex;
        let z = Complex::new(0.0, w).exp();
        let s = |i: usize, j: usize| Complex::from(toe.a()[2 * i + j]);
        let det = (z - s(0, 0)) * (z - s(1, 1)) - s(0, 1) * s(1, 0);
        let second = (s(1, 0) * toe.b()[0] + (z - s(0, 0)) * toe.b()[1]) / det + toe.d();
        second.arg()
    };
    let delay = -phase(1e-3) / 1e-3;
    assert!((direct.late as f64 - delay).abs() < 6.0 && direct.late > 10, "{} {delay}", direct.late);
    assert!(inverted.late.abs() <= 1, "{}", inverted.late);
}

#[test]
fn more_weight_on_changes_makes_them_smaller_and_the_fit_worse() {
    let (toe, plan) = (toe(), plan(400));
    let measure = |smoothness: f64| {
        let command = invert(&toe, &plan, settings(smoothness)).expect("solved");
        let changes: f64 = command.u.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
        (changes, command.fit.rms_error)
    };
    let all = [1e-4, 1e-2, 1.0].map(measure);
    assert!(all.windows(2).all(|w| w[0].0 > w[1].0 && w[0].1 < w[1].1), "{all:?}");
}

#[test]
fn sampled_continuous_model_is_exact_at_the_samples() {
    // dx/dt = -x / tau + u / tau: x(k+1) = e x(k) + (1 - e) u(k).
    let actuator = Actuator::sampled(&[-20.0], &[20.0], vec![1.0], 0.0, 0.01).expect("shapes agree");
    let e = (-0.2f64).exp();
    assert!((actuator.a()[0] - e).abs() < 1e-15 && (actuator.b()[0] - (1.0 - e)).abs() < 1e-15);
}

#[test]
fn what_cannot_be_is_named() {
    let toe = toe();
    let say = |error: Result<Command, Error>| error.expect_err("refused").to_string();
    assert!(say(invert(&toe, &[], settings(1.0))).contains("no samples"));
    assert!(say(invert(&toe, &[1.0, f64::NAN], settings(1.0))).contains("sample 1"));
    assert!(say(invert(&toe, &[600.0], settings(1.0))).contains("606.2"));
    assert!(say(invert(&toe, &[1.0], settings(-1.0))).contains("smoothness = -1"));
    let integrator = Actuator::new(vec![1.0], vec![1.0], vec![1.0], 0.0).expect("shapes agree");
    assert!(say(invert(&integrator, &[1.0], settings(1.0))).contains("pole at 1"));
    assert!(Actuator::new(vec![1.0], vec![1.0, 2.0], vec![1.0, 0.0], 0.0).is_err());
}
