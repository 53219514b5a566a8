//! Faults are reported by name, place and unit.

use airloop_ocp::transcription::{
    Discretization, Duration, Error, Limit, Link, Mesh, Program, Shooting, Transcription, Variable,
};
use airloop_optim::Nlp;

use crate::cart_pole::swing_up;
use crate::derivatives;

fn refused(
    transcription: Transcription,
    meshes: Vec<Mesh>,
    change: impl Fn(&mut airloop_ocp::transcription::Phase),
) -> Error {
    let mut problem = swing_up(1);
    change(&mut problem.phases[0]);
    match Program::new(&mut problem, &Discretization { transcription, meshes }) {
        Ok(_) => panic!("it was accepted"),
        Err(error) => error,
    }
}

#[test]
fn a_violated_stroke_reads_as_in_the_workshop() {
    let mut problem = swing_up(1);
    let discretization = Discretization::uniform(Transcription::HermiteSimpson, &[50]);
    let mut program = Program::new(&mut problem, &discretization).unwrap();
    let mut x = vec![0.0; program.variables()];
    // The cart at knot 32, t = 1.28 s, 3 mm beyond its stroke.
    x[32 * 8] = 0.153;
    let violations = program.violations(&x, 1e-8).unwrap();
    let found: Vec<String> = violations.iter().map(|violation| violation.to_string()).collect();
    let expected = "stroke: |x| <= 0.15 m at t = 1.28 s violated by 3 mm";
    assert!(found.iter().any(|sentence| sentence == expected), "{found:?}");
    assert_eq!(violations[0].name, "end", "{found:?}");
    assert_eq!(program.variable_name(32 * 8 + 7), "u at t = 1.3000 s");
    assert_eq!(program.constraint_name(32 * 6 + 1), "defect of theta after t = 1.2800 s");
}

#[test]
fn constraints_of_several_phases_are_named_after_theirs() {
    let (mut problem, meshes) = derivatives::problem(true);
    let transcription = Transcription::HermiteSimpson;
    let mut program = Program::new(&mut problem, &Discretization { transcription, meshes }).unwrap();
    let x = vec![1.0; program.variables()];
    let mut values = vec![0.0; program.constraints()];
    program.constraint_values(&x, &mut values).unwrap();
    let names: Vec<String> = (0..program.constraints()).map(|row| program.constraint_name(row)).collect();
    for expected in [
        "first: mixed: angle - 0.5 g0 + 2 valve + 0.5 angle at t = 0.0000 s",
        "second: defect of pressure after t = 1.5000 s",
        "first: one duration for the phase at t = 0.3000 s",
        "second: slew at t = 1.0000 s",
        "reset of speed at t = 1.0000 s",
        "continuity of valve at t = 1.0000 s",
        "impulse at t = 1.0000 s",
    ] {
        assert!(names.iter().any(|name| name == expected), "{expected}: {names:?}");
    }
}

#[test]
fn what_makes_no_sense_is_refused_with_a_remedy() {
    let mesh = |n| vec![Mesh::uniform(n)];
    let hs = Transcription::HermiteSimpson;
    let ms = Transcription::MultipleShooting;
    let error = refused(ms, mesh(300), |_| ());
    assert!(matches!(&error, Error::Samples { interval: 0, .. }), "{error}");
    assert!(error.to_string().contains("whole number of samples of 0.001 s"), "{error}");
    let free = Duration::Free { lower: 1.0, upper: 3.0 };
    let error = refused(ms, mesh(50), |phase| phase.duration = free);
    assert!(error.to_string().contains("fixed duration"), "{error}");
    let error =
        refused(hs, mesh(50), |phase| phase.start.push(Limit::equal("far", "m", Variable::State(0), 1.0)));
    assert!(error.to_string().contains("`far`") && error.to_string().contains("no value lies"), "{error}");
    let error = refused(hs, mesh(50), |phase| phase.end[0].quantity = Variable::Output(3).into());
    assert!(matches!(&error, Error::Variable { kind: "output", index: 3, count: 0, .. }), "{error}");
    let error = refused(hs, mesh(50), |phase| phase.duration = Duration::Fixed(f64::NAN));
    assert!(matches!(&error, Error::Value { .. }), "{error}");
    let error = refused(hs, vec![], |_| ());
    assert!(matches!(&error, Error::Count { what: "meshes", .. }), "{error}");
    let error = refused(hs, mesh(50), |phase| phase.dynamics.clear());
    assert!(matches!(&error, Error::NoDynamics { .. }), "{error}");
    let declared = Shooting::Sampled { states: vec![2], sample_time: 1e-3 };
    let error = refused(ms, mesh(50), |phase| phase.shooting = declared.clone());
    assert!(matches!(&error, Error::NotLinear { state, .. } if state == "v"), "{error}");
    let (mut problem, meshes) = derivatives::problem(false);
    problem.links = vec![Link { inputs: vec![(7, 0)], ..Link::continuous() }];
    let error = Program::new(&mut problem, &Discretization { transcription: hs, meshes }).err().unwrap();
    assert!(matches!(&error, Error::Link { .. }), "{error}");
}

#[test]
fn an_evaluation_that_fails_says_where() {
    let (mut problem, meshes) = derivatives::problem(false);
    let transcription = Transcription::HermiteSimpsonSeparated;
    let mut program = Program::new(&mut problem, &Discretization { transcription, meshes }).unwrap();
    let mut x = vec![0.0; program.variables()];
    // Angle of the second node of the first phase, t = 0.45 s.
    x[10] = 200.0;
    let error = program.objective(&x).unwrap_err().to_string();
    assert!(
        error.contains("arm in phase `first` at t = 0.450000 s") && error.contains("out of range"),
        "{error}"
    );
    x[10] = 0.0;
    assert!(program.objective(&x).is_ok());
}
