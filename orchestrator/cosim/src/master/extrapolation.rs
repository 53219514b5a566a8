//! Gauss-Seidel and Jacobi with inputs that run along polynomials inside the step, instead of being held.
//!
//! A source that has not stepped yet is continued by the polynomial through its last values. One that has stepped is
//! followed back from the end of the step along its tangent there. (The line through its two values would not do:
//! behind a sampled source it lags by half a sample.) Discrete outputs and system inputs are held.

use std::ops::Range;

use super::exchange::{Node, Wiring};
use super::interface_jacobian::{Feed, Outputs, Trajectory as Input, Unit, interfaces};
use super::loops::{Group, Loops};
use super::settings::MAX_ORDER;
use super::stop::{Stop, get_outputs};
use super::{Algorithm, Error, Grid, Settings, Values};
use crate::system::SystemGraph;

/// Trajectory of an input inside the step: value, slope \[1/s\] and second derivative \[1/s2\] at its beginning.
type Trajectory = [f64; 3];

/// See the module.
#[derive(Debug)]
pub(super) struct Extrapolation {
    units: Vec<Unit>,
    outputs: Outputs,
    /// Whether the output is discrete, and which unit it belongs to.
    sources: Vec<(bool, usize)>,
    /// Values at the two communication points before the present one, the steps \[s\] from each to the next, and how
    /// many of them there are.
    before: [Vec<f64>; 2],
    steps: [f64; 2],
    known: u32,
    /// Per unit: references, orders and values of all input derivatives.
    derivatives: Vec<(Vec<u32>, Vec<i32>, Vec<f64>)>,
    order: u32,
    /// Order of what continues a source that has not stepped yet.
    prediction: u32,
    /// Inputs of a slave at one instant.
    held: Vec<f64>,
    /// Whether the inputs of each unit in a loop have a trajectory.
    has_trajectory: Vec<bool>,
    /// Values and derivatives of all outputs after the last pass over the same step, if it is repeated.
    ahead: Option<[Vec<f64>; 2]>,
    last_pass: [Vec<f64>; 2],
    notes: Vec<String>,
}

impl Extrapolation {
    /// Plans the exchange of initialized slaves.
    pub fn new(
        graph: &SystemGraph,
        wiring: &Wiring,
        settings: &Settings,
        grid: &Grid,
        nodes: &mut [Node],
        values: &Values,
    ) -> Result<Extrapolation, Error> {
        let (units, outputs) = interfaces(graph, wiring, settings, grid, nodes, values)?;
        // Repeated steps run between known ends, along straight lines.
        let order = settings.extrapolation.max(u32::from(settings.adaptive.is_some()));
        let count = outputs.y.len();
        let mut sources = vec![(false, 0); count];
        let mut notes = Vec::new();
        for (unit, node) in units.iter().zip(nodes.iter()) {
            for (place, &discrete) in unit.outputs.clone().zip(&unit.discrete) {
                sources[place] = (discrete, unit.number);
            }
            let tangents = settings.algorithm == Algorithm::GaussSeidel && unit.discrete.contains(&false);
            if !unit.ramps && unit.inputs.iter().any(|input| matches!(input.feed, Feed::Signal(_))) {
                notes.push(format!(
                    "component `{}` takes no input derivatives: its inputs are held over the step",
                    node.name()
                ));
            }
            if !unit.rates && tangents {
                notes.push(format!(
                    "component `{}` gives no output derivatives: after it has stepped, the line through its last two values takes the place of its tangent",
                    node.name()
                ));
            }
        }
        let derivatives = units
            .iter()
            .map(|unit| {
                let references = (0..order).flat_map(|_| unit.input_references.clone()).collect();
                let orders = (1..=order).flat_map(|k| unit.inputs.iter().map(move |_| k as i32)).collect();
                (references, orders, vec![0.0; order as usize * unit.inputs.len()])
            })
            .collect();
        let most = units.iter().map(|unit| unit.inputs.len()).max().unwrap_or(0);
        let (held, has_trajectory) = (vec![0.0; most], vec![false; units.len()]);
        let before = [vec![0.0; count], vec![0.0; count]];
        let steps = [grid.step(); 2];
        Ok(Extrapolation {
            units,
            outputs,
            sources,
            before,
            steps,
            known: 0,
            derivatives,
            order,
            prediction: settings.extrapolation,
            held,
            has_trajectory,
            ahead: None,
            last_pass: [vec![0.0; count], vec![0.0; count]],
            notes,
        })
    }

