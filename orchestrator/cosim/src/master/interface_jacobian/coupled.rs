//! A strongly coupled component: solve the reduced problem, step the dynamic FMUs under the lines that have the
//! moments of its inputs, learn their defects, take the steps back and repeat; then step the static FMUs once.

use super::local_model::Origin;
use super::radau::{Radau, Unsolved};
use super::reduced::{Link, Reduced, Surroundings};
use super::signal::line_of;
use super::static_block::Function;
use super::unit::{Outputs, Unit};
use crate::master::exchange::Node;
use crate::master::loops::{Group, Loops};
use crate::master::stop::{Stop, get_outputs};
use crate::master::{Coupling, Error, Values};

/// Steps of an iteration to a tolerance before it is given up.
const MAX_STEPS: u32 = 20;
/// Change of an input for a difference quotient, as a part of the larger of value and nominal value.
const RELATIVE_DIFFERENCE_STEP: f64 = 1e-3;

/// See the module.
#[derive(Debug)]
pub(super) struct Coupled {
    /// Numbers of its units.
    pub members: Vec<usize>,
    pub problem: Reduced,
    pub radau: Radau,
    /// Nominal values of the states of the problem.
    pub nominal: Vec<f64>,
    /// Settings with which this component is stepped, after fallbacks.
    pub coupling: Coupling,
    /// Whether steps are taken back.
    pub repeats: bool,
    /// Size of the last step \[s\]; a defect belongs to it.
    pub last_step: f64,
    /// Outputs and their derivatives after a step of a dynamic FMU, as the outputs of the problem.
    pub y: Vec<f64>,
    pub rate: Vec<f64>,
    pub nudged: Vec<f64>,
    /// Algebraic loops (by number of their group): each is solved once this many static blocks have stepped.
    pub loops: Vec<(usize, usize)>,
    /// Steps of the whole component, with repetitions.
    pub passes: u64,
}

impl Coupled {
    /// Finds the loops among its members.
    pub fn place_loops(&mut self, loops: &Loops) {
        for group in self.members.iter().filter_map(|&unit| loops.group_of(unit)) {
            if self.loops.iter().any(|&(known, _)| known == group) {
                continue;
            }
            let mut statics = self.problem.statics.iter();
            let last = statics.rposition(|block| loops.group_of(block.unit) == Some(group));
            self.loops.push((group, last.map_or(0, |last| last + 1)));
        }
    }

    /// Steps the component from `t` to `t + h` \[s\].
    pub fn step(
        &mut self,
        units: &mut [Unit],
        nodes: &mut [Node],
        outputs: &mut Outputs,
        values: &mut Values,
        mut loops: Option<&mut Loops>,
        (t, h): (f64, f64),
    ) -> Result<(), Stop> {
        for &unit in &self.members {
            nodes[unit].set_non_reals(values)?;
        }
        self.prepare(units, nodes, outputs, (t, h))?;
        let limit = self.coupling.tolerance.map_or(self.coupling.corrections + 1, |_| MAX_STEPS);
        for pass in 0..limit {
            let around = Surroundings { units, outputs, values, t, h };
            if let Err(Unsolved { state, rest, r }) =
                self.radau.integrate(&mut self.problem, &around, &self.nominal)?
            {
                let block = self.problem.dynamics.iter().find(|block| block.x.contains(&state));
                let name = nodes[block.map_or(0, |block| block.unit)].name();
                let reason = match rest.is_nan() {
                    true => "has no inputs that fit its outputs (or values that are not finite)".to_owned(),
                    false => format!(
                        "has no solution near component `{name}` (rest {rest:.1e} of the nominal value)"
                    ),
                };
                return Err(self.unsolved(nodes, reason, t + r * h, h));
            }
            self.passes += 1;
            self.step_dynamics(units, nodes, pass, t, h)?;
            if !self.repeats {
                self.learn_gains(units, h);
            } else if pass == 0 {
                self.find_differences(units, nodes, t, h)?;
            }
            let (unit, output, change) = self.learn(units, h);
            if let Some(tolerance) = self.coupling.tolerance
                && pass > 0
            {
                if change <= tolerance {
                    break;
                }
                if pass + 1 == limit {
                    let (name, output) = (nodes[unit].name(), nodes[unit].output_name(output));
                    let reason = format!(
                        "does not settle in {limit} passes: `{name}.{output}` still changes by {change:.1e} of its size"
                    );
                    return Err(self.unsolved(nodes, reason, t, h));
                }
            }
            if pass + 1 < limit {
                self.find_secants(units, nodes, outputs, values, t, h)?;
            }
        }
        self.last_step = h;
        self.finish_dynamics(units, outputs, h);
        for index in 0..=self.problem.statics.len() {
            for position in 0..self.loops.len() {
                let (group, after) = self.loops[position];
                if let Some(loops) = loops.as_deref_mut().filter(|_| after == index) {
                    self.solve_loop(loops.group(group), units, nodes, outputs, values, (t, h))?;
                }
            }
            if index < self.problem.statics.len() {
                self.finish_static(index, units, nodes, outputs, values, (t, h))?;
            }
        }
        for &unit in &self.members {
            get_outputs(&mut nodes[unit], unit, values)?;
        }
        Ok(())
    }

