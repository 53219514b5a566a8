//! Noise floor of a study: errors of a true model when columns carry the noise and the rounding of their sensors, also
//! where they serve as inputs or initial states.
//!
//! [`SensorNoise`] says how much noise the columns carry. [`Noisy`] is a view whose null ([`crate::engine::goodness`])
//! draws noise for every column and carries it to the outputs through the slopes of the outputs by inputs and initial
//! states; where measured inputs drive states, through a set of simulations instead.

use std::collections::BTreeMap;

use super::columns::processed;
use super::declaration::{Initial, InitialWord, Role, Signal};
use super::model::Study;
use super::read::{ForceRecord, Layout, Record};
use super::signal::central;
use super::simulate::{Shift, View};
use crate::engine::noise::Noise;
use crate::engine::{Span, System, parallel, stop};

/// Simulations with noisy inputs that stand for all draws, each with either sign.
const SIMULATED: usize = 24;
/// The same once the search is asked to end.
const SIMULATED_AT_THE_END: usize = 2;
/// Errors of smoothed derivatives as multiples of what smoothing once more does: smooth motion has lost some already.
const ERROR_OVER_SECOND_SMOOTHING: f64 = std::f64::consts::SQRT_2;
/// Share of the errors of smoothed derivatives that remains where they are corrected by a model.
const SHARE_LEFT_BY_CORRECTION: f64 = 0.2;

/// Sensor of a column, in its unit: white noise before rounding, step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Column {
    /// Rms of the white noise.
    pub white: f64,
    /// Step.
    pub quantum: f64,
}

impl Column {
    /// Rms of the noise with rounding.
    pub fn rms(&self) -> f64 {
        (self.white.powi(2) + self.quantum.powi(2) / 12.0).sqrt()
    }
}

/// Noise of the columns, and the signals made of them.
#[derive(Debug, Clone, Default)]
pub struct SensorNoise {
    /// By column, as the estimation records show it.
    pub columns: BTreeMap<String, Column>,
    /// By column, as the validation records show it: amplifiers and ranges may change between records.
    pub validation: BTreeMap<String, Column>,
    /// Signals: inputs, states, further signals, outputs.
    pub signals: [Vec<Option<Signal>>; 4],
}

impl SensorNoise {
    /// White noise is estimated on the records of a role, the step is the coarsest of all; `declared`: noise rms of
    /// columns, in their unit, that is known.
    pub fn new(records: &[Record], layout: &Layout, declared: &BTreeMap<String, f64>) -> SensorNoise {
        let [columns, validation] =
            [Role::Estimation, Role::Validation].map(|role| columns(records, role, declared));
        let own = |list: Vec<Option<&Signal>>| list.into_iter().map(|s| s.cloned()).collect();
        SensorNoise { columns, validation, signals: layout.signals().map(own) }
    }

    /// Noise of the columns of a record.
    fn of_role(&self, role: Role) -> &BTreeMap<String, Column> {
        if role == Role::Validation { &self.validation } else { &self.columns }
    }

    /// Noise of a column.
    pub fn of(&self, column: &str) -> Column {
        self.columns.get(column).copied().unwrap_or_default()
    }

    /// Noise of one list of signals, made of the noise of their columns `[n]`; none for those without a column.
    fn made(&self, list: usize, record: &Record, drawn: &BTreeMap<&str, Vec<f64>>) -> Vec<Option<Vec<f64>>> {
        let one = |(signal, factor): (&Option<Signal>, &f64)| {
            let signal = signal.as_ref()?;
            let values = drawn.get(signal.source()?.as_str())?;
            let values = values.iter().map(|value| factor * value).collect();
            Some(processed(values, signal, record.step))
        };
        self.signals[list].iter().zip(&record.factors[list]).map(one).collect()
    }
}

/// Noise of the columns as the records of a role show it.
fn columns(records: &[Record], role: Role, declared: &BTreeMap<String, f64>) -> BTreeMap<String, Column> {
    let mut sums: BTreeMap<String, (f64, f64, f64)> = BTreeMap::new();
    for record in records {
        let weight = if record.role == role { record.n as f64 } else { 0.0 };
        for (name, sensor) in &record.sensors {
            let sum = sums.entry(name.clone()).or_insert((0.0, 0.0, 0.0));
            // Records that were resampled hide the step that others of the same sensor show.
            *sum = (sum.0 + weight * sensor.scatter.powi(2), sum.1 + weight, sum.2.max(sensor.quantum));
        }
    }
    let column = |(name, (square, weight, quantum)): (String, (f64, f64, f64))| {
        let known = declared.get(&name).map(|noise| noise.powi(2));
        let rounding = quantum.powi(2) / 12.0;
        // A sensor at rest shows less scatter than its rounding.
        let white = (known.unwrap_or(square / f64::max(weight, 1.0)) - rounding).max(0.0).sqrt();
        (name, Column { white, quantum })
    };
    sums.into_iter().map(column).collect()
}

