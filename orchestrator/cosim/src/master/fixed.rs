//! Runs of a [`Master`] over its grid of communication points.

use std::collections::BTreeMap;

use super::driver::{End, Run, Simulation};
use super::stimulus::{Sampler, Stimulus};
use super::{Error, Master, Progress, Settings};
use crate::results::Recorder;
use crate::results::states::{RowsSoFar, States};
use crate::system::SystemGraph;

/// A master with a fixed communication step and its inputs.
pub(super) struct FixedSteps<'a> {
    master: Master,
    inputs: Sampler<'a>,
}

impl<'a> Simulation<'a> for FixedSteps<'a> {
    type Inputs = Option<&'a Stimulus<'a>>;

    fn initialize(
        graph: &'a SystemGraph,
        settings: &Settings,
        stimulus: Self::Inputs,
    ) -> Result<Self, Error> {
        let mut inputs = Sampler::new(graph, stimulus);
        let master = Master::new(graph, settings, &inputs.list(settings.start_time))?;
        Ok(FixedSteps { master, inputs })
    }

    fn set_up(&mut self, graph: &SystemGraph) -> Result<Recorder, Error> {
        let master = &self.master;
        let mut rows = master.values().recorder(master.columns(graph), master.grid().steps());
        master.values().record(&mut rows, master.time());
        Ok(rows)
    }

    fn step(&mut self, rows: &mut Recorder) -> Result<(), End> {
        let master = &mut self.master;
        let progress = master.step()?;
        // Also where a component asks for the end of a step that was finished by all.
        if progress == Progress::Stepped || rows.ends_before(master.time()) {
            self.inputs.at(master.time(), |input, value| master.set_input(input, value));
            master.values().record(rows, master.time());
        }
        let Progress::Terminated { component, last_successful_time: time } = progress else { return Ok(()) };
        let alone = master.nodes.len() == 1;
        if let Some(time) = time.filter(|&time| alone && rows.ends_before(time)) {
            master.values().record(rows, time);
        }
        Err(End::Terminated { component, time })
    }

    fn is_finished(&self) -> bool {
        self.master.finished()
    }

    fn progress(&self) -> (u64, u64) {
        (self.master.steps(), self.master.grid().steps())
    }

    fn save(&mut self, run: &BTreeMap<String, String>, rows: RowsSoFar) -> Result<States, Error> {
        // A later process may return to this point.
        self.master.nodes.iter_mut().for_each(super::exchange::Node::keep_states);
        self.master.save(run, rows)
    }

    fn restore(&mut self, states: &States) -> Result<(), Error> {
        self.master.restore(states)
    }

    fn account(self, run: &mut Run) {
        run.effort = self.master.effort();
        run.notes = self.master.notes().to_vec();
    }
}
