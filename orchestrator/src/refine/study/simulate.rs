//! Pieces of records as the engine sees them: the system with the blocks of some candidates, simulated.

use std::cell::RefCell;
use std::ops::Range;

use super::command::delayed;
use super::declaration::{Initial, InitialWord};
use super::law::{Law, Point, preslide};
use super::model::{Action, Sensor, Study};
use super::plant::Plant;
use super::read::Record;
use crate::refine::engine::noise::Noise;
use crate::refine::engine::{Span, System};

/// A span of a record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Piece {
    /// Record.
    pub record: usize,
    /// Samples.
    pub range: Range<usize>,
}

/// Pieces, and the candidates whose blocks act.
#[derive(Debug, Clone)]
pub struct View<'a> {
    /// Study.
    pub study: &'a Study,
    /// Candidates that act.
    pub active: Vec<usize>,
    /// Pieces.
    pub pieces: Vec<Piece>,
    /// What residuals are divided by, one number for each output.
    pub scale: Vec<f64>,
}

/// Largest values seen at the attachments.
#[derive(Debug, Clone, Default)]
pub struct Survey {
    /// For each attachment: ranges of velocity, position, pressure force, pressure, and of the value that passes.
    pub ranges: Vec<[(f64, f64); 5]>,
}

impl Survey {
    fn see(&mut self, tap: usize, values: [f64; 5]) {
        for (range, value) in self.ranges[tap].iter_mut().zip(values) {
            *range = (range.0.min(value), range.1.max(value));
        }
    }
}

/// States of the blocks and what they need besides the slots.
pub(super) struct Blocks<'a> {
    study: &'a Study,
    p: &'a [f64],
    /// For each tap: law, its parameters, index into `z`.
    laws: Vec<Vec<(Law, Range<usize>, usize)>>,
    z: Vec<f64>,
    time: f64,
    survey: Option<RefCell<Survey>>,
}

impl Blocks<'_> {
    /// What the laws at an attachment depend on.
    pub(super) fn point(&self, tap: usize, slots: &[f64]) -> Point {
        let at = |slot: Option<usize>| slot.map_or(0.0, |slot| slots[slot]);
        let [velocity, position, pressure_force, pressure] = self.study.taps[tap].signals.map(at);
        Point { velocity, position, pressure_force, pressure, time: self.time }
    }

    /// Coulomb level that presliding acts on: declared and added.
    fn level(&self, tap: usize) -> f64 {
        let declared = self.study.taps[tap].coulomb.map_or(0.0, |level| level.of(self.p));
        let added = self.laws[tap].iter().find(|(law, ..)| *law == Law::Coulomb);
        declared + added.map_or(0.0, |(_, range, _)| self.p[range.start])
    }

    /// The value behind an attachment.
    pub(super) fn pass(&self, tap: usize, value: f64, slots: &[f64]) -> f64 {
        let point = self.point(tap, slots);
        if let Some(survey) = &self.survey {
            let Point { velocity, position, pressure_force, pressure, .. } = point;
            survey.borrow_mut().see(tap, [velocity, position, pressure_force, pressure, value]);
        }
        if self.laws[tap].is_empty() {
            return value;
        }
        let s = (point.velocity / self.study.taps[tap].vt).tanh();
        let mut value = value;
        for (law, range, state) in &self.laws[tap] {
            let p = &self.p[range.clone()];
            if law.changes_command() {
                value = law.command(p, &point, value);
            } else {
                let level = if *law == Law::Presliding { self.level(tap) } else { 0.0 };
                value -= law.force(p, &point, s, self.z[*state], level);
            }
        }
        value
    }

    /// Moves the states of presliding on.
    pub(super) fn advance(&mut self, step: f64, velocities: &[f64]) {
        for (tap, laws) in self.laws.iter().enumerate() {
            for (law, range, state) in laws {
                if *law == Law::Presliding {
                    self.z[*state] = preslide(self.z[*state], velocities[tap], self.p[range.start], step);
                }
            }
        }
        self.time += step;
    }
}

