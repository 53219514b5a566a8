//! System inputs of the monolithic master: from a series or from curves, as ramps between samples or knots.

use super::coupled::Ramp;
use crate::master::stimulus::{Curves, Sampler, Stimulus};
use crate::system::SystemGraph;
use airloop_series::Interpolation;
use airloop_series::resample::{locate, value_at};

/// See the module.
#[derive(Debug)]
pub(in crate::master) struct Inputs<'a> {
    samples: Sampler<'a>,
    curves: Option<&'a Curves>,
    /// Time \[s\] of the next sample.
    pub next: Option<f64>,
}

impl<'a> Inputs<'a> {
    /// Inputs from samples, if there are any.
    pub fn sampled(graph: &SystemGraph, stimulus: Option<&'a Stimulus<'a>>) -> Inputs<'a> {
        Inputs { samples: Sampler::new(graph, stimulus), curves: None, next: None }
    }

    /// Inputs along curves.
    pub fn along(graph: &SystemGraph, curves: &'a Curves) -> Inputs<'a> {
        Inputs { curves: Some(curves), ..Inputs::sampled(graph, None) }
    }

    /// Values and slopes from `time` \[s\] on, up to the next sample.
    pub(super) fn ramps(&mut self, time: f64) -> Vec<Ramp> {
        if let Some(curves) = self.curves {
            let (piece, next) = curves.piece_at(time);
            self.next = next;
            let of = |(&input, coefficients): (&usize, &[f64; 4])| {
                let late = (time - curves.knots[piece]).clamp(0.0, curves.length(piece));
                let ends = next.is_none() || time < curves.knots[0];
                let coefficients = shifted(coefficients, late);
                let held = [coefficients[0], 0.0, 0.0, 0.0];
                Ramp { input, coefficients: if ends { held } else { coefficients } }
            };
            return curves.inputs.iter().zip(&curves.pieces[piece]).map(of).collect();
        }
        let Some(stimulus) = self.samples.stimulus else { return Vec::new() };
        let samples = stimulus.series.time();
        let position = locate(samples, time, self.samples.guess);
        self.samples.guess = position.index;
        let index = position.index;
        // Before the first sample its value holds.
        let early =
            samples.first().is_some_and(|&first| time < first) && index == 0 && position.fraction == 0.0;
        self.next = if early { samples.first() } else { samples.get(index + 1) }.copied();
        let ramp = |(&(input, channel, factor, offset), &interpolation): (
            &(usize, usize, f64, f64),
            &Interpolation,
        )| {
            let values = &stimulus.series.channels()[channel].values;
            let value = factor * value_at(values, position, interpolation) + offset;
            let linear = interpolation == Interpolation::Linear && !early && index + 1 < samples.len();
            let slope = match linear {
                true => factor * (values[index + 1] - values[index]) / (samples[index + 1] - samples[index]),
                false => 0.0,
            };
            Ramp { input, coefficients: [value, slope, 0.0, 0.0] }
        };
        stimulus.links.iter().zip(&self.samples.interpolations).map(ramp).collect()
    }
}

/// A polynomial in the time that begins later.
fn shifted([a, b, c, d]: &[f64; 4], late: f64) -> [f64; 4] {
    [a + ((d * late + c) * late + b) * late, b + (3.0 * d * late + 2.0 * c) * late, c + 3.0 * d * late, *d]
}
