//! Behavior of the optimizer on problems that are infeasible, unbounded, badly posed, or cannot be evaluated.

use std::ops::ControlFlow;

use airloop_optim::{
    Bounds, Error, EvaluationError, Iteration, Method, Nlp, Settings, Start, Status, solve, solve_with,
};

const INF: f64 = f64::INFINITY;
const METHODS: [Method; 2] = [Method::InteriorPoint, Method::Sqp];

type Value = fn(&[f64]) -> f64;
type Gradient = fn(&[f64]) -> [f64; 2];
type Hessian = fn(&[f64]) -> [f64; 3];

/// Two variables, at most one constraint; Hessians as [xx, xy, yy].
struct Plane {
    f: (Value, Gradient, Hessian),
    c: Option<(Value, Gradient, Hessian)>,
    x: [(f64, f64); 2],
    row: (f64, f64),
}

impl Plane {
    fn rosenbrock() -> Self {
        let f = |x: &[f64]| 100.0 * (x[1] - x[0] * x[0]).powi(2) + (1.0 - x[0]).powi(2);
        let g = |x: &[f64]| {
            let gap = x[1] - x[0] * x[0];
            [-400.0 * x[0] * gap - 2.0 * (1.0 - x[0]), 200.0 * gap]
        };
        let h = |x: &[f64]| [1200.0 * x[0] * x[0] - 400.0 * x[1] + 2.0, -400.0 * x[0], 200.0];
        Self { f: (f, g, h), c: None, x: [(-INF, INF); 2], row: (0.0, 0.0) }
    }

    fn sum_of_squares(x: &[f64]) -> f64 {
        x[0] * x[0] + x[1] * x[1]
    }

    /// Minimize x0 + x1 on the circle of radius squared `r` in the half plane x0 >= `low`.
    fn circle(r: f64, low: f64) -> Self {
        let f: (Value, Gradient, Hessian) = (|x| x[0] + x[1], |_| [1.0, 1.0], |_| [0.0; 3]);
        let c: (Value, Gradient, Hessian) =
            (Self::sum_of_squares, |x| [2.0 * x[0], 2.0 * x[1]], |_| [2.0, 0.0, 2.0]);
        Self { f, c: Some(c), x: [(low, INF), (-INF, INF)], row: (r, r) }
    }
}

impl Nlp for Plane {
    fn variables(&self) -> usize {
        2
    }

    fn constraints(&self) -> usize {
        usize::from(self.c.is_some())
    }

    fn variable_bounds(&self) -> Bounds {
        Bounds { lower: self.x.map(|b| b.0).to_vec(), upper: self.x.map(|b| b.1).to_vec() }
    }

    fn constraint_bounds(&self) -> Bounds {
        let count = self.constraints();
        Bounds { lower: vec![self.row.0; count], upper: vec![self.row.1; count] }
    }

