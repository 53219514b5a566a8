//! Direct feed-through of an FMU: the inputs on which each output depends at the same time, by the `dependencies` of
//! the model structure. Looked up once per FMU, as systems ask for every output.

use std::collections::HashMap;

use crate::description::{Causality, ModelDescription, Unknown};

/// Inputs of every output, as indices of variables.
pub(super) struct FeedThrough {
    inputs: Vec<usize>,
    /// `None`: the FMU does not say.
    running: HashMap<usize, Option<Vec<usize>>>,
    initial: HashMap<usize, Option<Vec<usize>>>,
}

impl FeedThrough {
    pub(super) fn new(description: &ModelDescription) -> FeedThrough {
        let is_input = |&variable: &usize| description.variables[variable].causality == Causality::Input;
        let listed = |unknowns: &[Unknown]| -> HashMap<usize, Option<Vec<usize>>> {
            let known = |unknown: &Unknown| {
                let all = unknown.dependencies.as_ref()?.iter().map(|dependency| dependency.variable);
                Some(all.filter(is_input).collect())
            };
            // Of several entries the first counts.
            unknowns.iter().rev().map(|unknown| (unknown.variable, known(unknown))).collect()
        };
        let mut running = listed(&description.outputs);
        // A continuous state is integrated: it follows no input directly.
        if description.model_exchange.is_some() {
            running.extend(description.continuous_states().map(|state| (state, Some(Vec::new()))));
        }
        FeedThrough {
            inputs: (0..description.variables.len()).filter(is_input).collect(),
            running,
            initial: listed(&description.initial_unknowns),
        }
    }

    /// Inputs on which an output depends directly after initialization: none where it is a continuous state of an FMU
    /// with Model Exchange, else all inputs where the FMU does not say.
    pub(super) fn running(&self, output: usize) -> &[usize] {
        self.running.get(&output).and_then(Option::as_deref).unwrap_or(&self.inputs)
    }

    /// Inputs on which an output depends in initialization mode; where the FMU does not say, those after it.
    pub(super) fn initial(&self, output: usize) -> &[usize] {
        self.initial.get(&output).and_then(Option::as_deref).unwrap_or_else(|| self.running(output))
    }
}
