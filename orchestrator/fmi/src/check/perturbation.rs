//! Unknowns as a function of the knowns, evaluated at chosen points: the ground of the checks of derivatives and
//! dependencies.
//!
//! Model Exchange is evaluated in continuous-time mode (outputs and state derivatives by inputs and states),
//! Co-Simulation in initialization mode (outputs by inputs), the only mode in which it may be read after setting.

use std::sync::Arc;

use super::probe::{Advance, Probe};
use crate::description::{
    Causality, Dependency, ModelDescription, Unknown, Variability, Variable, VariableKind,
};
use crate::{Error, Fmu, InterfaceKind};

/// Different points at which the function is looked at.
pub(super) const POINTS: usize = 3;

/// Step of a central difference over the size of the known: the cube root of the machine precision.
const STEP: f64 = 6e-6;

/// The function and the point where it stands.
pub(super) struct Perturbation {
    probe: Probe,
    pub(super) knowns: Vec<Known>,
    pub(super) unknowns: Vec<Output>,
    point: Vec<f64>,
    start: Vec<f64>,
    /// All continuous states, `[state_count]`; those that are no knowns keep their start.
    states: Vec<f64>,
}

/// A real continuous known.
pub(super) struct Known {
    pub(super) variable: usize,
    pub(super) reference: u32,
    /// Position among all continuous states, known or not; inputs have none.
    state: Option<usize>,
    /// Typical size.
    pub(super) scale: f64,
    /// Of single precision (FMI 3.0): differences say little of derivatives.
    pub(super) is_single: bool,
    min: f64,
    max: f64,
}

/// A real continuous unknown.
pub(super) struct Output {
    pub(super) variable: usize,
    pub(super) reference: u32,
    pub(super) dependencies: Option<Vec<Dependency>>,
    pub(super) scale: f64,
    /// As for a known.
    pub(super) is_single: bool,
}

/// Change of all unknowns with one known.
pub(super) struct Slope {
    pub(super) central: Vec<f64>,
    pub(super) forward: Vec<f64>,
    pub(super) backward: Vec<f64>,
    /// The unknowns themselves.
    pub(super) values: Vec<f64>,
}

impl Perturbation {
    /// The function of an interface, or `None` if there is nothing to look at.
    pub(super) fn new(fmu: &Arc<Fmu>, kind: InterfaceKind) -> Result<Option<Self>, Error> {
        let description = &fmu.description;
        let (unknowns, knowns) = match kind {
            InterfaceKind::CoSimulation => {
                (outputs(description, &description.initial_unknowns, true), inputs(description))
            }
            InterfaceKind::ModelExchange => {
                let mut unknowns = outputs(description, &description.outputs, false);
                unknowns.extend(outputs(description, &description.derivatives, false));
                let mut knowns = inputs(description);
                knowns.extend(states(description));
                (unknowns, knowns)
            }
        };
        if unknowns.is_empty() || knowns.is_empty() {
            return Ok(None);
        }
        let mut probe = Probe::new(fmu, kind)?;
        match kind {
            InterfaceKind::CoSimulation => probe.begin()?,
            InterfaceKind::ModelExchange => {
                if probe.initialize()? != Advance::Done {
                    return Ok(None);
                }
            }
        }
        let mut start = vec![0.0; knowns.len()];
        let references: Vec<u32> = knowns.iter().map(|known| known.reference).collect();
        probe.instance().get_real(&references, &mut start)?;
        let mut states = Vec::new();
        if let Some(model) = probe.model() {
            states.resize(model.state_count(), 0.0);
            model.get_continuous_states(&mut states)?;
        }
        Ok(Some(Perturbation { probe, knowns, unknowns, point: start.clone(), start, states }))
    }

    /// Goes to one of the [`POINTS`] points near the start.
    pub(super) fn go_to(&mut self, number: usize) {
        for (index, known) in self.knowns.iter().enumerate() {
            // Irregular multiples keep the points away from symmetries and from each other.
            let irregular = ((index * 7 + number * 3 + 1) as f64 * 0.618_033_988_749).fract() - 0.5;
            self.point[index] =
                (self.start[index] + 0.4 * irregular * known.scale).clamp(known.min, known.max);
        }
    }

