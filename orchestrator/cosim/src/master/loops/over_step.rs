//! A loop through slaves whose outputs follow their inputs in a step only: the step is repeated from saved states until
//! its outputs at the end fit the inputs held over it.
//!
//! Unknown are all continuous Real inputs between slaves of the group, `w`; the residual is the value of their sources
//! at the end of the step under `w`, minus `w`. Damped Newton iteration; the Jacobian comes from difference quotients
//! of repeated steps, then from Broyden's updates (Broyden 1965), from step to step.

use std::ops::Range;

use crate::master::Values;
use crate::master::exchange::{Node, Wiring};
use crate::master::propagation::{LoopFailure, LoopInput, carry_flag, nominal, residuals, solve_linear};
use crate::master::stop::Stop;
use crate::system::SystemGraph;
use crate::system::graph::{DataType, Source};
use airloop_fmi::{StateHandle, Variability};

/// Residual that counts as zero, in units of max(|value|, nominal).
const TOLERANCE: f64 = 1e-11;
/// Residual that is taken where the FMUs' own integration keeps it from falling further.
const STAGNATION: f64 = 1e-6;
const MOST_ITERATIONS: usize = 40;
const MOST_HALVINGS: usize = 6;
/// Change of an input for a difference quotient, in units of max(|value|, nominal).
const RELATIVE_DIFFERENCE_STEP: f64 = 1e-6;

/// See the module; `n` unknowns.
#[derive(Debug)]
pub(in crate::master) struct OverStep {
    nodes: Range<usize>,
    /// Slave that makes the loop be solved over steps, by name.
    stuck: String,
    /// `source` is the place in the values of the system.
    inputs: Vec<LoopInput>,
    saved: Vec<Option<StateHandle>>,
    /// Values where the step begins.
    before: Values,
    started: bool,
    /// Whether the Jacobian was found, and whether it belongs to the present point.
    known: bool,
    fresh: bool,
    w: Vec<f64>,
    residuals: Vec<f64>,
    /// `[n, n]`, rows first, and a copy to factor.
    jacobian: Vec<f64>,
    factored: Vec<f64>,
    change: Vec<f64>,
    base: Vec<f64>,
    base_residuals: Vec<f64>,
    /// Steps of each node, and Newton steps.
    steps: Vec<u64>,
    passes: u64,
    rounds: u64,
}

impl OverStep {
    pub fn new(
        graph: &SystemGraph,
        wiring: &Wiring,
        members: &[usize],
        nodes: Range<usize>,
        stuck: usize,
    ) -> OverStep {
        let mut inputs = Vec::new();
        for connection in &graph.connections {
            let Source::Output { component, .. } = connection.source else { continue };
            let owner = &graph.components[connection.component];
            let variable = &owner.fmu.description.variables[connection.variable];
            let inside = members.contains(&component) && members.contains(&connection.component);
            let continuous = variable.variability == Variability::Continuous;
            if inside && continuous && DataType::of(variable) == DataType::Real {
                let owner_at = graph.order.iter().position(|&index| index == connection.component);
                inputs.push(LoopInput {
                    instance: owner_at.unwrap_or(nodes.start),
                    reference: variable.value_reference,
                    source: wiring.index_of(connection.source),
                    conversion: connection.conversion,
                    nominal: nominal(variable),
                    name: owner.path_of(connection.variable),
                });
            }
        }
        let n = inputs.len();
        let zeros = || vec![0.0; n];
        OverStep {
            stuck: graph.components[stuck].name.clone(),
            saved: nodes.clone().map(|_| None).collect(),
            before: wiring.initial_values(graph),
            started: false,
            known: false,
            fresh: false,
            w: zeros(),
            residuals: zeros(),
            jacobian: vec![0.0; n * n],
            factored: vec![0.0; n * n],
            change: zeros(),
            base: zeros(),
            base_residuals: zeros(),
            steps: vec![0; nodes.len()],
            passes: 0,
            rounds: 0,
            inputs,
            nodes,
        }
    }

    pub fn note(&self) -> String {
        let names: Vec<&str> = self.inputs.iter().map(|input| input.name.as_str()).collect();
        format!(
            "an algebraic loop is solved over the communication step for {}, as the outputs of `{}` follow its inputs through a step only: steps are repeated until the inputs held over them fit the outputs at their end",
            names.join(", "),
            self.stuck
        )
    }

    /// Shows what the next solution begins from, always in the same order.
    pub fn carry(&mut self, each: &mut dyn FnMut(&mut f64)) {
        carry_flag(&mut self.started, each);
        carry_flag(&mut self.known, each);
        self.w.iter_mut().chain(&mut self.jacobian).for_each(each);
    }

    /// Steps of a node of the group beyond one per macro step.
    pub fn repeated_steps(&self, node: usize) -> u64 {
        self.steps[node].saturating_sub(self.passes)
    }

    pub fn rounds(&self) -> u64 {
        self.rounds
    }

    /// Takes over the values where the step begins.
    pub fn begin(&mut self, values: &Values) {
        self.before.copy_from(values);
    }

