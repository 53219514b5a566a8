//! Problem P2: the cart-pole without friction (Kelly, SIAM Review 59(4), 2017), dynamics typed from the statement.

use std::f64::consts::PI;
use std::ops::ControlFlow;

use airloop_ocp::transcription::{
    Cost, Discretization, Duration, Dynamics, From, Interpolation, Limit, Path, Phase, PhaseTrajectory,
    Point, Problem, Refinement, Size, Structure, Trajectory, Transcription, Variable, refine, solve_on,
};
use airloop_optim::{EvaluationError, Settings, Status};

const SIZE: Size = Size { states: 4, inputs: 1, outputs: 0 };
const GRAVITY: f64 = 9.81;

/// Masses of cart and pole, length.
struct Kelly {
    parameters: [f64; 3],
    structure: Structure,
}

/// A number with its gradient and Hessian by (theta, w, u).
#[derive(Clone, Copy)]
struct Jet {
    value: f64,
    first: [f64; 3],
    second: [[f64; 3]; 3],
}

impl Jet {
    fn constant(value: f64) -> Jet {
        Jet { value, first: [0.0; 3], second: [[0.0; 3]; 3] }
    }

    fn variable(value: f64, i: usize) -> Jet {
        let mut jet = Jet::constant(value);
        jet.first[i] = 1.0;
        jet
    }

    /// A function of one number, with its first two derivatives.
    fn apply(self, value: f64, slope: f64, curvature: f64) -> Jet {
        let first = self.first.map(|d| slope * d);
        let entry =
            |i: usize, j: usize| slope * self.second[i][j] + curvature * self.first[i] * self.first[j];
        Jet { value, first, second: [0, 1, 2].map(|i| [0, 1, 2].map(|j| entry(i, j))) }
    }

    fn plus(self, other: Jet) -> Jet {
        let first = [0, 1, 2].map(|i| self.first[i] + other.first[i]);
        let second = [0, 1, 2].map(|i| [0, 1, 2].map(|j| self.second[i][j] + other.second[i][j]));
        Jet { value: self.value + other.value, first, second }
    }

    fn times(self, other: Jet) -> Jet {
        let first = [0, 1, 2].map(|i| self.first[i] * other.value + self.value * other.first[i]);
        let entry = |i: usize, j: usize| {
            self.second[i][j] * other.value
                + self.value * other.second[i][j]
                + self.first[i] * other.first[j]
                + self.first[j] * other.first[i]
        };
        Jet {
            value: self.value * other.value,
            first,
            second: [0, 1, 2].map(|i| [0, 1, 2].map(|j| entry(i, j))),
        }
    }

    fn scaled(self, factor: f64) -> Jet {
        self.times(Jet::constant(factor))
    }

    fn reciprocal(self) -> Jet {
        let r = 1.0 / self.value;
        self.apply(r, -r * r, 2.0 * r * r * r)
    }
}

impl Kelly {
    fn new(parameters: [f64; 3]) -> Kelly {
        Kelly { parameters, structure: Structure::dense(SIZE) }
    }

    /// Accelerations of cart and pole.
    fn accelerations(&self, at: Point<'_>) -> [Jet; 2] {
        let [m1, m2, l] = self.parameters;
        let theta = at.states[1];
        let (s, c) = theta.sin_cos();
        let angle = Jet::variable(theta, 0);
        let (sin, cos) = (angle.apply(s, c, -s), angle.apply(c, -s, -c));
        let (w, u) = (Jet::variable(at.states[3], 1), Jet::variable(at.inputs[0], 2));
        let sw2 = sin.times(w).times(w).scaled(l * m2);
        let below = cos.times(cos).scaled(-m2).plus(Jet::constant(m1 + m2)).reciprocal();
        let dv = sw2.plus(u).plus(cos.times(sin).scaled(m2 * GRAVITY));
        let dw = cos.times(sw2).plus(u.times(cos)).plus(sin.scaled((m1 + m2) * GRAVITY));
        [dv.times(below), dw.times(below).scaled(-1.0 / l)]
    }
}

impl Dynamics for Kelly {
    fn size(&self) -> Size {
        SIZE
    }

    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn names(&self) -> Vec<String> {
        ["x", "theta", "v", "w", "u"].map(str::to_owned).to_vec()
    }

    fn nominals(&self) -> Vec<f64> {
        vec![1.0, 3.0, 2.0, 6.0, 10.0]
    }

