//! Predictions of a view as the engine asks for them: simulations that were run before or new ones, and the effects of
//! sensors on their outputs.

use super::begin;
use super::command::{Command, delayed};
use super::declaration::{Initial, InitialWord};
use super::law::rounded;
use super::model::{Action, Sensor};
use super::read::Record;
use super::remembered::Key;
use super::simulate::{Piece, Shift, View};
use crate::engine::fit::Free;
use crate::engine::noise::Noise;
use crate::engine::system::Derivatives;
use crate::engine::{Span, System};
use crate::vocabulary::own::{MAX_STATES, Own};

impl View<'_> {
    /// Outputs of a piece without the effects of the sensors, `[outputs][n]`, from a simulation that was run before
    /// where there is one. A new one from the beginning of a record goes on to the end of all pieces of it.
    fn remembered(&self, piece: &Piece, p: &[f64], locals: &[f64]) -> Vec<f64> {
        let (begin, outputs) = (self.begin(piece), self.study.outputs.len());
        let simulate = || {
            let mut whole = Piece { record: piece.record, range: begin..piece.range.end };
            if self.begins_with_record(piece.record) {
                let own = self.pieces.iter().filter(|other| other.record == piece.record);
                whole.range.end = own.map(|other| other.range.end).fold(piece.range.end, usize::max);
            }
            self.simulate(&whole, p, locals, &mut self.blocks(p, false), &Shift::default())
        };
        let needed = (piece.range.end - begin) * outputs;
        let whole = self.remembered.get(self.key(piece, p, locals), needed, simulate);
        let n = whole.len() / outputs;
        let own = |o: usize| &whole[o * n + piece.range.start - begin..o * n + piece.range.end - begin];
        (0..outputs).flat_map(own).copied().collect()
    }

    /// All that the simulation of a piece depends on, however long it is: not the parameters of sensors.
    fn key(&self, piece: &Piece, p: &[f64], locals: &[f64]) -> Key {
        let flags = [self.quick, self.corrected, self.begins.is_empty()].map(u64::from);
        let is_sensor = |c: usize| matches!(self.study.candidates[c].action, Action::Sensor { .. });
        let place = [piece.record as u64, self.begin(piece) as u64, self.substeps as u64];
        let mut key: Key = place.into_iter().chain(flags).collect();
        let first = key.len();
        key.extend(p.iter().chain(locals).map(|value| value.to_bits()));
        let offsets = self.study.outputs.iter().filter_map(|output| output.offset);
        offsets.for_each(|index| key[first + index] = 0);
        for &c in &self.active {
            if is_sensor(c) {
                self.study.candidates[c].entries.clone().for_each(|index| key[first + index] = 0);
            } else {
                key.push(c as u64);
            }
        }
        key
    }

    /// As [`System::predict`], with something added to measured signals.
    pub fn shifted(&self, record: usize, p: &[f64], locals: &[f64], shift: &Shift) -> Vec<f64> {
        let piece = &self.pieces[record];
        let mut out = self.simulate(piece, p, locals, &mut self.blocks(p, false), shift);
        self.sense(piece, p, &mut out);
        out
    }

    /// Applies the sensor effects of the acting candidates to the outputs `out`, `[outputs][n]`, in place.
    fn sense(&self, piece: &Piece, p: &[f64], out: &mut [f64]) {
        let n = piece.range.len();
        let step = self.study.records[piece.record].step;
        for (o, output) in self.study.outputs.iter().enumerate() {
            let own = &mut out[o * n..(o + 1) * n];
            let mut resolution = 0.0;
            for &c in &self.active {
                let candidate = &self.study.candidates[c];
                let Action::Sensor { kind, output } = candidate.action else { continue };
                if output != o {
                    continue;
                }
                let time = |k: usize| (piece.range.start + k) as f64 * step;
                let value = p[candidate.entries.start..].first().copied().unwrap_or(0.0);
                match kind {
                    Sensor::Offset => own.iter_mut().for_each(|y| *y += value),
                    Sensor::Gain => own.iter_mut().for_each(|y| *y *= 1.0 + value),
                    Sensor::Drift => own.iter_mut().enumerate().for_each(|(k, y)| *y += value * time(k)),
                    Sensor::Nonlinearity => own.iter_mut().for_each(|y| *y += value * *y * *y),
                    Sensor::Delay => {
                        let late = delayed(own, value / step);
                        own.copy_from_slice(&late);
                    }
                    Sensor::Lag => {
                        let late = Command::Lag.apply(&[value], own, step, false);
                        own.copy_from_slice(&late);
                    }
                    Sensor::Own(index) => {
                        shown(&self.study.own[index], &p[candidate.entries.clone()], own, step, time(0));
                    }
                    // A sensor rounds what it has made of the signal.
                    Sensor::Quantization => resolution = value,
                }
            }
            if let Some(offset) = output.offset {
                own.iter_mut().for_each(|y| *y += p[offset]);
            }
            if resolution > 0.0 {
                own.iter_mut().for_each(|y| *y = rounded(*y, resolution));
            }
        }
    }

    /// Takes from residuals of a piece, in units of the scale, what noise of the states gives that windows start from.
    pub(super) fn without_starts(&self, record: usize, residuals: &mut [f64]) {
        let piece = &self.pieces[record];
        let own = self.study.starts.get(piece.record).filter(|_| self.white && self.begins.is_empty());
        let Some(own) = own else { return };
        let n = piece.range.len();
        let unit = |o: usize| self.study.outputs[o].noise / self.scale[o];
        residuals.iter_mut().enumerate().for_each(|(i, value)| *value /= unit(i / n));
        own.whiten(&piece.range, residuals);
        residuals.iter_mut().enumerate().for_each(|(i, value)| *value *= unit(i / n));
    }

    fn fitted(&self, record: &Record) -> bool {
        self.study.windows.is_none() && record.initial == Initial::Word(InitialWord::Fit)
    }
}