    /// The component could not be stepped with `h` \[s\] for this reason at `time` \[s\].
    #[cold]
    fn unsolved(&self, nodes: &[Node], reason: String, time: f64, h: f64) -> Stop {
        let names: Vec<&str> = self.members.iter().map(|&member| nodes[member].name()).collect();
        Stop::Unsolved(Box::new(Error::Coupling { components: names.join(", "), reason, time, step: h }))
    }

    /// Local models about the present point, tangents of static blocks, and saved states.
    fn prepare(
        &mut self,
        units: &mut [Unit],
        nodes: &mut [Node],
        outputs: &Outputs,
        (t, h): (f64, f64),
    ) -> Result<(), Stop> {
        let changed = (h - self.last_step).abs() > 1e-9 * h;
        for block in &mut self.problem.dynamics {
            let unit = &mut units[block.unit];
            let slave = nodes[block.unit].slave();
            let (y, rate) = (&outputs.y[unit.outputs.clone()], &outputs.rate[unit.outputs.clone()]);
            block.model.linearize(unit, slave, y, rate)?;
            if changed {
                block.model.forget();
            }
            self.problem.w[block.u.clone()].copy_from_slice(&unit.u);
            if self.repeats {
                unit.save(&mut nodes[block.unit])?;
            }
        }
        for block in &mut self.problem.statics {
            let unit = &mut units[block.unit];
            self.problem.w[block.u.clone()].copy_from_slice(&unit.u);
            if let Function::Secant(secant) = &mut block.function {
                let y = &outputs.y[unit.outputs.clone()];
                secant.linearize(unit, &mut nodes[block.unit], y, (t, h))?;
            }
        }
        Ok(())
    }

    /// One step of every dynamic FMU, from the saved state if this is not the first pass.
    fn step_dynamics(
        &mut self,
        units: &mut [Unit],
        nodes: &mut [Node],
        pass: u32,
        t: f64,
        h: f64,
    ) -> Result<(), Stop> {
        for block in &self.problem.dynamics {
            let (unit, node) = (&mut units[block.unit], &mut nodes[block.unit]);
            if pass > 0 {
                unit.restore(node)?;
            }
            for (k, i) in block.u.clone().enumerate() {
                let moments = self.radau.moments[i];
                (unit.value[k], unit.slope[k]) = if unit.ramps {
                    let [from, rise] = line_of(moments);
                    (from, rise / h)
                } else {
                    (moments[0], 0.0)
                };
            }
            unit.advance(node, t, h, self.repeats)?;
            unit.read(node, &mut self.y[block.y.clone()], &mut self.rate[block.y.clone()])?;
        }
        Ok(())
    }

