//! The numbers at one point: values through the components, and derivatives of each component there.

use super::calls::{Scratch, both_sides, one_side, set_one};
use super::memory::{Known, Memory};
use super::program::{Place, Program, Slopes, Step};
use crate::system::graph::Conversion;
use airloop_dynamics::{Point, Size};
use airloop_fmi::{Error as FmuError, Model};

/// Length of the difference quotients for first derivatives, in units of the argument's magnitude: the cube root of
/// the rounding error, where truncation and rounding of a central difference are the same.
const DIFFERENCE_OF_VALUES: f64 = 6e-6;
/// For first derivatives that are differenced again: the fourth root.
const DIFFERENCE_OF_DIFFERENCES: f64 = 1.2e-4;
/// For derivatives that run straight any length is right; a long one leaves little rounding.
const DIFFERENCE_OF_STRAIGHT_LINES: f64 = 1e-2;
/// Reason why there are no numbers at a point.
#[derive(Debug)]
pub(super) enum Trouble {
    /// A call into a component failed.
    Fmu { component: usize, error: FmuError },
    /// A value is not a number.
    NotFinite { value: usize, found: f64 },
    /// A derivative by an argument is not a number.
    Derivative { component: usize, argument: usize, found: f64 },
    /// A state or input is not a number.
    Argument { column: usize, found: f64 },
}

/// Numbers at a point.
#[derive(Debug)]
pub(super) struct Work {
    pub size: Size,
    /// States and inputs.
    pub point: Vec<f64>,
    /// Values of all components.
    pub values: Vec<f64>,
    /// Arguments of every component as it stands.
    pub arguments: Vec<Vec<f64>>,
    /// Varying derivatives.
    pub entries: Vec<f64>,
    /// Derivatives of every value, `[values][n_x + n_u]`.
    pub rows: Vec<f64>,
    /// Weight of every value in the function whose second derivatives are wanted.
    pub adjoint: Vec<f64>,
    /// Second derivatives of the component that is worked on, and those at the second point.
    pub curvatures: [Vec<f64>; 2],
    /// Second derivatives times weights by pairs of arguments.
    pub scratch: Scratch,
    buffer: Vec<f64>,
    /// Time and point, as the memory knows them.
    key: Vec<f64>,
    memory: Memory,
    /// Place of the present point in the memory.
    place: Option<usize>,
    /// Time that the components have.
    time: Option<f64>,
}

impl Work {
    pub fn new(program: &Program, widths: Vec<usize>, size: Size) -> Work {
        let values = program.patterns.len();
        let most = widths.iter().copied().max().unwrap_or(0);
        Work {
            size,
            point: vec![0.0; size.arguments()],
            values: vec![0.0; values],
            arguments: widths.into_iter().map(|width| vec![0.0; width]).collect(),
            entries: vec![0.0; program.entries],
            rows: vec![0.0; values * size.arguments()],
            adjoint: vec![0.0; values],
            curvatures: [vec![0.0; program.curvatures], vec![0.0; program.curvatures]],
            scratch: Scratch::new(values, program.width),
            buffer: vec![0.0; program.width.max(most)],
            key: vec![0.0; 1 + size.arguments()],
            memory: Memory::new(1 + size.arguments(), values + program.entries),
            place: None,
            time: None,
        }
    }

    /// For other instances of the same components. What is in the memory stays behind: it is large.
    pub fn fresh(&self) -> Work {
        Work {
            size: self.size,
            point: self.point.clone(),
            values: self.values.clone(),
            arguments: self.arguments.clone(),
            entries: self.entries.clone(),
            rows: self.rows.clone(),
            adjoint: self.adjoint.clone(),
            curvatures: self.curvatures.clone(),
            scratch: self.scratch.clone(),
            buffer: self.buffer.clone(),
            key: self.key.clone(),
            memory: self.memory.fresh(),
            place: None,
            time: None,
        }
    }

    /// The instances were made anew.
    pub fn forget(&mut self) {
        self.time = None;
    }

    fn at(&self, place: Place) -> f64 {
        match place {
            Place::Column(column) => self.point[column],
            Place::Value(value) => self.values[value],
            Place::Fixed(value) => value,
        }
    }

