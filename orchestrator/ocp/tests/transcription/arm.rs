//! Small dynamics with everything in them: nonlinear rates, a linear block, outputs, two inputs.
//!
//! ```text
//! x0' = x1    x1' = sin(x0) u0 - x1 x2 + 0.2 u1    x2' = -2 x2 + u1    g0 = x0 x2 + u0^2    g1 = x1 - 3 u1
//! ```

use airloop_ocp::transcription::{Dynamics, Entry, Point, Reset, ResetSize, Size, Structure};
use airloop_optim::EvaluationError;

const SIZE: Size = Size { states: 3, inputs: 2, outputs: 2 };

pub struct Arm {
    structure: Structure,
}

impl Arm {
    pub fn new() -> Arm {
        let (o, c, v) = (Entry::Zero, Entry::Constant, Entry::Varying);
        #[rustfmt::skip]
        let entries = vec![
            o, c, o, o, o,
            v, v, v, v, c,
            o, o, c, o, c,
            v, o, v, v, o,
            o, c, o, o, c,
        ];
        Arm { structure: Structure::new(SIZE, entries) }
    }
}

impl Dynamics for Arm {
    fn size(&self) -> Size {
        SIZE
    }

    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn names(&self) -> Vec<String> {
        ["angle", "speed", "pressure", "torque", "valve", "g0", "g1"].map(str::to_owned).to_vec()
    }

    fn evaluate(&mut self, at: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError> {
        let (x, u) = (at.states, at.inputs);
        if x[0] > 100.0 {
            let reason = "the angle is out of range".to_owned();
            return Err(EvaluationError { function: "arm".to_owned(), reason });
        }
        values.copy_from_slice(&[
            x[1],
            x[0].sin() * u[0] - x[1] * x[2] + 0.2 * u[1],
            -2.0 * x[2] + u[1],
            x[0] * x[2] + u[0] * u[0],
            x[1] - 3.0 * u[1],
        ]);
        Ok(())
    }

    fn jacobian(
        &mut self,
        at: Point<'_>,
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.evaluate(at, values)?;
        let (x, u) = (at.states, at.inputs);
        #[rustfmt::skip]
        jacobian.copy_from_slice(&[
            0.0, 1.0, 0.0, 0.0, 0.0,
            x[0].cos() * u[0], -x[2], -x[1], x[0].sin(), 0.2,
            0.0, 0.0, -2.0, 0.0, 1.0,
            x[2], 0.0, x[0], 2.0 * u[0], 0.0,
            0.0, 1.0, 0.0, 0.0, -3.0,
        ]);
        Ok(())
    }

    fn hessian(
        &mut self,
        at: Point<'_>,
        weights: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        let (x, u) = (at.states, at.inputs);
        hessian.fill(0.0);
        let mut set = |i: usize, j: usize, value: f64| {
            hessian[i * 5 + j] = value;
            hessian[j * 5 + i] = value;
        };
        set(0, 0, -weights[1] * x[0].sin() * u[0]);
        set(0, 3, weights[1] * x[0].cos());
        set(1, 2, -weights[1]);
        set(0, 2, weights[3]);
        set(3, 3, 2.0 * weights[3]);
        Ok(())
    }

    fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError> {
        Ok(Box::new(Arm::new()))
    }
}

/// `x+ = (x0, -0.5 x1 + 0.1 x0^2, x2 x1)`, output `x1^2`.
pub struct Impact;

impl Reset for Impact {
    fn size(&self) -> ResetSize {
        ResetSize { before: 3, after: 3, outputs: 1 }
    }

    fn output_names(&self) -> Vec<String> {
        vec!["impulse".to_owned()]
    }

    fn evaluate(&mut self, x: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        values.copy_from_slice(&[x[0], -0.5 * x[1] + 0.1 * x[0] * x[0], x[2] * x[1], x[1] * x[1]]);
        Ok(())
    }

    fn jacobian(
        &mut self,
        x: &[f64],
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.evaluate(x, values)?;
        #[rustfmt::skip]
        jacobian.copy_from_slice(&[
            1.0, 0.0, 0.0,
            0.2 * x[0], -0.5, 0.0,
            0.0, x[2], x[1],
            0.0, 2.0 * x[1], 0.0,
        ]);
        Ok(())
    }

    fn hessian(&mut self, _: &[f64], weights: &[f64], hessian: &mut [f64]) -> Result<(), EvaluationError> {
        hessian.fill(0.0);
        hessian[0] = 0.2 * weights[1];
        hessian[4] = 2.0 * weights[3];
        (hessian[5], hessian[7]) = (weights[2], weights[2]);
        Ok(())
    }
}