    /// One macro step from `t` to `t + h` \[s\]; `serial`: a slave sees what those before it have done.
    #[inline(never)]
    pub fn step(
        &mut self,
        nodes: &mut [Node],
        values: &mut Values,
        mut loops: Option<&mut Loops>,
        (t, h): (f64, f64),
        serial: bool,
    ) -> Result<(), Stop> {
        self.outputs.begin.copy_from_slice(&self.outputs.y);
        if let Some(loops) = loops.as_deref_mut().filter(|_| !serial) {
            for group in loops.groups() {
                self.begin(group, nodes, values, (t, h), serial)?;
            }
        }
        let mut next = 0;
        while next < nodes.len() {
            let (block, mut group) = match loops.as_deref_mut() {
                Some(loops) => loops.block(next),
                None => (next..next + 1, None),
            };
            next = block.end;
            match group.as_deref_mut() {
                Some(group) if serial => self.begin(group, nodes, values, (t, h), serial)?,
                Some(_) => {}
                None => nodes[block.start].set_inputs(values)?,
            }
            for number in block.clone() {
                let node = &mut nodes[number];
                if self.find_trajectory(number, values, &block, h, serial) {
                    self.give_trajectory(number, node, h)?;
                }
                Stop::unless_complete(number, node.do_step(t, h)?)?;
            }
            if serial {
                if let Some(group) = group {
                    self.finish(group, nodes, values, (t, h))?;
                }
                for number in block {
                    self.read(number, &mut nodes[number], values, h)?;
                }
            }
        }
        if !serial {
            for group in loops.into_iter().flat_map(Loops::groups) {
                self.finish(group, nodes, values, (t, h))?;
            }
            for (number, node) in nodes.iter_mut().enumerate() {
                self.read(number, node, values, h)?;
            }
        }
        let [last, second] = &mut self.before;
        second.copy_from_slice(last);
        last.copy_from_slice(&self.outputs.begin);
        self.steps = [h, self.steps[0]];
        self.known = (self.known + 1).min(MAX_ORDER);
        Ok(())
    }

    /// Hands the results of this pass to the next pass over the same step.
    pub fn look_ahead(&mut self) {
        let [y, rate] = self.ahead.get_or_insert_with(|| std::mem::take(&mut self.last_pass));
        y.copy_from_slice(&self.outputs.y);
        rate.copy_from_slice(&self.outputs.rate);
    }

    /// Forgets it, for the first pass over another step.
    pub fn look_no_further(&mut self) {
        if let Some(ahead) = self.ahead.take() {
            self.last_pass = ahead;
        }
    }

    /// Trajectories of system inputs (by place in the flat buffer) over the next step; inputs without one are held.
    pub fn trajectories(&mut self) -> &mut Vec<(usize, Input)> {
        &mut self.outputs.trajectories
    }

    /// Shows every number that is carried from step to step, always in the same order.
    pub fn carry(&mut self, each: &mut dyn FnMut(&mut f64)) {
        self.outputs.carry(each);
        self.before.iter_mut().flatten().chain(&mut self.steps).for_each(&mut *each);
        let mut known = f64::from(self.known);
        each(&mut known);
        self.known = known as u32;
    }

    /// Substitutes for missing capabilities of FMUs, one sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Solves a loop where the step begins, with the inputs from outside at the beginnings of their trajectories.
    fn begin(
        &mut self,
        group: &mut Group,
        nodes: &mut [Node],
        values: &mut Values,
        (t, h): (f64, f64),
        serial: bool,
    ) -> Result<(), Stop> {
        let block = group.nodes.clone();
        for number in block.clone() {
            nodes[number].set_inputs(values)?;
            self.has_trajectory[number] = self.find_trajectory(number, values, &block, h, serial);
            if self.has_trajectory[number] {
                let unit = &self.units[number];
                nodes[number].set_real(&unit.input_references, &unit.value)?;
            }
        }
        group.solve(nodes, values, t)?;
        for number in block {
            let unit = &self.units[number];
            let places = unit.outputs.clone();
            if !places.is_empty() {
                nodes[number].get_real(&unit.output_references, &mut self.outputs.y[places.clone()])?;
                self.outputs.begin[places.clone()].copy_from_slice(&self.outputs.y[places]);
            }
        }
        Ok(())
    }

    /// Solves a loop where the step ends, with the inputs from outside at the ends of their trajectories.
    fn finish(
        &mut self,
        group: &mut Group,
        nodes: &mut [Node],
        values: &mut Values,
        (t, h): (f64, f64),
    ) -> Result<(), Stop> {
        for number in group.nodes.clone().filter(|&number| self.has_trajectory[number]) {
            let unit = &self.units[number];
            let count = unit.inputs.len();
            self.held[..count].copy_from_slice(&unit.value);
            let mut power = 1.0;
            for order in 0..self.order as usize {
                power *= h / (order + 1) as f64;
                let rates = &self.derivatives[number].2[order * count..(order + 1) * count];
                self.held.iter_mut().zip(rates).for_each(|(value, rate)| *value += power * rate);
            }
            nodes[number].set_real(&unit.input_references, &self.held[..count])?;
        }
        group.solve(nodes, values, t + h)
    }

