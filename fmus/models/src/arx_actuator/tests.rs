//! The recursion against published numbers and against a plain loop over eq. 6.

use super::*;

/// An instance without FMI: sampled steps with the command held.
struct Run {
    model: ArxActuator,
    q: Values<f64>,
}

impl Run {
    fn new(interface: Interface, set: impl FnOnce(&ArxActuator, &mut Values<f64>)) -> Self {
        let (model, table) = Table::of::<ArxActuator>();
        let mut q = table.start_values(interface);
        set(&model, &mut q);
        Self { model, q }
    }

    fn prepared(mut self) -> Self {
        self.model.prepare(&mut self.q).expect("legal parameters");
        self
    }

    /// `[F_hat, F_act]` of the sample with this command.
    fn step(&mut self, u: f64) -> [f64; 2] {
        let (m, q) = (&self.model, &mut self.q);
        q[m.u] = u;
        q.at_sample = true;
        m.equations(q).expect("the recursion has a value everywhere");
        let at_sample = [q[m.F_hat], q[m.F_act]];
        m.sample(q);
        q.at_sample = false;
        m.equations(q).expect("the recursion has a value everywhere");
        assert_eq!(at_sample, [q[m.F_hat], q[m.F_act]], "the held value is that of the sample");
        at_sample
    }
}

fn set_first_order(m: &ArxActuator, q: &mut Values<f64>, (a1, b0, b1): FirstOrder) {
    for j in 0..2 {
        (0..2).for_each(|l| q[m.A[0][j][l]] = a1[j][l]);
        (q[m.B[0][j]], q[m.B[1][j]]) = (b0[j], b1[j]);
    }
}

#[test]
fn step_response_of_eq_8_has_the_published_values() {
    let mut run = Run::new(Interface::CoSimulation, |_, _| {}).prepared();
    let response: Vec<[f64; 2]> = (0..4000).map(|_| run.step(1.0)).collect();
    for (k, expected) in [(0, 0.0764), (10, 0.29220145), (50, 0.85012267), (100, 1.05908383)] {
        assert!((response[k][1] - expected).abs() < 1e-8, "{k}: {}", response[k][1]);
    }
    let [f_hat, f_act] = response[3999]; // modulus 0.98416 to the 4000th power is below 1e-27
    assert!((f_hat - 0.98884648).abs() < 1e-8 && (f_act - 0.94626802).abs() < 1e-8, "{f_hat} {f_act}");
}

#[test]
fn toe_of_eq_12_has_the_published_poles_and_gains() {
    let mut run = Run::new(Interface::CoSimulation, |m, q| set_first_order(m, q, TOE)).prepared();
    let poles = realization::Matrix::leading(&run.model.recursion(&run.q).transition(), 2).poles();
    assert!(poles.iter().any(|p| (p.0 - 0.97915).abs() < 5e-6 && (p.1 - 0.01532).abs() < 5e-6), "{poles:?}");
    let last = (0..4000).map(|_| run.step(1.0)).last().expect("4000 samples");
    assert!((last[0] - 1.00636).abs() < 5e-6 && (last[1] - 0.98965).abs() < 5e-6, "{last:?}");
}

#[test]
fn continuous_form_of_eq_8_has_the_published_matrices() {
    let run = Run::new(Interface::ModelExchange, |m, q| q[m.realization] = CONTINUOUS).prepared();
    let form: Vec<f64> = (0..6).map(|i| run.q[run.model.continuous.at(i)]).collect();
    let expected = [
        14.87318811654313,
        -21.948463279261194,
        14.22952987496634,
        53.55018587116065,
        -46.80605822841817,
        23.2070485930766,
    ];
    for (x, e) in form.iter().zip(expected) {
        assert!((x - e).abs() < 1e-10, "{form:?}"); // 1e-12 relative
    }
}

#[test]
fn every_order_agrees_with_a_loop_over_eq_6() {
    for (na, nb, nk, ny) in
        [(1, 1, 0, 1), (4, 5, 0, 2), (2, 3, 3, 2), (3, 5, 64, 1), (1, 2, 7, 2), (4, 1, 0, 2)]
    {
        let mut run = Run::new(Interface::CoSimulation, |m, q| {
            (q[m.na], q[m.nb], q[m.nk], q[m.ny]) = (na as i32, nb as i32, nk as i32, ny as i32);
            // Every entry is set: what the orders leave out must not matter.
            for i in 0..MAX_NA {
                for j in 0..2 {
                    for l in 0..2 {
                        q[m.A[i][j][l]] = 0.11 * (1.0 + i as f64) - 0.17 * j as f64 + 0.07 * l as f64;
                    }
                }
            }
            for i in 0..MAX_NB {
                (0..2).for_each(|j| q[m.B[i][j]] = 0.5 - 0.3 * i as f64 + 0.2 * j as f64);
            }
        })
        .prepared();
        let (a, b) = {
            let (m, q) = (&run.model, &run.q);
            (m.A.map(|a| a.map(|a| a.map(|a| q[a]))), m.B.map(|b| b.map(|b| q[b])))
        };
        let command = |k: usize| (0.37 * k as f64).sin() + 0.2;
        let mut past: Vec<[f64; 2]> = Vec::new();
        for k in 0..150 {
            let mut y = [0.0; 2];
            for j in 0..ny {
                for i in 1..=na.min(k) {
                    (0..ny).for_each(|l| y[j] -= a[i - 1][j][l] * past[k - i][l]);
                }
                for i in (0..nb).filter(|i| i + nk <= k) {
                    y[j] += b[i][j] * command(k - nk - i);
                }
            }
            past.push(y);
            let expected = if ny == 2 { y } else { [y[0], y[0]] };
            let got = run.step(command(k));
            let scale = 1e-12 * (1.0 + y[0].abs().max(y[1].abs()));
            assert!(
                (got[0] - expected[0]).abs() < scale && (got[1] - expected[1]).abs() < scale,
                "na {na} nb {nb} nk {nk} ny {ny} k {k}: {got:?} {expected:?}"
            );
        }
    }
}

