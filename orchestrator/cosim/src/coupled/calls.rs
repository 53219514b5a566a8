//! Calls into one component with all data prepared: which values are set, read and differentiated.

use std::ops::Range;

use super::anatomy::{Anatomy, Block};
use airloop_fmi::{Error as FmuError, Model, Status};

/// Sets all arguments of a component: states, then inputs.
pub(super) fn set_all(model: &mut Model, block: &Block, at: &[f64]) -> Result<(), FmuError> {
    let (states, inputs) = at.split_at(block.states);
    if !states.is_empty() {
        model.set_continuous_states(states)?;
    }
    for (argument, value) in block.arguments[block.states..].iter().zip(inputs) {
        model.set_real(&[argument.reference], &[*value])?;
    }
    Ok(())
}

/// Sets one argument, where the others stand at `at`.
pub(super) fn set_one(
    model: &mut Model,
    states: usize,
    argument: usize,
    reference: u32,
    at: &[f64],
) -> Result<(), FmuError> {
    match argument < states {
        true => model.set_continuous_states(&at[..states]),
        false => model.set_real(&[reference], &at[argument..=argument]),
    }
}

/// Whether a component refused a point but can go on elsewhere.
pub(super) fn is_discarded(error: &FmuError) -> bool {
    matches!(error, FmuError::Call(call) if call.status == Status::Discard)
}

/// Points at both sides of `here` at which `visit` succeeds: where a component refuses one, as beyond a limit of its
/// argument, `here` takes its place.
pub(super) fn both_sides(
    here: f64,
    step: f64,
    mut visit: impl FnMut(usize, f64) -> Result<(), FmuError>,
) -> Result<[f64; 2], FmuError> {
    let mut reached = [here + step, here - step];
    let mut refused = false;
    for (side, value) in reached.iter_mut().enumerate() {
        if let Err(error) = visit(side, *value) {
            if !is_discarded(&error) || refused {
                return Err(error);
            }
            refused = true;
            *value = here;
            visit(side, here)?;
        }
    }
    Ok(reached)
}

/// A point on one side of `here` at which `visit` succeeds: on the other where a component refuses the first.
pub(super) fn one_side(
    here: f64,
    step: f64,
    mut visit: impl FnMut(f64) -> Result<(), FmuError>,
) -> Result<f64, FmuError> {
    let other = match visit(here + step) {
        Ok(()) => return Ok(here + step),
        Err(error) if is_discarded(&error) => here - step,
        Err(error) => return Err(error),
    };
    visit(other).map(|()| other)
}

/// Values of one component that are read together.
#[derive(Debug, Clone, Default)]
pub(super) struct Reader {
    /// Number of all derivatives of the component.
    states: usize,
    /// Derivatives that are wanted: position, and place among the values.
    rates: Vec<(usize, usize)>,
    references: Vec<u32>,
    /// Places of the outputs among the values.
    places: Vec<usize>,
}

impl Reader {
    /// Of values of one component, by place.
    pub fn new(anatomy: &Anatomy, values: impl IntoIterator<Item = usize>) -> Reader {
        let mut reader = Reader::default();
        for place in values {
            let value = &anatomy.values[place];
            reader.states = anatomy.blocks[value.component].states;
            match value.rate {
                Some(k) => reader.rates.push((k, place)),
                None => {
                    reader.references.push(value.reference);
                    reader.places.push(place);
                }
            }
        }
        reader
    }

    /// Length of the buffer.
    pub fn width(&self) -> usize {
        self.states.max(self.references.len())
    }

    /// Places that are written.
    pub fn places(&self) -> impl Iterator<Item = usize> + '_ {
        self.rates.iter().map(|&(_, place)| place).chain(self.places.iter().copied())
    }

    /// Reads into `values`, which holds those of all components.
    pub fn read(&self, model: &mut Model, buffer: &mut [f64], values: &mut [f64]) -> Result<(), FmuError> {
        if !self.rates.is_empty() {
            let rates = &mut buffer[..self.states];
            model.get_derivatives(rates)?;
            self.rates.iter().for_each(|&(k, place)| values[place] = rates[k]);
        }
        if !self.references.is_empty() {
            let outputs = &mut buffer[..self.references.len()];
            model.get_real(&self.references, outputs)?;
            self.places.iter().zip(outputs).for_each(|(&place, value)| values[place] = *value);
        }
        Ok(())
    }
}

