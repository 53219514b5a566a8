//! Columns of the Jacobian that are computed ahead: the same bits as one by one, and none from another point.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks)]

use fmi_export::{Identity, Model, Outcome, Real, Scalar, Table, Values};

#[macro_use]
mod support;

const STATES: [&str; 6] = ["x1", "x2", "x3", "x4", "x5", "x6"];

/// dx_i/dt = sin(x_i x_(i+1)) + u exp(-x_i) / 3
struct Ring {
    u: Real,
    x: [Real; 6],
    der: [Real; 6],
}

impl Model for Ring {
    const IDENTITY: Identity = Identity {
        model_identifier: "ring",
        model_name: "ring",
        description: "every state with its neighbor",
        version: "1",
        author: "me",
        generation_tool: "test",
        stop_time: 1.0,
        step_size: 0.1,
    };
    fn declare(t: &mut Table) -> Self {
        let u = t.input("u").real(0.7);
        let x = std::array::from_fn(|i| t.state(STATES[i]).output().real(0.3 * (i + 1) as f64));
        let der =
            std::array::from_fn(|i| t.derivative(format!("der(x{})", i + 1), x[i]).unit("1/s").computed());
        Self { u, x, der }
    }
    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        for i in 0..6 {
            let (x, neighbor) = (q[self.x[i]], q[self.x[(i + 1) % 6]]);
            q[self.der[i]] = (x * neighbor).sin() + q[self.u] * (-x).exp() / 3.0;
        }
        Ok(())
    }
}

importer!(Ring);

fn ready() -> Fmu {
    Fmu::started(0)
}

/// Derivatives of all rates along one known.
fn column(fmu: &Fmu, known: &str, seed: f64) -> [f64; 6] {
    let unknowns: [u32; 6] = std::array::from_fn(|i| Fmu::vr(&format!("der(x{})", i + 1)));
    let (known, mut out) = (Fmu::vr(known), [f64::NAN; 6]);
    let status = unsafe {
        fmi2_functions::fmi2GetDirectionalDerivative(
            fmu.c,
            unknowns.as_ptr(),
            6,
            &known,
            1,
            &seed,
            out.as_mut_ptr(),
        )
    };
    assert_eq!(status, Status::OK);
    out
}

/// The same by an instance that was never asked before.
fn alone(values: [f64; 7], known: &str, seed: f64) -> [f64; 6] {
    let fmu = ready();
    place(&fmu, values);
    column(&fmu, known, seed)
}

fn place(fmu: &Fmu, values: [f64; 7]) {
    let names = STATES.into_iter().chain(["u"]);
    names.zip(values).for_each(|(name, value)| fmu.set(name, value));
}

fn point(k: usize) -> [f64; 7] {
    std::array::from_fn(|i| (1.3 * (i + 7 * k) as f64).sin())
}

#[test]
fn a_column_has_the_same_bits_whatever_was_asked_before() {
    let fmu = ready();
    let orders = [
        vec!["x1", "x2", "x3", "x4", "x5", "x6", "u"],
        vec!["x1", "x2", "x3", "x4", "x5", "x6", "u"],
        vec!["u", "x6", "x2", "x2", "x1", "x5"],
        vec!["x3"],
        vec!["x4", "x3", "x4", "x3", "u", "x1", "x6"],
        vec!["x1", "x2", "x3", "x4", "x5", "x6", "u"],
    ];
    for (k, order) in orders.iter().enumerate() {
        place(&fmu, point(k));
        for known in order {
            assert_eq!(column(&fmu, known, 1.0), alone(point(k), known, 1.0), "point {k}, {known}");
        }
        assert_eq!(column(&fmu, "x2", -0.7), alone(point(k), "x2", -0.7), "point {k}, another seed");
    }
}

#[test]
fn columns_belong_to_the_point_at_which_they_are_asked_for() {
    let fmu = ready();
    let (here, mut there) = (point(1), point(1));
    there[2] += 0.1;
    for _ in 0..2 {
        place(&fmu, here);
        STATES.iter().for_each(|known| _ = column(&fmu, known, 1.0));
    }
    // One input, one state, and a state of the FMU that was kept.
    let mut kept: FmuState = std::ptr::null_mut();
    assert_eq!(unsafe { fmi2_functions::fmi2GetFMUstate(fmu.c, &mut kept) }, Status::OK);
    column(&fmu, "x1", 1.0);
    fmu.set("x3", there[2]);
    assert_eq!(column(&fmu, "x2", 1.0), alone(there, "x2", 1.0));
    column(&fmu, "x1", 1.0);
    // Both states have computed outputs: nothing but the restoration says that the point is another.
    assert_eq!(unsafe { fmi2_functions::fmi2SetFMUstate(fmu.c, kept) }, Status::OK);
    assert_eq!(column(&fmu, "x2", 1.0), alone(here, "x2", 1.0));
    assert_eq!(unsafe { fmi2_functions::fmi2FreeFMUstate(fmu.c, &mut kept) }, Status::OK);
}

#[test]
fn values_that_come_with_derivatives_are_those_of_the_equations() {
    let fmu = ready();
    let rates = |fmu: &Fmu| -> [f64; 6] { std::array::from_fn(|i| fmu.get(&format!("der(x{})", i + 1))) };
    // The first column at the first point is a pass of its own, later ones bring others along; another seed never does.
    for (k, seed) in [(0, 1.0), (1, 1.0), (2, 1.0), (3, -0.4)] {
        place(&fmu, point(k));
        column(&fmu, "x1", seed);
        column(&fmu, "x2", seed);
        let plain = ready();
        place(&plain, point(k));
        assert_eq!(rates(&fmu), rates(&plain), "point {k}");
    }
}
