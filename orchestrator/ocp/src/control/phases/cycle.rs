//! Plans that repeat themselves: gains of period one turn, and the multipliers of the turn, with the events in it.
//!
//! Distances from the plan at the begin of a turn and of the next belong together by the monodromy matrix, the product
//! of the samples' derivatives and of the saltation matrices between them, that of the return included. Its eigenvalues
//! are the Poincaré multipliers of the section at the begin of a turn. The section is a time, not an event: without
//! feedback the inputs are functions of time; with feedback the mode of the plant changes to the nominal trajectory of
//! the next phase, which goes on beyond its ends as a function of time (Hiskens and Pai, "Trajectory sensitivity
//! analysis of hybrid systems", IEEE Trans. Circuits Syst. I 47, 2000).

use nalgebra::{Complex, DMatrix, DVector};

use super::{Event, Following, Phases, point};
use crate::control::controller::{Controller, PhaseRows, Repeat, Row};
use crate::control::tvlqr::{Design, Measured, row};
use crate::control::{Error, Linearization, riccati};
use crate::transcription::Relabeling;
use airloop_optim::linalg::spectral;

/// Turns over which Riccati equations are followed at most, and the relative change at which they repeat themselves.
const MAX_TURNS: usize = 500;
const PERIODIC: f64 = 1e-10;
/// Part of a sample by which the period may miss a whole number of samples.
const MAX_PART_OF_SAMPLE: f64 = 1e-6;
/// Most turns after which states and inputs are back in their places.
const MAX_ORDER: usize = 12;

/// How a plan repeats itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Turn {
    /// States of the next turn in this one, `[n_x]`; factors are 1 or -1.
    pub states: Relabeling,
    /// The same of inputs, `[n_u]`.
    pub inputs: Relabeling,
    /// States that need not return.
    pub free: Vec<usize>,
    /// Turns that the nominal trajectory covers.
    pub count: usize,
}

/// Derivatives of the states at the begin of a turn by those at the begin of the one before, and their eigenvalues.
#[derive(Debug, Clone, PartialEq)]
pub struct Monodromy {
    /// The matrix, `[n_x, n_x]`.
    pub matrix: DMatrix<f64>,
    /// Poincaré multipliers, the largest first. Without feedback those of free states, which are 1, are left out.
    pub multipliers: Vec<Complex<f64>>,
}

/// A controller for a plan that repeats itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Periodic {
    /// The controller.
    pub controller: Controller,
    /// Its rows at the first samples of [`Phases::nominal`], over as many turns as bring all states back to their
    /// places.
    pub rows: Vec<Row>,
    /// The plan under its own inputs, as functions of time.
    pub open_loop: Monodromy,
    /// The plan under the regulator, all states known.
    pub closed_loop: Monodromy,
    /// Turns after which gains repeat themselves, followed back from the weights of the states.
    pub turns_to_periodic_gains: usize,
}

impl Turn {
    /// Gives states and inputs that exchange their places the largest of their weights, drifts and initial deviations.
    pub fn share(&self, design: &mut Design) {
        let share = |places: &Relabeling, values: &mut Vec<f64>| {
            for _ in 0..MAX_ORDER {
                let before = values.clone();
                values.iter_mut().zip(places).for_each(|(value, &(j, _))| *value = value.max(before[j]));
            }
        };
        share(&self.states, &mut design.state_deviation);
        share(&self.states, &mut design.state_drift);
        share(&self.states, &mut design.initial);
        share(&self.inputs, &mut design.input_deviation);
    }

    /// Gives sampled states, which no event moves, their new places.
    fn place_held(&self, held: &[usize], sample: &mut Linearization) {
        let (a, b, next) = (sample.a.clone(), sample.b.clone(), sample.next.clone());
        for &i in held {
            let (j, factor) = self.states[i];
            sample.a.set_row(i, &(a.row(j) * factor));
            sample.b.set_row(i, &(b.row(j) * factor));
            sample.next[i] = factor * next[j];
        }
    }

    /// Turns after which all states and inputs are back in their places.
    fn order(&self) -> Option<usize> {
        let back = |places: &Relabeling, turns: usize| {
            (0..places.len()).all(|start| {
                let once = |(at, sign): (usize, f64), _| (places[at].0, sign * places[at].1);
                (0..turns).fold((start, 1.0), once) == (start, 1.0)
            })
        };
        (1..=MAX_ORDER).find(|&turns| back(&self.states, turns) && back(&self.inputs, turns))
    }
}

/// `P` with `after = P before`; orthogonal.
fn matrix(places: &Relabeling) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(places.len(), places.len());
    places.iter().enumerate().for_each(|(i, &(j, factor))| matrix[(i, j)] = factor);
    matrix
}