impl ForceRecord {
    /// With noise of the sensors on the measured states and the acceleration made of them.
    pub fn noisy(&self, study: &Study, record: &Record, noise: &mut Noise) -> ForceRecord {
        let (n, corner) = (self.acceleration.len(), study.force.as_ref().map(|rule| rule.0.low_pass_hz));
        let columns = drawn(study, (record.role, n), &BTreeMap::new(), noise);
        let mut found = self.clone();
        for (i, values) in found.states.iter_mut().enumerate() {
            let signal = study.sensors.signals[1].get(i).and_then(Option::as_ref);
            let (Some(values), Some(signal)) = (values, signal) else { continue };
            let Some(own) = signal.source().and_then(|name| columns.get(name.as_str())) else { continue };
            let own = own.iter().map(|value| record.factors[1][i] * value).collect();
            let filtered = Signal { low_pass_hz: signal.low_pass_hz.or(corner), ..signal.clone() };
            let own = processed(own, &filtered, record.step);
            values.iter_mut().zip(&own).for_each(|(value, own)| *value += own);
            if study.force.as_ref().is_some_and(|(_, velocity, ..)| *velocity == i) {
                let rates = central(&own, record.step);
                found.acceleration.iter_mut().zip(rates).for_each(|(value, own)| *value += own);
            }
        }
        found
    }
}

/// How a piece answers noise of inputs and initial states.
#[derive(Debug, Clone, Default)]
struct Slopes {
    /// Slope of the outputs `[outputs * n]` by the initial value of each state; none: not by a sensor.
    states: Vec<Option<Vec<f64>>>,
    /// Slope by each input and further signal at the same time, in systems without states.
    inputs: Vec<Option<Vec<f64>>>,
    extra: Vec<Option<Vec<f64>>>,
    /// Answers to drawn noise of inputs and further signals.
    simulated: Vec<Vec<f64>>,
    /// Residuals that smoothed derivatives give where the motion is not smooth; empty: none.
    bias: Vec<f64>,
}

/// A view whose null has the noise of all sensors.
#[derive(Debug)]
pub struct Noisy<'a> {
    view: &'a View<'a>,
    slopes: Vec<Slopes>,
}

impl<'a> Noisy<'a> {
    /// Around the parameters `p` and the local parameters of the pieces.
    pub fn new(view: &'a View<'a>, p: &[f64], locals: &[Vec<f64>], seed: u64) -> Noisy<'a> {
        let slopes = parallel::map(view.pieces.len(), |r| slopes(view, r, p, &locals[r], seed));
        Noisy { view, slopes }
    }

    fn study(&self) -> &Study {
        self.view.study
    }

    /// Residuals that smoothed derivatives give, in units of the scale of the view.
    pub fn bias(&self, r: usize) -> Vec<f64> {
        let n = self.view.pieces[r].range.len();
        let own = self.slopes[r].bias.iter().enumerate().map(|(i, value)| value / self.view.scale[i / n]);
        let mut own: Vec<f64> = own.collect();
        if !own.is_empty() {
            self.view.without_starts(r, &mut own);
        }
        own
    }
}

/// Noise of every column over a record of a role, `[n]`; `clean` has what the sensor would show, for rounding.
fn drawn<'s>(
    study: &'s Study,
    (role, n): (Role, usize),
    clean: &BTreeMap<&str, Vec<f64>>,
    noise: &mut Noise,
) -> BTreeMap<&'s str, Vec<f64>> {
    let one = |(name, column): (&'s String, &Column)| {
        let known = clean.get(name.as_str());
        let value = |k: usize| {
            let normal = noise.normal();
            match known {
                Some(clean) if column.quantum > 0.0 => {
                    let value = clean[k] + column.white * normal;
                    (value / column.quantum).round() * column.quantum - clean[k]
                }
                _ => column.rms() * normal,
            }
        };
        (name.as_str(), (0..n).map(value).collect())
    };
    study.sensors.of_role(role).iter().map(one).collect()
}