    /// Finds the trajectory of the inputs of a slave that steps together with those in `block`; false if they are held.
    fn find_trajectory(
        &mut self,
        number: usize,
        values: &Values,
        block: &Range<usize>,
        h: f64,
        serial: bool,
    ) -> bool {
        let count = self.units[number].inputs.len();
        let repeated = self.ahead.is_some();
        if count == 0 || !(self.units[number].ramps || repeated) {
            return false;
        }
        for k in 0..count {
            let input = self.units[number].inputs[k];
            let trajectory = match input.feed {
                Feed::Signal(place) => {
                    let source = self.sources[place].1;
                    let together = block.contains(&source);
                    self.trajectory(place, serial && source < number && !together, together, h)
                }
                feed => {
                    let [begin, end] = [(0.0, true), (1.0, false)]
                        .map(|(r, right)| feed.at(&self.outputs, values, r, right));
                    [begin, (end - begin) / h, 0.0]
                }
            };
            self.units[number].value[k] = input.conversion.apply(trajectory[0]);
            for order in 0..self.order as usize {
                self.derivatives[number].2[order * count + k] =
                    input.conversion.factor * trajectory[order + 1];
            }
        }
        true
    }

    /// Gives a slave the trajectory of its inputs.
    fn give_trajectory(&mut self, number: usize, node: &mut Node, h: f64) -> Result<(), Stop> {
        let unit = &self.units[number];
        let (references, orders, derivatives) = &self.derivatives[number];
        if unit.ramps {
            node.set_real(&unit.input_references, &unit.value)?;
            node.slave().set_real_input_derivatives(references, orders, derivatives)?;
            return Ok(());
        }
        // Held: a block without states at the end of the step, others at the mean.
        let part = if unit.is_static { h } else { 0.5 * h };
        let count = unit.inputs.len();
        for ((held, value), rate) in self.held.iter_mut().zip(&unit.value).zip(derivatives) {
            *held = value + part * rate;
        }
        node.set_real(&unit.input_references, &self.held[..count])?;
        Ok(())
    }

    /// Trajectory of an output; `stepped`: its slave has done the step; `together`: it steps with the one it feeds.
    fn trajectory(&self, place: usize, stepped: bool, together: bool, h: f64) -> Trajectory {
        if let Some([ahead, ahead_rate]) = &self.ahead {
            let (discrete, unit) = self.sources[place];
            let (y, rate) = match stepped {
                true => (self.outputs.y[place], self.outputs.rate[place]),
                false => (ahead[place], ahead_rate[place]),
            };
            let begin = self.outputs.begin[place];
            return match self.units[unit].is_static {
                _ if discrete => [y, 0.0, 0.0],
                // It may have jumped where the step begins; a loop was solved there.
                true if !together => [y - h * rate, rate, 0.0],
                _ => [begin, (y - begin) / h, 0.0],
            };
        }
        let y = if stepped { self.outputs.y[place] } else { self.outputs.begin[place] };
        if self.sources[place].0 {
            return [y, 0.0, 0.0];
        }
        if stepped && self.prediction == 0 {
            return [y, 0.0, 0.0];
        }
        if stepped {
            let rate = self.outputs.rate[place];
            return [y - h * rate, rate, 0.0];
        }
        let ([last, second], [h1, h2]) = (&self.before, self.steps);
        let slope = (y - last[place]) / h1;
        match self.prediction.min(self.known) {
            0 => [y, 0.0, 0.0],
            1 => [y, slope, 0.0],
            _ => {
                let curve = 2.0 * (slope - (last[place] - second[place]) / h2) / (h1 + h2);
                [y, slope + 0.5 * h1 * curve, curve]
            }
        }
    }

    /// Takes over the results of a slave.
    fn read(&mut self, number: usize, node: &mut Node, values: &mut Values, h: f64) -> Result<(), Stop> {
        get_outputs(node, number, values)?;
        let unit = &self.units[number];
        let places = unit.outputs.clone();
        unit.read(node, &mut self.outputs.y[places.clone()], &mut self.outputs.rate[places.clone()])?;
        if !unit.rates {
            for place in places {
                self.outputs.rate[place] = (self.outputs.y[place] - self.outputs.begin[place]) / h;
            }
        }
        Ok(())
    }
}