    /// Takes a point, and from the memory what is known of it.
    pub fn recall(&mut self, at: Point<'_>) -> Result<Known, Trouble> {
        self.key[0] = at.time;
        self.key[1..=at.states.len()].copy_from_slice(at.states);
        self.key[1 + at.states.len()..].copy_from_slice(at.inputs);
        self.point.copy_from_slice(&self.key[1..]);
        if let Some(column) = self.point.iter().position(|value| !value.is_finite()) {
            return Err(Trouble::Argument { column, found: self.point[column] });
        }
        let found = self.memory.place(&self.key);
        self.place = found.map(|(place, _)| place);
        let Some((place, known)) = found else { return Ok(Known::Nothing) };
        let numbers = self.memory.numbers(place);
        let (values, entries) = numbers.split_at(self.values.len());
        if known >= Known::Values {
            self.values.copy_from_slice(values);
        }
        if known == Known::Derivatives {
            self.entries.copy_from_slice(entries);
        }
        Ok(known)
    }

    /// Keeps what is known of the point now.
    pub fn remember(&mut self, known: Known) {
        if let Some(place) = self.place {
            self.memory.keep(place, known, [&self.values, &self.entries]);
        }
    }

    /// Brings the components to the time of the point.
    pub fn set_time(&mut self, program: &Program, models: &mut [Model]) -> Result<(), Trouble> {
        let time = self.key[0];
        if self.time == Some(time) {
            return Ok(());
        }
        // Where this fails, some components have the new time and some the old.
        self.time = None;
        for slopes in &program.slopes {
            let component = slopes.component;
            models[component].set_time(time).map_err(|error| Trouble::Fmu { component, error })?;
        }
        self.time = Some(time);
        Ok(())
    }

    /// Values at the point; the components then stand there.
    pub fn visit(&mut self, program: &Program, models: &mut [Model]) -> Result<(), Trouble> {
        self.set_time(program, models)?;
        for step in &program.steps {
            match step {
                Step::Affine(affine) => {
                    let terms = affine.terms.iter();
                    let found =
                        terms.fold(affine.offset, |sum, &(factor, place)| sum + factor * self.at(place));
                    if !found.is_finite() {
                        return Err(Trouble::NotFinite { value: affine.value, found });
                    }
                    self.values[affine.value] = found;
                }
                Step::Call(call) => {
                    let component = call.component;
                    let model = &mut models[component];
                    let refused = |error| Trouble::Fmu { component, error };
                    if !call.states.is_empty() {
                        for (k, &place) in call.states.iter().enumerate() {
                            self.arguments[component][k] = self.at(place);
                        }
                        let states = &self.arguments[component][..call.states.len()];
                        model.set_continuous_states(states).map_err(refused)?;
                    }
                    if !call.inputs.is_empty() {
                        for (k, &(argument, place, conversion)) in call.inputs.iter().enumerate() {
                            let value = match conversion == Conversion::IDENTITY {
                                true => self.at(place),
                                false => conversion.apply(self.at(place)),
                            };
                            self.arguments[component][argument] = value;
                            self.buffer[k] = value;
                        }
                        let values = &self.buffer[..call.inputs.len()];
                        model.set_real(&call.references, values).map_err(refused)?;
                    }
                    call.reader.read(model, &mut self.buffer, &mut self.values).map_err(refused)?;
                    if let Some(value) = call.reader.places().find(|&place| !self.values[place].is_finite()) {
                        return Err(Trouble::NotFinite { value, found: self.values[value] });
                    }
                }
            }
        }
        Ok(())
    }

    /// Rates and outputs of the dynamics.
    pub fn write_values(&self, rates: &[usize], outputs: &[(Place, Conversion)], values: &mut [f64]) {
        let (of_rates, of_outputs) = values.split_at_mut(rates.len());
        of_rates.iter_mut().zip(rates).for_each(|(target, &value)| *target = self.values[value]);
        for (target, &(place, conversion)) in of_outputs.iter_mut().zip(outputs) {
            *target = conversion.apply(self.at(place));
        }
    }