    /// Input gains of FMUs without directional derivatives, from repeated steps with changed inputs.
    fn find_differences(
        &mut self,
        units: &mut [Unit],
        nodes: &mut [Node],
        t: f64,
        h: f64,
    ) -> Result<(), Stop> {
        for block in &mut self.problem.dynamics {
            if block.model.origin != Origin::Differences {
                continue;
            }
            let (unit, node) = (&mut units[block.unit], &mut nodes[block.unit]);
            let nudged = &mut self.nudged[..block.y.len()];
            for k in 0..block.u.len() {
                let value = unit.value[k];
                let step = RELATIVE_DIFFERENCE_STEP * value.abs().max(unit.inputs[k].nominal);
                unit.restore(node)?;
                unit.value[k] = value + step;
                unit.advance(node, t, h, true)?;
                unit.value[k] = value;
                node.slave().get_real(&unit.output_references, nudged)?;
                for (row, q) in block.y.clone().enumerate() {
                    block.model.b[row * block.u.len() + k] = (nudged[row] - self.y[q]) / (step * h);
                }
            }
        }
        Ok(())
    }

    /// Input gains of FMUs without directional derivatives whose steps are not repeated.
    fn learn_gains(&mut self, units: &[Unit], h: f64) {
        for block in &mut self.problem.dynamics {
            if block.model.origin == Origin::Differences {
                let unit = &units[block.unit];
                block.model.respond(&unit.value, &unit.slope, h);
                block.model.learn_gains(unit, &self.y[block.y.clone()], h);
            }
        }
    }

    /// Defects of all local models; the largest relative change with the output it belongs to.
    fn learn(&mut self, units: &[Unit], h: f64) -> (usize, u32, f64) {
        let mut largest = (0, 0, 0.0);
        for block in &mut self.problem.dynamics {
            let unit = &units[block.unit];
            block.model.respond(&unit.value, &unit.slope, h);
            let rate = unit.rates.then(|| &self.rate[block.y.clone()]);
            let (change, k) = block.model.learn(&self.y[block.y.clone()], rate, &unit.output_nominals, h);
            if change >= largest.2 {
                largest = (block.unit, unit.output_references.get(k).copied().unwrap_or(0), change);
            }
        }
        largest
    }

    /// Inputs of static block `block` at the end of the step, into the unit's `value`.
    fn end_inputs(&self, block: usize, units: &mut [Unit], outputs: &Outputs, values: &Values) {
        let block = &self.problem.statics[block];
        for (k, i) in block.u.clone().enumerate() {
            let (link, input) = self.problem.inputs[i];
            let source = match link {
                Link::Inside(q) => self.y[q],
                Link::Outside(feed) => feed.at(outputs, values, 1.0, false),
            };
            units[block.unit].value[k] = input.conversion.apply(source);
        }
    }

    /// Steps static blocks without Model Exchange at the predicted inputs and takes the steps back.
    fn find_secants(
        &mut self,
        units: &mut [Unit],
        nodes: &mut [Node],
        outputs: &Outputs,
        values: &Values,
        t: f64,
        h: f64,
    ) -> Result<(), Stop> {
        if !self.problem.statics.iter().any(|block| matches!(block.function, Function::Secant(_))) {
            return Ok(());
        }
        for index in 0..self.problem.statics.len() {
            self.end_inputs(index, units, outputs, values);
            let block = &mut self.problem.statics[index];
            let (unit, node) = (&mut units[block.unit], &mut nodes[block.unit]);
            let y = &mut self.y[block.y.clone()];
            match &mut block.function {
                Function::Secant(_) if !unit.rollback => {}
                Function::Secant(secant) => {
                    unit.save(node)?;
                    unit.slope.fill(0.0);
                    unit.advance(node, t, h, true)?;
                    node.slave().get_real(&unit.output_references, y)?;
                    unit.restore(node)?;
                    unit.u.copy_from_slice(&secant.u0);
                    secant.correct(&unit.value, y);
                }
                Function::Exchange { .. } => {
                    block.function.values(unit, t + h, &unit.value, y)?;
                }
            }
        }
        Ok(())
    }

