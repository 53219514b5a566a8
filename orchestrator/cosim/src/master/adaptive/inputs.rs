//! System inputs in an adaptive run: which of their samples end a step, and their trajectory inside a step that spans
//! some.

use crate::master::Master;
use crate::master::interface_jacobian::Trajectory;
use crate::master::simulate::Stimulus;
use crate::results::Slot;
use crate::system::SystemGraph;
use crate::system::graph::Source;
use airloop_series::Interpolation;

/// See the module.
pub(super) struct Inputs<'a> {
    stimulus: Option<&'a Stimulus<'a>>,
    /// Interpolation of each linked input between its samples.
    interpolations: Vec<Interpolation>,
    guess: usize,
    /// Whether steps may span samples of the inputs.
    spanning: bool,
}

impl<'a> Inputs<'a> {
    /// Inputs from a series; `spanning` for a master whose steps may span their samples.
    pub fn new(graph: &SystemGraph, stimulus: Option<&'a Stimulus<'a>>, spanning: bool) -> Inputs<'a> {
        let interpolations = stimulus.map_or_else(Vec::new, |stimulus| stimulus.interpolations(graph));
        Inputs { stimulus, interpolations, guess: 0, spanning }
    }

    /// Values at `t` \[s\], as (index of the input, value).
    pub fn at(&mut self, t: f64, give: impl FnMut(usize, f64)) {
        if let Some(stimulus) = self.stimulus {
            stimulus.each(&self.interpolations, t, &mut self.guess, give);
        }
    }

    /// Times \[s\] at which steps have to end: the samples, if a component sees the inputs at every time. One that
    /// is sampled and `is_spanned` by a step takes them from their trajectory.
    pub fn stops(&self, graph: &SystemGraph, is_spanned: impl Fn(usize) -> bool) -> &'a [f64] {
        let Some(stimulus) = self.stimulus else { return &[] };
        let spanned = stimulus.links.iter().all(|&(input, ..)| {
            let mut fed =
                graph.connections.iter().filter(|connection| connection.source == Source::Input(input));
            fed.all(|connection| self.spanning && is_spanned(connection.component))
        });
        if spanned { &[] } else { stimulus.series.time() }
    }

    /// Puts the values at `begin` \[s\] into the master, and their trajectories until `end` \[s\].
    pub fn put(&mut self, master: &mut Master, begin: f64, end: f64) {
        self.at(begin, |input, value| master.set_input(input, value));
        let Some(stimulus) = self.stimulus else { return };
        let trajectories = match (&mut master.interface_jacobian, &mut master.extrapolation) {
            (Some(master), _) => master.trajectories(),
            (None, Some(master)) => master.trajectories(),
            (None, None) => return,
        };
        trajectories.clear();
        let time = stimulus.series.time();
        let close = 1e-9 * (end - begin);
        let first = time.partition_point(|&knot| knot <= begin + close);
        let inner = time[first..].iter().take_while(|&&knot| knot < end - close);
        let cuts: Vec<f64> = std::iter::once(begin).chain(inner.copied()).chain([end]).collect();
        for (&(input, channel, factor, offset), &interpolation) in
            stimulus.links.iter().zip(&self.interpolations)
        {
            let Some(Slot::Real(place)) = master.wiring.inputs[input] else { continue };
            let values = &stimulus.series.channels()[channel].values;
            let value = |t: f64, how: Interpolation| {
                let position = airloop_series::resample::locate(time, t, self.guess);
                factor * airloop_series::resample::value_at(values, position, how) + offset
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
