//! A solver that is kept: the same optima as solvers made anew.

use std::ops::ControlFlow;

use airloop_ocp::transcription::{
    Discretization, Error, From, LimitPlace, Outcome, Program, Solver, Transcription, solve_on,
};
use airloop_optim::{Settings, Start, Status, solve};

use crate::cart_pole::swing_up;
use crate::problem::SwingUp;

const INTERVALS: usize = 50;
/// Command limit, in force along much of the motion; without one the largest is 55 N.
const NARROW: [f64; 2] = [-45.0, 45.0];
/// The command is the second limit along the path.
const COMMAND: LimitPlace = LimitPlace::Path(1);

fn discretization() -> Discretization {
    Discretization::uniform(Transcription::HermiteSimpson, &[INTERVALS])
}

/// The optimum from the pump guess.
fn nominal() -> Outcome {
    let mut problem = swing_up(1);
    let guess = SwingUp::new(crate::problem::Transcription::HermiteSimpson, INTERVALS).pump();
    let guess = Program::new(&mut problem, &discretization()).unwrap().trajectory(&guess, None).unwrap();
    outcome(&mut problem, From::Guess(&guess))
}

fn outcome(problem: &mut airloop_ocp::transcription::Problem, from: From<'_>) -> Outcome {
    let go_on = &mut |_: &airloop_optim::Iteration| ControlFlow::Continue(());
    solve_on(problem, &discretization(), from, &Settings::default(), go_on).unwrap()
}

fn solver(outcome: &Outcome) -> Solver {
    Solver::new(swing_up(1), &discretization(), outcome, &Settings::default()).unwrap()
}

fn resolve(solver: &mut Solver) -> airloop_optim::Solution {
    solver.solve(&mut |_| ControlFlow::Continue(())).unwrap().clone()
}

/// Objective of a solver made anew, without multipliers, along the given variables.
fn cold(problem: &mut airloop_ocp::transcription::Problem, x: &[f64]) -> f64 {
    let mut program = Program::new(problem, &discretization()).unwrap();
    let solution = solve(&mut program, &Start::cold(x.to_vec()), &Settings::default()).unwrap();
    assert_eq!(solution.status, Status::Solved);
    solution.objective
}

/// Some states, about half a percent of their largest values in the plan off.
fn states(case: usize) -> Vec<f64> {
    let sizes = [0.0004, 0.015, 0.004, 0.06, 0.13, 0.27];
    sizes.iter().enumerate().map(|(i, size)| if case >> i & 1 == 1 { *size } else { -size }).collect()
}

#[test]
fn other_initial_states_lead_to_the_optima_of_solvers_made_anew() {
    let mut solver = solver(&nominal());
    for case in [0, 11, 21, 38, 63] {
        solver.set_initial(&states(case)).unwrap();
        let warm = resolve(&mut solver);
        assert_eq!(warm.status, Status::Solved);
        let mut problem = swing_up(1);
        for (limit, value) in problem.phases[0].start.iter_mut().zip(states(case)) {
            (limit.lower, limit.upper) = (value, value);
        }
        assert_eq!(warm.x[..6], states(case));
        let anew = cold(&mut problem, &warm.x);
        assert!((warm.objective - anew).abs() <= 1e-8 * anew, "{case}: {} {anew}", warm.objective);
    }
}

#[test]
fn bounds_that_come_into_force_and_go_again_are_kept() {
    let nominal = nominal();
    let mut solver = solver(&nominal);
    solver.set_limits(&[(0, COMMAND, NARROW)]).unwrap();
    let narrow = resolve(&mut solver);
    assert_eq!(narrow.status, Status::Solved);
    let inputs = narrow.x.chunks(8).flat_map(|node| &node[6..]);
    let held = inputs.filter(|u| (u.abs() - NARROW[1]).abs() < 1e-6).count();
    assert!(held > 3, "{held} inputs are on their bound");
    let mut problem = swing_up(1);
    (problem.phases[0].paths[1].limit.lower, problem.phases[0].paths[1].limit.upper) = NARROW.into();
    let anew = cold(&mut problem, &narrow.x);
    assert!((narrow.objective - anew).abs() <= 1e-8 * anew, "{} {anew}", narrow.objective);
    assert!(narrow.objective > nominal.solution.objective);

    solver.set_limits(&[(0, COMMAND, [-150.0, 150.0])]).unwrap();
    // There are several minima near each other; this one need not be where the solver began.
    let wide = resolve(&mut solver);
    let anew = cold(&mut swing_up(1), &wide.x);
    assert_eq!(wide.status, Status::Solved);
    assert!((wide.objective - anew).abs() <= 1e-8 * anew, "{} {anew}", wide.objective);
    assert!(wide.objective < narrow.objective);
}

