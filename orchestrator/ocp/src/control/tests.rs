//! A pendulum behind a sampled actuator: samples, gains and estimates by other routes.

use nalgebra::DMatrix;

use super::nominal::Knots;
use super::*;
use crate::transcription::{Dynamics, Entry, Point, Size, Structure};
use airloop_optim::EvaluationError;
use airloop_series::Interpolation;

/// Time constant of the actuator \[s\].
const LAG: f64 = 0.05;
const SAMPLE: f64 = 0.01;

/// States angle, rate, torque z with z' = (u - z) / LAG and rate' = -9.81 sin(angle) - 0.1 rate + z + 0.2 u; outputs
/// sin(angle) and z + u.
struct Pendulum(Structure);

impl Pendulum {
    fn new() -> Self {
        let (o, c, v) = (Entry::Zero, Entry::Constant, Entry::Varying);
        #[rustfmt::skip]
        let entries = vec![
            o, c, o, o,
            v, c, c, c,
            o, o, c, c,
            v, o, o, o,
            o, o, c, c,
        ];
        Pendulum(Structure::new(Size { states: 3, inputs: 1, outputs: 2 }, entries))
    }
}

impl Dynamics for Pendulum {
    fn size(&self) -> Size {
        Size { states: 3, inputs: 1, outputs: 2 }
    }

    fn structure(&self) -> &Structure {
        &self.0
    }

    fn names(&self) -> Vec<String> {
        ["angle", "rate", "torque", "u", "height", "sum"].map(String::from).to_vec()
    }