    fn evaluate(&mut self, at: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError> {
        let [dv, dw] = self.accelerations(at);
        values.copy_from_slice(&[at.states[2], at.states[3], dv.value, dw.value]);
        Ok(())
    }

    fn jacobian(
        &mut self,
        at: Point<'_>,
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        jacobian.fill(0.0);
        (jacobian[2], jacobian[5 + 3]) = (1.0, 1.0);
        for (row, jet) in self.accelerations(at).into_iter().enumerate() {
            [1, 3, 4].into_iter().zip(jet.first).for_each(|(j, d)| jacobian[(2 + row) * 5 + j] = d);
        }
        self.evaluate(at, values)
    }

    fn hessian(
        &mut self,
        at: Point<'_>,
        weights: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        hessian.fill(0.0);
        let [dv, dw] = self.accelerations(at);
        for (i, a) in [1, 3, 4].into_iter().enumerate() {
            for (j, b) in [1, 3, 4].into_iter().enumerate() {
                hessian[a * 5 + b] = weights[2] * dv.second[i][j] + weights[3] * dw.second[i][j];
            }
        }
        Ok(())
    }

    fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError> {
        Ok(Box::new(Kelly::new(self.parameters)))
    }
}

struct Case {
    parameters: [f64; 3],
    distance: f64,
    force: f64,
    stroke: f64,
}

const TUTORIAL: Case = Case { parameters: [1.0, 0.3, 0.5], distance: 1.0, force: 20.0, stroke: 2.0 };
const DEMO: Case = Case { parameters: [2.0, 0.5, 0.5], distance: 0.8, force: 100.0, stroke: 1.6 };

fn swing_up(case: &Case) -> (Problem, Trajectory) {
    let x = Variable::State;
    let mut phase = Phase::new("swing-up", vec![Box::new(Kelly::new(case.parameters))], Duration::Fixed(2.0));
    phase.paths = vec![
        Path::at_nodes(Limit::between("track", "m", x(0), -case.stroke, case.stroke)),
        Path::everywhere(Limit::between("force", "N", Variable::Input(0), -case.force, case.force)),
    ];
    let end = [case.distance, PI, 0.0, 0.0];
    phase.start = (0..4).map(|i| Limit::equal("start", "", x(i), 0.0)).collect();
    phase.end = (0..4).map(|i| Limit::equal("end", "", x(i), end[i])).collect();
    phase.integral = vec![Cost::square(Variable::Input(0), 1.0)];
    let states = vec![vec![0.0; 4], end.to_vec()];
    let line = PhaseTrajectory::from_knots(
        "swing-up",
        vec![0.0, 2.0],
        states,
        vec![vec![0.0]; 2],
        Interpolation::Linear,
    );
    (Problem::single(phase), Trajectory::guess(vec![line.unwrap()]))
}

#[test]
fn both_cases_reach_the_objective_of_another_solver() {
    // From `tests/reference/kelly_cart_pole.py`: CasADi with IPOPT on equations typed anew.
    for (case, transcription, expected) in [
        (&TUTORIAL, Transcription::HermiteSimpson, 58.807642165913),
        (&TUTORIAL, Transcription::Trapezoidal, 59.147757323374),
        (&DEMO, Transcription::HermiteSimpson, 225.553915646653),
        (&DEMO, Transcription::Trapezoidal, 226.892001098172),
    ] {
        let (mut problem, guess) = swing_up(case);
        let outcome = solve_on(
            &mut problem,
            &Discretization::uniform(transcription, &[50]),
            From::Guess(&guess),
            &Settings::default(),
            &mut |_| ControlFlow::Continue(()),
        )
        .unwrap();
        assert_eq!(outcome.solution.status, Status::Solved);
        let gap = (outcome.solution.objective - expected).abs();
        assert!(gap <= 1e-8 * expected, "{transcription:?}: {}", outcome.solution.objective);
    }
}

#[test]
fn the_mesh_is_refined_until_the_errors_between_knots_are_small() {
    let (mut problem, guess) = swing_up(&TUTORIAL);
    let refinement = Refinement { tolerance: 1e-6, ..Refinement::default() };
    let rounds = refine(
        &mut problem,
        &Discretization::uniform(Transcription::HermiteSimpson, &[10]),
        From::Guess(&guess),
        &refinement,
        &Settings::default(),
        &mut |_| ControlFlow::Continue(()),
    )
    .unwrap();
    let largest: Vec<f64> = rounds.iter().map(|round| round.errors[0].largest()).collect();
    let iterations: Vec<usize> =
        rounds.iter().map(|round| round.outcome.solution.iterations.len() - 1).collect();

    assert!(largest[0] > 1e-4 && *largest.last().unwrap() <= 1e-6, "{largest:?}");
    // A warm start costs a few iterations.
    assert!(iterations[1..].iter().all(|count| *count <= 10), "{iterations:?}");
}
