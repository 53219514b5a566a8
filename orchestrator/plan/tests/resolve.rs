//! A problem file that is solved again: other parameters and bounds, against the same problem opened anew.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::time::Instant;

use airloop_optim::Status;
use airloop_plan::file::{Source, parse};
use airloop_plan::prepare::{Prepared, prepare_statement};
use airloop_plan::solver::Solver;

/// The example with few intervals, when its FMUs are built.
fn example() -> Option<(PathBuf, String)> {
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    if !project.join("target/fmu/cart-pole.fmu").exists() {
        eprintln!("skipped: target/fmu/cart-pole.fmu is not built (make fmu)");
        return None;
    }
    let file = project.join("examples/03_swing_up/problem.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.contains("intervals = 100"));
    Some((file, text.replace("intervals = 100", "intervals = 40")))
}

fn prepared(file: &Path, text: &str) -> Prepared {
    let source = Source { file: file.to_owned(), text: text.to_owned() };
    prepare_statement(parse(source).unwrap(), Instant::now()).unwrap()
}

/// Objective of a run that has to succeed.
fn objective(solver: &mut Solver) -> f64 {
    let solution = solver.solve().unwrap();
    assert_eq!(solution.status, Status::Solved);
    solution.objective
}

fn agree(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-8 * a.abs()
}

#[test]
fn other_parameters_give_the_optimum_of_the_problem_that_states_them() {
    let Some((file, text)) = example() else { return };
    let mut solver = Solver::new(prepared(&file, &text), None).unwrap();
    let before = objective(&mut solver);
    solver.set_parameters(&[("cart_pole.m_p", 0.1005)]).unwrap();
    let after = objective(&mut solver);
    assert!((after - before).abs() > 1e-4 * before, "{before} {after}");

    let stated = text.replace("[settings]", "[parameters]\n\"cart_pole.m_p\" = 0.1005\n\n[settings]");
    let mut anew = Solver::new(prepared(&file, &stated), None).unwrap();
    // Minima lie near each other: compared is the one that the kept solver found.
    let (found, duals) = (solver.trajectory().unwrap(), solver.inner().duals().unwrap());
    anew.inner().start_at(&found, Some(&duals)).unwrap();
    assert!(agree(after, objective(&mut anew)));

    let refused = solver.set_parameters(&[("cart_pole.m_q", 1.0)]).unwrap_err().to_string();
    assert!(refused.contains("m_q"), "{refused}");
    assert!(agree(after, objective(&mut solver)));
}

#[test]
fn bounds_go_by_name_and_states_stay_fixed_with_other_parameters() {
    let Some((file, text)) = example() else { return };
    let mut solver = Solver::new(prepared(&file, &text), None).unwrap();
    assert_eq!(solver.states()[1], "theta");
    assert_eq!(solver.inputs(), ["u"]);
    let refused = solver.set_bounds("strokes", [-0.1, 0.1]).unwrap_err().to_string();
    assert!(refused.contains("`strokes`") && refused.contains("`stroke`, `force command`"), "{refused}");
    solver.set_bounds("force command", [-50.0, 50.0]).unwrap();
    let mut states = solver.initial().to_vec();
    states[1] = 0.01;
    solver.set_initial(&states).unwrap();
    objective(&mut solver);
    solver.set_parameters(&[("cart_pole.m_p", 0.1001)]).unwrap();
    objective(&mut solver);
    let phase = &solver.trajectory().unwrap().phases[0];
    assert_eq!(phase.states[0][1], 0.01);
    let largest = phase.inputs.iter().chain(&phase.middle_inputs).fold(0.0, |m: f64, u| m.max(u[0].abs()));
    assert!(largest <= 50.0 + 1e-6, "{largest} N");
}
