//! Figures of a report as data: residuals over time and against variables, their autocorrelation, the place in the rig,
//! the curve of each effect with its band.
//!
//! Nothing here decides anything; the search is over. All data come from validation records.

mod block;
pub mod correlation;
pub mod curve;
pub mod dependence;
pub mod ports;
pub mod study;
pub mod variables;

use super::answer::{Answer, fit_locals};
use super::case::Case;
use super::engine::{System, parallel};
use super::law::rig::with_law;
use super::rig::open::Rig;

pub use correlation::Correlation;
pub use curve::Curve;
pub use dependence::Dependence;
pub use ports::Port;
pub use variables::Variable;

/// Most records whose residuals are shown over time.
pub const MAX_RECORDS_OVER_TIME: usize = 2;

/// A measured signal.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Noise rms.
    pub noise: f64,
}

/// One signal of one record under both models.
#[derive(Debug, Clone, PartialEq)]
pub struct Residual {
    /// Index of the signal in [`Evidence::signals`].
    pub signal: usize,
    /// Measured values, shape \[n\].
    pub measured: Vec<f64>,
    /// Measured less predicted by the declared and by the corrected model, each of shape \[n\].
    pub values: [Vec<f64>; 2],
}

/// One validation record.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// File.
    pub name: String,
    /// Command that it repeats.
    pub group: String,
    /// Time between samples \[s\].
    pub sample_time: f64,
    /// Signals.
    pub residuals: Vec<Residual>,
    /// Variables to show residuals against, under the corrected model.
    pub variables: Vec<Variable>,
}

/// Material of the figures.
#[derive(Debug, Clone, Default)]
pub struct Evidence {
    /// Measured signals.
    pub signals: Vec<Signal>,
    /// Validation records that are shown over time, each of another command.
    pub records: Vec<Record>,
    /// Mean residuals over the variables that they depend on most.
    pub dependence: Vec<Dependence>,
    /// Autocorrelation of the residuals, one entry per signal.
    pub correlation: Vec<Correlation>,
    /// Parts of the rig with the power of their residuals.
    pub ports: Vec<Port>,
    /// Inputs where something is left, in multiples of the noise.
    pub left_at: Vec<(String, f64)>,
    /// Curves of the selected effects.
    pub curves: Vec<Curve>,
}

/// Gathers the material for the report of an answer.
pub fn gather(case: &Case, rig: &Rig, answer: &Answer) -> Evidence {
    let system = rig.system.as_ref();
    system.stage("figures");
    let declaration = &case.declaration;
    let chosen: Vec<usize> = (0..system.records()).filter(|&r| !system.estimation(r)).collect();
    let mut signals: Vec<Signal> = Vec::new();
    for span in chosen.iter().flat_map(|&record| system.signals(record)) {
        if !signals.iter().any(|signal| signal.name == span.signal) {
            let unit = declaration.sensors.get(&span.signal).map_or(String::new(), |s| s.unit.clone());
            signals.push(Signal { name: span.signal, unit, noise: span.noise });
        }
    }
    let lawful = with_law(rig, answer);
    let models: [(&dyn System, &[f64]); 2] = [
        (system, &answer.parameters[0]),
        lawful.as_ref().map_or((system, &answer.parameters[1]), |(own, p)| (own, p)),
    ];
    let fits = models.map(|(system, p)| fit_locals(system, &chosen, p).locals);
    let records = parallel::map(chosen.len(), |i| {
        let record = chosen[i];
        let measured = system.measured(record);
        let predicted = [0, 1].map(|m| models[m].0.predict(record, models[m].1, &fits[m][i]));
        let residual = |span: super::engine::Span| {
            let signal = signals.iter().position(|signal| signal.name == span.signal)?;
            let own = |m: usize| {
                let pairs = measured[span.range.clone()].iter().zip(&predicted[m][span.range.clone()]);
                pairs.map(|(y, p)| y - p).collect::<Vec<f64>>()
            };
            Some(Residual {
                signal,
                measured: measured[span.range.clone()].to_vec(),
                values: [own(0), own(1)],
            })
        };
        let residuals: Vec<Residual> = system.signals(record).into_iter().filter_map(residual).collect();
        let variables = variables::of(case, record, &signals, &residuals);
        Record {
            name: declaration.files.get(record).map_or(String::new(), |file| file.name.clone()),
            group: declaration.files.get(record).map_or(String::new(), |file| file.group.clone()),
            sample_time: 1.0 / declaration.sample_rate_hz,
            residuals,
            variables,
        }
    });
    let dependence = dependence::of(&signals, &records);
    let correlation = correlation::of(&signals, &records);
    let ports = ports::of(declaration.kind, rig, answer);
    let left_at = ports::left_at(case, rig, answer, &ports);
    let curves = curve::of(case, answer, &records);
    Evidence { signals, records: shown(records), dependence, correlation, ports, left_at, curves }
}

/// The first records of different commands.
fn shown(records: Vec<Record>) -> Vec<Record> {
    let mut found: Vec<Record> = Vec::new();
    for record in records {
        let repeated = found.iter().any(|other| !record.group.is_empty() && other.group == record.group);
        if !repeated && found.len() < MAX_RECORDS_OVER_TIME {
            found.push(record);
        }
    }
    found
}