    fn objective(&mut self, x: &[f64]) -> Result<f64, EvaluationError> {
        Ok((self.f.0)(x))
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> Result<(), EvaluationError> {
        gradient.copy_from_slice(&(self.f.1)(x));
        Ok(())
    }

    fn constraint_values(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        values.iter_mut().zip(&self.c).for_each(|(value, c)| *value = (c.0)(x));
        Ok(())
    }

    fn jacobian_pattern(&self) -> Vec<(usize, usize)> {
        self.c.iter().flat_map(|_| [(0, 0), (0, 1)]).collect()
    }

    fn jacobian(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        if let Some(c) = &self.c {
            values.copy_from_slice(&(c.1)(x));
        }
        Ok(())
    }

    fn hessian_pattern(&self) -> Vec<(usize, usize)> {
        vec![(0, 0), (0, 1), (1, 1)]
    }

    fn hessian(
        &mut self,
        x: &[f64],
        objective_factor: f64,
        multipliers: &[f64],
        values: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let (of_f, of_c) = ((self.f.2)(x), self.c.map_or([0.0; 3], |c| (c.2)(x)));
        let y = multipliers.first().copied().unwrap_or(0.0);
        (0..3).for_each(|i| values[i] = objective_factor * of_f[i] + y * of_c[i]);
        Ok(())
    }

    fn variable_name(&self, variable: usize) -> String {
        ["stroke", "angle"][variable].to_owned()
    }

    fn constraint_name(&self, _: usize) -> String {
        "circle".to_owned()
    }
}

fn with(method: Method) -> Settings {
    Settings { method, ..Settings::default() }
}

#[test]
fn multipliers_satisfy_the_stationarity_of_the_lagrangian() {
    for method in METHODS {
        // Minimum at (-1, -1), where grad f + y grad c = 0 gives y = 1/2.
        let mut problem = Plane::circle(2.0, -5.0);
        let solution = solve(&mut problem, &Start::cold(vec![-2.0, -0.5]), &with(method)).unwrap();
        assert_eq!(solution.status, Status::Solved);
        assert!((solution.x[0] + 1.0).abs() < 1e-8 && (solution.x[1] + 1.0).abs() < 1e-8);
        assert!((solution.multipliers.constraints[0] - 0.5).abs() < 1e-7);
        // With x0 >= 0 active: x = (0, -sqrt 2), y = 1 / (2 sqrt 2), z = 1.
        let mut problem = Plane::circle(2.0, 0.0);
        let solution = solve(&mut problem, &Start::cold(vec![0.3, -0.5]), &with(method)).unwrap();
        assert_eq!(solution.status, Status::Solved);
        assert!((solution.multipliers.constraints[0] - 0.125f64.sqrt()).abs() < 1e-6);
        assert!((solution.multipliers.lower[0] - 1.0).abs() < 1e-6);
    }
}

#[test]
fn an_infeasible_problem_names_the_constraint_that_is_violated() {
    for method in METHODS {
        // The circle of radius 1 does not reach x0 >= 2: nearest is (2, 0), where c - 1 = 3.
        let mut problem = Plane::circle(1.0, 2.0);
        let solution = solve(&mut problem, &Start::cold(vec![3.0, 1.0]), &with(method)).unwrap();
        assert_eq!(solution.status, Status::Infeasible, "{method:?}");
        assert_eq!(solution.blocking.unwrap().to_string(), "stroke >= 2");
        let worst = solution.worst.unwrap();
        assert_eq!(worst.name, "circle");
        assert!((worst.amount - 3.0).abs() < 1e-5, "{}", worst.amount);
        assert!(worst.to_string().starts_with("circle: 1 <= 4.0"), "{worst}");
        assert!((solution.x[0] - 2.0).abs() < 1e-6 && solution.x[1].abs() < 1e-3);
    }
}

#[test]
fn an_objective_without_a_minimum_is_called_diverging() {
    for method in METHODS {
        let mut problem = Plane::rosenbrock();
        problem.f = (|x| x[0] - x[1].exp(), |x| [1.0, -x[1].exp()], |x| [0.0, 0.0, -x[1].exp()]);
        let settings = Settings { diverging: 1e10, ..with(method) };
        let solution = solve(&mut problem, &Start::cold(vec![0.0, 0.0]), &settings).unwrap();
        assert_eq!(solution.status, Status::Diverging, "{method:?}");
    }
}

#[test]
fn a_point_where_the_functions_have_no_value_is_stepped_back_from() {
    // min (ln x0)^2 + (x1 - 1)^2 from x0 = 3: the full Newton step leads to x0 < 0, where the logarithm is NaN.
    for method in METHODS {
        let mut problem = Plane::rosenbrock();
        problem.f = (
            |x| x[0].ln().powi(2) + (x[1] - 1.0).powi(2),
            |x| [2.0 * x[0].ln() / x[0], 2.0 * (x[1] - 1.0)],
            |x| [2.0 * (1.0 - x[0].ln()) / (x[0] * x[0]), 0.0, 2.0],
        );
        let solution = solve(&mut problem, &Start::cold(vec![2.5, 0.0]), &with(method)).unwrap();
        assert_eq!(solution.status, Status::Solved, "{method:?}");
        assert!((solution.x[0] - 1.0).abs() < 1e-7 && (solution.x[1] - 1.0).abs() < 1e-7);
        assert!(solution.iterations.iter().any(|row| row.step_length < 1.0 && row.number > 0));
    }
}

#[test]
fn a_start_without_values_is_an_error_that_names_the_function() {
    let mut problem = Plane::rosenbrock();
    problem.f.0 = |_| f64::NAN;
    for method in METHODS {
        let error = solve(&mut problem, &Start::cold(vec![0.0; 2]), &with(method)).unwrap_err();
        assert_eq!(
            error.to_string(),
            "at the start: cannot evaluate the objective: its value is NaN; give a start at which all functions \
             can be evaluated"
        );
    }
}

#[test]
fn contradictory_bounds_and_wrong_lengths_are_errors() {
    let mut problem = Plane::rosenbrock();
    let start = |n: usize| Start::cold(vec![0.0; n]);
    for method in METHODS {
        let error = solve(&mut problem, &start(3), &with(method)).unwrap_err();
        assert_eq!(error, Error::Length { what: "the start", given: 3, expected: 2 });
    }
    problem.x[0] = (1.0, 0.5);
    let error = solve(&mut problem, &start(2), &Settings::default()).unwrap_err();
    assert_eq!(error, Error::Bounds { name: "stroke".to_owned(), lower: 1.0, upper: 0.5 });
    let settings = Settings { tolerance: -1.0, ..Settings::default() };
    let error = solve(&mut Plane::rosenbrock(), &start(2), &settings).unwrap_err();
    assert_eq!(error.to_string(), "setting `tolerance` is -1; allowed is a positive number");
}

#[test]
fn more_equations_than_free_variables_are_refused() {
    let mut problem = Plane::circle(2.0, 0.0);
    problem.x = [(1.0, 1.0), (1.0, 1.0)];
    let error = solve(&mut problem, &Start::cold(vec![1.0; 2]), &Settings::default()).unwrap_err();
    assert_eq!(error, Error::Overdetermined { equalities: 1, free: 0 });
}

#[test]
fn an_interrupted_run_goes_on_from_where_it_stopped() {
    for method in METHODS {
        let settings = with(method);
        let start = Start::cold(vec![-1.2, 1.0]);
        let whole = solve(&mut Plane::rosenbrock(), &start, &settings).unwrap();
        let mut stop = |row: &Iteration| {
            if row.number == 8 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let part = solve_with(&mut Plane::rosenbrock(), &start, &settings, &mut stop).unwrap();
        assert_eq!(part.status, Status::Interrupted);
        assert_eq!(part.iterations.len(), 9);
        let rest = solve(&mut Plane::rosenbrock(), &part.restart(), &settings).unwrap();
        assert_eq!(rest.status, Status::Solved);
        assert!(rest.iterations.len() < whole.iterations.len());
        assert!((rest.x[0] - 1.0).abs() < 1e-7);
    }
}

#[test]
fn a_warm_start_at_the_solution_needs_hardly_any_iteration() {
    for method in METHODS {
        let mut problem = Plane::circle(2.0, 0.0);
        let first = solve(&mut problem, &Start::cold(vec![0.3, -0.5]), &with(method)).unwrap();
        let again = solve(&mut problem, &first.restart(), &with(method)).unwrap();
        assert_eq!(again.status, Status::Solved);
        assert!(again.iterations.len() <= 3, "{method:?}: {}", again.iterations.len());
    }
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    for method in METHODS {
        let run =
            || solve(&mut Plane::circle(2.0, 0.0), &Start::cold(vec![0.3, -0.5]), &with(method)).unwrap();
        assert_eq!(run(), run());
    }
}

#[test]
fn the_limit_of_iterations_is_kept() {
    for method in METHODS {
        let settings = Settings { max_iterations: 3, ..with(method) };
        let solution = solve(&mut Plane::rosenbrock(), &Start::cold(vec![-1.2, 1.0]), &settings).unwrap();
        assert_eq!(solution.status, Status::IterationLimit);
        assert_eq!(solution.iterations.len(), 4);
    }
}

#[test]
fn an_objective_in_larger_units_is_solved_in_the_same_steps() {
    let f: (Value, Gradient, Hessian) = (|x| 1e-3 * (x[0] + x[1]), |_| [1e-3, 1e-3], |_| [0.0; 3]);
    for method in METHODS {
        let solved = |mut plane: Plane| {
            let solution = solve(&mut plane, &Start::cold(vec![-0.5, -1.5]), &with(method)).unwrap();
            assert_eq!(solution.status, Status::Solved, "{method:?}");
            (solution.iterations.len(), solution.x)
        };
        let small = solved(Plane { f, ..Plane::circle(2.0, -INF) });
        let (steps, x) = solved(Plane::circle(2.0, -INF));
        assert_eq!(small.0, steps, "{method:?}");
        assert!(small.1.iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-12), "{method:?}: {small:?} {x:?}");
    }
}
