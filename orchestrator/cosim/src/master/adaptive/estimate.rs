//! The error of a step, from the difference between one whole step and its two halves.
//!
//! Watched are continuous outputs that feed something and follow from states. Outputs that depend on connected inputs
//! directly are functions of those, and of lower order in the step; they are watched where there are no others.

use crate::master::Values;
use crate::master::exchange::Wiring;
use crate::master::interface_jacobian::nominal;
use crate::system::SystemGraph;
use crate::system::graph::{DataType, Source};
use airloop_fmi::Variability;

/// Smallest size of a signal, as a part of its nominal value.
const SMALLEST_SIZE: f64 = 1e-2;

/// A watched output.
#[derive(Debug)]
struct Signal {
    component: String,
    variable: String,
    /// Place in the flat buffer.
    place: usize,
    /// Largest absolute value so far.
    size: f64,
    /// Value after the whole step.
    whole: f64,
}

/// See the module.
#[derive(Debug)]
pub(super) struct Estimate {
    signals: Vec<Signal>,
    /// Difference over error.
    divisor: f64,
}

/// Error of a step relative to the tolerance, and the output (by position) that has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Verdict {
    pub error: f64,
    pub signal: usize,
}

impl Estimate {
    /// For a method whose error over a time span falls with this power of the step.
    pub fn new(graph: &SystemGraph, wiring: &Wiring, values: &Values, order: u32) -> Estimate {
        let mut sources: Vec<(usize, usize)> = graph
            .connections
            .iter()
            .map(|connection| connection.source)
            .chain(graph.outputs.iter().map(|output| output.source))
            .filter_map(|source| match source {
                Source::Output { component, variable } => Some((component, variable)),
                Source::Input(_) => None,
            })
            .filter(|&(component, variable)| {
                let variable = &graph.components[component].fmu.description.variables[variable];
                DataType::of(variable) == DataType::Real && variable.variability != Variability::Discrete
            })
            .collect();
        sources.sort_unstable();
        sources.dedup();
        let fed = |component: usize, variable: usize| {
            let mut connections = graph.connections.iter();
            connections.any(|connection| connection.component == component && connection.variable == variable)
        };
        let direct = |&(component, variable): &(usize, usize)| {
            graph.components[component].fmu.feed_through(variable).iter().any(|&input| fed(component, input))
        };
        if !sources.iter().all(direct) {
            sources.retain(|source| !direct(source));
        }
        let signals = sources.into_iter().map(|(component, variable)| {
            let place = wiring.index_of(Source::Output { component, variable });
            let component = &graph.components[component];
            let variable = &component.fmu.description.variables[variable];
            Signal {
                component: component.name.clone(),
                variable: variable.name.clone(),
                place,
                size: values.reals[place].abs().max(SMALLEST_SIZE * nominal(&variable.kind)),
                whole: 0.0,
            }
        });
        Estimate { signals: signals.collect(), divisor: f64::from((1_u32 << order) - 1) }
    }

    /// Whether there is nothing to watch.
    pub fn is_blind(&self) -> bool {
        self.signals.is_empty()
    }

    /// Takes the values after the whole step.
    pub fn take_whole(&mut self, values: &Values) {
        self.signals.iter_mut().for_each(|signal| signal.whole = values.reals[signal.place]);
    }

    /// The verdict over the values after both halves.
    pub fn judge(&self, values: &Values, tolerance: f64) -> Verdict {
        let mut verdict = Verdict { error: 0.0, signal: 0 };
        for (position, signal) in self.signals.iter().enumerate() {
            let value = values.reals[signal.place];
            let size = signal.size.max(value.abs());
            let error = (signal.whole - value).abs() / (self.divisor * tolerance * size);
            if error > verdict.error {
                verdict = Verdict { error, signal: position };
            }
        }
        verdict
    }

    /// Learns the sizes from accepted values.
    pub fn accept(&mut self, values: &Values) {
        for signal in &mut self.signals {
            signal.size = signal.size.max(values.reals[signal.place].abs());
        }
    }

    /// Component and variable of a signal.
    pub fn name(&self, signal: usize) -> (String, String) {
        let signal = self.signals.get(signal);
        signal.map_or_else(Default::default, |signal| (signal.component.clone(), signal.variable.clone()))
    }
}
