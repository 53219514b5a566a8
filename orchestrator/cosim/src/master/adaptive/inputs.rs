//! System inputs in an adaptive run: which of their samples end a step, and their trajectory inside a step that spans
//! some.

use crate::master::interface_jacobian::Trajectory;
use crate::master::stepping::Master;
use crate::master::stimulus::{Sampler, Stimulus};
use crate::results::Slot;
use crate::system::SystemGraph;
use crate::system::graph::Source;
use airloop_series::Interpolation;
use airloop_series::resample::{locate, value_at};

/// See the module.
pub(super) struct Inputs<'a> {
    pub samples: Sampler<'a>,
    /// Whether steps may span samples of the inputs.
    spanning: bool,
}

impl<'a> Inputs<'a> {
    /// Inputs from a series; `spanning` for a master whose steps may span their samples.
    pub fn new(graph: &SystemGraph, stimulus: Option<&'a Stimulus<'a>>, spanning: bool) -> Inputs<'a> {
        Inputs { samples: Sampler::new(graph, stimulus), spanning }
    }

    /// Times \[s\] at which steps have to end: the samples, if a component sees the inputs at every time. One that
    /// is sampled and `is_spanned` by a step takes them from their trajectory.
    pub fn stops(&self, graph: &SystemGraph, is_spanned: impl Fn(usize) -> bool) -> &'a [f64] {
        let Some(stimulus) = self.samples.stimulus else { return &[] };
        let spanned = stimulus.links.iter().all(|&(input, ..)| {
            let mut fed =
                graph.connections.iter().filter(|connection| connection.source == Source::Input(input));
            fed.all(|connection| self.spanning && is_spanned(connection.component))
        });
        if spanned { &[] } else { stimulus.series.time() }
    }

    /// Puts the values at `begin` \[s\] into the master, and their trajectories until `end` \[s\].
    pub fn put(&mut self, master: &mut Master, begin: f64, end: f64) {
        self.samples.at(begin, |input, value| master.set_input(input, value));
        let Some(stimulus) = self.samples.stimulus else { return };
        let Some(trajectories) = master.scheme.trajectories() else { return };
        trajectories.clear();
        let time = stimulus.series.time();
        let close = 1e-9 * (end - begin);
        let first = time.partition_point(|&knot| knot <= begin + close);
        let inner = time[first..].iter().take_while(|&&knot| knot < end - close);
        let cuts: Vec<f64> = std::iter::once(begin).chain(inner.copied()).chain([end]).collect();
        for (&(input, channel, factor, offset), &interpolation) in
            stimulus.links.iter().zip(&self.samples.interpolations)
        {
            let Some(Slot::Real(place)) = master.wiring.inputs[input] else { continue };
            let values = &stimulus.series.channels()[channel].values;
            let value = |t: f64, how: Interpolation| {
                let position = locate(time, t, self.samples.guess);
                factor * value_at(values, position, how) + offset
            };
            let mut trajectory = Trajectory::default();
            for pair in cuts.windows(2) {
                let [from, to] = [pair[0], pair[1]].map(|t| (t - begin) / (end - begin));
                match interpolation {
                    Interpolation::Hold => {
                        let middle = 0.5 * (pair[0] + pair[1]);
                        trajectory.hold(from, to, value(middle, Interpolation::Hold));
                    }
                    Interpolation::Linear => {
                        let [a, b] = [pair[0], pair[1]].map(|t| value(t, Interpolation::Linear));
                        trajectory.line(from, to, a, b);
                    }
                }
            }
            trajectories.push((place, trajectory));
        }
    }
}
