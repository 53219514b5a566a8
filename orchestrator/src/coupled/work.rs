//! The numbers at one point: values through the components, and derivatives of each component there.

use super::calls::{Scratch, set_one};
use super::program::{Place, Program, Slopes, Step};
use crate::fmu::{Error as FmuError, Model};
use crate::system::graph::Conversion;
use crate::transcription::dynamics::{Point, Size};

/// Length of the difference quotients for first derivatives, in units of the argument's magnitude: the cube root of
/// the rounding error, where truncation and rounding of a central difference are the same.
const FIRST: f64 = 6e-6;
/// For first derivatives that are differenced again: the fourth root.
const NESTED: f64 = 1.2e-4;

/// Why there are no numbers at a point.
#[derive(Debug)]
pub(super) enum Trouble {
    /// A call into a component failed.
    Fmu { component: usize, error: FmuError },
    /// A value is no number.
    NotFinite { value: usize, found: f64 },
    /// A state or input is no number.
    Argument { column: usize, found: f64 },
}

/// Numbers at a point.
#[derive(Debug, Clone)]
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
            time: None,
        }
    }

    /// For other instances of the same components.
    pub fn fresh(&self) -> Work {
        Work { time: None, ..self.clone() }
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

    /// Values at a point; the components then stand there.
    pub fn visit(&mut self, program: &Program, models: &mut [Model], at: Point<'_>) -> Result<(), Trouble> {
        let (states, inputs) = self.point.split_at_mut(self.size.states);
        states.copy_from_slice(at.states);
        inputs.copy_from_slice(at.inputs);
        if let Some(column) = self.point.iter().position(|value| !value.is_finite()) {
            return Err(Trouble::Argument { column, found: self.point[column] });
        }
        if self.time != Some(at.time) {
            // Where this fails, some components have the new time and some the old.
            self.time = None;
            for slopes in &program.slopes {
                let component = slopes.component;
                let done = models[component].set_time(at.time);
                done.map_err(|error| Trouble::Fmu { component, error })?;
            }
            self.time = Some(at.time);
        }
        for step in &program.steps {
            match step {
                Step::Affine(affine) => {
                    let terms = affine.terms.iter();
                    self.values[affine.value] =
                        terms.fold(affine.offset, |sum, &(factor, place)| sum + factor * self.at(place));
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
                    .differentiate(&mut models[component], at, FIRST, &mut self.scratch, results)
                    .map_err(|error| Trouble::Fmu { component, error })?;
            }
        }
        Ok(())
    }

    /// Second derivatives of a component where it stands, by central differences of its first ones.
    pub fn differentiate_twice(&mut self, slopes: &Slopes, model: &mut Model) -> Result<(), FmuError> {
        let at = &mut self.arguments[slopes.component];
        for bend in &slopes.bends {
            let moved = &bend.columns[0];
            let here = at[moved.argument];
            let step = FIRST * moved.scale(here);
            let (up, down) = (here + step, here - step);
            for (value, side) in [(up, 0), (down, 1)] {
                at[moved.argument] = value;
                set_one(model, slopes.states, moved.argument, moved.reference, at)?;
                for column in &bend.columns {
                    let results = &mut self.curvatures[side][column.targets.clone()];
                    column.differentiate(model, at, NESTED, &mut self.scratch, results)?;
                }
            }
            at[moved.argument] = here;
            set_one(model, slopes.states, moved.argument, moved.reference, at)?;
            let [above, below] = &mut self.curvatures;
            for column in &bend.columns {
                for target in column.targets.clone() {
                    above[target] = (above[target] - below[target]) / (up - down);
                }
            }
        }
        Ok(())
    }
}