    fn evaluate(&mut self, at: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError> {
        let ([angle, rate, z], u) = ([at.states[0], at.states[1], at.states[2]], at.inputs[0]);
        let pull = -9.81 * angle.sin() - 0.1 * rate + z + 0.2 * u;
        values.copy_from_slice(&[rate, pull, (u - z) / LAG, angle.sin(), z + u]);
        Ok(())
    }

    fn jacobian(
        &mut self,
        at: Point<'_>,
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.evaluate(at, values)?;
        let c = at.states[0].cos();
        #[rustfmt::skip]
        jacobian.copy_from_slice(&[
            0.0, 1.0, 0.0, 0.0,
            -9.81 * c, -0.1, 1.0, 0.2,
            0.0, 0.0, -1.0 / LAG, 1.0 / LAG,
            c, 0.0, 0.0, 0.0,
            0.0, 0.0, 1.0, 1.0,
        ]);
        Ok(())
    }

    fn hessian(&mut self, _: Point<'_>, _: &[f64], _: &mut [f64]) -> Result<(), EvaluationError> {
        let (function, reason) = ("pendulum".into(), "no curvature is needed here".into());
        Err(EvaluationError { function, reason })
    }

    fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError> {
        Ok(Box::new(Pendulum::new()))
    }
}

const ORIGIN: Point<'static> = Point { time: 0.0, states: &[0.0; 3], inputs: &[0.0] };

/// Half a swing to the side and on to rest at angle 1: knots every five samples.
fn plan() -> (Vec<f64>, Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let time: Vec<f64> = (0..=20).map(|k| 0.05 * f64::from(k)).collect();
    let s = |t: f64| t * t * (3.0 - 2.0 * t);
    let states = time.iter().map(|&t| vec![s(t), 6.0 * t * (1.0 - t), 8.0 * t]).collect();
    let inputs = time.iter().map(|&t| vec![8.0 * t]).collect();
    (time, states, inputs)
}

fn nominal(plant: &mut Sampled<'_>) -> Nominal {
    let (time, states, inputs) = plan();
    let knots = Knots { time: &time, states: &states, inputs: &inputs, interpolation: Interpolation::Linear };
    Nominal::new(plant, &knots).unwrap()
}

#[test]
fn a_sample_holds_the_actuator_and_follows_the_pendulum() {
    let mut pendulum = Pendulum::new();
    let mut fine = Sampled::new(&mut pendulum, &[2], SAMPLE, 50, ORIGIN).unwrap();
    let states = [0.4, -0.7, 1.5];
    let next = fine.advance(Point { time: 0.0, states: &states, inputs: &[2.0] }, SAMPLE).unwrap();
    // The actuator in closed form; the pendulum by ten thousand small steps (semi-implicit Euler, extrapolated).
    assert!((next[2] - (2.0 + (1.5 - 2.0) * (-SAMPLE / LAG).exp())).abs() < 1e-14);
    let euler = |steps: u32| {
        let h = SAMPLE / f64::from(steps);
        (0..steps).fold((0.4f64, -0.7f64), |(angle, rate), _| {
            let rate = rate + h * (-9.81 * angle.sin() - 0.1 * rate + 1.5 + 0.4);
            (angle + h * rate, rate)
        })
    };
    let (coarse, finer) = (euler(10_000), euler(20_000));
    assert!((next[0] - (2.0 * finer.0 - coarse.0)).abs() < 1e-9);
    assert!((next[1] - (2.0 * finer.1 - coarse.1)).abs() < 1e-9);
}

#[test]
fn derivatives_of_a_sample_agree_with_central_differences() {
    for (held, steps) in [(vec![2], 1), (vec![2], 3), (vec![], 2)] {
        let mut pendulum = Pendulum::new();
        let mut plant = Sampled::new(&mut pendulum, &held, 0.1, steps, ORIGIN).unwrap();
        let at = [0.4, -0.7, 1.5, 2.0];
        let exact = plant.linearize(Point { time: 0.0, states: &at[..3], inputs: &at[3..] }).unwrap();
        let mut sample =
            |at: &[f64]| plant.advance(Point { time: 0.0, states: &at[..3], inputs: &at[3..] }, 0.1).unwrap();
        assert_eq!(exact.next, sample(&at));
        for j in 0..4 {
            let (mut up, mut down) = (at, at);
            up[j] += 1e-6;
            down[j] -= 1e-6;
            for (i, (up, down)) in sample(&up).iter().zip(sample(&down)).enumerate() {
                let slope = if j < 3 { exact.a[(i, j)] } else { exact.b[(i, 0)] };
                assert!((slope - (up - down) / 2e-6).abs() < 1e-8, "{held:?} {steps}: {i} {j}");
            }
        }
    }
}

#[test]
fn a_state_that_is_not_linear_cannot_be_held() {
    let mut pendulum = Pendulum::new();
    let error = Sampled::new(&mut pendulum, &[0, 2], SAMPLE, 1, ORIGIN).err().unwrap();
    assert!(error.to_string().starts_with("`angle` cannot be held"), "{error}");
}

const STEADY: [f64; 9] = [
    15.760973280103773,
    7.458705800766944,
    0.512173106932286,
    7.458705800766944,
    7.348194509663814,
    1.9811317742380308,
    0.512173106932286,
    1.9811317742380308,
    1.9111098622545692,
];
const GAIN: [f64; 6] = [
    1.4058544287976302,
    1.6805269568713508,
    0.5446630657579474,
    0.23775964775306802,
    0.6824000856505957,
    0.9243136227395151,
];
const FIVE: [f64; 9] = [
    13.610949877742186,
    5.614410101432004,
    0.009914944770592848,
    5.614410101432004,
    5.739195469486554,
    1.525383323318168,
    0.009914944770592848,
    1.5253833233181675,
    1.771068824712092,
];
const CORRECTION: [f64; 6] = [
    0.8161046928727138,
    -0.2483261509549833,
    0.01444563665773719,
    0.7324402121343216,
    0.06292274420995658,
    0.4859278845212955,
];

#[test]
fn riccati_solutions_are_those_of_scipy() {
    // tests/reference/riccati.py
    let a = DMatrix::from_row_slice(3, 3, &[1.1, 0.3, 0.0, -0.2, 0.9, 0.4, 0.0, 0.1, 1.05]);
    let b = DMatrix::from_row_slice(3, 2, &[0.0, 0.1, 0.2, 0.0, 0.05, 1.0]);
    let q = DMatrix::from_row_slice(3, 3, &[2.0, 0.1, 0.0, 0.1, 1.0, 0.2, 0.0, 0.2, 0.5]);
    let r = DMatrix::from_row_slice(2, 2, &[0.5, 0.1, 0.1, 0.8]);
    let close = |found: &DMatrix<f64>, expected: &[f64]| {
        let expected = DMatrix::from_row_slice(found.nrows(), found.ncols(), expected);
        assert!((found - &expected).amax() < 1e-10 * expected.amax(), "{found}");
    };
    let p = riccati::steady(&a, &b, &q, &r).unwrap();
    close(&p, &STEADY);
    close(&riccati::gain(&a, &b, &p, &r).unwrap(), &GAIN);
    let mut p = DMatrix::identity(3, 3);
    for _ in 0..5 {
        let gain = riccati::gain(&a, &b, &p, &r).unwrap();
        p = riccati::cost_before((&a, &b), &gain, &p, (&q, &r));
    }
    close(&p, &FIVE);
    let c = DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 0.5, 0.0, 1.0, 0.0]);
    let p = riccati::steady(&a.transpose(), &c.transpose(), &q, &r).unwrap();
    close(&riccati::correction(&p, &c, &r).unwrap(), &CORRECTION);
    // A growing state that no input reaches.
    let b = DMatrix::from_row_slice(1, 1, &[0.0]);
    let (a, one) = (DMatrix::from_element(1, 1, 1.2), DMatrix::identity(1, 1));
    assert!(riccati::steady(&a, &b, &one, &one).is_none());
}

