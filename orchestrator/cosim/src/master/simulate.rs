//! A run over a time span: inputs from a series, steps of a master, rows in a recorder.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::{Algorithm, Effort, Error, Master, Progress, Settings, adaptive, monolithic};
use crate::results::Recorder;
use crate::results::summary::{AdaptiveRecord, Integration};
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
    /// Interpolation of each linked input between samples: an input that is not a Real, or feeds a discrete variable,
    /// is held, as interpolation would give it values that nobody commanded.
    pub fn interpolations(&self, graph: &SystemGraph) -> Vec<Interpolation> {
        let of = |&(input, ..): &(usize, usize, f64, f64)| match graph.input_is_held(input) {
            true => Interpolation::Hold,
            false => self.interpolation,
        };
        self.links.iter().map(of).collect()
    }

    pub(super) fn each(
        &self,
        interpolations: &[Interpolation],
        t: f64,
        guess: &mut usize,
        mut give: impl FnMut(usize, f64),
    ) {
        let position = locate(self.series.time(), t, *guess);
        *guess = position.index;
        for (&(input, channel, factor, offset), &interpolation) in self.links.iter().zip(interpolations) {
            let value = value_at(&self.series.channels()[channel].values, position, interpolation);
            give(input, factor * value + offset);
        }
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

    fn check(&self) -> Result<(), Error> {
        let rising = self.knots.windows(2).all(|pair| pair[0] < pair[1]);
        let fits = self.pieces.len() + 1 == self.knots.len() && !self.pieces.is_empty();
        match rising && fits && self.pieces.iter().all(|piece| piece.len() == self.inputs.len()) {
            true => Ok(()),
            false => Err(Error::Curves { knots: self.knots.len(), pieces: self.pieces.len() }),
        }
    }
}

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
    /// Called from time to time with the progress: (macro steps done, all macro steps).
    pub progress: &'a mut dyn FnMut(u64, u64),
}

/// Macro steps between two looks at the clock.
const STEPS_PER_LOOK: u64 = 16;
/// Time between two reports of progress.
pub(super) const REPORT_EVERY: Duration = Duration::from_millis(50);

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
    monolithic::run_along(graph, settings, curves, watch)
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
    if settings.algorithm == Algorithm::Monolithic {
        return monolithic::run(graph, settings, stimulus, watch);
    }
    if let Some(adaptive) = settings.adaptive {
        return adaptive::run(graph, settings, adaptive, stimulus, watch);
    }
    let began = Instant::now();
    let mut guess = 0;
    let mut first = Vec::new();
    let interpolations = stimulus.map_or_else(Vec::new, |stimulus| stimulus.interpolations(graph));
    if let Some(stimulus) = stimulus {
        stimulus.each(&interpolations, settings.start_time, &mut guess, |input, value| {
            first.push((input, value))
        });
    }
    let mut master = Master::new(graph, settings, &first)?;
    let total = master.grid().steps();
    let values = master.values();
    let width = [values.reals.len(), values.integers.len(), values.booleans.len()];
    let rows = usize::try_from(total).unwrap_or(usize::MAX).saturating_add(1);
    let mut recorder = Recorder::new(master.columns(graph), width, rows);
    let initialization = began.elapsed();
    let began = Instant::now();
    let mut reported = began;
    let record = |master: &Master, recorder: &mut Recorder, time: f64| {
        let values = master.values();
        recorder.record(time, &values.reals, &values.integers, &values.booleans);
    };
    record(&master, &mut recorder, master.time());
    let mut end = End::Completed;
    while !master.finished() {
        match master.step() {
            Ok(Progress::Stepped) => {}
            Ok(Progress::Terminated { component, last_successful_time }) => {
                let last = recorder.last_time().unwrap_or(settings.start_time);
                let alone = graph.components.len() == 1;
                if master.time() > last {
                    // The step was finished by all.
                    if let Some(stimulus) = stimulus {
                        let time = master.time();
                        stimulus.each(&interpolations, time, &mut guess, |input, value| {
                            master.set_input(input, value);
                        });
                    }
                    record(&master, &mut recorder, master.time());
                } else if let Some(time) = last_successful_time.filter(|&time| alone && time > last) {
                    record(&master, &mut recorder, time);
                }
                end = End::Terminated { component, time: last_successful_time };
                break;
            }
            Err(error) => {
                end = End::Failed(error);
                break;
            }
        }
        if let Some(stimulus) = stimulus {
            stimulus.each(&interpolations, master.time(), &mut guess, |input, value| {
                master.set_input(input, value)
            });
        }
        record(&master, &mut recorder, master.time());
        if watch.stop.load(Ordering::Relaxed) {
            end = End::Interrupted;
            break;
        }
        if master.steps() % STEPS_PER_LOOK == 0 && reported.elapsed() > REPORT_EVERY {
            reported = Instant::now();
            (watch.progress)(master.steps(), total);
        }
    }
    let stepping = began.elapsed();
    let result = recorder.finish()?;
    Ok(Run {
        result,
        end,
        steps: master.steps(),
        effort: master.effort(),
        initialization,
        stepping,
        notes: master.notes().to_vec(),
        integration: None,
        adaptive: None,
        state_events: Vec::new(),
    })
}
