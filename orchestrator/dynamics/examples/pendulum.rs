//! A pendulum as `Dynamics`, its Jacobian checked by differences: `cargo run -p airloop-dynamics --example pendulum`.

use airloop_dynamics::{Dynamics, EvaluationError, Point, Size, Structure};

const SIZE: Size = Size { states: 2, inputs: 1, outputs: 0 };

/// `theta' = omega`, `omega' = -9.81 sin(theta) + u` for a length of 1 m.
struct Pendulum(Structure);

impl Dynamics for Pendulum {
    fn size(&self) -> Size {
        SIZE
    }

    fn structure(&self) -> &Structure {
        &self.0
    }

    fn names(&self) -> Vec<String> {
        ["theta", "omega", "u"].map(str::to_owned).into()
    }

    fn evaluate(&mut self, at: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError> {
        values[0] = at.states[1];
        values[1] = -9.81 * at.states[0].sin() + at.inputs[0];
        Ok(())
    }

    fn jacobian(
        &mut self,
        at: Point<'_>,
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        jacobian.copy_from_slice(&[0.0, 1.0, 0.0, -9.81 * at.states[0].cos(), 0.0, 1.0]);
        self.evaluate(at, values)
    }

    fn hessian(
        &mut self,
        at: Point<'_>,
        weights: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        hessian.fill(0.0);
        hessian[0] = weights[1] * 9.81 * at.states[0].sin();
        Ok(())
    }

    fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError> {
        Ok(Box::new(Pendulum(self.0.clone())))
    }
}

fn main() -> Result<(), EvaluationError> {
    let mut plant = Pendulum(Structure::dense(SIZE));
    let (mut here, mut there, mut jacobian) = ([0.0; 2], [0.0; 2], [0.0; 6]);
    let at = |theta| [theta, 0.3];
    plant.jacobian(Point { time: 0.0, states: &at(1.0), inputs: &[2.0] }, &mut here, &mut jacobian)?;
    plant.evaluate(Point { time: 0.0, states: &at(1.0 + 1e-6), inputs: &[2.0] }, &mut there)?;
    println!("d omega'/d theta = {:.6}, by differences {:.6}", jacobian[3], (there[1] - here[1]) / 1e-6);
    Ok(())
}
