//! Pieces of records, simulated: the system with the blocks of some candidates.

use std::cell::{Cell, RefCell};
use std::ops::Range;
use std::sync::Arc;

use super::blocks::{Acting, Blocks, Survey};
use super::command::{PARTS, in_parts, means};
use super::declaration::{Initial, InitialWord};
use super::driven::Driven;
use super::law::{Law, Point};
use super::memory::Memory;
use super::model::{Action, Study, Target};
use super::plant::Plant;
use super::plant::past::Before;
use super::read::Record;
use super::remembered::Remembered;

/// State events in one step from which on the rest of it is integrated without: a part that rests between two of them.
const MAX_EVENTS_PER_STEP: usize = 20;

/// Slopes of the four stages, and a trial point.
type Slopes = [Vec<f64>; 5];

/// Rates of the system at a time and a point.
type Rates<'a> = dyn Fn(&mut Plant, f64, &[f64], &mut [f64]) -> Result<(), airloop_fmi::Error> + 'a;

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
    /// Divisors of the residuals, one number for each output.
    pub scale: Vec<f64>,
    /// Steps of second order instead of fourth, at half the cost.
    pub quick: bool,
    /// Runge-Kutta steps per sample.
    pub substeps: usize,
    /// Measured initial states without what smoothing adds to them; otherwise as the study says.
    pub corrected: bool,
    /// Residuals without what noise of the states gives that windows start from.
    pub white: bool,
    /// States at the start of each piece, `[pieces][nx]`: local parameters that are fitted along. Empty: pieces start
    /// as the study says.
    pub begins: Vec<Vec<f64>>,
    /// By state, whether it stays as it is in `begins`; empty: none does.
    pub held: Vec<bool>,
    /// Simulations that were run before, of these and other pieces with these and other candidates.
    pub remembered: Arc<Remembered>,
}

/// Values added to measured signals.
#[derive(Debug, Clone, Default)]
pub struct Shift {
    /// To initial states where they are measured, `[nx][n]`; empty: nothing.
    pub states: Vec<Option<Vec<f64>>>,
    /// To system inputs, `[inputs][n]`; empty: nothing.
    pub inputs: Vec<Option<Vec<f64>>>,
    /// To further signals, `[extra][n]`; empty: nothing.
    pub extra: Vec<Option<Vec<f64>>>,
}