#[test]
fn pure_integrator_has_a_continuous_form() {
    // y(k) = y(k-1) + u(k-1): dy/dt = u / Ts.
    let run = Run::new(Interface::ModelExchange, |m, q| {
        (q[m.ny], q[m.realization]) = (1, CONTINUOUS);
        (q[m.A[0][0][0]], q[m.B[0][0]], q[m.B[1][0]]) = (-1.0, 0.0, 1.0);
    })
    .prepared();
    let (a, b) = (run.q[run.model.continuous.at(0)], run.q[run.model.continuous.at(1)]);
    assert!(a.abs() < 1e-12 && (b - 1000.0).abs() < 1e-9, "{a} {b}");
}

#[test]
fn continuous_form_is_refused_with_the_pole_in_the_message() {
    let refused = |set: &dyn Fn(&ArxActuator, &mut Values<f64>)| {
        let mut run = Run::new(Interface::ModelExchange, |m, q| {
            q[m.realization] = CONTINUOUS;
            set(m, q);
        });
        match run.model.prepare(&mut run.q) {
            Err(Refusal::Error(message)) => message,
            other => panic!("not refused: {other:?}"),
        }
    };
    let one_output = |q: &mut Values<f64>, m: &ArxActuator, a: f64| (q[m.ny], q[m.A[0][0][0]]) = (1, a);
    for (a, pole) in [(0.5, "-0.500000"), (0.0, "0.000000")] {
        let message = refused(&|m, q| one_output(q, m, a));
        assert!(message.contains(pole) && message.contains("realization = sampled"), "{message}");
    }
    let message = refused(&|m, q| q[m.nk] = 3);
    assert!(message.contains("nk + nb - 1 = 4"), "{message}");
}

#[test]
fn both_realizations_agree_at_the_samples() {
    // Two outputs, second order with poles in the right half plane, and eq. 8.
    let second_order = |m: &ArxActuator, q: &mut Values<f64>| {
        (q[m.na], q[m.nb]) = (2, 3);
        for (i, a) in [[[-1.5, 0.05], [0.02, -1.4]], [[0.56, -0.01], [0.03, 0.45]]].iter().enumerate() {
            for (j, row) in a.iter().enumerate() {
                (0..2).for_each(|l| q[m.A[i][j][l]] = row[l]);
            }
        }
        (0..2).for_each(|j| q[m.B[2][j]] = 0.1 - 0.3 * j as f64);
    };
    let eq_8 = |_: &ArxActuator, _: &mut Values<f64>| {};
    for set in [&second_order as &dyn Fn(&ArxActuator, &mut Values<f64>), &eq_8] {
        let mut sampled = Run::new(Interface::ModelExchange, set).prepared();
        let mut continuous = Run::new(Interface::ModelExchange, |m, q| {
            set(m, q);
            q[m.realization] = CONTINUOUS;
        })
        .prepared();
        let mut command = 0.37_f64;
        for k in 0..150 {
            command = (command * 3.7) * (1.0 - command); // logistic map: no pattern
            let u = 10.0 * (command - 0.5);
            let expected = sampled.step(u);
            let (m, q) = (&continuous.model, &mut continuous.q);
            q[m.u] = u;
            m.equations(q).expect("prepared");
            let got = [q[m.F_hat], q[m.F_act]];
            for (g, e) in got.iter().zip(expected) {
                assert!((g - e).abs() < 1e-11, "{k}: {got:?} {expected:?}");
            }
            // Classical Runge-Kutta; the fastest pole is at 700/s, so a step errs by (700/s h)^5 / 120 = 1e-16.
            let h = 1e-3 / 400.0;
            for _ in 0..400 {
                let z0 = m.z.map(|z| q[z]);
                let mut rates = [[0.0; MAX_STATES]; 4];
                for (stage, fraction) in [0.0, 0.5, 0.5, 1.0].into_iter().enumerate() {
                    for i in 0..MAX_STATES {
                        let rate = if stage == 0 { 0.0 } else { rates[stage - 1][i] };
                        q[m.z[i]] = z0[i] + h * fraction * rate;
                    }
                    m.equations(q).expect("prepared");
                    rates[stage] = m.der_z.map(|d| q[d]);
                }
                for i in 0..MAX_STATES {
                    let mean = (rates[0][i] + 2.0 * (rates[1][i] + rates[2][i]) + rates[3][i]) / 6.0;
                    q[m.z[i]] = z0[i] + h * mean;
                }
            }
        }
    }
}
