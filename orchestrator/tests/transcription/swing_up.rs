//! Optima of the swing-up over the trait.

use airloop::optim::{Settings, Solution, Start, Status, solve};
use airloop::transcription::{Discretisation, Program, Transcription};

use crate::cart_pole::swing_up;
use crate::problem::SwingUp;
use crate::same_program::PAIRS;

fn from_pump(transcription: Transcription, intervals: usize) -> Solution {
    let (_, typed) = PAIRS.into_iter().find(|(t, _)| *t == transcription).unwrap();
    let guess = SwingUp::new(typed, intervals).pump();
    let mut problem = swing_up(1);
    let mut program =
        Program::new(&mut problem, &Discretisation::uniform(transcription, &[intervals])).unwrap();
    solve(&mut program, &Start::cold(guess), &Settings::default()).unwrap()
}

#[test]
fn the_optimum_is_the_reference() {
    // Section 6 of the statement: minima known at N = 100 from the pump guess.
    let references: [(Transcription, &[f64]); 4] = [
        (Transcription::HermiteSimpson, &[1085.5801989546, 1088.8114515]),
        (Transcription::Trapezoidal, &[1086.0637278, 1086.4606893559]),
        (Transcription::MultipleShooting, &[1094.6922941665]),
        (Transcription::ShootingCollocation, &[1091.4577017]),
    ];
    for (transcription, minima) in references {
        let solution = from_pump(transcription, 100);
        let near = |minimum: &f64| (solution.objective - minimum).abs() <= 1e-6 * minimum;
        assert_eq!(solution.status, Status::Solved);
        assert!(solution.violation() <= 1e-8);
        assert!(minima.iter().any(near), "{transcription:?}: {}", solution.objective);
    }
}
