//! Forces of constraints, such as those of the ground on feet, recomputed from the energy of the system by Lagrange's
//! equations.
//!
//! ```text
//! d/dt dT/dv - dT/dq + dV/dq = B u + J^T f,    E(q, v) = T + V,  T quadratic in v,  J = d(points)/dq
//! ```
//!
//! A model has its forces from its own equations of motion with constraints. Here these equations are not asked for: E
//! and the points are outputs, their derivatives give all terms but f, and the accelerations are those of the plan. f
//! follows by least squares of as many equations as there are coordinates; a force that does not act comes out as zero.

use serde::{Deserialize, Serialize};

use super::Error;
use super::catalog::Kind;
use super::prepare::{self, Prepared};
use super::task::Signals;
use airloop_ocp::transcription::{Dynamics, Point, Trajectory};
use airloop_optim::linalg::StreamedQr;

/// Deviation of forces from those of Lagrange's equations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Recomputed {
    /// Largest difference at the knots of the plan, in the unit of the force.
    pub largest_difference: f64,
    /// Force that differs most.
    pub force: String,
    /// Time \[s\].
    pub time: f64,
    /// Largest force, for comparison.
    pub largest_force: f64,
}

/// Step of the differences along the motion, in s; their error is of the fourth order.
const DIFFERENCE_STEP: f64 = 2e-3;

/// Recomputes the forces at all knots of a plan; none where the problem has no `[verification.balance]`.
///
/// # Errors
/// [`Error::File`] for names that are not what they have to be; [`Error::Evaluation`] where the system has no value.
pub fn recomputed(prepared: &Prepared, plan: &Trajectory) -> Result<Option<Recomputed>, Error> {
    let Some(names) = Names::new(prepared)? else { return Ok(None) };
    let mut worst =
        Recomputed { largest_difference: 0.0, force: String::new(), time: 0.0, largest_force: 0.0 };
    for (number, phase) in plan.phases.iter().enumerate() {
        let mut system = prepare::phase_dynamics(&prepared.setup, number, &names.signals)?;
        let mut equations = Equations::new(&names, &mut system);
        for (k, &time) in phase.times.iter().enumerate() {
            let inputs = phase.inputs_at(time);
            let (given, found) = equations.forces(&phase.states[k], &inputs)?;
            for (i, (given, found)) in given.iter().zip(&found).enumerate() {
                worst.largest_force = worst.largest_force.max(given.abs());
                if (given - found).abs() >= worst.largest_difference {
                    worst.largest_difference = (given - found).abs();
                    worst.force.clone_from(&names.forces[i]);
                    worst.time = time;
                }
            }
        }
    }
    Ok(Some(worst))
}

/// Everything by its index.
struct Names {
    /// States and inputs of the plan; outputs: energy, points, forces, then drives.
    signals: Signals,
    /// Coordinates and rates, as states.
    coordinates: Vec<(usize, usize)>,
    /// Output of a drive, coordinates with factors.
    drives: Vec<(Driven, Vec<(usize, f64)>)>,
    forces: Vec<String>,
}

/// Source of the value of a drive.
#[derive(Clone, Copy)]
enum Driven {
    State(usize),
    Input(usize),
    Output(usize),
}

impl Names {
    fn new(prepared: &Prepared) -> Result<Option<Names>, Error> {
        let (statement, catalog) = (&prepared.statement, &prepared.catalog);
        let Some(section) = &statement.verification.balance else { return Ok(None) };
        let source = &statement.source;
        let own = &prepared.task.signals;
        let output =
            |name: &crate::file::Text| {
                let (index, _) = catalog.want(source, name)?;
                match catalog.variables()[index].kind {
                    Kind::Output => Ok(index),
                    _ => Err(source
                        .error_at(name.place, format!("`{}` is not an output of the system", name.text))),
                }
            };
        let state = |name: &crate::file::Text| {
            let (index, _) = catalog.want(source, name)?;
            own.states.iter().position(|state| *state == index).ok_or_else(|| {
                source.error_at(name.place, format!("`{}` is not a state of the plan", name.text))
            })
        };
        let mut outputs = vec![output(&section.energy)?];
        for (_, point) in &section.forces {
            outputs.push(output(point)?);
        }
        for (force, _) in &section.forces {
            outputs.push(output(force)?);
        }
        let mut coordinates = Vec::new();
        for (coordinate, rate) in &section.coordinates {
            coordinates.push((state(coordinate)?, state(rate)?));
        }
        let mut drives = Vec::new();
        for (drive, along) in &section.drives {
            let (index, _) = catalog.want(source, drive)?;
            let driven = match catalog.variables()[index].kind {
                Kind::State => Driven::State(state(drive)?),
                Kind::Input => match own.inputs.iter().position(|input| *input == index) {
                    Some(input) => Driven::Input(input),
                    None => {
                        let problem = format!("`{}` is not an input of the plan", drive.text);
                        return Err(source.error_at(drive.place, problem));
                    }
                },
                Kind::Output => {
                    outputs.push(index);
                    Driven::Output(outputs.len() - 1)
                }
            };
            let mut factors = Vec::new();
            for (name, factor) in along {
                let at = state(name)?;
                let Some(coordinate) = coordinates.iter().position(|(own, _)| *own == at) else {
                    let problem = format!("`{}` is none of the `coordinates`", name.text);
                    return Err(source.error_at(name.place, problem));
                };
                factors.push((coordinate, *factor));
            }
            drives.push((driven, factors));
        }
        let forces = section.forces.iter().map(|(force, _)| force.text.clone()).collect();
        let signals = Signals { outputs, ..own.clone() };
        Ok(Some(Names { signals, coordinates, drives, forces }))
    }
}

