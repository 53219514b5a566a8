//! A whole system under a feed-forward command with weak centering, as sent.

use std::path::Path;

use super::{Error, Recording, input_of, open, sensor};
use airloop_cosim::master::{Algorithm, Master, Progress, Settings};
use airloop_cosim::results::{Column, Recorder, Slot};
use airloop_ident::excite::{self, Band, Signal, times};
use airloop_series::TimeSeries;
use airloop_series::random::Random;

/// Settings of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Input that is commanded.
    pub input: String,
    /// Outputs that are recorded.
    pub outputs: Vec<String>,
    /// Different commands; the last two fifths (at least one) are for validation.
    pub commands: usize,
    /// Number of times that each is sent.
    pub repeats: usize,
    /// Amplitude of the feed-forward multisine \[unit of the input\].
    pub amplitude: f64,
    /// Middle of the feed-forward.
    pub offset: f64,
    /// Its band \[Hz\].
    pub band: Band,
    /// Output that is kept near 0 by the command.
    pub centered: String,
    /// Command per unit of it.
    pub centering: f64,
    /// Start values that vary from trial to trial, uniform within plus and minus the spread.
    pub vary: Vec<(String, f64)>,
    /// Length of each record \[s\].
    pub duration: f64,
    /// Sample time \[s\].
    pub sample_time: f64,
    /// Seed of commands and start values.
    pub seed: u64,
}

impl Default for Plan {
    fn default() -> Plan {
        Plan {
            input: "u".into(),
            outputs: ["F_hat", "F_p", "x", "theta"].map(String::from).to_vec(),
            commands: 5,
            repeats: 2,
            amplitude: 25.0,
            offset: 0.0,
            band: 0.5..4.0,
            centered: "x".into(),
            centering: 60.0,
            vary: Vec::new(),
            duration: 4.0,
            sample_time: 1e-3,
            seed: 1,
        }
    }
}

/// Records the command as sent and the outputs of a system.
///
/// # Errors
/// A command out of range, a system without these signals, a run that fails.
pub fn record(system: &Path, plan: &Plan, set: &[(String, String)]) -> Result<Vec<Recording>, Error> {
    let mut recordings = Vec::new();
    let validation = (2 * plan.commands / 5).max(1);
    for command in 0..plan.commands {
        let letter = char::from(b'a' + (command % 26) as u8);
        let settings = excite::Settings {
            amplitude: plan.amplitude,
            offset: plan.offset,
            duration: plan.duration,
            sample_time: plan.sample_time,
            seed: plan.seed.wrapping_add(command as u64),
            ..excite::Settings::default()
        };
        let signal = Signal::Multisine { band: plan.band.clone(), period: None };
        let feed_forward = signal.samples(&settings)?;
        for repeat in 0..plan.repeats {
            let number = command * plan.repeats + repeat + 1;
            let mut random = Random::stream(plan.seed, &format!("start {number}"));
            let mut start = set.to_vec();
            for (name, spread) in &plan.vary {
                start.push((name.clone(), format!("{:?}", spread * (2.0 * random.uniform() - 1.0))));
            }
            recordings.push(Recording {
                name: format!("trial_{number:02}.csv"),
                estimation: command + validation < plan.commands,
                experiment: "coupled",
                group: format!("command_{letter}"),
                signals: trial(system, plan, &start, &feed_forward)?,
            });
        }
    }
    Ok(recordings)
}

fn trial(
    system: &Path,
    plan: &Plan,
    start: &[(String, String)],
    feed_forward: &[f64],
) -> Result<TimeSeries, Error> {
    let graph = open(system, Algorithm::InterfaceJacobian, start)?;
    let input = input_of(&graph, &plan.input)?;
    let n = feed_forward.len();
    // One step more than samples: a sampled output of the last one is known after it.
    let settings = Settings {
        stop_time: n as f64 * plan.sample_time,
        step_size: plan.sample_time,
        algorithm: Algorithm::InterfaceJacobian,
        ..Settings::default()
    };
    let step = sensor::usual(&plan.input).step;
    let position = |value: f64, k: usize| {
        let wanted = feed_forward[k.min(n - 1)] - plan.centering * value;
        sensor::quantize(wanted, step)
    };
    let mut sent = vec![position(0.0, 0)];
    let mut master = Master::new(&graph, &settings, &[(input, sent[0])])?;
    let columns = master.columns(&graph);
    let known = || columns.iter().map(|c| format!("`{}`", c.name)).collect::<Vec<_>>().join(", ");
    let column = |name: &str| -> Result<&Column, Error> {
        columns.iter().find(|column| column.name == name).ok_or_else(|| Error::Signal {
            file: graph.file.clone(),
            kind: "output",
            name: name.into(),
            there: known(),
        })
    };
    let centered = column(&plan.centered)?.clone();
    for name in &plan.outputs {
        column(name)?;
    }
    let values = master.values();
    let width = [values.reals.len(), values.integers.len(), values.booleans.len()];
    let mut recorder = Recorder::new(columns.clone(), width, n + 1);
    let mut keep = |master: &Master| {
        let values = master.values();
        recorder.record(master.time(), &values.reals, &values.integers, &values.booleans);
    };
    keep(&master);
    while !master.finished() {
        if let Progress::Terminated { component, .. } = master.step()? {
            let why = format!("`{component}` asked for the end");
            return Err(Error::Ended { file: graph.file.clone(), time: master.time(), why });
        }
        let value = match centered.slot {
            Slot::Real(index) => centered.factor * master.values().reals[index] + centered.offset,
            _ => 0.0,
        };
        let command = position(value, sent.len());
        sent.push(command);
        master.set_input(input, command);
        keep(&master);
    }
    let result = recorder.finish()?;
    let mut signals = TimeSeries::new(times(n, plan.sample_time))?;
    signals.push(plan.input.clone(), None, sent[..n].to_vec())?;
    for name in &plan.outputs {
        let channel = result.channel(name).ok_or_else(|| Error::Signal {
            file: graph.file.clone(),
            kind: "output",
            name: name.clone(),
            there: known(),
        })?;
        signals.push(name.clone(), channel.unit.clone(), channel.values[..n].to_vec())?;
    }
    Ok(signals)
}