#[test]
fn between_knots_the_plant_is_followed_and_the_end_is_an_equilibrium() {
    let mut pendulum = Pendulum::new();
    let mut plant = Sampled::new(&mut pendulum, &[2], SAMPLE, 1, ORIGIN).unwrap();
    let nominal = nominal(&mut plant);
    let (_, states, inputs) = plan();
    assert_eq!(nominal.samples(), 100);
    for (k, (state, input)) in states.iter().zip(&inputs).enumerate().take(20) {
        assert_eq!(&nominal.states[5 * k], state);
        assert!((nominal.inputs[5 * k][0] - input[0]).abs() < 1e-12);
        let at = Point { time: 0.0, states: &nominal.states[5 * k + 1], inputs: &nominal.inputs[5 * k + 1] };
        assert_eq!(plant.advance(at, SAMPLE).unwrap(), nominal.states[5 * k + 2]);
    }
    // 0 = -9.81 sin(1) + z + 0.2 u with z = u; the angle and its rate are those of the plan.
    assert!(nominal.rests);
    let torque = 9.81 * 1f64.sin() / 1.2;
    assert_eq!(nominal.states[100][..2], [1.0, 0.0]);
    assert!((nominal.states[100][2] - torque).abs() < 1e-6 && (nominal.inputs[100][0] - torque).abs() < 1e-6);
}

#[test]
fn knots_beside_the_samples_are_met_by_a_shorter_step() {
    let mut pendulum = Pendulum::new();
    let mut plant = Sampled::new(&mut pendulum, &[2], SAMPLE, 1, ORIGIN).unwrap();
    let (time, states, inputs) =
        ([0.0, 0.013, 0.05], [[0.0; 3], [0.1, 0.0, 1.0], [0.2, 0.0, 1.0]], [[1.0]; 3]);
    let (states, inputs) = (states.map(|x| x.to_vec()), inputs.map(|u| u.to_vec()));
    let knots = Knots { time: &time, states: &states, inputs: &inputs, interpolation: Interpolation::Hold };
    let nominal = Nominal::new(&mut plant, &knots).unwrap();
    let at = Point { time: 0.013, states: &states[1], inputs: &inputs[1] };
    let expected = plant.advance(at, 0.02 - 0.013).unwrap();
    assert!(nominal.states[2].iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-14));
    assert_eq!(nominal.samples(), 5);
    let long = [0.0, 1.0, 1e9];
    let message = Nominal::new(&mut plant, &Knots { time: &long, ..knots }).unwrap_err().to_string();
    assert!(message.contains("lengthen the sample time"), "{message}");
    let backwards = [0.0, 0.05, 0.02];
    let knots = Knots { time: &backwards, ..knots };
    let message = Nominal::new(&mut plant, &knots).unwrap_err().to_string();
    assert!(message.contains("0.05 s is followed by 0.02 s"), "{message}");
}

/// Deviation of the states from the reference over the hold, with a wrong start and gravity replaced by `gravity`.
fn closed_loop(gravity: f64, controller: &Controller, samples: usize) -> Vec<f64> {
    let (mut angle, mut rate, mut z) = (0.05f64, 0.0, 0.0);
    let mut estimate = controller.begin();
    let mut errors = Vec::new();
    for k in 0..samples {
        let reference = &controller.rows[k.min(controller.rows.len() - 1)].states;
        errors.push(angle - reference[0]);
        let (inputs, _) = controller.step(&mut estimate, &[angle.sin()]);
        let u = inputs[0];
        for _ in 0..10 {
            rate += 0.1 * SAMPLE * (-gravity * angle.sin() - 0.1 * rate + z + 0.2 * u);
            angle += 0.1 * SAMPLE * rate;
        }
        z = u + (z - u) * (-SAMPLE / LAG).exp();
    }
    errors
}

fn controller(signal: Measured, drift: f64) -> Result<Controller, Error> {
    let mut pendulum = Pendulum::new();
    let mut plant = Sampled::new(&mut pendulum, &[2], SAMPLE, 1, ORIGIN).unwrap();
    let nominal = nominal(&mut plant);
    let limits = vec![(-30.0, 30.0)];
    let settings =
        Design { input_drift: vec![drift], ..Design::of(&nominal, vec![signal], vec![1e-3], limits) };
    design(&mut plant, &nominal, &settings)
}

#[test]
fn the_loop_settles_on_the_reference_and_with_a_disturbance_state_also_under_a_wrong_model() {
    let measured = Measured::Output(0);
    let plain = controller(measured, 0.0).unwrap();
    let with = controller(measured, 1.0).unwrap();
    assert_eq!((plain.rows[0].states.len(), with.rows[0].states.len()), (3, 4));
    let last = |errors: Vec<f64>| errors[errors.len() - 1].abs();
    assert!(last(closed_loop(9.81, &plain, 1000)) < 1e-5);
    // Gravity 5 % stronger leaves an offset without the disturbance state.
    assert!(last(closed_loop(1.05 * 9.81, &plain, 2000)) > 1e-3);
    assert!(last(closed_loop(1.05 * 9.81, &with, 2000)) < 1e-5);
}

