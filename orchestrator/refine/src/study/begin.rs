//! Start of the fit of an initial state that no column of `[states]` shows: an output that is this state shows it, too;
//! any other state begins as its FMU does.
//!
//! A level of zero is no place to begin from: the outflow of a tank has no slope there.

use super::declaration::{Initial, InitialWord};
use super::fits::Fits;
use super::model::Study;
use super::simulate::Piece;

/// Step of a difference over the size of a state.
pub const STEP: f64 = 1e-5;
/// Size of a state that is zero wherever it is known.
pub const LEAST_SIZE: f64 = 1e-6;

/// A state without a column.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Begin {
    /// Measured output that is this state.
    pub output: Option<usize>,
    /// Value with which the FMUs start.
    pub start: f64,
}

impl Begin {
    /// Initial value in a piece, and the step of a difference.
    pub fn of(self, study: &Study, piece: &Piece) -> (f64, f64) {
        match self.output.map(|o| &study.records[piece.record].outputs[o]) {
            Some(values) => measured(values, piece),
            None if self.start == 0.0 => (0.0, STEP),
            None => (self.start, STEP * self.start.abs().max(LEAST_SIZE)),
        }
    }
}

/// Initial value that a signal shows in a piece, and the step of a difference.
pub fn measured(values: &[f64], piece: &Piece) -> (f64, f64) {
    let size = values.iter().fold(0.0f64, |a, b| a.max(b.abs()));
    (values[piece.range.start], STEP * size.max(LEAST_SIZE))
}

/// Where the states begin, `[nx]`; empty where no initial states are fitted, or the FMUs do not start.
pub fn begins(study: &Study) -> Vec<Begin> {
    if !study.records.iter().any(|record| record.initial == Initial::Word(InitialWord::Fit)) {
        return Vec::new();
    }
    let Ok(mut plant) = study.take() else { return Vec::new() };
    let mut x = vec![0.0; plant.nx];
    let parameters =
        Fits::new(study, vec![1.0; study.outputs.len()]).view(&[], &[]).parameters(&study.start());
    let started = plant.initialize(&[], &parameters, 0.0, &mut x, &|_, value, _| value);
    let output = |i: usize| study.outputs.iter().position(|own| plant.state(&own.port) == Some(i));
    let start = |i: usize| if started.is_ok() && x[i].is_finite() { x[i] } else { 0.0 };
    let found = (0..x.len()).map(|i| Begin { output: output(i), start: start(i) }).collect();
    if started.is_ok() {
        study.give(plant);
    }
    found
}
