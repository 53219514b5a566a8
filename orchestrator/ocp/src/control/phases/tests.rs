//! A ball that falls and bounces, whose motion with the bounce inside is known in closed form.

use super::*;
use crate::transcription::{Dynamics, ResetSize, Size, Structure};
use airloop_optim::EvaluationError;
use airloop_series::Interpolation;

const SAMPLE: f64 = 0.01;
const GRAVITY: f64 = 9.81;
/// Share of the speed that is left after a bounce.
const KEPT: f64 = 0.5;
const SIZE: Size = Size { states: 2, inputs: 1, outputs: 2 };

/// States height and velocity, input an acceleration, outputs the states.
struct Ball(Structure);

impl Dynamics for Ball {
    fn size(&self) -> Size {
        SIZE
    }
    fn structure(&self) -> &Structure {
        &self.0
    }
    fn names(&self) -> Vec<String> {
        ["height", "velocity", "push", "above", "rising"].map(String::from).to_vec()
    }
    fn evaluate(&mut self, at: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError> {
        values.copy_from_slice(&[at.states[1], at.inputs[0] - GRAVITY, at.states[0], at.states[1]]);
        Ok(())
    }
    fn jacobian(
        &mut self,
        at: Point<'_>,
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.evaluate(at, values)?;
        jacobian.copy_from_slice(&[0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        Ok(())
    }
    fn hessian(&mut self, _: Point<'_>, _: &[f64], hessian: &mut [f64]) -> Result<(), EvaluationError> {
        hessian.fill(0.0);
        Ok(())
    }
    fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError> {
        Ok(Box::new(Ball(self.0.clone())))
    }
}

struct Bounce;

impl Reset for Bounce {
    fn size(&self) -> ResetSize {
        ResetSize { before: 2, after: 2, outputs: 0 }
    }
    fn output_names(&self) -> Vec<String> {
        Vec::new()
    }
    fn evaluate(&mut self, before: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        values.copy_from_slice(&[before[0], -KEPT * before[1]]);
        Ok(())
    }
    fn jacobian(
        &mut self,
        before: &[f64],
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.evaluate(before, values)?;
        jacobian.copy_from_slice(&[1.0, 0.0, 0.0, -KEPT]);
        Ok(())
    }
    fn hessian(&mut self, _: &[f64], _: &[f64], hessian: &mut [f64]) -> Result<(), EvaluationError> {
        hessian.fill(0.0);
        Ok(())
    }
}

/// From (height, velocity) under a push, over a time \[s\], with the bounce where the height is 0.
fn moved((y, v): (f64, f64), push: f64, time: f64) -> ((f64, f64), bool) {
    let a = push - GRAVITY;
    let free = |(y, v): (f64, f64), t: f64| (y + v * t + 0.5 * a * t * t, v + a * t);
    // The later root of y + v t + a t^2 / 2, with a < 0.
    let landing = (-v - (v * v - 2.0 * a * y).sqrt()) / a;
    if landing > time || landing < 0.0 {
        return (free((y, v), time), false);
    }
    let (_, speed) = free((y, v), landing);
    (free((0.0, -KEPT * speed), time - landing), true)
}

/// Time at which a ball that is dropped from 1 m lands \[s\].
fn landing() -> f64 {
    (2.0 / GRAVITY).sqrt()
}

/// Knots of a fall from 1 m and of the 0.3 s after it.
type Table = (Vec<f64>, Vec<Vec<f64>>, Vec<Vec<f64>>);
fn knots() -> [Table; 2] {
    let table = |from: f64, to: f64, at: &dyn Fn(f64) -> Vec<f64>| -> Table {
        let time: Vec<f64> = (0..=10).map(|k| from + (to - from) * f64::from(k) / 10.0).collect();
        let states = time.iter().map(|&t| at(t)).collect();
        (time, states, vec![vec![0.0]; 11])
    };
    let rise = KEPT * GRAVITY * landing();
    let fall = |t: f64| vec![1.0 - 0.5 * GRAVITY * t * t, -GRAVITY * t];
    let after = |t: f64| {
        let t = t - landing();
        vec![rise * t - 0.5 * GRAVITY * t * t, rise - GRAVITY * t]
    };
    [table(0.0, landing(), &fall), table(landing(), landing() + 0.3, &after)]
}

fn with_phases<T>(then: impl FnOnce(&mut Phases<'_>) -> T) -> T {
    let tables = knots();
    let mut balls = [Ball(Structure::dense(SIZE)), Ball(Structure::dense(SIZE))];
    let mut legs = Vec::new();
    for ((ball, (time, states, inputs)), name) in balls.iter_mut().zip(&tables).zip(["fall", "rise"]) {
        let at = Point { time: 0.0, states: &states[0], inputs: &inputs[0] };
        let plant = Sampled::new(ball, &[], SAMPLE, 1, at).unwrap();
        legs.push(Leg {
            plant,
            knots: Knots { time, states, inputs, interpolation: Interpolation::Linear },
            name,
        });
    }
    then(&mut Phases::new(legs).unwrap())
}

fn event() -> Event {
    Event { guard: 0, reset: Some(Box::new(Bounce)) }
}

#[test]
fn the_sample_with_the_event_has_the_derivatives_of_the_bounce() {
    with_phases(|phases| {
        let k = phases.own[0].end - 1;
        assert_eq!(k, 45, "the ball lands at 0.4515 s");
        let found = phases.across(0, k, &mut event(), None).unwrap();
        let start = (phases.nominal.states[k][0], phases.nominal.states[k][1]);
        let h = 1e-6;
        let at = |dy: f64, dv: f64, push: f64| {
            let (end, bounced) = moved((start.0 + dy, start.1 + dv), push, SAMPLE);
            assert!(bounced);
            [end.0, end.1]
        };
        let slope = |a: [f64; 2], b: [f64; 2], i: usize| (a[i] - b[i]) / (2.0 * h);
        for i in 0..2 {
            // Central differences are exact to h^2 and rounding / h.
            assert!((found.a[(i, 0)] - slope(at(h, 0.0, 0.0), at(-h, 0.0, 0.0), i)).abs() < 1e-7);
            assert!((found.a[(i, 1)] - slope(at(0.0, h, 0.0), at(0.0, -h, 0.0), i)).abs() < 1e-7);
            assert!((found.b[(i, 0)] - slope(at(0.0, 0.0, h), at(0.0, 0.0, -h), i)).abs() < 1e-7);
            assert!((found.next[i] - at(0.0, 0.0, 0.0)[i]).abs() < 1e-12);
        }
    });
}

#[test]
fn a_phase_goes_on_beyond_its_ends_as_without_the_event() {
    with_phases(|phases| {
        let below = phases.sample(0, 50).unwrap().0;
        assert!((below[0] - (1.0 - 0.5 * GRAVITY * 0.25)).abs() < 1e-12 && below[0] < 0.0);
        let (before, _) = phases.sample(1, 40).unwrap();
        let (rise, t) = (KEPT * GRAVITY * landing(), 0.4 - landing());
        assert!((before[0] - (rise * t - 0.5 * GRAVITY * t * t)).abs() < 1e-12);
    });
}

/// Largest command after a knock by 50 mm shortly before the bounce, and the last error of the height.
fn closed_loop(modes: Option<Vec<i32>>) -> (f64, f64) {
    with_phases(|phases| {
        let following = Following { modes, overlap: 0.1, horizon: 0.5 };
        let design = Design {
            state_deviation: vec![0.05, 0.5],
            input_deviation: vec![10.0],
            measured: vec![crate::control::Measured::State(0), crate::control::Measured::State(1)],
            noise: vec![1e-6; 2],
            state_drift: vec![0.01; 2],
            input_drift: vec![0.0],
            initial: vec![0.01; 2],
            limits: vec![(-1e3, 1e3)],
        };
        let (controller, _) = phases.design(vec![event()], &following, &design).unwrap();
        let mut estimate = controller.begin();
        let (mut state, mut mode, mut largest) = ((1.0, 0.0), 1, 0.0_f64);
        for k in 0..phases.nominal.samples() {
            // Five samples before the bounce.
            state.0 -= if k == 40 { 0.05 } else { 0.0 };
            let (command, _) = controller.step_in(&mut estimate, mode, &[state.0, state.1]);
            largest = largest.max(command[0].abs());
            let (next, bounced) = moved(state, command[0], SAMPLE);
            (state, mode) = (next, if bounced { 2 } else { mode });
        }
        let end = &phases.nominal.states[phases.nominal.samples() - 1];
        let time = phases.nominal.time(phases.nominal.samples()) - landing();
        let planned = KEPT * GRAVITY * landing() * time - 0.5 * GRAVITY * time * time;
        assert!(end[0] > 0.0);
        (largest, (state.0 - planned).abs())
    })
}

#[test]
fn the_mode_of_the_plant_keeps_the_command_small_around_an_early_event() {
    let (by_time, _) = closed_loop(None);
    let (by_mode, error) = closed_loop(Some(vec![1, 2]));
    // Half of the knock at most is left after 0.3 s.
    assert!(error < 0.025, "{error}");
    assert!(by_mode < 0.5 * by_time, "{by_mode} {by_time}");
}

#[test]
fn an_event_that_is_only_touched_is_refused_with_phase_and_guard() {
    with_phases(|phases| {
        // At the top of a flight the height does not pass through anything.
        let top: Vec<Vec<f64>> = (0..11).map(|_| vec![0.0, 0.0]).collect();
        let knots = phases.legs[0].knots;
        phases.legs[0].knots = Knots { states: Box::leak(top.into_boxed_slice()), ..knots };
        let message = phases.across(0, 45, &mut event(), None).unwrap_err().to_string();
        assert!(message.contains("above") && message.contains("`fall`"), "{message}");
    });
}

#[test]
fn the_table_of_a_controller_with_phases_names_sample_and_mode() {
    with_phases(|phases| {
        let following = Following { modes: Some(vec![4, 9]), overlap: 0.02, horizon: 0.1 };
        let nominal = phases.nominal.clone();
        let measured = vec![crate::control::Measured::State(0), crate::control::Measured::State(1)];
        let mut design = Design::of(&nominal, measured, vec![1e-6; 2], vec![(-1e3, 1e3)]);
        design.input_deviation = vec![1.0];
        let (controller, rows) = phases.design(vec![event()], &following, &design).unwrap();
        assert_eq!(rows.len(), nominal.samples() + 1);
        let table = controller.table();
        let places: Vec<String> = table
            .lines()
            .skip(1)
            .map(|line| line.split(',').skip(1).take(2).collect::<Vec<_>>().join(" "))
            .collect();
        assert!(table.starts_with("time,sample,mode,x[1]"));
        // 46 samples of the fall and two beyond; the rise from two before.
        assert_eq!((places[47].as_str(), places[48].as_str()), ("47 4", "44 9"));
        assert_eq!(places.len(), controller.rows.len());
    });
}

/// A ball that is kept bouncing, once a second: under the push g - 3/2 g t it rises until t = 1/sqrt(3) s and is back
/// on the floor after 1 s, twice as fast as it left.
fn with_turn<T>(then: impl FnOnce(&mut Phases<'_>) -> T) -> T {
    let top = (1.0_f64 / 3.0).sqrt();
    let table = |from: f64, to: f64| -> Table {
        let time: Vec<f64> = (0..=20).map(|k| from + (to - from) * f64::from(k) / 20.0).collect();
        let states = |t: &f64| vec![0.25 * GRAVITY * (t - t * t * t), 0.25 * GRAVITY * (1.0 - 3.0 * t * t)];
        let inputs = |t: &f64| vec![GRAVITY - 1.5 * GRAVITY * t];
        let (states, inputs) = (time.iter().map(states).collect(), time.iter().map(inputs).collect());
        (time, states, inputs)
    };
    let tables = [table(0.0, top), table(top, 1.0)];
    let mut balls = [Ball(Structure::dense(SIZE)), Ball(Structure::dense(SIZE))];
    let mut legs = Vec::new();
    for ((ball, (time, states, inputs)), name) in balls.iter_mut().zip(&tables).zip(["rise", "fall"]) {
        let at = Point { time: 0.0, states: &states[0], inputs: &inputs[0] };
        let plant = Sampled::new(ball, &[], SAMPLE, 1, at).unwrap();
        legs.push(Leg {
            plant,
            knots: Knots { time, states, inputs, interpolation: Interpolation::Linear },
            name,
        });
    }
    then(&mut Phases::new(legs).unwrap())
}

fn design_turn(phases: &mut Phases<'_>, modes: Vec<i32>) -> Result<Periodic, Error> {
    let following = Following { modes: Some(modes), overlap: 0.1, horizon: 0.5 };
    let design = Design {
        state_deviation: vec![0.05, 0.5],
        input_deviation: vec![10.0],
        measured: vec![crate::control::Measured::State(0), crate::control::Measured::State(1)],
        noise: vec![1e-6; 2],
        state_drift: vec![0.01; 2],
        input_drift: vec![0.0],
        initial: vec![0.01; 2],
        limits: vec![(-1e3, 1e3)],
    };
    let turn = Turn { states: vec![(0, 1.0), (1, 1.0)], inputs: vec![(0, 1.0)], free: vec![], count: 20 };
    let apex = Event { guard: 1, reset: None };
    phases.design_cycle(vec![apex, event()], &following, &design, &turn)
}

#[test]
fn multipliers_of_a_ball_that_is_kept_bouncing_are_those_of_its_saltation() {
    with_turn(|phases| {
        let made = design_turn(phases, vec![1, 2]).unwrap();
        // With v- = -g/2, v+ = g/4 and the acceleration -3/2 g on both sides of the bounce:
        // Xi = [[1 + (v+ - v-) / v-, 0], [(-3/2 g - 3/4 g) / v-, -1/2]], and Phi = [[1, 1], [0, 1]].
        let expected = DMatrix::from_row_slice(2, 2, &[-0.5, -0.5, 4.5, 4.0]);
        assert!((&made.open_loop.matrix - expected).norm() < 1e-9, "{}", made.open_loop.matrix);
        let (sum, product): (f64, f64) = (3.5, 0.25);
        let root = (0.25 * sum * sum - product).sqrt();
        let found: Vec<f64> = made.open_loop.multipliers.iter().map(|one| one.re).collect();
        assert!((found[0] - (0.5 * sum + root)).abs() < 1e-9 && (found[1] - (0.5 * sum - root)).abs() < 1e-9);
        assert!(made.closed_loop.multipliers[0].norm() < 0.5, "{:?}", made.closed_loop.multipliers);
    });
}

#[test]
fn twenty_turns_are_held_and_the_controller_begins_again_after_each() {
    with_turn(|phases| {
        let Periodic { controller, .. } = design_turn(phases, vec![1, 2]).unwrap();
        assert_eq!(controller.repeat.as_ref().unwrap().samples, 100);
        assert_eq!(phases.nominal.samples(), 2000);
        let run = |feedback: bool| {
            let mut estimate = controller.begin();
            let mut state = (0.0, 0.25 * GRAVITY + 0.1);
            let mut largest = 0.0_f64;
            for k in 0..2000 {
                let mode = if state.1 > 0.0 { 1 } else { 2 };
                let (command, _) = controller.step_in(&mut estimate, mode, &[state.0, state.1]);
                let push = if feedback { command[0] } else { phases.nominal.inputs[k][0] };
                // Within a sample after it left the floor it does not land.
                state = match moved(state, push, SAMPLE) {
                    (next, true) if state.0 > 1e-9 || state.1 < 0.0 => next,
                    _ => (
                        state.0 + state.1 * SAMPLE + 0.5 * (push - GRAVITY) * SAMPLE * SAMPLE,
                        state.1 + (push - GRAVITY) * SAMPLE,
                    ),
                };
                let t = k % 100 + 1;
                if k >= 1900 && t == 50 {
                    // A ball that has fallen through the floor has no height.
                    let off = (state.0 - phases.nominal.states[k + 1][0]).abs();
                    largest = if off.is_nan() { f64::INFINITY } else { largest.max(off) };
                }
            }
            largest
        };
        let (held, alone) = (run(true), run(false));
        assert!(held < 1e-3, "{held}");
        assert!(alone > 0.1, "{alone}");
    });
}

#[test]
fn a_turn_that_cannot_be_followed_is_refused() {
    with_turn(|phases| {
        let message = design_turn(phases, vec![1, 1]).unwrap_err().to_string();
        assert!(message.contains("same value"), "{message}");
        let message = design_turn(phases, vec![1, 2, 3]).unwrap_err().to_string();
        assert!(message.contains("in each of the 2"), "{message}");
    });
    with_phases(|phases| {
        let message = design_turn(phases, vec![1, 2]).unwrap_err().to_string();
        assert!(message.contains("no whole number of samples of 0.01 s"), "{message}");
    });
}