    /// First derivatives of every component where it stands.
    pub fn differentiate(&mut self, program: &Program, models: &mut [Model]) -> Result<(), Trouble> {
        for slopes in &program.slopes {
            let component = slopes.component;
            for column in &slopes.columns {
                let at = &mut self.arguments[component];
                let results = &mut self.entries[column.targets.clone()];
                column
                    .differentiate(
                        &mut models[component],
                        at,
                        DIFFERENCE_OF_VALUES,
                        &mut self.scratch,
                        results,
                    )
                    .map_err(|error| Trouble::Fmu { component, error })?;
                if let Some(found) = results.iter().find(|slope| !slope.is_finite()) {
                    return Err(Trouble::Derivative { component, argument: column.argument, found: *found });
                }
            }
        }
        Ok(())
    }

    /// Arguments of a component at the point, from the values of all.
    fn take_arguments(&mut self, slopes: &Slopes) {
        for (argument, &(conversion, place)) in slopes.arguments.iter().enumerate() {
            let value = self.at(place);
            self.arguments[slopes.component][argument] = match conversion == Conversion::IDENTITY {
                true => value,
                false => conversion.apply(value),
            };
        }
    }

    /// Brings the arguments of a component that matter for derivatives to the point, but for one that is set next.
    fn stand(&mut self, slopes: &Slopes, model: &mut Model, next: Option<usize>) -> Result<(), FmuError> {
        let at = &self.arguments[slopes.component];
        // The states are set together.
        let is_state = |argument: usize| argument < slopes.states;
        let mut states_set = next.is_some_and(is_state);
        for column in &slopes.columns {
            let again = match is_state(column.argument) {
                true => std::mem::replace(&mut states_set, true),
                false => next == Some(column.argument),
            };
            if !again {
                set_one(model, slopes.states, column.argument, column.reference, at)?;
            }
        }
        Ok(())
    }

    /// First derivatives of every component at a point whose values are known.
    pub fn revisit(&mut self, program: &Program, models: &mut [Model]) -> Result<(), Trouble> {
        self.set_time(program, models)?;
        for slopes in &program.slopes {
            let component = slopes.component;
            self.take_arguments(slopes);
            self.stand(slopes, &mut models[component], None)
                .map_err(|error| Trouble::Fmu { component, error })?;
        }
        self.differentiate(program, models)
    }

    /// Second derivatives of a component at a point whose first derivatives are known, by differences of them.
    pub fn differentiate_twice(&mut self, slopes: &Slopes, model: &mut Model) -> Result<(), FmuError> {
        self.take_arguments(slopes);
        let first = slopes.bends.first().map(|bend| bend.columns[0].argument);
        self.stand(slopes, model, first)?;
        let last = slopes.bends.len().saturating_sub(1);
        let at = &mut self.arguments[slopes.component];
        for (number, bend) in slopes.bends.iter().enumerate() {
            let moved = &bend.columns[0];
            let here = at[moved.argument];
            let (scratch, curvatures) = (&mut self.scratch, &mut self.curvatures);
            let mut visit = |side: usize, value: f64| {
                at[moved.argument] = value;
                set_one(model, slopes.states, moved.argument, moved.reference, at)?;
                bend.columns.iter().try_for_each(|column| {
                    let results = &mut curvatures[side][column.targets.clone()];
                    column.differentiate(model, at, DIFFERENCE_OF_DIFFERENCES, scratch, results)
                })
            };
            let scale = moved.scale(here);
            let [up, down] = match bend.straight {
                true => {
                    [one_side(here, DIFFERENCE_OF_STRAIGHT_LINES * scale, |value| visit(0, value))?, here]
                }
                false => both_sides(here, DIFFERENCE_OF_VALUES * scale, visit)?,
            };
            at[moved.argument] = here;
            // The states are set together: the next of them brings this one back.
            let next = slopes.bends.get(number + 1).map(|bend| bend.columns[0].argument);
            let both = moved.argument < slopes.states && next.is_some_and(|next| next < slopes.states);
            if number != last && !both {
                set_one(model, slopes.states, moved.argument, moved.reference, at)?;
            }
            let [above, below] = &mut self.curvatures;
            for target in bend.columns.iter().flat_map(|column| column.targets.clone()) {
                let other = match bend.straight {
                    true => self.entries[slopes.curvatures[target].entry],
                    false => below[target],
                };
                above[target] = (above[target] - other) / (up - down);
            }
        }
        Ok(())
    }
}