/// Errors of derivatives by smoothing, `[signals][n]`: known by a model, or estimated by smoothing them once more. None
/// for signals that are no derivatives.
fn smoothing(
    study: &Study,
    record: &Record,
    list: usize,
    values: &[Option<Vec<f64>>],
) -> Vec<Option<Vec<f64>>> {
    let one = |(signal, values): (&Option<Signal>, &Option<Vec<f64>>)| {
        let signal = signal.as_ref().filter(|signal| signal.derivative_of.is_some())?;
        let values = values.as_ref()?;
        let mut sum = 0.0;
        let mut last = values.first().copied()?;
        let integral = values.iter().map(|value| {
            sum += 0.5 * record.step * (value + last);
            last = *value;
            sum
        });
        let again = processed(integral.collect(), &Signal { scale: None, ..signal.clone() }, record.step);
        Some(
            again
                .iter()
                .zip(values)
                .map(|(again, once)| ERROR_OVER_SECOND_SMOOTHING * (again - once))
                .collect(),
        )
    };
    study.sensors.signals[list].iter().zip(values).map(one).collect()
}

/// Rms of the noise of each measured state of a record, with what smoothing adds to derivatives; none where no sensor
/// shows it.
pub fn of_states(study: &Study, record: &Record, seed: u64) -> Vec<Option<f64>> {
    let columns = drawn(study, (record.role, record.n), &BTreeMap::new(), &mut Noise::new(seed, 0));
    let noise = study.sensors.made(1, record, &columns);
    let smoothed = smoothing(study, record, 1, &record.states);
    let rms = |own: &[f64]| (own.iter().map(|e| e * e).sum::<f64>() / own.len().max(1) as f64).sqrt();
    let one = |(noise, smoothed): (Option<Vec<f64>>, Option<Vec<f64>>)| {
        noise.map(|own| rms(&own).hypot(smoothed.map_or(0.0, |own| rms(&own))))
    };
    noise.into_iter().zip(smoothed).map(one).collect()
}

/// Known errors of smoothed measured states, times `share`.
fn known(record: &Record, share: f64) -> Vec<Option<Vec<f64>>> {
    let one = |own: &Option<Vec<f64>>| own.as_ref().map(|own| own.iter().map(|e| share * e).collect());
    record.smoothed.iter().map(one).collect()
}

fn slopes(view: &View, r: usize, p: &[f64], locals: &[f64], seed: u64) -> Slopes {
    let study = view.study;
    let piece = &view.pieces[r];
    let record = &study.records[piece.record];
    let base = view.predict(r, p, locals);
    let nx = record.states.len();
    let measured = study.windows.is_some() || record.initial == Initial::Word(InitialWord::Measured);
    let slope = |shift: Shift, size: f64| {
        let moved = view.shifted(r, p, locals, &shift);
        moved.iter().zip(&base).map(|(a, b)| (a - b) / size).collect::<Vec<f64>>()
    };
    let width = |values: &[f64]| 1e-4 * values.iter().fold(1e-6f64, |a, b| a.max(b.abs()));
    let state = |i: usize| {
        let values = record.states[i].as_ref().filter(|_| measured)?;
        let size = width(values);
        let mut states = vec![None; nx];
        states[i] = Some(vec![size; record.n]);
        Some(slope(Shift { states, ..Shift::default() }, size))
    };
    let mut found = Slopes { states: (0..nx).map(state).collect(), ..Slopes::default() };
    let states = match (measured, record.smoothed.is_empty()) {
        (false, _) => Vec::new(),
        (true, true) => smoothing(study, record, 1, &record.states),
        (true, false) => known(record, if view.corrected { SHARE_LEFT_BY_CORRECTION } else { 1.0 }),
    };
    let smoothed = Shift {
        states,
        inputs: smoothing(study, record, 0, &record.inputs),
        extra: smoothing(study, record, 2, &record.extra.iter().cloned().map(Some).collect::<Vec<_>>()),
    };
    let lists = [&smoothed.states, &smoothed.inputs, &smoothed.extra];
    if lists.iter().any(|list| list.iter().any(Option::is_some)) {
        found.bias = slope(smoothed, -1.0);
    }
    let lists = [record.inputs.len(), record.extra.len()];
    let noisy = |list: usize, i: usize| {
        let column = study.sensors.signals[list][i].as_ref().and_then(Signal::source);
        let held = list == 0 && study.held[i];
        !held && column.is_some_and(|column| study.sensors.of(column).rms() > 0.0)
    };
    let any = (0..lists[0]).any(|i| noisy(0, i)) || (0..lists[1]).any(|i| noisy(2, i));
    if nx == 0 && !study.sampled {
        let one = |list: usize, i: usize| {
            if !noisy(list, i) {
                return None;
            }
            let values = if list == 0 { record.inputs[i].as_ref()? } else { &record.extra[i] };
            let size = width(values);
            let mut moved = vec![None; lists[list / 2]];
            moved[i] = Some(vec![size; record.n]);
            let shift = match list {
                0 => Shift { inputs: moved, ..Shift::default() },
                _ => Shift { extra: moved, ..Shift::default() },
            };
            Some(slope(shift, size))
        };
        found.inputs = (0..lists[0]).map(|i| one(0, i)).collect();
        found.extra = (0..lists[1]).map(|i| one(2, i)).collect();
    } else if any {
        let one = |k: usize| {
            let mut noise = Noise::new(seed ^ 0x5eed, (r * SIMULATED + k) as u64);
            let own = drawn(study, (record.role, record.n), &BTreeMap::new(), &mut noise);
            let mut inputs = study.sensors.made(0, record, &own);
            inputs.iter_mut().enumerate().filter(|(i, _)| !noisy(0, *i)).for_each(|(_, v)| *v = None);
            let extra = study.sensors.made(2, record, &own);
            slope(Shift { inputs, extra, ..Shift::default() }, 1.0)
        };
        let count = if stop::asked() { SIMULATED_AT_THE_END } else { SIMULATED };
        found.simulated = (0..count).map(one).collect();
    }
    found
}