impl<'a> View<'a> {
    /// Blocks of the active candidates, at rest.
    pub(super) fn blocks<'b>(&self, p: &'b [f64], survey: bool) -> Blocks<'b>
    where
        'a: 'b,
    {
        let study: &'b Study = self.study;
        let (mut laws, mut count) = (vec![Vec::new(); study.taps.len()], 0);
        for &c in &self.active {
            let own = &study.candidates[c];
            if let Action::Block { law, tap } = own.action {
                laws[tap].push((law, own.entries.clone(), count));
                count += 1;
            }
        }
        let seen = [(f64::INFINITY, f64::NEG_INFINITY); 5];
        let survey = survey.then(|| RefCell::new(Survey { ranges: vec![seen; study.taps.len()] }));
        Blocks { study, p, laws, z: vec![0.0; count], time: 0.0, survey }
    }

    /// Ranges of what passes the attachments in a simulation of all pieces.
    pub fn survey(&self, p: &[f64], locals: &[Vec<f64>]) -> Survey {
        let mut found = Survey::default();
        for (piece, locals) in self.pieces.iter().zip(locals) {
            let mut blocks = self.blocks(p, true);
            self.simulate(piece, p, locals, &mut blocks);
            let Some(one) = blocks.survey.map(RefCell::into_inner) else { continue };
            if found.ranges.is_empty() {
                found = one;
            } else {
                for (all, own) in found.ranges.iter_mut().zip(one.ranges) {
                    for (a, b) in all.iter_mut().zip(own) {
                        *a = (a.0.min(b.0), a.1.max(b.1));
                    }
                }
            }
        }
        found
    }

    /// Outputs of a piece, one after the other; NaN from where the simulation cannot go on.
    fn simulate(&self, piece: &Piece, p: &[f64], locals: &[f64], blocks: &mut Blocks) -> Vec<f64> {
        let n = piece.range.len();
        let mut out = vec![f64::NAN; n * self.study.outputs.len()];
        if let Ok(mut plant) = self.study.take()
            && self.run(&mut plant, piece, p, locals, blocks, &mut out).is_ok()
        {
            self.study.give(plant);
        }
        self.sense(piece, p, &mut out);
        out
    }

    /// Commands of a piece with the effects that have a memory.
    fn inputs(&self, record: &Record, p: &[f64]) -> Vec<Option<Vec<f64>>> {
        let mut inputs = record.inputs.clone();
        for &c in &self.active {
            let own = &self.study.candidates[c];
            if let Action::Command { kind, input } = own.action
                && let Some(values) = &mut inputs[input]
            {
                *values = kind.apply(&p[own.entries.clone()], values, record.step);
            }
        }
        inputs
    }

    fn run(
        &self,
        plant: &mut Plant,
        piece: &Piece,
        p: &[f64],
        locals: &[f64],
        blocks: &mut Blocks,
        out: &mut [f64],
    ) -> Result<(), super::Problem> {
        let study = self.study;
        let record = &study.records[piece.record];
        let inputs = self.inputs(record, p);
        let nx = plant.nx;
        let (mut x, mut dx) = (vec![0.0; nx], [vec![0.0; nx], vec![0.0; nx], vec![0.0; nx], vec![0.0; nx]]);
        let mut trial = vec![0.0; nx];
        let mut velocities = vec![0.0; study.taps.len()];
        plant.initialise(&self.parameters(p), &mut x)?;
        let start = x.clone();
        let (n, step) = (piece.range.len(), record.step);
        let window = study.windows.map(|window| ((window / step).round() as usize).max(2));
        match &record.initial {
            _ if window.is_some() => {}
            Initial::Word(InitialWord::Fit) if nx > 0 => x.copy_from_slice(locals),
            Initial::Given(values) => {
                for (name, value) in values {
                    if let Some(state) = plant.state(name) {
                        x[state] = *value;
                    }
                }
            }
            Initial::Word(_) => self.measured_states(record, piece.range.start, &start, &mut x),
        }
        let set = |plant: &mut Plant, k: usize, part: f64| {
            for (slot, values) in inputs.iter().enumerate() {
                let Some(values) = values else { continue };
                let here = values[k];
                let next = values[(k + 1).min(record.n - 1)];
                plant.slots[slot] = if study.held[slot] { here } else { here + part * (next - here) };
            }
            let first = plant.extra_first;
            for (slot, values) in record.extra.iter().enumerate() {
                plant.slots[first + slot] = values[k];
            }
        };
        for j in 0..n {
            let k = piece.range.start + j;
            if window.is_some_and(|window| j % window == 0) {
                self.measured_states(record, k, &start, &mut x);
                blocks.z.fill(0.0);
            }
            let t = k as f64 * step;
            let at = |plant: &mut Plant, part: f64, x: &[f64], dx: &mut [f64], blocks: &Blocks| {
                set(plant, k, part);
                plant.evaluate(t + part * step, x, dx, &|tap, value, slots| blocks.pass(tap, value, slots))
            };
            at(plant, 0.0, &x, &mut dx[0], blocks).map_err(super::Problem::fmu)?;
            for (o, output) in study.outputs.iter().enumerate() {
                out[o * n + j] = plant.slots[output.slot];
            }
            for (tap, velocity) in velocities.iter_mut().enumerate() {
                *velocity = blocks.point(tap, &plant.slots).velocity;
            }
            if nx > 0 && j + 1 < n {
                let [d1, d2, d3, d4] = &mut dx;
                let mut stage = |part: f64, from: &[f64], to: &mut [f64], x: &[f64]| {
                    for (i, value) in trial.iter_mut().enumerate() {
                        *value = x[i] + part * step * from[i];
                    }
                    at(plant, part, &trial, to, blocks)
                };
                stage(0.5, d1, d2, &x).map_err(super::Problem::fmu)?;
                stage(0.5, d2, d3, &x).map_err(super::Problem::fmu)?;
                stage(1.0, d3, d4, &x).map_err(super::Problem::fmu)?;
                for i in 0..nx {
                    x[i] += step / 6.0 * (d1[i] + 2.0 * (d2[i] + d3[i]) + d4[i]);
                }
                if x.iter().any(|value| !value.is_finite()) {
                    return Ok(());
                }
            }
            blocks.advance(step, &velocities);
        }
        Ok(())
    }

    /// Measured states at sample `k`; start values where there are none.
    fn measured_states(&self, record: &Record, k: usize, start: &[f64], x: &mut [f64]) {
        for (i, values) in record.states.iter().enumerate() {
            x[i] = values.as_ref().map_or(start[i], |values| values[k]);
        }
    }

    /// Values of the parameters of the system.
    pub fn parameters(&self, p: &[f64]) -> Vec<(super::plant::Parameter, f64)> {
        let declared = self.study.entries.iter().zip(p).filter_map(|(entry, value)| match entry.target {
            super::model::Target::Declared(parameter) => Some((parameter, *value)),
            _ => None,
        });
        self.study.fixed.iter().copied().chain(declared).collect()
    }

    /// What the sensors make of the outputs.
    fn sense(&self, piece: &Piece, p: &[f64], out: &mut [f64]) {
        let n = piece.range.len();
        let step = self.study.records[piece.record].step;
        for (o, output) in self.study.outputs.iter().enumerate() {
            let own = &mut out[o * n..(o + 1) * n];
            for &c in &self.active {
                let candidate = &self.study.candidates[c];
                let Action::Sensor { kind, output } = candidate.action else { continue };
                if output != o {
                    continue;
                }
                let value = p[candidate.entries.start];
                match kind {
                    Sensor::Offset => own.iter_mut().for_each(|y| *y += value),
                    Sensor::Gain => own.iter_mut().for_each(|y| *y *= 1.0 + value),
                    Sensor::Delay => {
                        let first = own[0];
                        let late: Vec<f64> =
                            delayed(&own.iter().map(|y| y - first).collect::<Vec<_>>(), value / step);
                        own.iter_mut().zip(late).for_each(|(y, late)| *y = first + late);
                    }
                }
            }
            if let Some(offset) = output.offset {
                own.iter_mut().for_each(|y| *y += p[offset]);
            }
        }
    }

    fn fitted(&self, record: &Record) -> bool {
        self.study.windows.is_none() && record.initial == Initial::Word(InitialWord::Fit)
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
        let piece = &self.pieces[record];
        let record = &self.study.records[piece.record];
        if !self.fitted(record) {
            return Vec::new();
        }
        let one = |values: &Option<Vec<f64>>| match values {
            None => (0.0, 1e-5),
            Some(values) => {
                let size = values.iter().fold(0.0f64, |a, b| a.max(b.abs()));
                (values[piece.range.start], 1e-5 * size.max(1e-6))
            }
        };
        record.states.iter().map(one).collect()
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
        let mut blocks = self.blocks(parameters, false);
        self.simulate(&self.pieces[record], parameters, locals, &mut blocks)
    }

    fn measured(&self, record: usize) -> Vec<f64> {
        let piece = &self.pieces[record];
        let outputs = &self.study.records[piece.record].outputs;
        outputs.iter().flat_map(|values| values[piece.range.clone()].iter().copied()).collect()
    }

    fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
        let n = self.pieces[record].range.len();
        let measured = self.measured(record);
        measured.iter().zip(predicted).enumerate().map(|(i, (m, p))| (m - p) / self.scale[i / n]).collect()
    }

    fn redraw(&self, record: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        let n = self.pieces[record].range.len();
        let one = |i: usize| self.study.outputs[i / n].noise / self.scale[i / n];
        (0..predicted.len()).map(|i| one(i) * noise.normal()).collect()
    }
}
