//! The pneumatic cart-pole as dynamics, from the equations that were typed by hand, and its swing-up as a problem.

use std::f64::consts::PI;

use airloop_ocp::transcription::{
    Cost, Duration, Dynamics, Entry, Limit, Path, Phase, Point, Problem, Shooting, Size, Structure, Variable,
};
use airloop_optim::EvaluationError;

use crate::problem::{DURATION, STROKE, U_MAX};
use airloop_testing::mechanics::{Accelerations, FEED, SAMPLE, accelerations, continuous_actuator};

const SIZE: Size = Size { states: 6, inputs: 1, outputs: 0 };

/// States x, theta, v, w, z1, z2; input u.
pub struct CartPole {
    structure: Structure,
    ac: [[f64; 2]; 2],
    bc: [f64; 2],
}

impl CartPole {
    pub fn new() -> CartPole {
        let (o, c, v) = (Entry::Zero, Entry::Constant, Entry::Varying);
        #[rustfmt::skip]
        let entries = vec![
            o, o, c, o, o, o, o,
            o, o, o, c, o, o, o,
            o, v, v, v, o, v, v,
            o, v, v, v, o, v, v,
            o, o, o, o, c, c, c,
            o, o, o, o, c, c, c,
        ];
        let (ac, bc) = continuous_actuator();
        CartPole { structure: Structure::new(SIZE, entries), ac, bc }
    }

    fn at(x: &[f64], u: f64) -> Accelerations {
        accelerations([x[1], x[2], x[3], x[5] + FEED * u])
    }

    fn rates(&self, x: &[f64], u: f64, accelerations: &Accelerations, values: &mut [f64]) {
        values[..2].copy_from_slice(&x[2..4]);
        values[2..4].copy_from_slice(&accelerations.value);
        for i in 0..2 {
            values[4 + i] = self.ac[i][0] * x[4] + self.ac[i][1] * x[5] + self.bc[i] * u;
        }
    }
}

impl Dynamics for CartPole {
    fn size(&self) -> Size {
        SIZE
    }

    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn names(&self) -> Vec<String> {
        ["x", "theta", "v", "w", "z1", "z2", "u"].map(str::to_owned).to_vec()
    }

    fn evaluate(&mut self, at: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError> {
        let (x, u) = (at.states, at.inputs[0]);
        self.rates(x, u, &Self::at(x, u), values);
        Ok(())
    }

    fn jacobian(
        &mut self,
        at: Point<'_>,
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let accelerations = Self::at(at.states, at.inputs[0]);
        self.rates(at.states, at.inputs[0], &accelerations, values);
        jacobian.fill(0.0);
        jacobian[2] = 1.0;
        jacobian[7 + 3] = 1.0;
        for i in 0..2 {
            let row = &mut jacobian[(2 + i) * 7..(3 + i) * 7];
            row[1..4].copy_from_slice(&accelerations.gradient[i][..3]);
            row[5] = accelerations.gradient[i][3];
            row[6] = FEED * accelerations.gradient[i][3];
            let row = &mut jacobian[(4 + i) * 7..(5 + i) * 7];
            row[4..6].copy_from_slice(&self.ac[i]);
            row[6] = self.bc[i];
        }
        Ok(())
    }

    fn hessian(
        &mut self,
        at: Point<'_>,
        weights: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let h = Self::at(at.states, at.inputs[0]).hessian([weights[2], weights[3]]);
        hessian.fill(0.0);
        // The force is z2 + FEED u.
        let places = [(1, 0, 1.0), (2, 1, 1.0), (3, 2, 1.0), (5, 3, 1.0), (6, 3, FEED)];
        for (a, i, of_a) in places {
            for (b, j, of_b) in places {
                hessian[a * 7 + b] = h[i][j] * of_a * of_b;
            }
        }
        Ok(())
    }

    fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError> {
        Ok(Box::new(CartPole::new()))
    }
}

/// Problem P1 with that many instances of its dynamics.
pub fn swing_up(threads: usize) -> Problem {
    let instances = (0..threads).map(|_| Box::new(CartPole::new()) as Box<dyn Dynamics>).collect();
    let mut phase = Phase::new("swing-up", instances, Duration::Fixed(DURATION));
    phase.shooting = Shooting::Sampled { states: vec![4, 5], sample_time: SAMPLE };
    let x = |i| Variable::State(i);
    phase.paths = vec![
        Path::at_nodes(Limit::between("stroke", "m", x(0), -STROKE, STROKE)),
        Path::everywhere(Limit::between("command", "N", Variable::Input(0), -U_MAX, U_MAX)),
    ];
    phase.start = (0..6).map(|i| Limit::equal("start", "", x(i), 0.0)).collect();
    let end = [0.0, PI, 0.0, 0.0];
    phase.end = end.iter().enumerate().map(|(i, &value)| Limit::equal("end", "", x(i), value)).collect();
    phase.integral = vec![Cost::square(Variable::Input(0), 1.0)];
    Problem::single(phase)
}
