//! Signals for the inputs of a system: samples of a series, or polynomials between knots.

use super::Error;
use crate::system::SystemGraph;
use airloop_series::resample::{locate, value_at};
use airloop_series::{Interpolation, TimeSeries};

/// Signals for inputs of the system.
#[derive(Debug, Clone, PartialEq)]
pub struct Stimulus<'a> {
    /// Samples.
    pub series: &'a TimeSeries,
    /// (index of the system input, index of the channel, factor, offset): input = factor * channel + offset.
    pub links: Vec<(usize, usize, f64, f64)>,
    /// Between samples, for continuous Reals; other inputs are always held ([`Stimulus::interpolations`]).
    pub interpolation: Interpolation,
}

impl Stimulus<'_> {
    /// Interpolation of each linked input between samples: an input that is no Real, or feeds a discrete variable, is
    /// held, as interpolation would give it values that nobody commanded.
    pub fn interpolations(&self, graph: &SystemGraph) -> Vec<Interpolation> {
        let of = |&(input, ..): &(usize, usize, f64, f64)| match graph.input_is_held(input) {
            true => Interpolation::Hold,
            false => self.interpolation,
        };
        self.links.iter().map(of).collect()
    }
}

/// Inputs of the system that are polynomials between knots and may jump there.
#[derive(Debug, Clone, PartialEq)]
pub struct Curves {
    /// Times \[s\], rising, `[k + 1]`.
    pub knots: Vec<f64>,
    /// Indices of the inputs, `[m]`; those that are held between events are to have constant pieces.
    pub inputs: Vec<usize>,
    /// Value, and factors of the time since the knot \[s\], its square and its cube, `[k, m]`; before the first knot
    /// and after the last the value there is held.
    pub pieces: Vec<Vec<[f64; 4]>>,
}

impl Curves {
    /// The piece that holds from a time \[s\] on, and the knot at which it ends; none after the last.
    pub(super) fn piece_at(&self, time: f64) -> (usize, Option<f64>) {
        if time < self.knots[0] {
            return (0, Some(self.knots[0]));
        }
        let after = self.knots.partition_point(|&knot| knot <= time);
        ((after - 1).min(self.pieces.len() - 1), self.knots.get(after).copied())
    }

    /// Length of a piece \[s\].
    pub(super) fn length(&self, piece: usize) -> f64 {
        self.knots[piece + 1] - self.knots[piece]
    }

    /// Checks that the knots rise and fit the pieces.
    pub(super) fn check(&self) -> Result<(), Error> {
        let rising = self.knots.windows(2).all(|pair| pair[0] < pair[1]);
        let fits = self.pieces.len() + 1 == self.knots.len() && !self.pieces.is_empty();
        match rising && fits && self.pieces.iter().all(|piece| piece.len() == self.inputs.len()) {
            true => Ok(()),
            false => Err(Error::Curves { knots: self.knots.len(), pieces: self.pieces.len() }),
        }
    }
}

/// Values of the linked inputs over time; none without a stimulus.
#[derive(Debug)]
pub(super) struct Sampler<'a> {
    pub stimulus: Option<&'a Stimulus<'a>>,
    /// Interpolation of each linked input between its samples.
    pub interpolations: Vec<Interpolation>,
    /// Index of the sample where the next search begins.
    pub guess: usize,
}

impl<'a> Sampler<'a> {
    pub fn new(graph: &SystemGraph, stimulus: Option<&'a Stimulus<'a>>) -> Sampler<'a> {
        let interpolations = stimulus.map_or_else(Vec::new, |stimulus| stimulus.interpolations(graph));
        Sampler { stimulus, interpolations, guess: 0 }
    }

    /// Gives the values at `t` \[s\], as (index of the input, value).
    pub fn at(&mut self, t: f64, mut give: impl FnMut(usize, f64)) {
        let Some(stimulus) = self.stimulus else { return };
        let position = locate(stimulus.series.time(), t, self.guess);
        self.guess = position.index;
        for (&(input, channel, factor, offset), &interpolation) in
            stimulus.links.iter().zip(&self.interpolations)
        {
            let value = value_at(&stimulus.series.channels()[channel].values, position, interpolation);
            give(input, factor * value + offset);
        }
    }

    /// The values at `t` \[s\] in a list.
    pub fn list(&mut self, t: f64) -> Vec<(usize, f64)> {
        let mut values = Vec::new();
        self.at(t, |input, value| values.push((input, value)));
        values
    }
}
