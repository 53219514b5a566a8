//! Trials: the closed loop, and the plan alone, on systems whose parameters and initial states differ from the model's.
//!
//! A trial is a run of the closed-loop system through a master. Its seed gives the perturbations, in the order of the
//! file, each drawn again as long as it leaves the range of a variable, and the sensor noise, sample by sample; the
//! same seed gives the same trial on any number of threads, with and without feedback.

mod judge;
mod ready;
mod sources;

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use rayon::prelude::*;

use super::Error;
use super::workers::workers;
use airloop_cosim::master::simulate::{self, End, Stimulus, Watch};
use airloop_cosim::master::{Algorithm, Settings as MasterSettings};
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::Start;
use airloop_series::random::Random;
use airloop_series::{Interpolation, TimeSeries};

pub use judge::Judgment;
pub(crate) use ready::perturbation;
pub use ready::{Ready, prepare};
pub use sources::{SETTINGS, SYSTEMS, sources};

/// Draws of a perturbation after which none within the ranges of its variables is to be expected.
const MAX_DRAWS: usize = 1000;

/// Request for trials.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Request {
    /// Number of trials.
    pub count: usize,
    /// Seed of the first; each next one has the next seed.
    pub seed: u64,
    /// Factor of all perturbations; the sensor noise stays as it is.
    pub scale: f64,
    /// Master.
    pub algorithm: Algorithm,
    /// Threads.
    pub threads: usize,
    /// Trials whose trajectories are kept.
    pub keep: usize,
}

/// One trial.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Seed.
    pub seed: u64,
    /// Whether the controller had feedback.
    pub closed: bool,
    /// Each criterion: kept or not.
    pub judgment: Judgment,
    /// How often each perturbation was drawn again since a variable would have left the range that its FMU declares.
    pub drawn_again: Vec<usize>,
    /// Reason why it ended early, if it did.
    pub problem: Option<String>,
    /// Trajectory of the signals that are judged, and of the commands; of the first trials only.
    pub trajectory: Option<TimeSeries>,
}

/// Runs all trials, closed loop first, each with all seeds; fewer where `stop` was set.
///
/// # Errors
/// A trial that cannot begin, whichever comes first in that order.
pub fn run(
    ready: &Ready,
    request: &Request,
    stop: &AtomicBool,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Vec<Trial>, Error> {
    let jobs: Vec<(bool, u64, bool)> = [true, false]
        .into_iter()
        .flat_map(|closed| {
            (0..request.count).map(move |k| (closed, request.seed + k as u64, k < request.keep))
        })
        .collect();
    let done = AtomicUsize::new(0);
    let trial = |&job: &(bool, u64, bool)| {
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        let trial = one(ready, request, job, Watch { stop, progress: &mut |_, _| {} });
        progress(done.fetch_add(1, Ordering::Relaxed) + 1, jobs.len());
        trial.transpose()
    };
    workers(request.threads.clamp(1, jobs.len().max(1)))?
        .install(|| jobs.par_iter().with_max_len(1).filter_map(trial).collect())
}

/// One trial, by (whether the controller has feedback, seed, whether the trajectory is kept); none if `watch`
/// stopped it.
///
/// # Errors
/// A trial that cannot begin.
pub fn one(
    ready: &Ready,
    request: &Request,
    (closed, seed, keep): (bool, u64, bool),
    watch: Watch,
) -> Result<Option<Trial>, Error> {
    let mut random = Random::new(seed);
    let mut graph = ready.graph.clone();
    let drawn_again = perturb(ready, &mut graph, request.scale, &mut random)
        .map_err(|problem| Error::Place { place: format!("trial of seed {seed}"), problem })?;
    graph.components[ready.controller].set_start(ready.feedback, Start::Boolean(closed));
    let noise = noise(ready, &mut random)?;
    let stimulus =
        Stimulus { series: &noise, links: ready.noise_links(), interpolation: Interpolation::Hold };
    let settings = MasterSettings {
        start_time: ready.start,
        stop_time: ready.stop,
        step_size: ready.sample_time,
        algorithm: request.algorithm,
        ..MasterSettings::default()
    };
    let run = simulate::run(&graph, &settings, Some(&stimulus), watch).map_err(|error| Error::Place {
        place: format!("trial of seed {seed}"),
        problem: format!("{error}; if a parameter is out of its range, perturb it less"),
    })?;
    let problem = match run.end {
        End::Completed => None,
        End::Terminated { component, .. } => Some(format!("component `{component}` ended the trial")),
        End::Interrupted => return Ok(None),
        End::Failed(error) => Some(error.to_string()),
    };
    let judgment = judge::judge(&ready.criteria, &run.result, problem.is_some())?;
    let trajectory = keep.then(|| ready.trajectory(&run.result)).transpose()?;
    Ok(Some(Trial { seed, closed, judgment, drawn_again, problem, trajectory }))
}

/// Draws the perturbations: one number each, at the value of the model, again as long as a variable would leave its
/// range. Tells how often each was drawn again.
fn perturb(
    ready: &Ready,
    graph: &mut SystemGraph,
    scale: f64,
    random: &mut Random,
) -> Result<Vec<usize>, String> {
    let mut drawn_again = Vec::with_capacity(ready.perturbations.len());
    for perturbation in &ready.perturbations {
        let mut parts = (0..MAX_DRAWS).map(|_| scale * random.symmetric()).enumerate();
        let Some((again, part)) = parts.find(|(_, part)| perturbation.allows(*part)) else {
            return Err(format!(
                "no value of {} is within the range that its FMU declares, in {MAX_DRAWS} draws; perturb it less",
                perturbation.name
            ));
        };
        drawn_again.push(again);
        for place in &perturbation.places {
            graph.components[place.component].set_start(place.variable, Start::Real(place.perturbed(part)));
        }
    }
    Ok(drawn_again)
}

/// Sensor noise at all samples.
fn noise(ready: &Ready, random: &mut Random) -> Result<TimeSeries, Error> {
    let samples = ((ready.stop - ready.start) / ready.sample_time).ceil() as usize + 1;
    let time: Vec<f64> = (0..samples).map(|k| ready.start + k as f64 * ready.sample_time).collect();
    let mut columns = vec![Vec::with_capacity(samples); ready.noise.len()];
    for _ in 0..samples {
        for (column, noise) in columns.iter_mut().zip(&ready.noise) {
            column.push(noise.deviation * random.normal());
        }
    }
    let mut series = TimeSeries::new(time)?;
    for (noise, column) in ready.noise.iter().zip(columns) {
        series.push(noise.name.clone(), None, column)?;
    }
    Ok(series)
}

#[cfg(test)]
mod tests {
    use super::ready::{Perturbation, Place};

    #[test]
    fn a_perturbation_is_allowed_while_all_its_variables_stay_in_their_ranges() {
        let place = |value: f64, width: f64, range: [f64; 2]| Place {
            component: 0,
            variable: 0,
            value,
            width,
            range,
        };
        let free = [f64::NEG_INFINITY, f64::INFINITY];
        let places = vec![place(0.1, 0.02, [1e-9, f64::INFINITY]), place(5.0, 5.0, free)];
        let perturbation = Perturbation { name: "m, k".into(), places };
        assert!(perturbation.allows(-4.9) && perturbation.allows(30.0));
        assert!(!perturbation.allows(-5.1));
    }
}