#[test]
fn a_solve_depends_on_problem_and_start_alone() {
    let nominal = nominal();
    let mut solver = solver(&nominal);
    let mut runs = Vec::new();
    for between in [None, Some(5), Some(40)] {
        if let Some(case) = between {
            solver.set_initial(&states(case)).unwrap();
            resolve(&mut solver);
        }
        solver.start_at(&nominal.trajectory, Some(&nominal.duals)).unwrap();
        solver.set_initial(&states(21)).unwrap();
        runs.push(resolve(&mut solver));
    }
    assert_eq!(runs[0], runs[1]);
    assert_eq!(runs[0], runs[2]);
}

#[test]
fn a_run_without_a_solution_leaves_the_start_as_it_was() {
    let mut solver = solver(&nominal());
    solver.set_initial(&states(3)).unwrap();
    let before = resolve(&mut solver);
    solver.set_limits(&[(0, COMMAND, [-1.0, 1.0])]).unwrap();
    let too_weak = resolve(&mut solver);
    assert!(!matches!(too_weak.status, Status::Solved | Status::Acceptable), "{}", too_weak.status);
    solver.set_limits(&[(0, COMMAND, [-150.0, 150.0])]).unwrap();
    let after = resolve(&mut solver);
    assert_eq!(after.status, Status::Solved);
    assert!((after.objective - before.objective).abs() <= 1e-8 * before.objective);
    assert!(after.iterations.len() <= 2, "{} iterations from the solution", after.iterations.len() - 1);
}

#[test]
fn a_start_moved_ahead_is_nearer_to_the_rest_of_the_plan() {
    let nominal = nominal();
    let mut solver = solver(&nominal);
    resolve(&mut solver);
    let mut start = Start { x: nominal.solution.x.clone(), multipliers: None, barrier: None };
    solver.program().shift(&mut start, 0.1).unwrap();
    let phase = &nominal.trajectory.phases[0];
    for (k, node) in start.x.chunks(8).enumerate() {
        let time = (phase.times[k] + 0.1).min(phase.end());
        // Straight lines between knots 0.04 s apart, in the angle of the pole.
        assert!((node[1] - phase.states_at(time)[1]).abs() < 0.02, "{k}: {} at {time} s", node[1]);
    }
    let refused = solver.shift(3.0).unwrap_err().to_string();
    assert!(refused.contains("3 s is not between 0 and the duration of 2 s"), "{refused}");
}

#[test]
fn requests_that_make_no_sense_are_refused_and_change_nothing() {
    let nominal = nominal();
    let mut solver = solver(&nominal);
    let few = solver.set_initial(&[0.0; 2]).unwrap_err().to_string();
    assert!(few.contains("2 values for 6 states"), "{few}");
    assert!(matches!(solver.set_limits(&[(0, LimitPlace::End(9), [0.0; 2])]), Err(Error::NoLimit { .. })));
    assert!(matches!(solver.set_limits(&[(0, COMMAND, [1.0, -1.0])]), Err(Error::Bounds { .. })));
    // The stroke ends at 150 mm.
    assert!(matches!(solver.set_initial(&[0.2, 0.0, 0.0, 0.0, 0.0, 0.0]), Err(Error::Bounds { .. })));
    // The first state is not kept where the second is refused.
    assert!(solver.set_initial(&[0.1, f64::NAN, 0.0, 0.0, 0.0, 0.0]).is_err());
    let objective = resolve(&mut solver).objective;
    assert!((objective - nominal.solution.objective).abs() <= 1e-8 * objective);
}