    /// Takes over the last step of the dynamic FMUs.
    fn finish_dynamics(&mut self, units: &[Unit], outputs: &mut Outputs, h: f64) {
        for block in &self.problem.dynamics {
            let unit = &units[block.unit];
            for (k, q) in unit.outputs.clone().zip(block.y.clone()) {
                let (y0, rate0, y) = (outputs.y[k], outputs.rate[k], self.y[q]);
                let rate = if unit.rates { self.rate[q] } else { (y - y0) / h };
                let signal = &mut outputs.signals[k];
                signal.clear();
                signal.hermite((0.0, 1.0), [y0, rate0], [y, rate], h);
                (outputs.y[k], outputs.rate[k]) = (y, rate);
            }
        }
    }

    /// Solves a loop at the end of the step through the FMUs, whose own steps met its solution but nearly.
    fn solve_loop(
        &mut self,
        group: &mut Group,
        units: &mut [Unit],
        nodes: &mut [Node],
        outputs: &mut Outputs,
        values: &mut Values,
        (t, h): (f64, f64),
    ) -> Result<(), Stop> {
        if group.nodes.clone().any(|number| units[number].ended) {
            return Ok(());
        }
        group.solve(nodes, values, t + h)?;
        let dynamics = self.problem.dynamics.iter().map(|block| (block.unit, &block.y, false));
        let statics = self.problem.statics.iter().map(|block| (block.unit, &block.y, true));
        for (number, y, is_static) in dynamics.chain(statics) {
            if !group.nodes.contains(&number) {
                continue;
            }
            let unit = &units[number];
            unit.read(&mut nodes[number], &mut self.y[y.clone()], &mut self.rate[y.clone()])?;
            for (k, q) in unit.outputs.clone().zip(y.clone()) {
                outputs.signals[k].move_end(self.y[q] - outputs.y[k]);
                outputs.y[k] = self.y[q];
                outputs.rate[k] = match unit.rates && !is_static {
                    true => self.rate[q],
                    false => (self.y[q] - outputs.begin[k]) / h,
                };
            }
        }
        let dynamics = self.problem.dynamics.iter().map(|block| (block.unit, &block.u));
        let statics = self.problem.statics.iter().map(|block| (block.unit, &block.u));
        for (number, u) in dynamics.chain(statics).filter(|(number, _)| group.nodes.contains(number)) {
            for (k, i) in u.clone().enumerate() {
                // From inside the group, or known before: what the slave has now.
                if let (Link::Inside(q), input) = self.problem.inputs[i]
                    && self.is_of(group, q)
                {
                    units[number].u[k] = input.conversion.apply(self.y[q]);
                }
            }
        }
        Ok(())
    }

    /// Whether output `q` of the problem belongs to a slave of the group.
    fn is_of(&self, group: &Group, q: usize) -> bool {
        let dynamics = self.problem.dynamics.iter().map(|block| (block.unit, &block.y));
        let statics = self.problem.statics.iter().map(|block| (block.unit, &block.y));
        dynamics.chain(statics).any(|(number, y)| y.contains(&q) && group.nodes.contains(&number))
    }

    /// Steps a static FMU to the inputs at the end of the step.
    fn finish_static(
        &mut self,
        index: usize,
        units: &mut [Unit],
        nodes: &mut [Node],
        outputs: &mut Outputs,
        values: &Values,
        (t, h): (f64, f64),
    ) -> Result<(), Stop> {
        self.end_inputs(index, units, outputs, values);
        let block = &self.problem.statics[index];
        let (unit, node) = (&mut units[block.unit], &mut nodes[block.unit]);
        if unit.ramps {
            for k in 0..unit.u.len() {
                unit.slope[k] = (unit.value[k] - unit.u[k]) / h;
                unit.value[k] = unit.u[k];
            }
        }
        unit.advance(node, t, h, false)?;
        unit.read(node, &mut self.y[block.y.clone()], &mut self.rate[block.y.clone()])?;
        for (k, q) in unit.outputs.clone().zip(block.y.clone()) {
            let signal = &mut outputs.signals[k];
            signal.clear();
            signal.line(0.0, 1.0, outputs.y[k], self.y[q]);
            outputs.rate[k] = if unit.rates { self.rate[q] } else { (self.y[q] - outputs.y[k]) / h };
            outputs.y[k] = self.y[q];
        }
        Ok(())
    }
}
