//! Jumps of states between phases, such as impacts: read from outputs of the system at the end of the phase before.

use super::Error;
use super::assemble;
use super::catalog::{Catalog, Kind};
use super::file::{self, Parameters, Placed, Statement};
use super::task::{self, Reader, Signal, Signals};
use airloop_cosim::coupled::System;
use airloop_ocp::transcription::{After, Dynamics, Limit, Link, OutputReset, Reset};
use airloop_optim::EvaluationError;

/// A jump of states, ready to become a [`Link`].
pub struct Jump {
    /// The system, with the outputs that the jump refers to.
    dynamics: Box<dyn Dynamics>,
    after: Vec<After>,
    limits: Vec<Limit>,
    /// The limits as stated.
    stated: Vec<task::Limit>,
}

impl Jump {
    /// The system, with the outputs that the limits refer to.
    pub(super) fn dynamics(&mut self) -> &mut dyn Dynamics {
        self.dynamics.as_mut()
    }

    /// Bounds of outputs, in the order of the problem file.
    pub(super) fn stated(&self) -> Vec<task::Limit> {
        self.stated.clone()
    }

    /// Bounds of outputs, as the transcription takes them.
    pub(super) fn limits(&self) -> Vec<Limit> {
        self.limits.clone()
    }

    /// The link, with an instance of its own.
    ///
    /// # Errors
    /// When no further instance can be made.
    pub fn link(&self) -> Result<Link, EvaluationError> {
        Ok(Link::reset(self.reset()?, self.limits()))
    }

    /// The map, with an instance of its own.
    ///
    /// # Errors
    /// When no further instance can be made.
    pub(super) fn reset(&self) -> Result<Box<dyn Reset>, EvaluationError> {
        let dynamics = self.dynamics.duplicate()?;
        let size = dynamics.size();
        let reset = OutputReset::new(
            dynamics,
            self.after.clone(),
            (0..size.outputs).collect(),
            vec![0.0; size.inputs],
        );
        Ok(Box::new(reset))
    }
}

/// The jumps of a problem: into every phase from the one before, into the first from the last; `open` opens the system
/// with parameters and signals.
///
/// # Errors
/// [`Error::File`] names line, column and remedy.
pub fn resets(
    statement: &Statement,
    catalog: &Catalog,
    signals: &Signals,
    open: impl Fn(&Parameters, &Signals) -> Result<Box<System>, Error>,
) -> Result<Vec<Option<Jump>>, Error> {
    let first = statement.phases.first().filter(|_| statement.cycle.is_none());
    if let Some(reset) = first.and_then(|phase| phase.reset.as_ref()) {
        let problem = "the first phase has no phase before it, as there is no [cycle]; a `reset` belongs to the phase that \
                       it leads to";
        return Err(statement.source.error_at(reset.place, problem.to_owned()));
    }
    let one = |reset: &Placed<file::phase::Reset>| {
        let signals = Signals { outputs: outputs(statement, catalog, reset)?, ..signals.clone() };
        let dynamics = open(&reset.parameters, &signals)?;
        let reader = Reader { source: &statement.source, catalog, signals: &signals };
        let mut after: Vec<After> = (0..signals.states.len()).map(After::State).collect();
        for (state, shown) in &reset.states {
            let (Signal::State(state), _) = reader.signal(state)? else {
                let problem = format!("`{}` is not a state; only states follow from a reset", state.text);
                return Err(statement.source.error_at(state.place, problem));
            };
            after[state] = match reader.signal(shown)?.0 {
                Signal::State(before) => After::State(before),
                Signal::Output(output) => After::Output(output),
                Signal::Input(_) => {
                    let problem =
                        format!("`{}` is an input; a state follows from a state or an output", shown.text);
                    return Err(statement.source.error_at(shown.place, problem));
                }
            };
        }
        let (mut limits, mut stated) = (Vec::new(), Vec::new());
        for bound in reset.limits() {
            let limit = reader.bound(bound)?.with_margin();
            if limit.terms.iter().any(|(signal, _)| !matches!(signal, Signal::Output(_))) {
                let problem =
                    format!("`{}`: a bound of a reset is about outputs, such as impulses", limit.name);
                return Err(statement.source.error_at(bound.place, problem));
            }
            limits.push(assemble::limit(&limit));
            stated.push(limit);
        }
        Ok(Jump { dynamics, after, limits, stated })
    };
    statement.phases.iter().map(|phase| phase.reset.as_ref().map(one).transpose()).collect()
}

/// The variables of a reset that are neither state nor input, as indices into the catalog.
fn outputs(
    statement: &Statement,
    catalog: &Catalog,
    reset: &file::phase::Reset,
) -> Result<Vec<usize>, Error> {
    let bounded = reset.limits().flat_map(|bound| bound.terms.iter().map(|(name, _)| name));
    let mut found = Vec::new();
    for name in reset.states.iter().map(|(_, shown)| shown).chain(bounded) {
        let (index, _) = catalog.want(&statement.source, name)?;
        if catalog.variables()[index].kind == Kind::Output && !found.contains(&index) {
            found.push(index);
        }
    }
    Ok(found)
}