/// Places of measured signals, which have to be states here.
fn measured_places(turn: &Turn, design: &Design) -> Result<Relabeling, Error> {
    let place = |signal: &Measured| {
        let Measured::State(state) = signal else {
            return Err("a measured signal is no state".to_owned());
        };
        let (before, factor) = turn.states[*state];
        let found = design.measured.iter().position(|one| *one == Measured::State(before));
        let found = found.filter(|&found| {
            let own = design.measured.iter().position(|one| one == signal);
            own.is_some_and(|own| design.noise[own] == design.noise[found])
        });
        Ok((
            found.ok_or("a state is measured, but the one in its place is not, or with other noise")?,
            factor,
        ))
    };
    let places: Result<Relabeling, String> = design.measured.iter().map(place).collect();
    places.map_err(|why| {
        Error::Trajectory(format!(
            "{why}; for a plan that repeats itself measure all states that exchange places"
        ))
    })
}

/// Maps of a row to the next turn.
struct Maps {
    states: DMatrix<f64>,
    inputs: DMatrix<f64>,
    measured: DMatrix<f64>,
    /// Change of the nominal states in a turn.
    advance: Vec<f64>,
}

impl Maps {
    /// The row one turn later.
    fn next(&self, row: &Row) -> Row {
        let Maps { states: p, inputs: q, measured: w, .. } = self;
        let placed = |map: &DMatrix<f64>, values: &[f64]| {
            (map * DVector::from_column_slice(values)).as_slice().to_vec()
        };
        let moved = DVector::from_column_slice(&self.advance);
        let states: Vec<f64> =
            placed(p, &row.states).iter().zip(&self.advance).map(|(x, by)| x + by).collect();
        let output = w * &row.output * p.transpose();
        let shown = &output * moved;
        let measured = placed(w, &row.measured).iter().zip(shown.iter()).map(|(y, by)| y + by).collect();
        Row {
            states,
            inputs: placed(q, &row.inputs),
            measured,
            feedback: q * &row.feedback * p.transpose(),
            correction: p * &row.correction * w.transpose(),
            a: p * &row.a * p.transpose(),
            b: p * &row.b * q.transpose(),
            drift: placed(p, &row.drift),
            output,
        }
    }
}

