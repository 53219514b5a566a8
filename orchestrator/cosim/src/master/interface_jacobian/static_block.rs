//! A block without states inside a coupled component, evaluated at any input while the coupling is solved.
//!
//! Through a second instance for Model Exchange this is the block itself. An FMU without that interface is replaced
//! by a secant model: tangent at the present input, corrected along the way to a predicted input, at which the slave
//! has made a step that is then taken back.

use super::unit::Unit;
use crate::master::exchange::Node;
use crate::master::stop::Stop;
use airloop_fmi::Model;

/// Relative size of the change of an input for a difference quotient.
const RELATIVE_DIFFERENCE_STEP: f64 = 1e-6;

/// See the module.
#[derive(Debug)]
pub(super) enum Function {
    /// A Model Exchange instance, and whether it offers directional derivatives.
    Exchange { model: Box<Model>, derivatives: bool },
    /// Values at the present input, and where the block does not offer directional derivatives, none of its own.
    Secant(Secant),
}

/// See the module; `[ny]`, `[nu]` and `[ny, nu]` row by row.
#[derive(Debug)]
pub(super) struct Secant {
    pub u0: Vec<f64>,
    pub y0: Vec<f64>,
    pub tangent: Vec<f64>,
    /// 1 for an input on which an output depends nonlinearly (scaled by its nominal value), else 0.
    pub weight: Vec<f64>,
    slope: Vec<f64>,
    /// Whether the slave has directional derivatives.
    derivatives: bool,
}

impl Secant {
    pub fn new(weight: Vec<f64>, ny: usize, derivatives: bool) -> Secant {
        let nu = weight.len();
        let tangent = vec![0.0; ny * nu];
        Secant { u0: vec![0.0; nu], y0: vec![0.0; ny], slope: tangent.clone(), tangent, weight, derivatives }
    }

    /// Tangent at the present input, from directional derivatives or else from steps that are taken back.
    pub fn linearize(
        &mut self,
        unit: &mut Unit,
        node: &mut Node,
        y: &[f64],
        (t, h): (f64, f64),
    ) -> Result<(), Stop> {
        self.u0.copy_from_slice(&unit.u);
        self.y0.copy_from_slice(y);
        let (nu, ny) = (self.weight.len(), y.len());
        if !self.derivatives {
            unit.save(node)?;
        }
        for k in 0..nu {
            // `slope` serves as the column here; it is overwritten below.
            let column = &mut self.slope[..ny];
            if self.derivatives {
                let known = [unit.input_references[k]];
                node.slave().directional_derivative(&unit.output_references, &known, &[1.0], column)?;
            } else {
                let step = RELATIVE_DIFFERENCE_STEP * unit.u[k].abs().max(unit.inputs[k].nominal);
                unit.value.copy_from_slice(&self.u0);
                unit.slope.fill(0.0);
                unit.value[k] += step;
                unit.advance(node, t, h, true)?;
                node.slave().get_real(&unit.output_references, column)?;
                column.iter_mut().zip(y).for_each(|(moved, y)| *moved = (*moved - y) / step);
                unit.restore(node)?;
                unit.u.copy_from_slice(&self.u0);
            }
            for row in 0..ny {
                self.tangent[row * nu + k] = self.slope[row];
            }
        }
        self.slope.copy_from_slice(&self.tangent);
        Ok(())
    }

    /// Corrects the slope so that the model gives `y` at `u`.
    pub fn correct(&mut self, u: &[f64], y: &[f64]) {
        let nu = self.weight.len();
        let direction = |k: usize| self.weight[k] * (u[k] - self.u0[k]);
        let length: f64 = (0..nu).map(|k| direction(k) * (u[k] - self.u0[k])).sum();
        if length <= f64::MIN_POSITIVE {
            return;
        }
        for row in 0..y.len() {
            let along: f64 = (0..nu).map(|k| self.tangent[row * nu + k] * (u[k] - self.u0[k])).sum();
            let rest = y[row] - self.y0[row] - along;
            for k in 0..nu {
                self.slope[row * nu + k] = self.tangent[row * nu + k] + rest * direction(k) / length;
            }
        }
    }
}

impl Function {
    /// Outputs `y` of a Model Exchange instance at the inputs `u` and the time `t` \[s\].
    pub fn values(&mut self, unit: &Unit, t: f64, u: &[f64], y: &mut [f64]) -> Result<(), Stop> {
        if let Function::Exchange { model, .. } = self {
            model.set_time(t)?;
            model.set_real(&unit.input_references, u)?;
            model.get_real(&unit.output_references, y)?;
        }
        Ok(())
    }

    /// Outputs `y` and their Jacobian `[ny, nu]` at the inputs `u` and the time `t` \[s\].
    pub fn evaluate(
        &mut self,
        unit: &Unit,
        t: f64,
        u: &[f64],
        y: &mut [f64],
        jacobian: &mut [f64],
        column: &mut [f64],
    ) -> Result<(), Stop> {
        let nu = u.len();
        let column = &mut column[..y.len().max(nu)];
        match self {
            Function::Secant(secant) => {
                for (row, y) in y.iter_mut().enumerate() {
                    let slope = &secant.slope[row * nu..(row + 1) * nu];
                    *y = secant.y0[row] + (0..nu).map(|k| slope[k] * (u[k] - secant.u0[k])).sum::<f64>();
                }
                jacobian.copy_from_slice(&secant.slope);
            }
            Function::Exchange { .. } => {
                self.values(unit, t, u, y)?;
                let Function::Exchange { model, derivatives } = self else { return Ok(()) };
                for k in 0..nu {
                    let known = [unit.input_references[k]];
                    let column = &mut column[..y.len()];
                    if *derivatives {
                        model.directional_derivative(&unit.output_references, &known, &[1.0], column)?;
                    } else {
                        let step = RELATIVE_DIFFERENCE_STEP * u[k].abs().max(unit.inputs[k].nominal);
                        model.set_real(&known, &[u[k] + step])?;
                        model.get_real(&unit.output_references, column)?;
                        model.set_real(&known, &u[k..=k])?;
                        column.iter_mut().zip(&*y).for_each(|(moved, y)| *moved = (*moved - y) / step);
                    }
                    for (row, value) in column.iter().enumerate() {
                        jacobian[row * nu + k] = *value;
                    }
                }
            }
        }
        Ok(())
    }
}