/// Adds where there is something to add.
fn add(values: &mut [f64], own: Option<&Option<Vec<f64>>>) {
    if let Some(Some(own)) = own {
        values.iter_mut().zip(own).for_each(|(value, shift)| *value += shift);
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
                let states = match law {
                    Law::Own(index) => study.own[index].states.len(),
                    Law::Surface(_) => 0,
                    Law::Memory(kind) => kind.states(),
                    _ => 1,
                };
                laws[tap].push((law, own.entries.clone(), count..count + states));
                count += states;
                if let Some(into) = own.into {
                    laws[into].push((Law::Caught(tap), own.entries.clone(), count..count));
                }
            }
        }
        laws.iter_mut().for_each(|own| own.sort_by_key(|(law, ..): &Acting| law.rank()));
        // Coulomb friction that is fitted with the velocity of its sign change gives it to all friction there.
        let fitted = |laws: &[Acting]| {
            let own = laws.iter().find(|(law, range, _)| *law == Law::Coulomb && range.len() == 2);
            own.map(|(_, range, _)| p[range.start + 1])
        };
        let vt = study.taps.iter().zip(&laws).map(|(tap, own)| fitted(own).unwrap_or(tap.vt)).collect();
        let seen = [(f64::INFINITY, f64::NEG_INFINITY); 5];
        let survey = survey
            .then(|| RefCell::new(Survey { ranges: vec![seen; study.taps.len()], ..Survey::default() }));
        let mut blocks = Blocks {
            study,
            p,
            laws,
            vt,
            z: vec![0.0; count],
            memories: (0..count).map(|_| Memory::default()).collect(),
            time: 0.0,
            now: Cell::new(0.0),
            seen: vec![Cell::new(0.0); study.taps.len()],
            within: vec![[Cell::new(Point::default()), Cell::new(Point::default())]; study.taps.len()],
            survey,
            trace: Vec::new(),
            states: Vec::new(),
            offset: Cell::new(0.0),
            linear: None,
        };
        blocks.rest();
        blocks
    }

    /// Ranges of what passes the attachments in a simulation of all pieces.
    pub fn survey(&self, p: &[f64], locals: &[Vec<f64>]) -> Survey {
        let mut found = Survey::default();
        for (piece, locals) in self.pieces.iter().zip(locals) {
            let mut blocks = self.blocks(p, true);
            self.simulate(piece, p, locals, &mut blocks, &Shift::default());
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

    /// Outputs of a piece without the effects of the sensors, one after the other; NaN from where the simulation cannot
    /// go on.
    pub(super) fn simulate(
        &self,
        piece: &Piece,
        p: &[f64],
        locals: &[f64],
        blocks: &mut Blocks,
        shift: &Shift,
    ) -> Vec<f64> {
        let n = piece.range.len();
        let mut out = vec![f64::NAN; n * self.study.outputs.len()];
        let mut run = || -> Result<(), super::Problem> {
            let mut plant = self.study.take()?;
            self.run(&mut plant, piece, p, locals, (&mut *blocks, shift), &mut out)?;
            self.study.give(plant);
            Ok(())
        };
        if let Err(problem) = run() {
            self.study.failed(&problem);
        }
        out
    }

    /// Whether pieces of a record are simulated from its beginning, so that those of a whole record hold all of them.
    pub(super) fn begins_with_record(&self, record: usize) -> bool {
        self.begins.is_empty() && self.study.from_start(&self.study.records[record])
    }

    /// Sample at which the simulation of a piece begins.
    pub(super) fn begin(&self, piece: &Piece) -> usize {
        if self.begins_with_record(piece.record) { 0 } else { piece.range.start }
    }

    /// Commands of a record with the effects that have a memory: the past before it, and it; and where effects let them
    /// move between its samples, the values halfway.
    fn inputs(&self, record: &Record, p: &[f64], shift: &Shift) -> [Vec<Option<Vec<f64>>>; 2] {
        let mut inputs = record.past.clone();
        let mut middles = vec![None; inputs.len()];
        for (index, (values, own)) in inputs.iter_mut().zip(&record.inputs).enumerate() {
            if let (Some(values), Some(own)) = (values, own) {
                let past = values.len();
                values.extend(own);
                add(&mut values[past..], shift.inputs.get(index));
            }
        }
        let mut commands: Vec<_> = self
            .active
            .iter()
            .map(|&c| &self.study.candidates[c])
            .filter_map(|own| match own.action {
                Action::Command { kind, input } => Some((kind, input, own.entries.clone())),
                _ => None,
            })
            .collect();
        commands.sort_by_key(|(kind, ..)| kind.rank());
        // Of the record, in parts of its samples.
        let mut fine: Vec<Option<Vec<f64>>> = vec![None; inputs.len()];
        for (kind, input, entries) in commands {
            let Some(values) = &mut inputs[input] else { continue };
            let (held, p) = (self.study.held[input], &p[entries]);
            let before = record.past[input].as_ref().map_or(0, Vec::len);
            if kind.moves_between_samples() {
                // It begins settled, as its block in the amended system does.
                let (own, held) = match fine[input].take() {
                    Some(own) => (own, false),
                    None => (in_parts(&values[before..], held), held),
                };
                fine[input] = Some(kind.apply(p, &own, record.step / PARTS as f64, held));
            } else {
                let own = kind.apply(p, values, record.step, held);
                values.copy_from_slice(&own);
            }
        }
        for (input, fine) in fine.into_iter().enumerate() {
            let (Some(fine), Some(values)) = (fine, &mut inputs[input]) else { continue };
            let past = values.len() - fine.len() / PARTS;
            let samples = fine.iter().step_by(PARTS);
            values[past..].iter_mut().zip(samples).for_each(|(value, own)| *value = *own);
            // Such that the integration sees the mean: this share of what the middle is off the line, by Simpson's
            // rule or by midpoints.
            let substeps = self.substeps_with(p, record.step) as f64;
            let seen = 2.0 / 3.0 + if self.quick { 1.0 / (3.0 * substeps.powi(2)) } else { 0.0 };
            let ends = values[past..].iter().zip(values[past + 1..].iter().chain(values.last()));
            let middle = |(mean, (from, to)): (f64, (&f64, &f64))| {
                let line = 0.5 * (from + to);
                line + (mean - line) / seen
            };
            middles[input] = Some(means(&fine).zip(ends).map(middle).collect());
        }
        [inputs, middles]
    }

    fn run(
        &self,
        plant: &mut Plant,
        piece: &Piece,
        p: &[f64],
        locals: &[f64],
        (blocks, shift): (&mut Blocks, &Shift),
        out: &mut [f64],
    ) -> Result<(), super::Problem> {
        let study = self.study;
        let record = &study.records[piece.record];
        let [inputs, middles] = self.inputs(record, p, shift);
        let count = self.substeps_with(p, record.step);
        let past = record.past.iter().flatten().map(Vec::len).next().unwrap_or(0);
        let mut extra = record.extra.clone();
        extra.iter_mut().enumerate().for_each(|(index, values)| add(values, shift.extra.get(index)));
        let nx = plant.nx;
        let (mut x, mut dx): (Vec<f64>, Slopes) = (vec![0.0; nx], std::array::from_fn(|_| vec![0.0; nx]));
        let mut saved = vec![0.0; nx];
        let (n, step) = (piece.range.len(), record.step);
        let window = study.window(step);
        let held: Vec<bool> =
            study.held.iter().zip(&middles).map(|(own, middles)| *own && middles.is_none()).collect();
        let mut driven = Driven::new(&inputs, &middles, &held, (past, record.n));
        let held_signal = |index: usize| study.sensors.signals[2][index].as_ref().is_some_and(|own| own.hold);
        let mut shown = Driven::further(&extra, held_signal, (plant.extra_first, record.n));
        let own = !self.begins.is_empty();
        let begin = self.begin(piece);
        blocks.time = begin as f64 * step;
        blocks.now.set(blocks.time);
        let mut fixed = self.parameters(p);
        fixed.extend(&record.parameters);
        let given: Vec<Option<f64>> = match &record.initial {
            _ if own || window.is_some() => Vec::new(),
            Initial::Word(InitialWord::Fit) => locals.iter().copied().map(Some).collect(),
            Initial::Given(values) => {
                let mut given = vec![None; nx];
                for (name, value) in values {
                    if let Some(state) = plant.state(name) {
                        given[state] = Some(*value);
                    }
                }
                given
            }
            Initial::Word(_) => (0..nx).map(|i| self.measured_state((record, begin), i, shift)).collect(),
        };
        let pass = |tap, value, slots: &[f64]| blocks.pass(tap, value, slots);
        let follows_outputs = self.active.iter().any(|&c| match study.candidates[c].action {
            Action::Block { law, .. } => !law.changes_command(),
            _ => false,
        });
        plant.keep_pace(step, follows_outputs);
        let ahead = plant.communication_step().map_or(0.0, |own| 0.5 * own);
        driven.at(begin);
        driven.set(&mut plant.slots, ahead / step);
        shown.at(begin);
        shown.set(&mut plant.slots, 0.0);
        let before = Before { inputs: &inputs, held: &held, end: past + begin, most: n, step };
        plant.initialize_after(&before, &given, &fixed, begin as f64 * step, &mut x, &pass)?;
        if own {
            // They are those behind the events of the first sample.
            x.copy_from_slice(locals);
        }
        // Events within this time of each other are one.
        let near = 1e-6 * step;
        let due = |plant: &Plant, until: f64| plant.next_event().filter(|next| *next <= until);
        let restarts = |k: usize| !own && window.is_some_and(|window| (k - begin).is_multiple_of(window));
        for k in begin..piece.range.end {
            let j = k.checked_sub(piece.range.start);
            if restarts(k) {
                self.measured_states((record, k), shift, &mut x);
                plant.moved();
            }
            let t = k as f64 * step;
            driven.at(k);
            shown.at(k);
            // Sums of steps are not their multiples to the last bit.
            blocks.time = t;
            let at = |plant: &mut Plant, time: f64, x: &[f64], dx: &mut [f64], blocks: &Blocks| {
                driven.set(&mut plant.slots, (time - t) / step);
                shown.set(&mut plant.slots, (time - t) / step);
                blocks.now.set(time);
                plant.evaluate(time, x, dx, &|tap, value, slots| blocks.pass(tap, value, slots))
            };
            let event = |plant: &mut Plant, (time, state): (f64, bool), x: &mut [f64], blocks: &Blocks| {
                // A slave holds a moving input at its mean over the communication step.
                driven.set(&mut plant.slots, (time - t + ahead) / step);
                shown.set(&mut plant.slots, (time - t) / step);
                blocks.now.set(time);
                plant.event((time, state), x, &|tap, value, slots| blocks.pass(tap, value, slots))
            };
            if let Some(time) = due(plant, t + near) {
                event(plant, (time.max(t), false), &mut x, blocks).map_err(super::Problem::fmu)?;
            }
            at(plant, t, &x, &mut dx[0], blocks).map_err(super::Problem::fmu)?;
            if let Some(j) = j {
                for (o, output) in study.outputs.iter().enumerate() {
                    out[o * n + j] = plant.slots[output.slot];
                }
            }
            if !blocks.trace.is_empty() && j.is_some() {
                blocks.states.push(x.clone());
            }
            if j.is_some() {
                for tap in 0..blocks.trace.len() {
                    let point = blocks.point(tap, &plant.slots);
                    blocks.trace[tap].push(point);
                }
            }
            let move_to = |plant: &mut Plant, (from, to): (f64, f64), x: &mut [f64], dx: &mut Slopes| {
                let at =
                    |plant: &mut Plant, time: f64, x: &[f64], dx: &mut [f64]| at(plant, time, x, dx, blocks);
                let edge = |i: usize| from + (to - from) * i as f64 / count as f64;
                for i in 0..count {
                    // The slopes of a single step are there.
                    if count > 1 {
                        at(plant, edge(i), x, &mut dx[0])?;
                    }
                    self.step(&at, plant, (edge(i), edge(i + 1)), x, dx)?;
                }
                Ok(())
            };
            if let Some(linear) = &blocks.linear {
                let mut linear = linear.borrow_mut();
                let tap = linear.tap;
                let point = |plant: &Plant| {
                    let value = blocks.seen[tap].get();
                    Point { time: blocks.now.get(), value, ..blocks.point(tap, &plant.slots) }
                };
                linear
                    .record(&x, restarts(k), |from, offset, to, shown| {
                        blocks.offset.set(offset);
                        to.copy_from_slice(from);
                        at(plant, t, to, &mut dx[0], blocks)?;
                        let outputs = shown.iter_mut().zip(&study.outputs);
                        outputs.for_each(|(shown, output)| *shown = plant.slots[output.slot]);
                        let begin = point(plant);
                        if k + 1 == piece.range.end {
                            return Ok([begin; 2]);
                        }
                        move_to(plant, (t, t + step), to, &mut dx)?;
                        if offset == 0.0 && from == x {
                            at(plant, t + step, to, &mut dx[0], blocks)?;
                        }
                        Ok([begin, point(plant)])
                    })
                    .map_err(super::Problem::fmu)?;
                blocks.offset.set(0.0);
                at(plant, t, &x, &mut dx[0], blocks).map_err(super::Problem::fmu)?;
            }
            if k + 1 < piece.range.end {
                let (mut from, end) = (t, t + step);
                let (mut events, mut before) = (0, std::mem::take(&mut saved));
                loop {
                    let between = due(plant, end - near).filter(|time| *time > from);
                    let mut to = between.unwrap_or(end);
                    before.copy_from_slice(&x);
                    move_to(plant, (from, to), &mut x, &mut dx).map_err(super::Problem::fmu)?;
                    if x.iter().any(|value| !value.is_finite()) {
                        return Ok(());
                    }
                    let mut state = false;
                    if plant.has_state_events() && events < MAX_EVENTS_PER_STEP {
                        let crossed = |plant: &mut Plant, to: f64, x: &mut [f64], dx: &mut Slopes| {
                            x.copy_from_slice(&before);
                            move_to(plant, (from, to), x, dx)?;
                            at(plant, to, x, &mut dx[1], blocks)?;
                            plant.crossed()
                        };
                        state = crossed(plant, to, &mut x, &mut dx).map_err(super::Problem::fmu)?;
                        let (mut low, mut high) = (from, to);
                        while state && high - low > near {
                            let middle = 0.5 * (low + high);
                            match crossed(plant, middle, &mut x, &mut dx).map_err(super::Problem::fmu)? {
                                true => high = middle,
                                false => low = middle,
                            }
                        }
                        if state {
                            to = high;
                            crossed(plant, to, &mut x, &mut dx).map_err(super::Problem::fmu)?;
                        }
                    }
                    if between.is_none() && !state {
                        break;
                    }
                    events += usize::from(state);
                    event(plant, (to, state), &mut x, blocks).map_err(super::Problem::fmu)?;
                    if to >= end {
                        break;
                    }
                    at(plant, to, &x, &mut dx[0], blocks).map_err(super::Problem::fmu)?;
                    from = to;
                }
                saved = before;
                plant.step_done().map_err(super::Problem::fmu)?;
            }
            blocks.advance(step);
        }
        Ok(())
    }

    /// One Runge-Kutta step between two times; the first slopes are there.
    fn step(
        &self,
        at: &Rates,
        plant: &mut Plant,
        (from, to): (f64, f64),
        x: &mut [f64],
        [d1, d2, d3, d4, trial]: &mut Slopes,
    ) -> Result<(), airloop_fmi::Error> {
        if plant.rests() {
            return Ok(());
        }
        let length = to - from;
        let mut stage = |part: f64, slope: &[f64], found: &mut [f64], x: &[f64]| {
            for (i, value) in trial.iter_mut().enumerate() {
                *value = x[i] + part * length * slope[i];
            }
            at(plant, from + part * length, trial, found)
        };
        stage(0.5, d1, d2, x)?;
        if self.quick {
            x.iter_mut().zip(d2.iter()).for_each(|(x, slope)| *x += length * slope);
            return Ok(());
        }
        stage(0.5, d2, d3, x)?;
        stage(1.0, d3, d4, x)?;
        for (i, value) in x.iter_mut().enumerate() {
            *value += length / 6.0 * (d1[i] + 2.0 * (d2[i] + d3[i]) + d4[i]);
        }
        Ok(())
    }

    /// Puts the states to where they are measured at sample `k`; the others go on, as do those of effects.
    fn measured_states(&self, at: (&Record, usize), shift: &Shift, x: &mut [f64]) {
        for (i, x) in x.iter_mut().enumerate() {
            *x = self.measured_state(at, i, shift).unwrap_or(*x);
        }
    }

    /// State `i` at sample `k`, if it is measured.
    fn measured_state(&self, (record, k): (&Record, usize), i: usize, shift: &Shift) -> Option<f64> {
        let values = record.states.get(i)?.as_ref()?;
        let added = shift.states.get(i).and_then(|own| own.as_ref()).map_or(0.0, |own| own[k]);
        let smoothed = record.smoothed.get(i).filter(|_| self.corrected);
        let smoothed = smoothed.and_then(Option::as_ref).map_or(0.0, |own| own[k]);
        Some(values[k] + added - smoothed)
    }

    /// Signals that the laws at each attachment depend on, `[taps][n]`; shorter where the simulation cannot go on.
    pub fn trace(&self, record: usize, p: &[f64], locals: &[f64]) -> Vec<Vec<Point>> {
        self.traced(record, p, locals).0
    }

    /// The same with the states, `[n][nx]`; none where there is no attachment.
    pub fn traced(&self, record: usize, p: &[f64], locals: &[f64]) -> (Vec<Vec<Point>>, Vec<Vec<f64>>) {
        let mut blocks = self.blocks(p, false);
        blocks.trace = vec![Vec::new(); self.study.taps.len()];
        self.simulate(&self.pieces[record], p, locals, &mut blocks, &Shift::default());
        (blocks.trace, blocks.states)
    }

    /// Values of the parameters of the system.
    pub fn parameters(&self, p: &[f64]) -> Vec<(super::plant::Parameter, f64)> {
        let declared = self.study.entries.iter().zip(p).filter_map(|(entry, value)| match entry.target {
            Target::Declared(parameter) => Some((parameter, *value)),
            Target::Correction { parameter, declared } if *value != 0.0 => {
                Some((parameter, declared * (1.0 + value)))
            }
            _ => None,
        });
        self.study.fixed.iter().copied().chain(declared).collect()
    }
}