/// Applies an effect of one's own with parameters `p` to samples of an output, in place; the first is at `begin` \[s\].
fn shown(effect: &Own, p: &[f64], samples: &mut [f64], step: f64, begin: f64) {
    let mut z = [0.0; MAX_STATES];
    for k in 0..samples.len() {
        let (value, time) = (samples[k], begin + k as f64 * step);
        samples[k] = effect.value([0.0, 0.0, value, time], &z, p);
        if let Some(next) = samples.get(k + 1) {
            // The output moves between its samples.
            effect.advance([0.0, 0.0, 0.5 * (value + next), time + 0.5 * step], &mut z, p, step);
        }
    }
}

impl System for View<'_> {
    fn records(&self) -> usize {
        self.pieces.len()
    }

    fn estimation(&self, _: usize) -> bool {
        true
    }

    fn locals(&self, record: usize) -> Vec<(f64, f64)> {
        if let Some(own) = self.begins.get(record) {
            let size = |i: usize| self.begins.iter().fold(0.0f64, |a, b| a.max(b[i].abs()));
            let step = |i: usize| begin::STEP * size(i).max(begin::LEAST_SIZE);
            let held = |i: usize| self.held.get(i) == Some(&true);
            let one = |(i, x): (usize, &f64)| (*x, if held(i) { 0.0 } else { step(i) });
            return own.iter().enumerate().map(one).collect();
        }
        let piece = &self.pieces[record];
        let record = &self.study.records[piece.record];
        if !self.fitted(record) {
            return Vec::new();
        }
        let from = if self.study.from_start(record) { 0 } else { piece.range.start };
        let begin = Piece { record: piece.record, range: from..piece.range.end };
        let piece = &begin;
        let one = |(i, values): (usize, &Option<Vec<f64>>)| match values {
            None if self.study.unobservable.get(i) == Some(&true) => (0.0, 0.0),
            None => self.study.begins.get(i).copied().unwrap_or_default().of(self.study, piece),
            Some(values) => begin::measured(values, piece),
        };
        record.states.iter().enumerate().map(one).collect()
    }

    fn derivatives(&self, record: usize, p: &[f64], locals: &[f64], free: &[Free]) -> Option<Derivatives> {
        self.linearized(record, p, locals, free)
    }

    fn signals(&self, record: usize) -> Vec<Span> {
        let n = self.pieces[record].range.len();
        let one = |(o, output): (usize, &super::model::Output)| Span {
            signal: output.name.clone(),
            range: o * n..(o + 1) * n,
            noise: self.scale[o],
        };
        self.study.outputs.iter().enumerate().map(one).collect()
    }

    fn predict(&self, record: usize, parameters: &[f64], locals: &[f64]) -> Vec<f64> {
        let piece = &self.pieces[record];
        let mut out = self.remembered(piece, parameters, locals);
        self.sense(piece, parameters, &mut out);
        out
    }

    fn measured(&self, record: usize) -> Vec<f64> {
        let piece = &self.pieces[record];
        let outputs = &self.study.records[piece.record].outputs;
        outputs.iter().flat_map(|values| values[piece.range.clone()].iter().copied()).collect()
    }

    fn silence(&self, record: usize, residuals: &mut [f64]) {
        let piece = &self.pieces[record];
        let n = piece.range.len();
        for (o, measured) in self.study.records[piece.record].measured.iter().enumerate() {
            let Some(measured) = measured else { continue };
            let own = residuals[o * n..(o + 1) * n].iter_mut().zip(&measured[piece.range.clone()]);
            own.filter(|(_, there)| !**there).for_each(|(value, _)| *value = 0.0);
        }
    }

    fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
        let n = self.pieces[record].range.len();
        let measured = self.measured(record);
        let own = measured.iter().zip(predicted).enumerate().map(|(i, (m, p))| (m - p) / self.scale[i / n]);
        let mut residuals: Vec<f64> = own.collect();
        self.silence(record, &mut residuals);
        self.without_starts(record, &mut residuals);
        residuals
    }

    fn redraw(&self, record: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        let n = self.pieces[record].range.len();
        let one = |i: usize| self.study.outputs[i / n].noise / self.scale[i / n];
        let mut drawn: Vec<f64> = (0..predicted.len()).map(|i| one(i) * noise.normal()).collect();
        self.silence(record, &mut drawn);
        drawn
    }
}
