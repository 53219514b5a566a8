//! Kinds of the derivatives of a component by its arguments: zero, constant (and how large), or varying.
//!
//! The description says so, and it is tried: at some points around the start every derivative is computed, and what
//! contradicts the description counts as varying.

use super::anatomy::{Anatomy, Block, Origin};
use super::calls::{self, Reader};
use super::start;
use super::{Error, names};
use crate::system::SystemGraph;
use crate::system::graph::Start;
use airloop_fmi::Model;

/// Derivative of a value by an argument.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Coefficient {
    Zero,
    Constant(f64),
    Varying,
}

/// A component as far as it is known beforehand.
#[derive(Debug, Clone)]
pub(super) struct Local {
    /// `[values, arguments]`, row by row.
    coefficients: Vec<Coefficient>,
    /// Arguments at the start.
    pub anchor: Vec<f64>,
    /// Value less its linear part, where it has no other part.
    pub offsets: Vec<f64>,
    /// Whether all first derivatives run on straight lines where only this argument moves: inputs, and velocities in
    /// mechanics. Their difference quotients are exact over any distance, from one side.
    pub straight: Vec<bool>,
    /// Whether the first derivatives by the second argument stay as they are where the first, a straight one, moves;
    /// `[arguments, arguments]`, row by row.
    flat: Vec<bool>,
}

impl Local {
    /// Derivative of the value at position `row` of the block by an argument.
    pub fn coefficient(&self, row: usize, argument: usize) -> Coefficient {
        self.coefficients[row * self.anchor.len() + argument]
    }

    /// Whether nothing has a second derivative by two arguments, of which the first is straight.
    pub fn is_flat(&self, first: usize, second: usize) -> bool {
        self.straight[first] && self.flat[first * self.anchor.len() + second]
    }

    /// Derivatives of a value.
    pub fn row(&self, row: usize) -> &[Coefficient] {
        let width = self.anchor.len();
        &self.coefficients[row * width..(row + 1) * width]
    }

    /// Whether a value is a linear function and a constant.
    pub fn is_affine(&self, row: usize) -> bool {
        !self.row(row).contains(&Coefficient::Varying)
    }
}

/// Points that are tried, in nominal magnitudes of the arguments from the start.
const TRIAL_POINTS: usize = 4;
/// A derivative that differs by more than this part of its typical size is not what the description says.
const DECLARED_TOLERANCE: f64 = 1e-6;
/// Same as above, for the values of a linear function.
const LINEARITY_TOLERANCE: f64 = 1e-9;
/// Distance of difference quotients for constants, in nominal magnitudes.
const DIFFERENCE_OF_CONSTANTS: f64 = 1e-2;
/// A first derivative whose changes over two neighboring distances differ by more than this part of it is not straight.
const STRAIGHTNESS_TOLERANCE: f64 = 1e-10;

/// All components, one sentence for everything that was found different, and whether the instances can still be used.
pub(super) fn learn(
    graph: &SystemGraph,
    anatomy: &Anatomy,
    models: &mut [Model],
    time: f64,
) -> Result<(Vec<Local>, Vec<String>, bool), Error> {
    let (mut locals, mut notes, mut intact) = (Vec::new(), Vec::new(), true);
    for (index, model) in models.iter_mut().enumerate() {
        let mut student = Student::new(graph, anatomy, index, model, time)?;
        let tried = (0..TRIAL_POINTS).try_for_each(|trial| student.compare(model, time, trial));
        let tried = tried
            .and_then(|()| (0..=TRIAL_POINTS).try_for_each(|trial| student.straighten(model, time, trial)))
            .inspect_err(|_| student.local.straight.fill(false));
        // A component may refuse a point that is far away: what was tried before counts.
        intact &= tried.is_ok() && student.restore(model, time).is_ok();
        notes.extend(student.notes(graph, index));
        locals.push(student.local);
    }
    Ok((locals, notes, intact))
}

struct Student<'a> {
    anatomy: &'a Anatomy,
    block: &'a Block,
    local: Local,
    reader: Reader,
    nominals: Vec<f64>,
    /// (row, argument) found to be different from the description.
    wrong: Vec<(usize, usize)>,
}

