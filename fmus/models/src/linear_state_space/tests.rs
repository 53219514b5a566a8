//! The system against a plain loop over its equations, the ARX recursion, and its own continuous form.

use super::*;
use crate::ArxActuator;

type Setup<'a> = &'a dyn Fn(&LinearStateSpace, &mut Values<f64>);

fn instance(interface: Interface, set: Setup<'_>) -> (LinearStateSpace, Values<f64>) {
    let (model, table) = Table::of::<LinearStateSpace>();
    let mut q = table.start_values(interface);
    set(&model, &mut q);
    (model, q)
}

/// Outputs of the sample with these inputs.
fn step(m: &LinearStateSpace, q: &mut Values<f64>, u: [f64; MAX_NU]) -> [f64; MAX_NY] {
    m.u.iter().zip(u).for_each(|(variable, u)| q[*variable] = u);
    q.at_sample = true;
    m.equations(q).expect("a linear system has a value everywhere");
    let at_sample = m.y.map(|y| q[y]);
    m.sample(q);
    q.at_sample = false;
    m.equations(q).expect("a linear system has a value everywhere");
    assert_eq!(at_sample, m.y.map(|y| q[y]), "the held value is that of the sample");
    at_sample
}

/// A number in (-0.5, 0.5) for each place, without pattern.
fn number(i: usize, j: usize, k: usize) -> f64 {
    ((12.9898 * i as f64 + 78.233 * j as f64 + 37.719 * k as f64 + 1.0).sin() * 43758.5453).fract() / 2.0
}

/// Every matrix filled to its full size: what the numbers of states, inputs and outputs leave out must not matter.
fn fill(m: &LinearStateSpace, q: &mut Values<f64>) {
    for i in 0..MAX_NX {
        (0..MAX_NX).for_each(|j| q[m.A[i][j]] = 0.3 * number(i, j, 0) + if i == j { 0.4 } else { 0.0 });
        (0..MAX_NU).for_each(|j| q[m.B[i][j]] = number(i, j, 1));
        (0..MAX_NY).for_each(|j| q[m.C[j][i]] = number(i, j, 2));
        q[m.x[i]] = number(i, 0, 3);
    }
    for j in 0..MAX_NY {
        (0..MAX_NU).for_each(|i| q[m.D[j][i]] = number(i, j, 4));
        q[m.y_offset[j]] = number(j, 0, 5);
        q[m.u_offset[j]] = number(j, 1, 5);
    }
}

#[test]
fn every_size_and_delay_agrees_with_a_loop_over_the_equations() {
    for (nx, nu, ny, delays) in [
        (12, 4, 4, [0, 0, 0, 0]),
        (1, 1, 1, [64, 0, 0, 0]),
        (5, 3, 2, [0, 1, 7, 0]),
        (12, 4, 4, [2, 0, 64, 5]),
    ] {
        let (m, mut q) = instance(Interface::CoSimulation, &|m, q| {
            fill(m, q);
            (q[m.n_x], q[m.n_u], q[m.n_y]) = (nx as i32, nu as i32, ny as i32);
            m.nk.iter().zip(delays).for_each(|(nk, delay)| q[*nk] = delay as i32);
        });
        let input = |k: usize, i: usize| (0.3 * k as f64 + i as f64).sin();
        let mut x: Vec<f64> = (0..nx).map(|i| q[m.x[i]]).collect();
        for k in 0..150 {
            let w: Vec<f64> = (0..nu)
                .map(|i| if k < delays[i] { 0.0 } else { input(k - delays[i], i) - q[m.u_offset[i]] })
                .collect();
            let row = |of_x: &dyn Fn(usize) -> Real, of_w: &dyn Fn(usize) -> Real| -> f64 {
                let states: f64 = (0..nx).map(|j| q[of_x(j)] * x[j]).sum();
                states + (0..nu).map(|j| q[of_w(j)] * w[j]).sum::<f64>()
            };
            let mut expected = [0.0; MAX_NY];
            for (j, y) in expected.iter_mut().enumerate().take(ny) {
                *y = row(&|i| m.C[j][i], &|i| m.D[j][i]) + q[m.y_offset[j]];
            }
            x = (0..nx).map(|i| row(&|j| m.A[i][j], &|j| m.B[i][j])).collect();
            let got = step(&m, &mut q, std::array::from_fn(|i| input(k, i)));
            let error = got.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(error < 1e-12, "nx {nx} nu {nu} ny {ny} k {k}: {got:?} {expected:?}");
        }
    }
}

