//! A double integrator moved by one meter in one second with the least effort, against the closed form
//! `u(t) = 6 - 12 t`: `cargo run -p airloop-ocp --example least_effort`.

use std::ops::ControlFlow;

use airloop_dynamics::{Dynamics, EvaluationError, Point, Size, Structure};
use airloop_ocp::transcription::{
    Cost, Discretization, Duration, From, Interpolation, Limit, Phase, PhaseTrajectory, Problem, Trajectory,
    Transcription, Variable, solve_on,
};
use airloop_optim::Settings;

const SIZE: Size = Size { states: 2, inputs: 1, outputs: 0 };

/// `x' = v`, `v' = u`.
struct DoubleIntegrator(Structure);

impl Dynamics for DoubleIntegrator {
    fn size(&self) -> Size {
        SIZE
    }

    fn structure(&self) -> &Structure {
        &self.0
    }

    fn names(&self) -> Vec<String> {
        ["x", "v", "u"].map(str::to_owned).into()
    }

    fn evaluate(&mut self, at: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError> {
        values.copy_from_slice(&[at.states[1], at.inputs[0]]);
        Ok(())
    }

    fn jacobian(
        &mut self,
        at: Point<'_>,
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        jacobian.copy_from_slice(&[0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        self.evaluate(at, values)
    }

    fn hessian(&mut self, _: Point<'_>, _: &[f64], hessian: &mut [f64]) -> Result<(), EvaluationError> {
        hessian.fill(0.0);
        Ok(())
    }

    fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError> {
        Ok(Box::new(DoubleIntegrator(self.0.clone())))
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let plant = Box::new(DoubleIntegrator(Structure::dense(SIZE)));
    let mut phase = Phase::new("move", vec![plant], Duration::Fixed(1.0));
    let at = |name: &str, state, value| Limit::equal(name, "", Variable::State(state), value);
    phase.start = vec![at("start", 0, 0.0), at("at rest", 1, 0.0)];
    phase.end = vec![at("goal", 0, 1.0), at("at rest", 1, 0.0)];
    phase.integral = vec![Cost::square(Variable::Input(0), 1.0)];

    let (times, states, inputs) = (vec![0.0, 1.0], vec![vec![0.0; 2], vec![1.0, 0.0]], vec![vec![0.0]; 2]);
    let line = PhaseTrajectory::from_knots("move", times, states, inputs, Interpolation::Linear)?;
    let mesh = Discretization::uniform(Transcription::HermiteSimpson, &[20]);
    let guess = Trajectory::guess(vec![line]);
    let mut monitor = |_: &airloop_optim::Iteration| ControlFlow::Continue(());
    let settings = Settings::default();
    let found = solve_on(&mut Problem::single(phase), &mesh, From::Guess(&guess), &settings, &mut monitor)?;
    println!("integral of u^2: {:.9}, closed form 12", found.solution.objective);
    Ok(())
}
