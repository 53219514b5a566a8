//! The driver of a simulation: one loop over the steps of any master, with rows in a recorder.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::{Effort, Error, Settings, restart};
use crate::results::states::{self, RowsSoFar, States};
use crate::results::summary::{AdaptiveRecord, Integration};
use crate::results::{Keep, Recorder};
use crate::system::SystemGraph;
use airloop_series::TimeSeries;

/// Outcome of a run.
#[derive(Debug)]
pub enum End {
    /// At the stop time.
    Completed,
    /// A component asked for the end.
    Terminated {
        /// Component that did.
        component: String,
        /// Time that it reached \[s\], if it says.
        time: Option<f64>,
    },
    /// The caller asked for the end.
    Interrupted,
    /// A step failed; the result holds what came before.
    Failed(Error),
}

impl From<Error> for End {
    fn from(error: Error) -> End {
        End::Failed(error)
    }
}

/// Result of a run, also of one that ended early.
#[derive(Debug)]
pub struct Run {
    /// Values at the communication points reached.
    pub result: TimeSeries,
    /// Outcome.
    pub end: End,
    /// Macro steps done.
    pub steps: u64,
    /// Work of the master.
    pub effort: Effort,
    /// Wall-clock time of initialization.
    pub initialization: Duration,
    /// Wall-clock time of stepping.
    pub stepping: Duration,
    /// Substitutes of the master for missing capabilities of FMUs, one sentence each.
    pub notes: Vec<String>,
    /// Work of the integrator; monolithic master only.
    pub integration: Option<Integration>,
    /// Adaptive steps, if they were wanted.
    pub adaptive: Option<AdaptiveRecord>,
    /// Times \[s\] of the state events, each as it was handled; monolithic master only.
    pub state_events: Vec<f64>,
}

/// A caller who watches a run.
pub struct Watch<'a> {
    /// Set from outside to end the run after the current step.
    pub stop: &'a AtomicBool,
    /// Told now and then how far the run is: (macro steps done, all macro steps).
    pub progress: &'a mut dyn FnMut(u64, u64),
}

/// Samples of a run that are kept, and their place.
#[derive(Debug, Default)]
pub struct Record {
    /// Rows that are kept.
    pub keep: Keep,
    /// File that the rows are written to while the run goes on.
    pub file: Option<std::fs::File>,
    /// States that are saved while the run goes on, and where it is interrupted.
    pub saving: Option<Saving>,
    /// Point to go on from; `file` then holds the rows before it.
    pub from: Option<States>,
}

/// States that are saved while a run goes on.
#[derive(Debug, Clone)]
pub struct Saving {
    /// Real time between two savings.
    pub interval: Duration,
    /// File of the latest, which replaces the one before.
    pub file: PathBuf,
}

/// Steps between two looks at the clock, where a step is short.
const STEPS_PER_LOOK: u64 = 16;
/// A step that takes longer is followed by a look at the clock.
const LONG_STEP: Duration = Duration::from_millis(2);
/// Time between two reports of progress.
const REPORT_EVERY: Duration = Duration::from_millis(50);

/// A master over a time span, with the inputs of the system.
pub(super) trait Simulation<'a>: Sized {
    /// Source of the inputs of the system.
    type Inputs;

    /// Instantiates and initializes all components at the start time.
    fn initialize(graph: &'a SystemGraph, settings: &Settings, inputs: Self::Inputs) -> Result<Self, Error>;

    /// Sets up the recorder, with the row at the start time.
    fn set_up(&mut self, graph: &SystemGraph) -> Result<Recorder, Error>;

    /// Makes one step and records it, or tells why the run ends.
    fn step(&mut self, rows: &mut Recorder) -> Result<(), End>;

    /// Whether the stop time is reached.
    fn is_finished(&self) -> bool;

    /// Macro steps done, and all macro steps as far as is known.
    fn progress(&self) -> (u64, u64);

    /// The present point, `rows` of the result before it.
    ///
    /// # Errors
    /// [`Error::NoPoints`], or an FMU cannot save its state.
    fn save(&mut self, _run: &BTreeMap<String, String>, _rows: RowsSoFar) -> Result<States, Error> {
        Err(Error::NoPoints)
    }

    /// Goes to a point that was saved, before [`Simulation::set_up`].
    ///
    /// # Errors
    /// [`Error::NoPoints`], or the states do not fit.
    fn restore(&mut self, _states: &States) -> Result<(), Error> {
        Err(Error::NoPoints)
    }

    /// Adds the work that was done to the result.
    fn account(self, run: &mut Run);
}