#[test]
fn a_signal_that_depends_on_the_input_is_refused() {
    let message = controller(Measured::Output(1), 0.0).unwrap_err().to_string();
    assert!(message.contains("`sum` depends directly on the input `u`"), "{message}");
    let message = controller(Measured::State(1), 1.0).unwrap_err().to_string();
    assert!(message.starts_with("the estimator has no stabilizing gain at the end"), "{message}");
}

/// A normal number by twelve uniform ones.
fn normal(state: &mut u64) -> f64 {
    let mut uniform = || {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

#[test]
fn the_error_of_the_estimate_is_as_large_as_its_covariance_says() {
    // Normalized estimation error squared of 300 runs of the linearized plant with the noise of the design: its mean
    // over runs is chi-squared with 300 n degrees of freedom over 300, n = 4: 4 +- 0.16 (one standard deviation).
    let mut pendulum = Pendulum::new();
    let mut plant = Sampled::new(&mut pendulum, &[2], SAMPLE, 1, ORIGIN).unwrap();
    let nominal = nominal(&mut plant);
    let settings = Design::of(&nominal, vec![Measured::Output(0)], vec![1e-3], vec![(-1e9, 1e9)]);
    let controller = design(&mut plant, &nominal, &settings).unwrap();
    let drift = [&settings.state_drift[..], &settings.input_drift].concat();
    let initial = [&settings.initial[..], &settings.input_drift].concat();
    let squares =
        |v: &[f64], f: f64| DMatrix::from_fn(4, 4, |i, j| if i == j { f * v[i] * v[i] } else { 0.0 });
    let (q, r) = (squares(&drift, SAMPLE), DMatrix::from_element(1, 1, 1e-6));
    let mut random = 11u64;
    let (mut sum_early, mut sum_late) = (0.0, 0.0);
    for _ in 0..300 {
        let mut estimate = controller.begin();
        let mut truth: Vec<f64> = initial.iter().map(|sd| sd * normal(&mut random)).collect();
        let mut p = squares(&initial, 1.0);
        for k in 0..60 {
            let row = &controller.rows[k];
            let noise = 1e-3 * normal(&mut random);
            let measured =
                row.measured[0] + (0..4).map(|i| row.output[(0, i)] * truth[i]).sum::<f64>() + noise;
            let (inputs, states) = controller.step(&mut estimate, &[measured]);
            p = riccati::corrected(&p, &row.correction, &row.output, &r);
            let error = DMatrix::from_fn(4, 1, |i, _| states[i] - row.states[i] - truth[i]);
            let squared = (error.transpose() * p.clone().cholesky().unwrap().solve(&error))[(0, 0)];
            if k == 2 {
                sum_early += squared / 300.0;
            } else if k == 59 {
                sum_late += squared / 300.0;
            }
            truth = (0..4)
                .map(|i| {
                    let of_states: f64 = (0..4).map(|j| row.a[(i, j)] * truth[j]).sum();
                    let moved = row.drift[i] + of_states + row.b[(i, 0)] * (inputs[0] - row.inputs[0]);
                    moved + drift[i] * SAMPLE.sqrt() * normal(&mut random)
                })
                .collect();
            p = riccati::predicted(&p, &row.a, &q);
        }
    }
    for mean in [sum_early, sum_late] {
        assert!((mean - 4.0).abs() < 4.0 * 0.163, "{sum_early} {sum_late}");
    }
}

#[test]
fn the_table_has_every_number_of_every_row() {
    let controller = controller(Measured::Output(0), 1.0).unwrap();
    let table = controller.table();
    let mut lines = table.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    // time, x 4, u 1, y 1, K 4, L 4, A 16, B 4, c 4, C 4.
    assert_eq!(header.len(), 43);
    assert_eq!(header[7..12], ["K[1][1]", "K[1][2]", "K[1][3]", "K[1][4]", "L[1][1]"]);
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 101);
    for (k, (row, written)) in controller.rows.iter().zip(&rows).enumerate() {
        let at = |name: &str| written[header.iter().position(|column| *column == name).unwrap()];
        assert!((written[0] - 0.01 * k as f64).abs() < 1e-12);
        assert_eq!((at("A[2][3]"), at("K[1][3]")), (row.a[(1, 2)], row.feedback[(0, 2)]));
        assert_eq!((at("L[4][1]"), at("C[1][1]")), (row.correction[(3, 0)], row.output[(0, 0)]));
    }
}