/// Derivatives of some values by one argument.
#[derive(Debug, Clone)]
pub(super) struct Column {
    /// Position among the arguments.
    pub argument: usize,
    pub reference: u32,
    nominal: f64,
    states: usize,
    unknowns: Vec<u32>,
    /// Destination of the results: those of `unknowns`, then those of `differences`.
    pub targets: Range<usize>,
    /// Values that the FMU does not differentiate.
    differences: Reader,
    differenced: Vec<usize>,
}

impl Column {
    /// Derivatives of `values` by an argument, written from `first` on in the order of [`Column::values`].
    pub fn new(
        anatomy: &Anatomy,
        component: usize,
        argument: usize,
        values: &[usize],
        first: usize,
    ) -> Column {
        let block = &anatomy.blocks[component];
        let (exact, others): (Vec<usize>, Vec<usize>) =
            values.iter().partition(|&&value| anatomy.values[value].exact);
        let unknowns = exact.iter().map(|&value| anatomy.values[value].reference).collect();
        let differences = Reader::new(anatomy, others.iter().copied());
        Column {
            argument,
            reference: block.arguments[argument].reference,
            nominal: block.arguments[argument].nominal,
            states: block.states,
            unknowns,
            targets: first..first + values.len(),
            differenced: others,
            differences,
        }
    }

    /// Values in the order of the results.
    pub fn values(anatomy: &Anatomy, values: &[usize]) -> Vec<usize> {
        let (mut exact, others): (Vec<usize>, Vec<usize>) =
            values.iter().partition(|&&value| anatomy.values[value].exact);
        exact.extend(others);
        exact
    }

    /// Length of the buffers.
    pub fn width(&self) -> usize {
        self.differences.width().max(self.unknowns.len())
    }

    /// Typical magnitude of the argument near a value.
    pub fn scale(&self, value: f64) -> f64 {
        self.nominal.max(value.abs())
    }

    /// Derivatives at `at`, where the component stands; `part` is the length of the difference quotient in units of
    /// the argument's magnitude.
    pub fn differentiate(
        &self,
        model: &mut Model,
        at: &mut [f64],
        part: f64,
        scratch: &mut Scratch,
        results: &mut [f64],
    ) -> Result<(), FmuError> {
        let (exact, others) = results.split_at_mut(self.unknowns.len());
        if !exact.is_empty() {
            model.directional_derivative(&self.unknowns, &[self.reference], &[1.0], exact)?;
        }
        if others.is_empty() {
            return Ok(());
        }
        let here = at[self.argument];
        let Scratch { buffer, sides } = scratch;
        let [up, down] = both_sides(here, part * self.scale(here), |side, value| {
            at[self.argument] = value;
            set_one(model, self.states, self.argument, self.reference, at)?;
            self.differences.read(model, buffer, &mut sides[side])
        })?;
        at[self.argument] = here;
        set_one(model, self.states, self.argument, self.reference, at)?;
        for (slope, &place) in others.iter_mut().zip(&self.differenced) {
            *slope = (sides[0][place] - sides[1][place]) / (up - down);
        }
        Ok(())
    }
}

/// Buffers of difference quotients.
#[derive(Debug, Clone, Default)]
pub(super) struct Scratch {
    buffer: Vec<f64>,
    sides: [Vec<f64>; 2],
}

impl Scratch {
    /// For that many values, and calls of that width.
    pub fn new(values: usize, width: usize) -> Scratch {
        Scratch { buffer: vec![0.0; width], sides: [vec![0.0; values], vec![0.0; values]] }
    }
}