impl<'a> Student<'a> {
    fn new(
        graph: &SystemGraph,
        anatomy: &'a Anatomy,
        index: usize,
        model: &mut Model,
        time: f64,
    ) -> Result<Student<'a>, Error> {
        let block = &anatomy.blocks[index];
        let component = &graph.components[index];
        let mut anchor = vec![0.0; block.arguments.len()];
        if block.states > 0 {
            model.get_continuous_states(&mut anchor[..block.states])?;
        }
        for (value, argument) in anchor.iter_mut().zip(&block.arguments).skip(block.states) {
            if let Start::Real(start) = start::read(model, component, argument.variable)? {
                *value = start;
            }
        }
        let nominals = block.values.clone().map(|value| anatomy.values[value].nominal).collect();
        let reader = Reader::new(anatomy, block.values.clone());
        let (rows, width) = (block.values.len(), anchor.len());
        let exact = block.values.clone().all(|value| anatomy.values[value].exact);
        let (straight, flat) = (vec![exact; width], vec![exact; width * width]);
        let local = Local { coefficients: Vec::new(), anchor, offsets: vec![0.0; rows], straight, flat };
        let mut student = Student { anatomy, block, local, reader, nominals, wrong: Vec::new() };
        model.set_time(time)?;
        let at = student.local.anchor.clone();
        let values = student.values(model, &at)?;
        let columns = student.columns(model, &at)?;
        let mut coefficients = Vec::with_capacity(rows * width);
        for (row, value) in block.values.clone().enumerate() {
            for (j, argument) in block.arguments.iter().enumerate() {
                coefficients.push(match anatomy.declared(graph, value, argument) {
                    None => Coefficient::Zero,
                    Some(false) => Coefficient::Varying,
                    Some(true) if columns[j][row] == 0.0 => Coefficient::Zero,
                    Some(true) => Coefficient::Constant(columns[j][row]),
                });
            }
        }
        student.local.coefficients = coefficients;
        // Where the start is no place for a value, nothing is learned of it there.
        for (row, value) in values.iter().enumerate() {
            let finite = |entry: &Coefficient| !matches!(entry, Coefficient::Constant(c) if !c.is_finite());
            if !(value.is_finite() && student.local.row(row).iter().all(finite)) {
                (0..width).for_each(|j| student.local.coefficients[row * width + j] = Coefficient::Varying);
            }
        }
        for (row, value) in values.iter().enumerate() {
            student.local.offsets[row] = value - student.linear(row, &at).0;
        }
        Ok(student)
    }

    /// Sum of the constant coefficients times the arguments, and of its magnitudes.
    fn linear(&self, row: usize, at: &[f64]) -> (f64, f64) {
        let terms = self.local.row(row).iter().zip(at);
        terms.fold((0.0, 0.0), |(sum, size), (coefficient, argument)| match coefficient {
            Coefficient::Constant(c) => (sum + c * argument, size + (c * argument).abs()),
            _ => (sum, size),
        })
    }

    fn values(&self, model: &mut Model, at: &[f64]) -> Result<Vec<f64>, Error> {
        calls::set_all(model, self.block, at)?;
        let mut values = vec![0.0; self.anatomy.values.len()];
        self.reader.read(model, &mut vec![0.0; self.reader.width()], &mut values)?;
        Ok(values[self.block.values.clone()].to_vec())
    }

    /// Derivatives by each argument, `[arguments][values]`; the model stands at `at`.
    fn columns(&self, model: &mut Model, at: &[f64]) -> Result<Vec<Vec<f64>>, Error> {
        let exact: Vec<usize> =
            self.block.values.clone().filter(|&value| self.anatomy.values[value].exact).collect();
        let unknowns: Vec<u32> = exact.iter().map(|&value| self.anatomy.values[value].reference).collect();
        let mut columns = Vec::with_capacity(at.len());
        for (j, argument) in self.block.arguments.iter().enumerate() {
            let mut column = vec![0.0; self.block.values.len()];
            if exact.len() < column.len() {
                // A constant is the same over any distance, and rounding matters less over a long one.
                let distance = DIFFERENCE_OF_CONSTANTS * argument.nominal;
                let mut moved = at.to_vec();
                moved[j] = at[j] + distance;
                let up = self.values(model, &moved)?;
                let width = moved[j];
                moved[j] = at[j] - distance;
                let down = self.values(model, &moved)?;
                let width = width - moved[j];
                column.iter_mut().zip(up.iter().zip(&down)).for_each(|(slope, (up, down))| {
                    *slope = (up - down) / width;
                });
                calls::set_all(model, self.block, at)?;
            }
            let mut found = vec![0.0; unknowns.len()];
            if !unknowns.is_empty() {
                model.directional_derivative(&unknowns, &[argument.reference], &[1.0], &mut found)?;
            }
            exact
                .iter()
                .zip(found)
                .for_each(|(value, slope)| column[value - self.block.values.start] = slope);
            columns.push(column);
        }
        Ok(columns)
    }

    /// A point that is tried.
    fn trial(&self, model: &mut Model, time: f64, trial: usize) -> Result<Vec<f64>, Error> {
        let shift = |j: usize| 2.0 * (1.7 * (j + 1) as f64 + 2.3 * (trial + 1) as f64).sin();
        let arguments = self.local.anchor.iter().zip(&self.block.arguments).enumerate();
        model.set_time(time + 0.37 * trial as f64)?;
        Ok(arguments.map(|(j, (anchor, argument))| anchor + shift(j) * argument.nominal).collect())
    }

    /// Tries one point.
    fn compare(&mut self, model: &mut Model, time: f64, trial: usize) -> Result<(), Error> {
        let at = self.trial(model, time, trial)?;
        let values = self.values(model, &at)?;
        let columns = self.columns(model, &at)?;
        for row in 0..self.nominals.len() {
            for (j, argument) in self.block.arguments.iter().enumerate() {
                let typical = self.nominals[row] / argument.nominal;
                let known = match self.local.coefficient(row, j) {
                    Coefficient::Zero => 0.0,
                    Coefficient::Constant(value) => value,
                    Coefficient::Varying => continue,
                };
                let gap = (columns[j][row] - known).abs();
                if gap > DECLARED_TOLERANCE * (known.abs() + typical) {
                    self.vary(row, j);
                }
            }
            let (linear, size) = self.linear(row, &at);
            let gap = (values[row] - linear - self.local.offsets[row]).abs();
            if self.local.is_affine(row)
                && gap > LINEARITY_TOLERANCE * (size + values[row].abs() + self.nominals[row])
            {
                for j in 0..at.len() {
                    if self.local.coefficient(row, j) != Coefficient::Zero {
                        self.vary(row, j);
                    }
                }
            }
        }
        Ok(())
    }

    /// Tries at one point, the last time at the start, along which arguments the first derivatives run straight.
    fn straighten(&mut self, model: &mut Model, time: f64, trial: usize) -> Result<(), Error> {
        let at = match trial == TRIAL_POINTS {
            true => self.local.anchor.clone(),
            false => self.trial(model, time, trial)?,
        };
        calls::set_all(model, self.block, &at)?;
        let here = self.columns(model, &at)?;
        let varies = |local: &Local, argument: usize| {
            (0..local.offsets.len()).any(|row| local.coefficient(row, argument) == Coefficient::Varying)
        };
        for moved in 0..at.len() {
            // What bends within a short distance only, as a friction, may look straight over a long one.
            for part in [1.0, DIFFERENCE_OF_CONSTANTS] {
                if self.local.straight[moved] && varies(&self.local, moved) {
                    self.local.straight[moved] = self.is_straight(model, &at, (moved, part), &here)?;
                }
            }
        }
        Ok(())
    }

    /// Whether first derivatives, which are `here` at a point, run straight where one argument moves; those that do not
    /// move at all are noted.
    fn is_straight(
        &mut self,
        model: &mut Model,
        at: &[f64],
        (moved, part): (usize, f64),
        here: &[Vec<f64>],
    ) -> Result<bool, Error> {
        let mut beside = at.to_vec();
        let mut sides = [Vec::new(), Vec::new()];
        for (side, sign) in sides.iter_mut().zip([1.0, -1.0]) {
            beside[moved] = at[moved] + sign * part * self.block.arguments[moved].nominal;
            calls::set_all(model, self.block, &beside)?;
            *side = self.columns(model, &beside)?;
        }
        let [up, down] = sides;
        let mut straight = true;
        for (second, ((up, down), here)) in up.iter().zip(&down).zip(here).enumerate() {
            let mut flat = true;
            for (((up, down), here), nominal) in up.iter().zip(down).zip(here).zip(&self.nominals) {
                // What is far below its typical size is rounding.
                let typical = 1e-3 * nominal / self.block.arguments[second].nominal;
                let limit = STRAIGHTNESS_TOLERANCE * up.abs().max(down.abs()).max(here.abs()).max(typical);
                let (above, below) = (up - here, here - down);
                // What is not a number shows nothing.
                straight &= (above - below).abs() <= limit;
                flat &= above.abs() <= limit && below.abs() <= limit;
            }
            self.local.flat[moved * at.len() + second] &= flat;
        }
        Ok(straight)
    }

    fn vary(&mut self, row: usize, argument: usize) {
        let width = self.local.anchor.len();
        self.local.coefficients[row * width + argument] = Coefficient::Varying;
        self.wrong.push((row, argument));
    }

    fn restore(&self, model: &mut Model, time: f64) -> Result<(), Error> {
        model.set_time(time)?;
        Ok(calls::set_all(model, self.block, &self.local.anchor)?)
    }

    fn notes(&self, graph: &SystemGraph, index: usize) -> Vec<String> {
        let component = &graph.components[index];
        let mut notes = Vec::new();
        if !self.wrong.is_empty() {
            let name = |&(row, argument): &(usize, usize)| {
                let value = &self.anatomy.values[self.block.values.start + row];
                format!(
                    "`{}` by `{}`",
                    component.path_of(value.variable),
                    component.path_of(self.block.arguments[argument].variable)
                )
            };
            let list = self.wrong.iter().map(name).collect::<Vec<_>>().join(", ");
            notes.push(format!(
                "component `{}` declares derivatives as zero or constant that are not; they are taken to vary: {list}",
                component.name
            ));
        }
        let approximate = self.block.values.clone().filter(|&value| {
            let row = value - self.block.values.start;
            !self.anatomy.values[value].exact && !self.local.is_affine(row)
        });
        let list: Vec<String> = approximate
            .map(|value| format!("`{}`", component.path_of(self.anatomy.values[value].variable)))
            .collect();
        if !list.is_empty() {
            notes.push(format!(
                "component `{}` has no directional derivatives of {}: they are central differences",
                component.name,
                list.join(", ")
            ));
        }
        notes
    }
}