    /// Steps the group from `t` to `t + h` \[s\], so that its inputs fit its outputs.
    pub fn step(&mut self, nodes: &mut [Node], values: &mut Values, t: f64, h: f64) -> Result<(), Stop> {
        self.passes += 1;
        for (saved, number) in self.saved.iter_mut().zip(self.nodes.clone()) {
            nodes[number].slave().get_state(saved)?;
        }
        if !self.started {
            self.started = true;
            for (w, input) in self.w.iter_mut().zip(&self.inputs) {
                *w = input.conversion.apply(values.reals[input.source]);
            }
        }
        self.fresh = false;
        let mut size = self.evaluate(nodes, values, (t, h))?;
        for iteration in 0..MOST_ITERATIONS {
            if size <= TOLERANCE {
                return Ok(());
            }
            if !size.is_finite() {
                return Err(self.unsolved(iteration, "a value in the loop is not finite", t + h));
            }
            if !self.known {
                self.differentiate(nodes, values, (t, h))?;
            }
            self.factored.copy_from_slice(&self.jacobian);
            self.change.copy_from_slice(&self.residuals);
            let regular = solve_linear(&mut self.factored, &mut self.change);
            self.base.copy_from_slice(&self.w);
            self.base_residuals.copy_from_slice(&self.residuals);
            if regular && self.descend(nodes, values, (t, h), &mut size)? {
                self.fresh = false;
                continue;
            }
            if self.fresh {
                if regular && size <= STAGNATION {
                    return Ok(());
                }
                let problem = match regular {
                    true => "no step along the Newton direction makes them smaller",
                    false => "its Jacobian is singular",
                };
                return Err(self.unsolved(iteration + 1, problem, t + h));
            }
            self.known = false;
        }
        match size <= STAGNATION {
            true => Ok(()),
            false => Err(self.unsolved(MOST_ITERATIONS, "the iteration does not converge", t + h)),
        }
    }

    /// Goes along the Newton direction until the residual falls; false, at the old point, if it does not.
    fn descend(
        &mut self,
        nodes: &mut [Node],
        values: &mut Values,
        step: (f64, f64),
        size: &mut f64,
    ) -> Result<bool, Stop> {
        self.rounds += 1;
        let mut length = 1.0;
        for _ in 0..MOST_HALVINGS {
            for ((w, base), change) in self.w.iter_mut().zip(&self.base).zip(&self.change) {
                *w = base - length * change;
            }
            let new = self.evaluate(nodes, values, step)?;
            if new < *size {
                *size = new;
                self.update(length);
                return Ok(true);
            }
            length *= 0.5;
        }
        self.w.copy_from_slice(&self.base);
        *size = self.evaluate(nodes, values, step)?;
        Ok(false)
    }

    /// Broyden's update after a step of `-length * change`, unknowns in units of their magnitude.
    fn update(&mut self, length: f64) {
        let n = self.inputs.len();
        let weight = |k: usize| self.w[k].abs().max(self.inputs[k].nominal).powi(-2);
        let square: f64 = (0..n).map(|k| weight(k) * (length * self.change[k]).powi(2)).sum();
        if square <= 0.0 {
            return;
        }
        for row in 0..n {
            let line = &mut self.jacobian[row * n..(row + 1) * n];
            let predicted: f64 = line.iter().zip(&self.change).map(|(j, change)| -length * j * change).sum();
            let rest = self.residuals[row] - self.base_residuals[row] - predicted;
            for (k, j) in line.iter_mut().enumerate() {
                *j -= rest * weight(k) * length * self.change[k] / square;
            }
        }
    }

    /// Derivatives of the residuals, from a step of one slave for every unknown; `values` stay those of the present
    /// unknowns, and so do the slaves.
    fn differentiate(
        &mut self,
        nodes: &mut [Node],
        values: &mut Values,
        step: (f64, f64),
    ) -> Result<(), Stop> {
        let n = self.inputs.len();
        self.base.copy_from_slice(&self.w);
        self.base_residuals.copy_from_slice(&self.residuals);
        for column in 0..n {
            let number = self.inputs[column].instance;
            self.w[column] +=
                RELATIVE_DIFFERENCE_STEP * self.base[column].abs().max(self.inputs[column].nominal);
            let moved = self.w[column] - self.base[column];
            self.advance(number, nodes, values, step)?;
            for row in 0..n {
                let input = &self.inputs[row];
                let given = input.conversion.apply(values.reals[input.source]);
                let own = if row == column { 1.0 } else { 0.0 };
                let change = given - (self.base_residuals[row] + self.base[row]);
                self.jacobian[row * n + column] = change / moved - own;
            }
            self.w[column] = self.base[column];
            self.advance(number, nodes, values, step)?;
        }
        self.known = true;
        self.fresh = true;
        Ok(())
    }

    /// Steps all slaves under `w`; the largest residual in units of its magnitude.
    fn evaluate(&mut self, nodes: &mut [Node], values: &mut Values, step: (f64, f64)) -> Result<f64, Stop> {
        for number in self.nodes.clone() {
            self.advance(number, nodes, values, step)?;
        }
        let given = |input: &LoopInput| input.conversion.apply(values.reals[input.source]);
        Ok(residuals(&self.inputs, &self.w, given, &mut self.residuals))
    }

    /// Steps one slave from the saved state, under `w`.
    fn advance(
        &mut self,
        number: usize,
        nodes: &mut [Node],
        values: &mut Values,
        (t, h): (f64, f64),
    ) -> Result<(), Stop> {
        let node = &mut nodes[number];
        let index = number - self.nodes.start;
        if let Some(state) = &self.saved[index] {
            node.slave().set_state(state)?;
        }
        node.set_inputs(&self.before)?;
        for (input, w) in self.inputs.iter().zip(&self.w).filter(|(input, _)| input.instance == number) {
            node.slave().set_real(&[input.reference], &[*w])?;
        }
        let status = node.step_keeping(t, h, true)?;
        self.steps[index] += 1;
        Stop::unless_complete(number, status)?;
        node.get_outputs(values)?;
        Ok(())
    }

    #[cold]
    fn unsolved(&self, iterations: usize, problem: &'static str, time: f64) -> Stop {
        Stop::of_loop(LoopFailure::unsolved(&self.inputs, &self.residuals, iterations, problem), time)
    }
}