    /// The unknowns at the point where known `index` is changed by `change`.
    pub(super) fn evaluate(&mut self, index: usize, change: f64) -> Result<Vec<f64>, Error> {
        let mut point = self.point.clone();
        point[index] += change;
        let mut states = self.states.clone();
        let (mut references, mut inputs) = (Vec::new(), Vec::new());
        for (known, value) in self.knowns.iter().zip(point) {
            match known.state {
                // A description may name more states than the model has.
                Some(position) => {
                    if let Some(state) = states.get_mut(position) {
                        *state = value;
                    }
                }
                None => {
                    references.push(known.reference);
                    inputs.push(value);
                }
            }
        }
        if !references.is_empty() {
            self.probe.instance().set_real(&references, &inputs)?;
        }
        if let Some(model) = self.probe.model() {
            model.set_continuous_states(&states)?;
        }
        let references: Vec<u32> = self.unknowns.iter().map(|unknown| unknown.reference).collect();
        let mut values = vec![0.0; references.len()];
        self.probe.instance().get_real(&references, &mut values)?;
        Ok(values)
    }

    /// Differences of all unknowns by known `index` at the point; `None` where a bound is too near.
    pub(super) fn slope(&mut self, index: usize) -> Result<Option<Slope>, Error> {
        let known = &self.knowns[index];
        let step = STEP * known.scale.max(self.point[index].abs());
        let here = self.point[index];
        if here - step < known.min || here + step > known.max {
            return Ok(None);
        }
        // The step that the rounded sums really make.
        let (up, down) = ((here + step) - here, here - (here - step));
        let (above, below) = (self.evaluate(index, up)?, self.evaluate(index, -down)?);
        let values = self.evaluate(index, 0.0)?;
        let quotient = |a: &[f64], b: &[f64], by: f64| a.iter().zip(b).map(|(a, b)| (a - b) / by).collect();
        Ok(Some(Slope {
            central: quotient(&above, &below, up + down),
            forward: quotient(&above, &values, up),
            backward: quotient(&values, &below, down),
            values,
        }))
    }

    /// fmi2GetDirectionalDerivative of all unknowns for a seed of all knowns, at the point.
    pub(super) fn directional(&mut self, seed: &[f64]) -> Result<Vec<f64>, Error> {
        self.evaluate(0, 0.0)?;
        let unknowns: Vec<u32> = self.unknowns.iter().map(|unknown| unknown.reference).collect();
        let knowns: Vec<u32> = self.knowns.iter().map(|known| known.reference).collect();
        let mut out = vec![0.0; unknowns.len()];
        self.probe.instance().directional_derivative(&unknowns, &knowns, seed, &mut out)?;
        Ok(out)
    }
}

fn real(variable: &Variable) -> Option<&crate::RealAttributes> {
    match &variable.kind {
        VariableKind::Real(real) if variable.variability == Variability::Continuous => Some(real),
        _ => None,
    }
}

fn outputs(description: &ModelDescription, list: &[Unknown], only_outputs: bool) -> Vec<Output> {
    let unknown = |unknown: &Unknown| {
        let variable = &description.variables[unknown.variable];
        let real = real(variable)?;
        (!only_outputs || variable.causality == Causality::Output).then(|| Output {
            variable: unknown.variable,
            reference: variable.value_reference,
            dependencies: unknown.dependencies.clone(),
            scale: real.nominal.unwrap_or(1.0).abs(),
            is_single: description.is_single(unknown.variable),
        })
    };
    list.iter().filter_map(unknown).collect()
}

fn known(description: &ModelDescription, position: usize, state: Option<usize>) -> Option<Known> {
    let variable = &description.variables[position];
    let real = real(variable)?;
    let typical = real.nominal.unwrap_or_else(|| real.start.unwrap_or(1.0)).abs();
    Some(Known {
        variable: position,
        reference: variable.value_reference,
        state,
        scale: if typical > 0.0 { typical } else { 1.0 },
        is_single: description.is_single(position),
        min: real.min.unwrap_or(f64::NEG_INFINITY),
        max: real.max.unwrap_or(f64::INFINITY).max(real.min.unwrap_or(f64::NEG_INFINITY)),
    })
}

fn inputs(description: &ModelDescription) -> Vec<Known> {
    let all = 0..description.variables.len();
    all.filter(|&i| description.variables[i].causality == Causality::Input)
        .filter_map(|i| known(description, i, None))
        .collect()
}

fn states(description: &ModelDescription) -> Vec<Known> {
    description
        .continuous_states()
        .enumerate()
        .filter_map(|(number, position)| known(description, position, Some(number)))
        .collect()
}
