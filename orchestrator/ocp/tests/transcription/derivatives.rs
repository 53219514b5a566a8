//! Exact derivatives against central differences, on a problem with everything in it.

use airloop_ocp::transcription::{
    Cost, Discretization, Duration, Dynamics, Limit, Link, Mesh, Path, Phase, Place, Problem, Program,
    RateLimit, Transcription, Variable,
};
use airloop_optim::Nlp;

use crate::arm::{Arm, Impact};

pub const ALL: [Transcription; 5] = [
    Transcription::Trapezoidal,
    Transcription::HermiteSimpson,
    Transcription::HermiteSimpsonSeparated,
    Transcription::MultipleShooting,
    Transcription::ShootingCollocation,
];

fn phase(name: &str, duration: Duration) -> Phase {
    let mut phase = Phase::new(name, vec![Box::new(Arm::new()) as Box<dyn Dynamics>], duration);
    let (x, u, g) = (Variable::State, Variable::Input, Variable::Output);
    let between = |name: &str, quantity: Vec<(Variable, f64)>| Limit::between(name, "", quantity, -2.0, 2.0);
    phase.paths = vec![
        Path::everywhere(between("mixed", vec![(x(0), 1.0), (g(0), -0.5), (u(1), 2.0), (x(0), 0.5)])),
        Path::everywhere(between("speed", vec![(x(1), -2.0)])),
        Path::at_nodes(between("torque", vec![(u(0), 1.0)])),
        Path { limit: between("late", vec![(g(1), 1.0)]), place: Place::Midpoints, window: [0.5, 1.0] },
    ];
    phase.start = vec![Limit::equal("angle", "rad", x(0), 0.1), between("begin", vec![(g(0), 1.0)])];
    phase.end = vec![between("sum", vec![(g(0), 1.0), (x(1), 1.0), (u(0), 1.0)])];
    phase.rates = vec![RateLimit {
        name: "slew".to_owned(),
        unit: "1/s".to_owned(),
        input: 1,
        lower: -3.0,
        upper: 4.0,
    }];
    phase.integral = vec![
        Cost::square(u(0), 0.3),
        Cost { quantity: vec![(g(0), 1.0), (x(2), -1.0)].into(), reference: 0.4, weight: 2.0 },
    ];
    phase.final_cost =
        vec![Cost { quantity: vec![(g(0), 1.0), (x(1), 2.0)].into(), reference: 1.0, weight: 0.7 }];
    phase.duration_weight = 1.3;
    phase
}

/// Two phases with a reset between them and a mesh of unequal intervals.
pub fn problem(free: bool) -> (Problem, Vec<Mesh>) {
    let duration = |d: f64| if free { Duration::Free { lower: 0.1, upper: 5.0 } } else { Duration::Fixed(d) };
    let phases = vec![phase("first", duration(1.5)), phase("second", duration(0.8))];
    let mut link =
        Link::reset(Box::new(Impact), vec![Limit::between("impulse", "N s", Variable::Output(0), 0.0, 4.0)]);
    link.inputs = vec![(1, 0)];
    let meshes = vec![Mesh::new(vec![0.0, 0.3, 0.6, 1.0]).unwrap(), Mesh::uniform(2)];
    (Problem { phases, links: vec![link], cycle: None }, meshes)
}

/// Whether a transcription can do with free durations here, where one state is linear.
pub fn takes_free(transcription: Transcription) -> bool {
    transcription != Transcription::ShootingCollocation
}

fn gradient(program: &mut Program<'_>, pattern: &[(usize, usize)], x: &[f64], y: &[f64]) -> Vec<f64> {
    let (mut gradient, mut values) = (vec![0.0; x.len()], vec![0.0; pattern.len()]);
    program.gradient(x, &mut gradient).unwrap();
    program.jacobian(x, &mut values).unwrap();
    pattern.iter().zip(&values).for_each(|(&(row, column), value)| gradient[column] += y[row] * value);
    gradient
}

fn lagrangian(program: &mut Program<'_>, x: &[f64], y: &[f64]) -> f64 {
    let mut c = vec![0.0; y.len()];
    program.constraint_values(x, &mut c).unwrap();
    program.objective(x).unwrap() + c.iter().zip(y).map(|(c, y)| c * y).sum::<f64>()
}

fn agree(transcription: Transcription, free: bool) {
    let (mut problem, meshes) = problem(free);
    let mut program = Program::new(&mut problem, &Discretization { transcription, meshes }).unwrap();
    let (n, m) = (program.variables(), program.constraints());
    let x: Vec<f64> = (0..n).map(|i| 0.8 + 0.3 * (1.7 * i as f64).sin()).collect();
    let y: Vec<f64> = (0..m).map(|i| (0.9 * i as f64).cos()).collect();
    let (jacobian, hessian) = (program.jacobian_pattern(), program.hessian_pattern());
    let exact = gradient(&mut program, &jacobian, &x, &y);
    let mut values = vec![0.0; hessian.len()];
    program.hessian(&x, 1.0, &y, &mut values).unwrap();
    let mut curvature = vec![vec![0.0; n]; n];
    for (&(i, j), value) in hessian.iter().zip(&values) {
        curvature[i][j] += value;
        curvature[j][i] += if i == j { 0.0 } else { *value };
    }
    // Central differences with this step: truncation some 1e-10 of the third derivatives, rounding 1e-10.
    let step = 1e-5;
    for i in 0..n {
        let mut moved = x.clone();
        moved[i] += step;
        let (up, slopes) =
            (lagrangian(&mut program, &moved, &y), gradient(&mut program, &jacobian, &moved, &y));
        moved[i] -= 2.0 * step;
        let (down, before) =
            (lagrangian(&mut program, &moved, &y), gradient(&mut program, &jacobian, &moved, &y));
        let slope = (up - down) / (2.0 * step);
        let name = program.variable_name(i);
        assert!(
            (slope - exact[i]).abs() < 1e-8 * (1.0 + slope.abs()),
            "{transcription:?}, free {free}, {name}: {slope} {}",
            exact[i]
        );
        for j in 0..n {
            let second = (slopes[j] - before[j]) / (2.0 * step);
            assert!(
                (second - curvature[i][j]).abs() < 1e-8 * (1.0 + second.abs()),
                "{transcription:?}, free {free}, {name} and {}: {second} {}",
                program.variable_name(j),
                curvature[i][j]
            );
        }
    }
}

#[test]
fn derivatives_agree_with_central_differences() {
    for transcription in ALL {
        agree(transcription, false);
        if takes_free(transcription) {
            agree(transcription, true);
        }
    }
}

#[test]
fn entries_couple_neighboring_stages_only() {
    for transcription in ALL {
        let (mut problem, meshes) = problem(takes_free(transcription));
        let program = Program::new(&mut problem, &Discretization { transcription, meshes }).unwrap();
        let stages = program.stages().unwrap();
        for (row, column) in program.jacobian_pattern() {
            let gap = stages.constraints[row].abs_diff(stages.variables[column]);
            assert!(
                gap <= 1,
                "{transcription:?}: {} {}",
                program.constraint_name(row),
                program.variable_name(column)
            );
        }
        for (i, j) in program.hessian_pattern() {
            assert!(stages.variables[i].abs_diff(stages.variables[j]) <= 1, "{transcription:?}: {i} {j}");
        }
    }
}
