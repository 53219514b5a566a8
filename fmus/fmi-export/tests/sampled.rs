//! A sampled update in front of a continuous lag: sample times, event iteration, input ramps, derivatives.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks)]

use fmi_export::{Identity, MemoryBlock, Model, Outcome, Real, Scalar, Table, Values};

#[macro_use]
mod support;

const TS: f64 = 0.01;
const A: f64 = 0.9;
const B: f64 = 0.3;
const C: f64 = 0.2;

/// y(k) = z(k) + B u(k), z(k+1) = A z(k) + C u(k), held; dx/dt = (u - x) / 0.1.
struct Filter {
    u: Real,
    y: Real,
    x: Real,
    der_x: Real,
    held: MemoryBlock,
}

impl Model for Filter {
    const IDENTITY: Identity = Identity {
        model_identifier: "filter",
        model_name: "filter",
        description: "sampled filter and continuous lag",
        version: "1",
        author: "test",
        generation_tool: "test",
        stop_time: 1.0,
        step_size: 0.01,
    };

    fn declare(t: &mut Table) -> Self {
        let u = t.input("u").real(0.0);
        let y = t.output("y").discrete().computed();
        let x = t.state("x").output().real(0.0);
        let der_x = t.derivative("der(x)", x).unit("1/s").computed();
        let held = t.memory(2);
        Filter { u, y, x, der_x, held }
    }

    fn equations<S: Scalar>(&self, v: &mut Values<S>) -> Outcome {
        let z = v[self.held.at(0)];
        v[self.y] = if v.at_sample { z + v[self.u] * B } else { v[self.held.at(1)] };
        v[self.der_x] = (v[self.u] - v[self.x]) / 0.1;
        Ok(())
    }

    fn sample_period(&self, _: &Values<f64>) -> Option<f64> {
        Some(TS)
    }

    fn sample(&self, v: &mut Values<f64>) {
        let (z, u) = (self.held.at(0), v[self.u]);
        v[self.held.at(1)] = v[self.y];
        v[z] = A * v[z] + C * u;
    }
}

importer!(Filter);

/// Outputs of the recursion for u(k), k = 0, 1, ...
fn recursion(u: impl Fn(usize) -> f64, n: usize) -> Vec<f64> {
    let mut z = 0.0;
    (0..n)
        .map(|k| {
            let y = z + B * u(k);
            z = A * z + C * u(k);
            y
        })
        .collect()
}

fn command(k: usize) -> f64 {
    ((k * 7919) % 13) as f64 - 6.0
}

#[test]
fn one_step_per_sample_reports_the_value_held_over_the_interval() {
    let fmu = Fmu::started(1);
    let expected = recursion(command, 100);
    for (k, y) in expected.iter().enumerate() {
        fmu.set("u", command(k));
        // Communication points are added up here as an importer might do, and drift by rounding.
        assert_eq!(fmu.step(k as f64 * TS, TS), Status::OK, "{}", fmu.last_message());
        assert_eq!(fmu.get("y").to_bits(), y.to_bits(), "sample {k}");
    }
}

#[test]
fn any_communication_step_takes_the_same_samples() {
    for h in [TS / 4.0, 0.3 * TS, 0.007, 2.0 * TS, 3.7 * TS] {
        let fmu = Fmu::started(1);
        // The command changes at communication points only; sample k sees the input of the step it falls into.
        let steps = (0.5 / h) as usize;
        let mut seen = Vec::new();
        let mut t = 0.0;
        for i in 0..steps {
            fmu.set("u", command(i));
            assert_eq!(fmu.step(t, h), Status::OK, "{}", fmu.last_message());
            t += h;
            while (seen.len() as f64) * TS < t - 1e-9 {
                seen.push(command(i));
            }
            let expected = recursion(|k| seen[k], seen.len());
            assert_eq!(fmu.get("y").to_bits(), expected.last().unwrap().to_bits(), "h = {h}, step {i}");
        }
    }
}

#[test]
fn outputs_follow_the_input_before_the_first_step() {
    let fmu = Fmu::new(1);
    fmu.set("u", 2.0);
    fmu.start();
    assert_eq!(fmu.get("y"), B * 2.0);
    fmu.set("u", -1.0);
    assert_eq!(fmu.step(0.0, TS), Status::OK);
    assert_eq!(fmu.get("y"), -B, "the sample saw the input of the step");
}