impl System for Noisy<'_> {
    fn records(&self) -> usize {
        self.view.records()
    }

    fn estimation(&self, record: usize) -> bool {
        self.view.estimation(record)
    }

    fn locals(&self, record: usize) -> Vec<(f64, f64)> {
        self.view.locals(record)
    }

    fn signals(&self, record: usize) -> Vec<Span> {
        self.view.signals(record)
    }

    fn predict(&self, record: usize, parameters: &[f64], locals: &[f64]) -> Vec<f64> {
        self.view.predict(record, parameters, locals)
    }

    fn measured(&self, record: usize) -> Vec<f64> {
        self.view.measured(record)
    }

    fn silence(&self, record: usize, residuals: &mut [f64]) {
        self.view.silence(record, residuals);
    }

    fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
        self.view.whiten(record, predicted)
    }

    fn redraw(&self, r: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        let study = self.study();
        let piece = &self.view.pieces[r];
        let record = &study.records[piece.record];
        let (n, slopes) = (piece.range.len(), &self.slopes[r]);
        let mut clean = BTreeMap::new();
        for (o, signal) in study.sensors.signals[3].iter().enumerate() {
            if let Some(name) = signal.as_ref().and_then(Signal::source) {
                let mut whole = vec![0.0; record.n];
                let scale = signal.as_ref().and_then(|signal| signal.scale).filter(|scale| *scale != 0.0);
                let factor = record.factors[3][o] * scale.unwrap_or(1.0);
                let own = predicted[o * n..(o + 1) * n].iter();
                whole[piece.range.clone()].iter_mut().zip(own).for_each(|(a, b)| *a = b / factor);
                clean.insert(name.as_str(), whole);
            }
        }
        let columns = drawn(study, (record.role, record.n), &clean, noise);
        let range = piece.range.clone();
        let outputs = study.sensors.made(3, record, &columns);
        let mut found: Vec<f64> = Vec::with_capacity(predicted.len());
        for own in &outputs {
            match own {
                Some(values) => found.extend(&values[range.clone()]),
                None => found.extend(std::iter::repeat_n(0.0, n)),
            }
        }
        let window = study.window(record.step);
        let shifts = study.sensors.made(1, record, &columns);
        for (slope, shift) in slopes.states.iter().zip(&shifts) {
            let (Some(slope), Some(shift)) = (slope, shift) else { continue };
            let begin = if study.from_start(record) { 0 } else { range.start };
            for (i, (value, slope)) in found.iter_mut().zip(slope).enumerate() {
                let since = range.start - begin + i % n;
                let from = begin + window.map_or(0, |window| since / window * window);
                *value -= slope * shift[from];
            }
        }
        for (list, slopes) in [(0, &slopes.inputs), (2, &slopes.extra)] {
            let shifts =
                if slopes.is_empty() { Vec::new() } else { study.sensors.made(list, record, &columns) };
            for (slope, shift) in slopes.iter().zip(&shifts) {
                let (Some(slope), Some(shift)) = (slope, shift) else { continue };
                for (i, (value, slope)) in found.iter_mut().zip(slope).enumerate() {
                    *value -= slope * shift[range.start + i % n];
                }
            }
        }
        if !slopes.simulated.is_empty() {
            let pick = (noise.uniform() * slopes.simulated.len() as f64) as usize;
            let own = &slopes.simulated[pick.min(slopes.simulated.len() - 1)];
            let sign = if noise.uniform() < 0.5 { -1.0 } else { 1.0 };
            found.iter_mut().zip(own).for_each(|(value, own)| *value -= sign * own);
        }
        let mut found: Vec<f64> =
            found.iter().enumerate().map(|(i, value)| value / self.view.scale[i / n]).collect();
        self.view.silence(r, &mut found);
        self.view.without_starts(r, &mut found);
        found
    }
}
