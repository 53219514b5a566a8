//! A state whose initial value follows from a parameter: until the start the model sets it, afterwards the importer
//! may.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks)]

use fmi_export::{Identity, Model, Outcome, Real, Scalar, Table, Values};

#[macro_use]
mod support;

/// dx/dt = -x, x(0) = a²
struct Decay {
    a: Real,
    x: Real,
    der_x: Real,
}

impl Model for Decay {
    const IDENTITY: Identity = Identity {
        model_identifier: "decay",
        model_name: "decay",
        description: "decays from a squared",
        version: "1",
        author: "me",
        generation_tool: "test",
        stop_time: 1.0,
        step_size: 0.1,
    };
    fn declare(t: &mut Table) -> Self {
        let a = t.parameter("a").real(3.0);
        let x = t.computed_state("x").output().computed();
        Self { a, x, der_x: t.derivative("der(x)", x).unit("1/s").computed() }
    }
    fn initialize<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        q[self.x] = q[self.a].squared();
        Ok(())
    }
    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        q[self.der_x] = -q[self.x];
        Ok(())
    }
}

importer!(Decay);

const MODEL_EXCHANGE: i32 = 0;
const CO_SIMULATION: i32 = 1;

fn in_initialization_mode(kind: i32) -> Fmu {
    let fmu = Fmu::new(kind);
    unsafe {
        assert_eq!(fmi2_functions::fmi2SetupExperiment(fmu.c, 0, 0.0, 0.0, 0, 0.0), Status::OK);
        assert_eq!(fmi2_functions::fmi2EnterInitializationMode(fmu.c), Status::OK);
    }
    fmu
}

#[test]
fn initial_value_and_its_derivative_follow_the_parameter() {
    for kind in [MODEL_EXCHANGE, CO_SIMULATION] {
        let fmu = in_initialization_mode(kind);
        assert_eq!((fmu.get("x"), fmu.get("der(x)")), (9.0, -9.0));
        fmu.set("a", -5.0);
        assert_eq!((fmu.get("x"), fmu.get("der(x)")), (25.0, -25.0));
        let (unknown, known, mut slope) = ([Fmu::vr("x"), Fmu::vr("der(x)")], Fmu::vr("a"), [0.0; 2]);
        let status = unsafe {
            fmi2_functions::fmi2GetDirectionalDerivative(
                fmu.c,
                unknown.as_ptr(),
                2,
                &known,
                1,
                &1.0,
                slope.as_mut_ptr(),
            )
        };
        assert_eq!((status, slope), (Status::OK, [-10.0, 10.0]));
    }
}

#[test]
fn it_cannot_be_set_before_the_start() {
    let fmu = in_initialization_mode(CO_SIMULATION);
    assert_eq!(fmu.try_set("x", 1.0), Status::Error);
    assert!(fmu.last_message().contains("`x`"), "{}", fmu.last_message());
}

#[test]
fn simulation_starts_there_and_goes_on_from_it() {
    let fmu = Fmu::started(CO_SIMULATION);
    for k in 0..10 {
        assert_eq!(fmu.step(0.1 * f64::from(k), 0.1), Status::OK);
    }
    // RK4 with 1 ms.
    assert!((fmu.get("x") - 9.0 * (-1.0f64).exp()).abs() < 1e-11);
}

#[test]
fn model_structure_lists_it_as_unknown_of_the_initialization() {
    let structure = fmi_export::Definition::<Decay>::new().structure();
    let names = |i: usize| Fmu::table().variables()[i].name.clone();
    let unknowns: Vec<(String, Vec<String>)> = structure
        .initial_unknowns
        .iter()
        .map(|u| (names(u.variable), u.dependencies.iter().map(|(i, _)| names(*i)).collect()))
        .collect();
    let of_a = |name: &str| (name.to_owned(), vec!["a".to_owned()]);
    assert_eq!(unknowns, [of_a("x"), of_a("der(x)")]);
}