impl Phases<'_> {
    /// Designs the controller of a plan that repeats itself, with gains of period one turn; `events` end all legs, the
    /// last one with the return to the first. [`Phases::nominal`] goes on over the turns from then on.
    ///
    /// # Errors
    /// Same as [`Phases::design`]; a period that is no whole number of samples, or limits, weights and measured signals
    /// that change with the places of states and inputs.
    pub fn design_cycle(
        &mut self,
        mut events: Vec<Event>,
        following: &Following,
        design: &Design,
        turn: &Turn,
    ) -> Result<Periodic, Error> {
        design.check()?;
        let wrong = |problem: String| Error::Trajectory(problem);
        let period = self.period()?;
        let order = turn.order().ok_or_else(|| {
            wrong(format!("states and inputs are not back in their places after {MAX_ORDER} turns"))
        })?;
        if !design.disturbed().is_empty() {
            let problem = "disturbances of inputs are not estimated along a plan that repeats itself; set their drifts to 0";
            return Err(wrong(problem.into()));
        }
        check_places(turn, design)?;
        let held = self.legs[0].plant.held();
        if turn.states.iter().enumerate().any(|(i, (j, _))| held.contains(&i) != held.contains(j)) {
            return Err(wrong("a sampled state exchanges its place with one that is not".into()));
        }
        let mut rows = Vec::with_capacity(period);
        let mut linear: Vec<Linearization> = Vec::with_capacity(period);
        let mut alone = Vec::with_capacity(period);
        for (leg, event) in events.iter_mut().enumerate().take(self.legs.len()) {
            let own = self.own[leg].clone();
            for k in own.clone() {
                let sample = if k + 1 == own.end {
                    // Inputs that are functions of time do not know of the event.
                    let closes = leg + 1 == self.legs.len();
                    let inputs = self.legs[leg].knots.inputs.last().cloned().unwrap_or_default();
                    let turned = || turn.inputs.iter().map(|&(i, factor)| factor * inputs[i]).collect();
                    let inputs = if closes { turned() } else { inputs.clone() };
                    let held = self.legs[leg].plant.held().to_vec();
                    let mut both = [Some(&inputs[..]), None].map(|inputs| self.across(leg, k, event, inputs));
                    for sample in both.iter_mut().flatten().filter(|_| closes) {
                        turn.place_held(&held, sample);
                    }
                    let [own, with_mode] = both;
                    alone.push(own?.a);
                    with_mode?
                } else {
                    let sample = self.legs[leg].plant.linearize(point(&self.nominal, k))?;
                    alone.push(sample.a.clone());
                    sample
                };
                let after = self.nominal.states.get(k + 1).filter(|_| k + 1 < period);
                let plant = &mut self.legs[leg].plant;
                rows.push(row(plant, point(&self.nominal, k), &sample, after, design, &[])?);
                linear.push(sample);
            }
        }
        let turns_to_periodic_gains = regulate(&mut rows, &linear, design, self.nominal.start)?;
        estimate(&mut rows, design, self.nominal.sample_time, self.nominal.start)?;
        let first = &self.legs[0].knots.states[0];
        let last = self.legs.last().and_then(|leg| leg.knots.states.last()).unwrap_or(first);
        let mut advance = vec![0.0; first.len()];
        turn.free.iter().for_each(|&i| advance[i] = last[i] - first[i]);
        let maps = Maps {
            states: matrix(&turn.states),
            inputs: matrix(&turn.inputs),
            measured: matrix(&measured_places(turn, design)?),
            advance,
        };
        let open_loop = monodromy(alone.into_iter(), &turn.free);
        let closed = linear.iter().zip(&rows).map(|(sample, row)| &sample.a - &sample.b * &row.feedback);
        let closed_loop = monodromy(closed, &[]);
        let (modes, legs) = (following.modes.as_deref(), self.legs.len());
        let modes = modes.filter(|modes| modes.len() == legs || modes.len() == legs * order).ok_or_else(|| {
            wrong(format!(
                "a plan of {legs} phases that is back in its places after {order} turns needs the output that tells \
                 the phase, with its value in each of the {legs} or {} phases",
                legs * order
            ))
        })?;
        if (0..modes.len()).any(|i| modes[i] == modes[(i + 1) % modes.len()]) {
            let problem = "phases that follow each other have the same value of the output that tells them; nothing \
                           would tell the next from the one before";
            return Err(wrong(problem.into()));
        }
        let (table, phases) = self.turns(&rows, (period, order, modes), following.overlap, design, &maps)?;
        let advance: Vec<f64> = maps.advance.iter().map(|by| by * order as f64).collect();
        let mut all = rows;
        for _ in 1..order {
            let next: Vec<Row> = all[all.len() - period..].iter().map(|row| maps.next(row)).collect();
            all.extend(next);
        }
        self.go_on(&all, &advance, period * turn.count);
        let (start, sample_time) = (self.nominal.start, self.nominal.sample_time);
        let repeat = Some(Repeat { samples: period * order, advance });
        let controller =
            Controller { start, sample_time, rows: table, phases, repeat, limits: design.limits.clone() };
        Ok(Periodic { controller, rows: all, open_loop, closed_loop, turns_to_periodic_gains })
    }

    /// Samples of a turn.
    fn period(&self) -> Result<usize, Error> {
        let (start, h) = (self.nominal.start, self.nominal.sample_time);
        let end = self.legs.last().and_then(|leg| leg.knots.time.last()).copied().unwrap_or(start);
        let samples = (end - start) / h;
        if (samples - samples.round()).abs() > MAX_PART_OF_SAMPLE {
            return Err(Error::Trajectory(format!(
                "it repeats itself after {:.9} s, which is no whole number of samples of {h} s; choose durations that \
                 add up to one",
                end - start
            )));
        }
        Ok(self.nominal.samples())
    }

    /// Rows of all legs of `order` turns, from before their begins to behind their ends, with the gains of the chain.
    fn turns(
        &mut self,
        chain: &[Row],
        (period, order, modes): (usize, usize, &[i32]),
        overlap: f64,
        design: &Design,
        maps: &Maps,
    ) -> Result<(Vec<Row>, Vec<PhaseRows>), Error> {
        let more = (overlap / self.nominal.sample_time).ceil().max(1.0) as usize;
        let (mut rows, mut phases) = (Vec::new(), Vec::new());
        for (leg, &mode) in modes.iter().enumerate().take(self.legs.len()) {
            let own = self.own[leg].clone();
            let (from, to) = (own.start as i64 - more as i64, own.end as i64 + more as i64);
            self.rows_of(leg, from..to, chain, (design, &[]), &mut rows)?;
            phases.push(PhaseRows { mode, first_sample: from, rows: (to - from) as usize });
        }
        let (of_turn, legs) = (rows.len(), self.legs.len());
        for turn in 1..order {
            let next: Vec<Row> = rows[rows.len() - of_turn..].iter().map(|row| maps.next(row)).collect();
            rows.extend(next);
            for leg in 0..legs {
                let first_sample = phases[leg].first_sample + (turn * period) as i64;
                let mode = modes[(turn * legs + leg) % modes.len()];
                phases.push(PhaseRows { mode, first_sample, ..phases[leg] });
            }
        }
        Ok((rows, phases))
    }

    /// Repeats the nominal trajectory, of which `rows` have the first turns, up to a number of samples and the one
    /// after.
    fn go_on(&mut self, rows: &[Row], advance: &[f64], samples: usize) {
        let at = |k: usize| -> (Vec<f64>, Vec<f64>) {
            let (row, times) = (&rows[k % rows.len()], (k / rows.len()) as f64);
            (row.states.iter().zip(advance).map(|(x, by)| x + times * by).collect(), row.inputs.clone())
        };
        (self.nominal.states, self.nominal.inputs) = (0..=samples).map(at).unzip();
        self.nominal.rests = false;
    }
}