#[test]
fn model_exchange_takes_the_sample_of_an_event_once_whatever_the_event_iteration() {
    let fmu = Fmu::started(0);
    let expected = recursion(command, 50);
    for (k, y) in expected.iter().enumerate() {
        if k > 0 {
            unsafe {
                assert_eq!(fmi2_functions::fmi2SetTime(fmu.c, k as f64 * TS), Status::OK);
                assert_eq!(fmi2_functions::fmi2EnterEventMode(fmu.c), Status::OK);
            }
        }
        fmu.set("u", 99.0);
        fmu.new_discrete_states();
        assert_ne!(fmu.get("y"), *y, "the sample of the wrong command");
        fmu.set("u", command(k)); // upstream settled later in the same event
        let info = fmu.new_discrete_states();
        assert!((info.next_event_time - (k + 1) as f64 * TS).abs() < 1e-12);
        unsafe { assert_eq!(fmi2_functions::fmi2EnterContinuousTimeMode(fmu.c), Status::OK) };
        assert_eq!(fmu.get("y").to_bits(), y.to_bits(), "sample {k}");
        fmu.set("u", 50.0);
        assert_eq!(fmu.get("y").to_bits(), y.to_bits(), "held between events");
    }
}

/// Error of x after 1 s for u = sin 5t with the input derivatives up to `order` given at each step.
fn ramp_error(h: f64, order: i32) -> f64 {
    let fmu = Fmu::started(1);
    let w: f64 = 5.0;
    let n = (1.0 / h).round() as usize;
    for i in 0..n {
        let t = i as f64 * h;
        fmu.set("u", (w * t).sin());
        for (k, rate) in
            [(1, w * (w * t).cos()), (2, -w * w * (w * t).sin()), (3, -w.powi(3) * (w * t).cos())]
        {
            if k <= order {
                fmu.ramp("u", k, rate);
            }
        }
        assert_eq!(fmu.step(t, h), Status::OK);
    }
    // dx/dt = a (sin wt - x), x(0) = 0
    let a = 10.0f64;
    let exact = a / (a * a + w * w) * (a * w.sin() - w * w.cos() + w * (-a).exp());
    (fmu.get("x") - exact).abs()
}

#[test]
fn input_derivatives_of_order_n_give_convergence_of_order_n_plus_one() {
    for order in 0..=3 {
        let observed = (ramp_error(0.02, order) / ramp_error(0.01, order)).log2();
        assert!((observed - f64::from(order + 1)).abs() < 0.25, "order {order}: observed {observed}");
    }
}

#[test]
fn output_derivatives_are_those_of_the_equations() {
    let fmu = Fmu::started(1);
    fmu.set("u", 1.0);
    fmu.ramp("u", 1, 3.0);
    assert_eq!(fmu.step(0.0, 0.1), Status::OK);
    let (mut slope, order) = (f64::NAN, 1);
    let x = Fmu::vr("x");
    let status = unsafe { fmi2_functions::fmi2GetRealOutputDerivatives(fmu.c, &x, 1, &order, &mut slope) };
    assert_eq!(status, Status::OK);
    assert!((fmu.get("u") - 1.3).abs() < 1e-15, "the input stays where its ramp ended");
    assert_eq!(slope, 0.0 + fmu.get("der(x)") * 1.0, "x is a state: its slope is its derivative");
}

#[test]
fn wrong_input_derivatives_are_refused() {
    let call = |fmu: &Fmu, vr: u32, order: i32, rate: f64| unsafe {
        fmi2_functions::fmi2SetRealInputDerivatives(fmu.c, &vr, 1, &order, &rate)
    };
    assert_eq!(call(&Fmu::started(1), Fmu::vr("u"), 1, f64::NAN), Status::Discard);
    assert_eq!(call(&Fmu::started(1), Fmu::vr("u"), 0, 1.0), Status::Error);
    assert_eq!(call(&Fmu::started(1), Fmu::vr("u"), 4, 1.0), Status::Error);
    assert_eq!(call(&Fmu::started(1), Fmu::vr("y"), 1, 1.0), Status::Error);
    assert_eq!(call(&Fmu::started(0), Fmu::vr("u"), 1, 1.0), Status::Error, "Model Exchange has no steps");
}
