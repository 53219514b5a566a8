//! Cost of an evaluation, as counts.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use airloop_ocp::transcription::{
    Discretization, Dynamics, Point, Problem, Program, Size, Structure, Transcription,
};
use airloop_optim::{EvaluationError, Nlp};

use crate::cart_pole::{CartPole, swing_up};
use crate::derivatives::ALL;

/// Calls of the three functions.
#[derive(Default)]
struct Calls([AtomicUsize; 3]);

impl Calls {
    fn take(&self) -> [usize; 3] {
        self.0.each_ref().map(|count| count.swap(0, Ordering::Relaxed))
    }
}

struct Counted {
    inner: CartPole,
    calls: Arc<Calls>,
}

impl Dynamics for Counted {
    fn size(&self) -> Size {
        self.inner.size()
    }

    fn structure(&self) -> &Structure {
        self.inner.structure()
    }

    fn names(&self) -> Vec<String> {
        self.inner.names()
    }

    fn evaluate(&mut self, at: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError> {
        self.calls.0[0].fetch_add(1, Ordering::Relaxed);
        self.inner.evaluate(at, values)
    }

    fn jacobian(
        &mut self,
        at: Point<'_>,
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.calls.0[1].fetch_add(1, Ordering::Relaxed);
        self.inner.jacobian(at, values, jacobian)
    }

    fn hessian(
        &mut self,
        at: Point<'_>,
        weights: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.calls.0[2].fetch_add(1, Ordering::Relaxed);
        self.inner.hessian(at, weights, hessian)
    }

    fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError> {
        Ok(Box::new(Counted { inner: CartPole::new(), calls: self.calls.clone() }))
    }
}

fn counted() -> (Problem, Arc<Calls>) {
    let calls = Arc::new(Calls::default());
    let mut problem = swing_up(1);
    problem.phases[0].dynamics = vec![Box::new(Counted { inner: CartPole::new(), calls: calls.clone() })];
    (problem, calls)
}

#[test]
fn every_point_is_evaluated_once_for_all_functions() {
    let n = 20;
    // Nodes and midpoints; 100 ms are 100 samples of four Runge-Kutta stages; both ends and the middle.
    let points = [n + 1, 2 * n + 1, 2 * n + 1, 4 * 100 * n, 3 * n];
    for (transcription, points) in ALL.into_iter().zip(points) {
        let (mut problem, calls) = counted();
        let mut program = Program::new(&mut problem, &Discretization::uniform(transcription, &[n])).unwrap();
        let x: Vec<f64> = (0..program.variables()).map(|i| 0.1 * (i as f64).sin()).collect();
        let (mut values, mut gradient) = (vec![0.0; program.constraints()], vec![0.0; x.len()]);
        let mut jacobian = vec![0.0; program.jacobian_pattern().len()];
        let mut hessian = vec![0.0; program.hessian_pattern().len()];
        calls.take();
        program.constraint_values(&x, &mut values).unwrap();
        program.objective(&x).unwrap();
        assert_eq!(calls.take(), [points, 0, 0], "{transcription:?}");
        program.gradient(&x, &mut gradient).unwrap();
        program.jacobian(&x, &mut jacobian).unwrap();
        program.objective(&x).unwrap();
        assert_eq!(calls.take(), [0, points, 0], "{transcription:?}");
        program.hessian(&x, 1.0, &values.clone(), &mut hessian).unwrap();
        assert_eq!(calls.take(), [0, 0, points], "{transcription:?}");
    }
}

#[test]
fn entries_grow_with_the_number_of_intervals() {
    let entries = |transcription: Transcription, n: usize| {
        let mut problem = swing_up(1);
        let program = Program::new(&mut problem, &Discretization::uniform(transcription, &[n])).unwrap();
        [program.jacobian_pattern().len(), program.hessian_pattern().len()]
    };
    for transcription in ALL {
        let [a, b, c] = [25, 50, 100].map(|n| entries(transcription, n));
        for i in 0..2 {
            assert_eq!(c[i] - b[i], 2 * (b[i] - a[i]), "{transcription:?}");
        }
    }
}
