//! The half step of the walker over its FMU.
#![cfg(target_os = "linux")]

mod step;

use airloop::optim::{Iteration, Settings, Start, Status, solve_with};
use airloop::transcription::{Discretisation, Program, Transcription};
use step::Variant;

#[test]
fn half_step_has_the_reference_cost_and_durations() {
    let Some(fmu) = step::fmu() else { return };
    let mut problem = step::problem(&fmu, Variant::B);
    let discretisation = Discretisation::uniform(Transcription::HermiteSimpsonSeparated, &[30, 10, 30]);
    let mut program = Program::new(&mut problem, &discretisation).unwrap();
    let x = program.vector(&step::guess(Variant::B)).unwrap();
    let begin = std::time::Instant::now();
    let mut monitor = |one: &Iteration| {
        println!("{one:?}");
        std::ops::ControlFlow::Continue(())
    };
    let solution = solve_with(&mut program, &Start::cold(x), &Settings::default(), &mut monitor).unwrap();
    println!(
        "{:?} {} {:?} {:?}",
        solution.status,
        solution.objective,
        program.phase_times(&solution.x),
        begin.elapsed()
    );
    println!("{:?}", solution.worst);
    assert_eq!(solution.status, Status::Solved);
    assert!((solution.objective - 0.0405907915).abs() < 2e-5);
}