#[test]
fn start_values_are_the_actuator_of_eq_8() {
    let (m, mut q) = instance(Interface::CoSimulation, &|_, _| {});
    let (arx, table) = Table::of::<ArxActuator>();
    let mut p = table.start_values(Interface::CoSimulation);
    for k in 0..300 {
        let u = (0.1 * k as f64).sin() * 30.0;
        let y = step(&m, &mut q, [u, 9.0, 9.0, 9.0]);
        p[arx.u] = u;
        p.at_sample = true;
        arx.equations(&mut p).expect("the recursion has a value everywhere");
        assert!((y[0] - p[arx.F_hat]).abs() < 1e-12 && (y[1] - p[arx.F_act]).abs() < 1e-12, "{k}: {y:?}");
        assert_eq!(y[2..], [0.0, 0.0]);
        arx.sample(&mut p);
    }
}

#[test]
fn continuous_form_passes_through_the_samples() {
    let all = |m: &LinearStateSpace, q: &mut Values<f64>| {
        fill(m, q);
        (q[m.n_x], q[m.n_u], q[m.n_y]) = (12, 4, 4);
        // Poles close to 1, as those of a plant that is sampled fast.
        (0..MAX_NX).for_each(|i| (0..MAX_NX).for_each(|j| q[m.A[i][j]] *= 0.2));
        (0..MAX_NX).for_each(|i| q[m.A[i][i]] += 0.8);
    };
    let (m, mut sampled) = instance(Interface::ModelExchange, &all);
    let (_, mut q) = instance(Interface::ModelExchange, &|m, q| {
        all(m, q);
        q[m.realization] = CONTINUOUS;
    });
    m.prepare(&mut q).expect("poles in the right half plane");
    for k in 0..20 {
        let u = std::array::from_fn(|i| number(k, i, 6));
        let expected = step(&m, &mut sampled, u);
        m.u.iter().zip(u).for_each(|(variable, u)| q[*variable] = u);
        m.equations(&mut q).expect("prepared");
        for (y, expected) in m.y.iter().zip(expected) {
            assert!((q[*y] - expected).abs() < 1e-11, "{k}");
        }
        // Classical Runge-Kutta; the fastest pole is slower than 2000/s, so a step errs by (2 / 200)^5 / 120 = 1e-12.
        let h = 1e-3 / 200.0;
        for _ in 0..200 {
            let x0 = m.x.map(|x| q[x]);
            let mut rates = [[0.0; MAX_NX]; 4];
            for (stage, part) in [0.0, 0.5, 0.5, 1.0].into_iter().enumerate() {
                for i in 0..MAX_NX {
                    q[m.x[i]] = x0[i] + if stage == 0 { 0.0 } else { h * part * rates[stage - 1][i] };
                }
                m.equations(&mut q).expect("prepared");
                rates[stage] = m.der_x.map(|d| q[d]);
            }
            for i in 0..MAX_NX {
                q[m.x[i]] = x0[i] + h / 6.0 * (rates[0][i] + 2.0 * (rates[1][i] + rates[2][i]) + rates[3][i]);
            }
        }
    }
}

#[test]
fn what_has_no_continuous_form_is_refused_with_the_reason() {
    let refused = |set: Setup<'_>| {
        let (m, mut q) = instance(Interface::ModelExchange, &|m, q| {
            q[m.realization] = CONTINUOUS;
            set(m, q);
        });
        match m.prepare(&mut q) {
            Err(Refusal::Error(message)) => message,
            other => panic!("{other:?}"),
        }
    };
    let delay = refused(&|m, q| q[m.nk[0]] = 3);
    assert!(delay.contains("nk[1] = 3") && delay.contains("realization = sampled"), "{delay}");
    for (pole, expected) in [(-0.5, "a pole at -0.5"), (0.0, "a pole at 0")] {
        let message = refused(&|m, q| {
            (q[m.A[0][0]], q[m.A[0][1]], q[m.A[1][0]]) = (pole, 0.0, 0.0);
        });
        assert!(message.contains(expected) && message.contains("realization = sampled"), "{message}");
    }
    // The delay of an input that is not in use does not matter.
    let (m, mut q) = instance(Interface::ModelExchange, &|m, q| {
        (q[m.realization], q[m.nk[3]]) = (CONTINUOUS, 3);
    });
    assert_eq!(m.prepare(&mut q), Ok(()));
}