/// Lagrange's equations at a point of a phase.
struct Equations<'a> {
    names: &'a Names,
    system: &'a mut dyn Dynamics,
    values: Vec<f64>,
    jacobian: Vec<f64>,
}

impl<'a> Equations<'a> {
    fn new(names: &'a Names, system: &'a mut dyn Dynamics) -> Equations<'a> {
        let size = system.size();
        Equations {
            names,
            system,
            values: vec![0.0; size.values()],
            jacobian: vec![0.0; size.values() * size.arguments()],
        }
    }

    fn at(&mut self, states: &[f64], inputs: &[f64]) -> Result<(), Error> {
        let point = Point { time: 0.0, states, inputs };
        Ok(self.system.jacobian(point, &mut self.values, &mut self.jacobian)?)
    }

    /// Derivative of an output by a state at the last point.
    fn slope(&self, output: usize, state: usize) -> f64 {
        let size = self.system.size();
        self.jacobian[(size.states + output) * size.arguments() + state]
    }

    /// dE/dv at the last point.
    fn momentum(&self) -> Vec<f64> {
        self.names.coordinates.iter().map(|&(_, rate)| self.slope(0, rate)).collect()
    }

    /// Forces as the model has them, and as they follow.
    fn forces(&mut self, states: &[f64], inputs: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let names = self.names;
        let (n, count) = (names.coordinates.len(), names.forces.len());
        self.at(states, inputs)?;
        let outputs = self.values[states.len()..].to_vec();
        let rates: Vec<f64> = names.coordinates.iter().map(|&(_, rate)| self.values[rate]).collect();
        // - dE/dq; B u; J^T.
        let mut rest: Vec<f64> = names.coordinates.iter().map(|&(q, _)| -self.slope(0, q)).collect();
        let points: Vec<Vec<f64>> = (0..count)
            .map(|i| names.coordinates.iter().map(|&(q, _)| self.slope(1 + i, q)).collect())
            .collect();
        for (driven, along) in &names.drives {
            let value = match *driven {
                Driven::State(i) => states[i],
                Driven::Input(i) => inputs[i],
                Driven::Output(i) => outputs[i],
            };
            along.iter().for_each(|&(coordinate, factor)| rest[coordinate] -= factor * value);
        }
        // dT/dv along the motion with the rates held: central differences of the fourth order.
        for (steps, weight) in [(1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)] {
            let mut moved = states.to_vec();
            names.coordinates.iter().for_each(|&(q, v)| moved[q] += steps * DIFFERENCE_STEP * states[v]);
            self.at(&moved, inputs)?;
            let momentum = self.momentum();
            rest.iter_mut()
                .zip(momentum)
                .for_each(|(rest, p)| *rest += weight * p / (12.0 * DIFFERENCE_STEP));
        }
        // 2 dV/dq, and the mass matrix times the accelerations, column by column.
        let mut still = states.to_vec();
        names.coordinates.iter().for_each(|&(_, v)| still[v] = 0.0);
        self.at(&still, inputs)?;
        for (rest, &(q, _)) in rest.iter_mut().zip(&names.coordinates) {
            *rest += 2.0 * self.slope(0, q);
        }
        for (&(_, v), rate) in names.coordinates.iter().zip(&rates) {
            still[v] = 1.0;
            self.at(&still, inputs)?;
            let column = self.momentum();
            rest.iter_mut().zip(column).for_each(|(rest, mass)| *rest += mass * rate);
            still[v] = 0.0;
        }
        let mut qr = StreamedQr::new(count + 1);
        qr.append(n, |column, out| out.copy_from_slice(points.get(column).unwrap_or(&rest)));
        let found = qr.finish().solve(count);
        let found =
            found.map_or_else(|| vec![f64::NAN; count], |found| found.column(0).iter().copied().collect());
        Ok((outputs[1 + count..1 + 2 * count].to_vec(), found))
    }
}
