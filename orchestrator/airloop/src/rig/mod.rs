//! A virtual rig: records as an experimenter would take them, from FMUs, with the noise and the steps of sensors.
//!
//! | module | what |
//! |--------|------|
//! | [`sensor`] | noise and quantization |
//! | [`rod_fixed`] | actuator with its rod held: chirps and stairs |
//! | [`sweep`] | friction of piston and cart under an imposed motion |
//! | [`coupled`] | a whole system under a command with weak centering |
//! | [`case`] | what an experimenter knows, as `case.toml` |
//!
//! Writes no files but the text of `case.toml`; commands come from [`airloop_ident::excite`].

pub mod case;
pub mod coupled;
pub mod rod_fixed;
pub mod sensor;
pub mod sweep;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use airloop_cosim::master::simulate::{self, End, Stimulus, Watch};
use airloop_cosim::master::{Algorithm, Settings};
use airloop_cosim::system::SystemGraph;
use airloop_series::{Interpolation, TimeSeries};

/// One record with what is known of it.
#[derive(Debug, Clone)]
pub struct Recording {
    /// File name.
    pub name: String,
    /// Whether it is for estimation; otherwise for validation.
    pub estimation: bool,
    /// `rod_fixed`, `sweep_piston`, `sweep_cart` or `coupled`.
    pub experiment: &'static str,
    /// Records of one group repeat one command.
    pub group: String,
    /// Signals without noise.
    pub signals: TimeSeries,
}

/// Reason why nothing is recorded.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "file and signal, as named in each message")]
pub enum Error {
    /// A command.
    #[error(transparent)]
    Command(#[from] airloop_ident::excite::Error),
    /// A system.
    #[error(transparent)]
    System(#[from] airloop_cosim::system::Error),
    /// A run.
    #[error(transparent)]
    Master(#[from] airloop_cosim::master::Error),
    /// A series.
    #[error(transparent)]
    Series(#[from] airloop_series::Error),
    /// Not an input or output.
    #[error("{}: there is no {kind} `{name}`; there are {there}", file.display())]
    Signal { file: PathBuf, kind: &'static str, name: String, there: String },
    /// The run did not reach its end.
    #[error("{}: the run ended at {time} s: {why}", file.display())]
    Ended { file: PathBuf, time: f64, why: String },
    /// A motion beyond the stroke.
    #[error(
        "the sweep of {amplitude} m/s from {from} Hz on moves {travel:.3} m to and fro, but the stroke is {stroke} m; raise the lowest frequency or lower the amplitude"
    )]
    Stroke { amplitude: f64, from: f64, travel: f64, stroke: f64 },
    /// An option of another experiment.
    #[error("{option} is only for --plan {plan}; leave it away")]
    Unused { option: &'static str, plan: &'static str },
    /// A sensor for nothing.
    #[error("no signal `{name}` is recorded; there are {there}")]
    Sensor { name: String, there: String },
}

/// Opens a system (or a single FMU) and sets start values.
fn open(file: &Path, algorithm: Algorithm, set: &[(String, String)]) -> Result<SystemGraph, Error> {
    let mut graph = match algorithm {
        Algorithm::Monolithic => SystemGraph::open_for(file, airloop_fmi::InterfaceKind::ModelExchange)?,
        _ => SystemGraph::open(file)?,
    };
    for (name, value) in set {
        graph.set_start(name, value, &format!("{name}={value}"))?;
    }
    Ok(graph)
}

/// Whether a single FMU has a variable of this name.
fn has_variable(graph: &SystemGraph, name: &str) -> bool {
    graph.components.iter().any(|c| c.fmu.description.variables.iter().any(|variable| variable.name == name))
}

fn input_of(graph: &SystemGraph, name: &str) -> Result<usize, Error> {
    graph.inputs.iter().position(|input| input.name == name).ok_or_else(|| Error::Signal {
        file: graph.file.clone(),
        kind: "input",
        name: name.into(),
        there: graph.inputs.iter().map(|input| format!("`{}`", input.name)).collect::<Vec<_>>().join(", "),
    })
}

/// Runs a system with inputs of the same names as the channels of `inputs`, to the last of their times.
fn run(graph: &SystemGraph, algorithm: Algorithm, inputs: &TimeSeries) -> Result<TimeSeries, Error> {
    let mut links = Vec::new();
    for (channel, signal) in inputs.channels().iter().enumerate() {
        links.push((input_of(graph, &signal.name)?, channel, 1.0, 0.0));
    }
    let time = inputs.time();
    let n = time.len();
    let settings = Settings {
        start_time: time[0],
        stop_time: time[n - 1],
        step_size: (time[n - 1] - time[0]) / (n - 1) as f64,
        algorithm,
        ..Settings::default()
    };
    let interpolation = match algorithm {
        Algorithm::Monolithic => Interpolation::Linear,
        _ => Interpolation::Hold,
    };
    let stimulus = Stimulus { series: inputs, links, interpolation };
    let stop = AtomicBool::new(false);
    let watch = Watch { stop: &stop, progress: &mut |_, _| {} };
    let run = simulate::run(graph, &settings, Some(&stimulus), watch)?;
    match run.end {
        End::Completed => Ok(run.result),
        End::Failed(error) => Err(error.into()),
        End::Terminated { component, .. } => {
            let time = run.result.time().last().copied().unwrap_or(time[0]);
            Err(Error::Ended {
                file: graph.file.clone(),
                time,
                why: format!("`{component}` asked for the end"),
            })
        }
        End::Interrupted => {
            let time = run.result.time().last().copied().unwrap_or(time[0]);
            Err(Error::Ended { file: graph.file.clone(), time, why: "interrupted".into() })
        }
    }
}

/// Values of an output.
fn output<'a>(result: &'a TimeSeries, name: &str, file: &Path) -> Result<&'a [f64], Error> {
    result.channel(name).map(|channel| channel.values.as_slice()).ok_or_else(|| Error::Signal {
        file: file.into(),
        kind: "output",
        name: name.into(),
        there: result.channels().iter().map(|c| format!("`{}`", c.name)).collect::<Vec<_>>().join(", "),
    })
}