/// States of a run that are saved now and then.
struct Saves {
    saving: Saving,
    run: BTreeMap<String, String>,
    last: Instant,
}

impl Saves {
    /// Saves the present point, once the rows before it are on the disk.
    fn save<'a, S: Simulation<'a>>(&mut self, simulation: &mut S, rows: &mut Recorder) -> Result<(), Error> {
        let so_far = rows.so_far().map_err(Error::Rows)?;
        let states = simulation.save(&self.run, so_far)?;
        states::write(&states, &self.saving.file)
            .map_err(|source| Error::SavedStates { file: self.saving.file.clone(), source })?;
        self.last = Instant::now();
        Ok(())
    }
}

/// Runs a master from start to stop.
///
/// # Errors
/// Fails if the run cannot start; a failure after that is an [`End::Failed`] with the result so far.
pub(super) fn drive<'a, S: Simulation<'a>>(
    graph: &'a SystemGraph,
    settings: &Settings,
    inputs: S::Inputs,
    watch: Watch,
    record: Record,
) -> Result<Run, Error> {
    if graph.components.is_empty() {
        return Err(Error::Empty(graph.file.clone()));
    }
    let began = Instant::now();
    let run = restart::identity(graph, settings, &record.keep);
    if record.saving.is_some() || record.from.is_some() {
        restart::refuse(graph)?;
    }
    if let Some(problem) = record.from.as_ref().and_then(|states| states.difference(&run)) {
        return Err(Error::Restart(problem));
    }
    let mut simulation = S::initialize(graph, settings, inputs)?;
    if let Some(states) = &record.from {
        simulation.restore(states)?;
    }
    let mut rows = simulation.set_up(graph)?;
    rows.keep(record.keep);
    if let Some(states) = &record.from {
        rows.go_on(settings.start_time, states.rows);
    }
    if let Some(file) = record.file {
        rows.write_to(file).map_err(Error::Rows)?;
    }
    let mut saves = record.saving.map(|saving| Saves { saving, run, last: Instant::now() });
    if let Some(saves) = &mut saves {
        // An FMU that refuses says so before hours are spent.
        saves.save(&mut simulation, &mut rows)?;
    }
    let initialization = began.elapsed();
    let began = Instant::now();
    let mut reported = began;
    let (mut end, mut steps) = (End::Completed, 0_u64);
    let mut look = STEPS_PER_LOOK;
    let mut looked = began;
    while !simulation.is_finished() {
        if let Err(reason) = simulation.step(&mut rows) {
            end = reason;
            break;
        }
        if watch.stop.load(Ordering::Relaxed) && !simulation.is_finished() {
            end = End::Interrupted;
            break;
        }
        steps += 1;
        // In the first moments of a run the file has at least half of its rows.
        let mut write = steps.is_power_of_two();
        if steps % look == 0 {
            let now = Instant::now();
            look = if now - looked > LONG_STEP * look as u32 { 1 } else { STEPS_PER_LOOK };
            looked = now;
            write |= rows.is_due();
            if now - reported > REPORT_EVERY {
                reported = now;
                let (done, all) = simulation.progress();
                (watch.progress)(done, all);
            }
            if let Some(saves) = saves.as_mut().filter(|saves| now - saves.last > saves.saving.interval)
                && let Err(error) = saves.save(&mut simulation, &mut rows)
            {
                end = End::Failed(error);
                break;
            }
        }
        if write && let Err(source) = rows.write_out(false) {
            end = End::Failed(Error::Rows(source));
            break;
        }
    }
    let stepping = began.elapsed();
    if let (Some(saves), End::Interrupted) = (&mut saves, &end)
        && let Err(error) = saves.save(&mut simulation, &mut rows)
    {
        end = End::Failed(error);
    }
    if let Err(source) = rows.write_out(true) {
        end = End::Failed(Error::Rows(source));
    }
    let mut run = Run {
        result: rows.finish()?,
        end,
        steps: simulation.progress().0,
        effort: Effort::default(),
        initialization,
        stepping,
        notes: Vec::new(),
        integration: None,
        adaptive: None,
        state_events: Vec::new(),
    };
    simulation.account(&mut run);
    Ok(run)
}