/// Weights and limits have to be those of the places.
fn check_places(turn: &Turn, design: &Design) -> Result<(), Error> {
    let same = |what: &str, places: &Relabeling, values: &[f64]| match places
        .iter()
        .enumerate()
        .find(|&(i, &(j, _))| values[i] != values[j])
    {
        None => Ok(()),
        Some((i, &(j, _))) => Err(Error::Trajectory(format!(
            "{what} {} and {} exchange their places from turn to turn, but have {} and {}; give both the same",
            i + 1,
            j + 1,
            values[i],
            values[j]
        ))),
    };
    let (low, high): (Vec<f64>, Vec<f64>) = design.limits.iter().copied().unzip();
    let turned = |i: usize, factor: f64| if factor < 0.0 { (-high[i], -low[i]) } else { (low[i], high[i]) };
    if turn.inputs.iter().zip(&design.limits).any(|(&(i, factor), own)| turned(i, factor) != *own) {
        let problem =
            "inputs exchange their places from turn to turn, but have other limits there; give them the same";
        return Err(Error::Trajectory(problem.into()));
    }
    same("the deviations of inputs", &turn.inputs, &design.input_deviation)?;
    same("the deviations of states", &turn.states, &design.state_deviation)?;
    same("the drifts of states", &turn.states, &design.state_drift)
}

/// Product of the samples' derivatives; multipliers of `free` states are left out.
fn monodromy(samples: impl Iterator<Item = DMatrix<f64>>, free: &[usize]) -> Monodromy {
    let matrix = samples.reduce(|product, sample| sample * product).unwrap_or_else(|| DMatrix::zeros(0, 0));
    let others = matrix.clone().remove_rows_at(free).remove_columns_at(free);
    let mut multipliers = spectral::eigenvalues(&others);
    multipliers.sort_by(|a, b| b.norm().total_cmp(&a.norm()).then(b.im.total_cmp(&a.im)));
    Monodromy { matrix, multipliers }
}

/// Gains of period one turn; gives the turns after which they repeat themselves.
fn regulate(rows: &mut [Row], linear: &[Linearization], design: &Design, time: f64) -> Result<usize, Error> {
    let weights = |deviations: &[f64]| {
        DMatrix::from_diagonal(&DVector::from_iterator(
            deviations.len(),
            deviations.iter().map(|d| 1.0 / (d * d)),
        ))
    };
    let (q, r) = (weights(&design.state_deviation), weights(&design.input_deviation));
    let unstable = Error::Riccati {
        what: "the regulator has no gains that repeat themselves",
        time,
        why: "the inputs do not reach every state that is not stable by itself, or such a state has no weight",
        remedy: "weights",
    };
    let mut p = q.clone();
    for turns in 1..=MAX_TURNS {
        let before = p.clone();
        for (row, sample) in rows.iter_mut().zip(linear).rev() {
            let Some(gain) = riccati::gain(&sample.a, &sample.b, &p, &r) else { return Err(unstable) };
            p = riccati::cost_before((&sample.a, &sample.b), &gain, &p, (&q, &r));
            row.feedback = gain;
        }
        if (&p - before).norm() <= PERIODIC * p.norm() {
            return Ok(turns);
        }
    }
    Err(unstable)
}

/// Corrections of period one turn.
fn estimate(rows: &mut [Row], design: &Design, sample_time: f64, time: f64) -> Result<(), Error> {
    let squares = |values: &[f64], factor: f64| {
        DMatrix::from_diagonal(&DVector::from_iterator(values.len(), values.iter().map(|v| factor * v * v)))
    };
    let (q, r) = (squares(&design.state_drift, sample_time), squares(&design.noise, 1.0));
    let unseen = Error::Riccati {
        what: "the estimator has no gains that repeat themselves",
        time,
        why: "the measured signals do not show every state that is not stable by itself",
        remedy: "measured signals or drifts",
    };
    let mut p = squares(&design.initial, 1.0);
    for _ in 0..MAX_TURNS {
        let before = p.clone();
        for row in rows.iter_mut() {
            let Some(correction) = riccati::correction(&p, &row.output, &r) else { return Err(unseen) };
            row.correction = correction;
            p = riccati::corrected(&p, &row.correction, &row.output, &r);
            p = riccati::predicted(&p, &row.a, &q);
        }
        if (&p - before).norm() <= PERIODIC * p.norm() {
            return Ok(());
        }
    }
    Err(unseen)
}