/// States, as (component, position), whose rate is always zero and on which nothing depends.
pub(super) fn idle_states(anatomy: &Anatomy, locals: &[Local]) -> Vec<(usize, usize)> {
    let mut idle = Vec::new();
    for (index, (block, local)) in anatomy.blocks.iter().zip(locals).enumerate() {
        for state in 0..block.states {
            let still = local.row(state).iter().all(|entry| *entry == Coefficient::Zero)
                && local.offsets[state] == 0.0;
            let alone = (0..block.values.len()).all(|row| local.coefficient(row, state) == Coefficient::Zero);
            let origin = |origin: &Origin| matches!(origin, Origin::State(own) if *own == state);
            let shown = anatomy.outputs.iter().zip(&anatomy.owners);
            let shown = shown.into_iter().any(|((from, _), owner)| *owner == index && origin(from));
            if still && alone && !shown {
                idle.push((index, state));
            }
        }
    }
    idle
}

/// One sentence about the states that are left out.
pub(super) fn idle_note(graph: &SystemGraph, idle: &[(usize, usize)]) -> Option<String> {
    if idle.is_empty() {
        return None;
    }
    let name =
        |&(component, state): &(usize, usize)| format!("`{}`", names::state_name(graph, component, state));
    let list = idle.iter().map(name).collect::<Vec<_>>().join(", ");
    Some(format!("nothing moves or depends on the states {list}: they are left out"))
}
