//! Runs over a time span, with inputs from a series or from curves, by any of the masters.

pub use super::driver::{End, Record, Run, Saving, Watch};
pub use super::stimulus::{Curves, Stimulus};

use super::adaptive::AdaptiveSteps;
use super::driver::drive;
use super::fixed::FixedSteps;
use super::monolithic::{Inputs, Monolith};
use super::{Algorithm, Error, Settings};
use crate::system::SystemGraph;

/// Runs a system under inputs that are polynomials between knots, with the monolithic master whatever the settings say:
/// no other follows a curve within a step.
///
/// # Errors
/// Same as [`run`]; knots that do not rise or do not fit the pieces.
pub fn run_along(
    graph: &SystemGraph,
    settings: &Settings,
    curves: &Curves,
    watch: Watch,
) -> Result<Run, Error> {
    curves.check()?;
    drive::<Monolith>(graph, settings, Inputs::along(graph, curves), watch, Record::default())
}

/// Runs a system from start to stop and records all outputs at the communication points.
///
/// ```no_run
/// use airloop_cosim::master::{Settings, simulate};
/// let graph = airloop_cosim::system::SystemGraph::open("examples/01_run/system.ssd".as_ref())?;
/// let settings = Settings { stop_time: 4.0, ..Settings::default() };
/// let stop = std::sync::atomic::AtomicBool::new(false);
/// let watch = simulate::Watch { stop: &stop, progress: &mut |_, _| {} };
/// let run = simulate::run(&graph, &settings, None, watch)?;
/// airloop_series::csv::write(&run.result, "result.csv".as_ref())?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Fails if the run cannot start; a failure after that is an [`End::Failed`] with the result so far.
pub fn run(
    graph: &SystemGraph,
    settings: &Settings,
    stimulus: Option<&Stimulus>,
    watch: Watch,
) -> Result<Run, Error> {
    run_recorded(graph, settings, stimulus, watch, Record::default())
}

/// Same as [`run`], with a choice of rows, and with a file that they are written to while the run goes on.
///
/// # Errors
/// Same as [`run`].
pub fn run_recorded(
    graph: &SystemGraph,
    settings: &Settings,
    stimulus: Option<&Stimulus>,
    watch: Watch,
    record: Record,
) -> Result<Run, Error> {
    match (settings.algorithm, settings.adaptive) {
        (Algorithm::Monolithic, _) => {
            drive::<Monolith>(graph, settings, Inputs::sampled(graph, stimulus), watch, record)
        }
        (_, Some(adaptive)) => drive::<AdaptiveSteps>(graph, settings, (adaptive, stimulus), watch, record),
        (_, None) => drive::<FixedSteps>(graph, settings, stimulus, watch, record),
    }
}
