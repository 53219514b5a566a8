//! Trajectories with phases: nominal samples of each phase beyond its ends, and a design across the events between
//! them.
//!
//! A plant that is off its plan meets an event earlier or later than planned. Between the two times the distance from
//! the plan is as large as the jump, whatever the controller does. So each phase has a nominal trajectory that goes on
//! before its begin and after its end, as the plant would without the event, and the mode of the plant tells which one
//! counts (Rijnen, Saccon and Nijmeijer, "On optimal trajectory tracking for mechanical systems with unilateral
//! constraints", CDC 2015). Distances before and after an event then belong together by the saltation matrix, to first
//! order:
//!
//! `Xi = DR + (f+ - DR f-) Dg / (Dg f-)`, with guard g, reset map R, and rates f- before and f+ after the event.

mod cycle;

use nalgebra::{DMatrix, RowDVector};

use super::controller::{Controller, PhaseRows, Row};
use super::nominal::{self, Knots};
use super::tvlqr::{Design, gains, row};
use super::{Error, Linearization, Nominal, Sampled};
use crate::transcription::{Point, Reset};

pub use cycle::{Monodromy, Periodic, Turn};

/// One phase of a plan.
pub struct Leg<'a> {
    /// The plant in this phase.
    pub plant: Sampled<'a>,
    /// Knots from its begin to its end.
    pub knots: Knots<'a>,
    /// Name for messages.
    pub name: &'a str,
}

/// Event that ends a phase.
pub struct Event {
    /// Output of the plant that passes through zero, by index.
    pub guard: usize,
    /// Reset map; none: the states are continuous.
    pub reset: Option<Box<dyn Reset>>,
}

/// Settings for following a plan with phases.
#[derive(Debug, Clone, PartialEq)]
pub struct Following {
    /// Mode of the plant in every phase; none: phases begin by time.
    pub modes: Option<Vec<i32>>,
    /// Time by which the nominal trajectory of a phase goes beyond its ends \[s\].
    pub overlap: f64,
    /// Time by which the regulator looks beyond the end of the plan \[s\].
    pub horizon: f64,
}

/// A plan with phases on the samples.
pub struct Phases<'a> {
    legs: Vec<Leg<'a>>,
    /// Rates at the knots of each leg.
    rates: Vec<Vec<Vec<f64>>>,
    /// Samples of each leg.
    own: Vec<std::ops::Range<usize>>,
    /// The samples of all legs in their order, and the hold at the end.
    pub nominal: Nominal,
}

impl<'a> Phases<'a> {
    /// Puts the knots of legs on common samples. Between knots the states are cubic with the rates of the plant;
    /// sampled states stand half a sample later, so that their held values have the mean of the plan.
    ///
    /// # Errors
    /// A phase without a sample, or functions without a value.
    pub fn new(mut legs: Vec<Leg<'a>>) -> Result<Phases<'a>, Error> {
        let (Some(first), Some(last)) = (legs.first(), legs.last()) else {
            return Err(Error::Trajectory("it has no phases".into()));
        };
        let (Some(&start), Some(&end)) = (first.knots.time.first(), last.knots.time.last()) else {
            return Err(Error::Trajectory("it has no knots".into()));
        };
        let h = first.plant.sample_time();
        let count = ((end - start) / h - 1e-6).ceil().max(0.0) as usize;
        let mut rates = Vec::new();
        let mut own: Vec<std::ops::Range<usize>> = Vec::new();
        for leg in &mut legs {
            let mut of_leg = Vec::new();
            for (k, state) in leg.knots.states.iter().enumerate() {
                of_leg.push(leg.rates(leg.knots.time[k], state, &leg.knots.inputs[k].clone())?);
            }
            rates.push(of_leg);
            let from = own.last().map_or(0, |before| before.end);
            let end = leg.knots.time.last().copied().unwrap_or(start);
            let to = (((end - start) / h - 1e-6).ceil().max(0.0) as usize).min(count);
            if to <= from {
                let problem =
                    format!("phase `{}` is shorter than a sample of {h} s; shorten the samples", leg.name);
                return Err(Error::Trajectory(problem));
            }
            own.push(from..to);
        }
        let nominal = Nominal { start, sample_time: h, states: Vec::new(), inputs: Vec::new(), rests: false };
        let mut phases = Phases { legs, rates, own, nominal };
        for leg in 0..phases.legs.len() {
            for k in phases.own[leg].clone() {
                let (state, input) = phases.sample(leg, k as i64)?;
                phases.nominal.states.push(state);
                phases.nominal.inputs.push(input);
            }
        }
        let size = nominal::size(&phases.nominal.states);
        let leg = phases.legs.last_mut().expect("there is one");
        let last = leg.knots.states[leg.knots.states.len() - 1].clone();
        let input = phases.nominal.inputs[count - 1].clone();
        let (state, input, rests) = nominal::rest(&mut leg.plant, end, last, input, &size)?;
        phases.nominal.states.push(state);
        phases.nominal.inputs.push(input);
        phases.nominal.rests = rests;
        Ok(phases)
    }

    /// Nominal states and inputs of a leg at sample `k`, beyond its ends as well.
    fn sample(&mut self, leg: usize, k: i64) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let (time, h) = (self.nominal.start + k as f64 * self.nominal.sample_time, self.nominal.sample_time);
        let mut state = self.legs[leg].state(&self.rates[leg], time)?;
        let held = self.legs[leg].plant.held().to_vec();
        if !held.is_empty() {
            let later = self.legs[leg].state(&self.rates[leg], time + 0.5 * h)?;
            held.iter().for_each(|&i| state[i] = later[i]);
        }
        if held.is_empty() {
            return Ok((state, self.legs[leg].knots.input(time + 0.5 * h)));
        }
        // The sample with the event leads to where the next leg begins.
        let ends = k + 1 == self.own[leg].end as i64 && leg + 1 < self.legs.len();
        let next = if ends { leg + 1 } else { leg };
        let after = self.legs[next].state(&self.rates[next], time + 1.5 * h)?;
        let input = self.legs[leg].knots.input(time + h);
        let input = self.legs[leg].plant.inputs_between(&state, &after, &input);
        Ok((state, input))
    }

    /// The leg after a leg; in a plan that repeats itself the last one is followed by the first.
    fn next(&self, leg: usize) -> usize {
        (leg + 1) % self.legs.len()
    }

    /// Saltation matrix of the event that ends a leg; rows of sampled states are those of the identity. From the event
    /// on the inputs are those of the next leg, or `inputs`.
    fn saltation(
        &mut self,
        leg: usize,
        event: &mut Event,
        inputs: Option<&[f64]>,
    ) -> Result<DMatrix<f64>, Error> {
        let knots = self.legs[leg].knots;
        let last = knots.time.len() - 1;
        let (time, x, u) = (knots.time[last], &knots.states[last], &knots.inputs[last]);
        let n = x.len();
        let dynamics = self.legs[leg].plant.dynamics();
        let size = dynamics.size();
        let (mut values, mut jacobian) =
            (vec![0.0; size.values()], vec![0.0; size.values() * size.arguments()]);
        let at = Point { time, states: x, inputs: u };
        dynamics.jacobian(at, &mut values, &mut jacobian).map_err(Error::at(time))?;
        let before = values[..n].to_vec();
        let guard = RowDVector::from_row_slice(&jacobian[(n + event.guard) * size.arguments()..][..n]);
        let speed: f64 = guard.iter().zip(&before).map(|(g, f)| g * f).sum();
        let scale: f64 = guard.iter().zip(&before).map(|(g, f)| (g * f).abs()).sum();
        if speed.abs() <= 1e-9 * scale {
            let name = &dynamics.names()[size.arguments() + event.guard];
            let problem = format!(
                "`{name}` does not pass through zero at the end of phase `{}` (t = {time} s), it touches it; plan a \
                 crossing, such as a landing with some velocity",
                self.legs[leg].name
            );
            return Err(Error::Trajectory(problem));
        }
        let mut jump = DMatrix::identity(n, n);
        if let Some(reset) = &mut event.reset {
            let of = reset.size();
            let rows = of.after + of.outputs;
            let (mut values, mut slopes) = (vec![0.0; rows], vec![0.0; rows * of.before]);
            reset.jacobian(x, &mut values, &mut slopes).map_err(Error::at(time))?;
            jump = DMatrix::from_row_slice(of.after, of.before, &slopes[..of.after * of.before]);
        }
        let following = self.next(leg);
        let next = &mut self.legs[following];
        let knots = next.knots;
        let after = next.rates(knots.time[0], &knots.states[0], inputs.unwrap_or(&knots.inputs[0]))?;
        let lost = &jump * DMatrix::from_column_slice(n, 1, &before);
        let mut added = DMatrix::from_column_slice(n, 1, &after) - lost;
        next.plant.held().iter().for_each(|&i| added[(i, 0)] = 0.0);
        Ok(jump + added * guard / speed)
    }

    /// The sample in which a leg ends, with the event inside; `inputs` as in [`Phases::saltation`].
    fn across(
        &mut self,
        leg: usize,
        k: usize,
        event: &mut Event,
        inputs: Option<&[f64]>,
    ) -> Result<Linearization, Error> {
        let saltation = self.saltation(leg, event, inputs)?;
        let (time, h) = (self.nominal.time(k), self.nominal.sample_time);
        let at = Point { time, states: &self.nominal.states[k], inputs: &self.nominal.inputs[k] };
        let end = self.legs[leg].knots.time[self.legs[leg].knots.time.len() - 1];
        let before = self.legs[leg].plant.flow(at, end - time)?;
        let following = self.next(leg);
        let mut state = self.legs[following].knots.states[0].clone();
        let next = &mut self.legs[following].plant;
        next.held().iter().for_each(|&i| state[i] = before.next[i]);
        let after = next.flow(Point { time: end, states: &state, inputs: at.inputs }, time + h - end)?;
        let carried = &after.a * saltation;
        let mut sample =
            Linearization { next: after.next, a: &carried * before.a, b: carried * before.b + after.b };
        next.hold(at, &mut sample);
        Ok(sample)
    }

    /// Designs the controller; `events` end all legs but the last. Also its rows at [`Phases::nominal`].
    ///
    /// # Errors
    /// Same as [`super::design`]; an event that is only touched.
    pub fn design(
        &mut self,
        mut events: Vec<Event>,
        following: &Following,
        design: &Design,
    ) -> Result<(Controller, Vec<Row>), Error> {
        design.check()?;
        let disturbed = design.disturbed();
        let (mut rows, mut linear) = (Vec::new(), Vec::new());
        for leg in 0..self.legs.len() {
            let own = self.own[leg].clone();
            let hold = leg + 1 == self.legs.len();
            for k in own.start..own.end + usize::from(hold) {
                let sample = match events.get_mut(leg).filter(|_| k + 1 == own.end) {
                    Some(event) => self.across(leg, k, event, None)?,
                    None => self.legs[leg].plant.linearize(point(&self.nominal, k))?,
                };
                let after = self.nominal.states.get(k + 1);
                let plant = &mut self.legs[leg].plant;
                rows.push(row(plant, point(&self.nominal, k), &sample, after, design, &disturbed)?);
                linear.push(sample);
            }
        }
        let horizon = (following.horizon / self.nominal.sample_time).ceil().max(1.0) as usize;
        gains(&mut rows, &linear, &self.nominal, design, Some(horizon))?;
        let (all, phases) = match &following.modes {
            None => (rows.clone(), Vec::new()),
            Some(modes) => self.beyond(&rows, modes, (following.overlap, design, &disturbed))?,
        };
        let (start, sample_time) = (self.nominal.start, self.nominal.sample_time);
        let limits = design.limits.clone();
        Ok((Controller { start, sample_time, rows: all, phases, repeat: None, limits }, rows))
    }

    /// Rows of every leg from before its begin to behind its end; beyond its own samples with the gains of the next of
    /// them.
    fn beyond(
        &mut self,
        chain: &[Row],
        modes: &[i32],
        (overlap, design, disturbed): (f64, &Design, &[usize]),
    ) -> Result<(Vec<Row>, Vec<PhaseRows>), Error> {
        let more = (overlap / self.nominal.sample_time).ceil().max(1.0) as usize;
        let (mut rows, mut phases) = (Vec::new(), Vec::new());
        let last_leg = self.legs.len() - 1;
        for (leg, &mode) in modes.iter().enumerate().take(self.legs.len()) {
            let own = self.own[leg].clone();
            let from = if leg == 0 { own.start } else { own.start.saturating_sub(more) } as i64;
            let to = if leg == last_leg { own.end } else { own.end + more } as i64;
            self.rows_of(leg, from..to, chain, (design, disturbed), &mut rows)?;
            let hold = (leg == last_leg).then(|| chain[chain.len() - 1].clone());
            phases.push(PhaseRows {
                mode,
                first_sample: from,
                rows: (to - from) as usize + usize::from(hold.is_some()),
            });
            rows.extend(hold);
        }
        Ok((rows, phases))
    }

    /// Rows of a leg at samples, with the gains of the nearest row of its own in `chain`.
    fn rows_of(
        &mut self,
        leg: usize,
        samples: std::ops::Range<i64>,
        chain: &[Row],
        (design, disturbed): (&Design, &[usize]),
        rows: &mut Vec<Row>,
    ) -> Result<(), Error> {
        let own = self.own[leg].clone();
        let mut now = self.sample(leg, samples.start)?;
        for k in samples {
            let next = self.sample(leg, k + 1)?;
            let time = self.nominal.start + k as f64 * self.nominal.sample_time;
            let at = Point { time, states: &now.0, inputs: &now.1 };
            let plant = &mut self.legs[leg].plant;
            let sample = plant.linearize(at)?;
            let mut one = row(plant, at, &sample, Some(&next.0), design, disturbed)?;
            let gains = &chain[k.clamp(own.start as i64, own.end as i64 - 1) as usize];
            (one.feedback, one.correction) = (gains.feedback.clone(), gains.correction.clone());
            rows.push(one);
            now = next;
        }
        Ok(())
    }
}

fn point(nominal: &Nominal, k: usize) -> Point<'_> {
    Point { time: nominal.time(k), states: &nominal.states[k], inputs: &nominal.inputs[k] }
}

impl Leg<'_> {
    fn rates(&mut self, time: f64, states: &[f64], inputs: &[f64]) -> Result<Vec<f64>, Error> {
        let dynamics = self.plant.dynamics();
        let size = dynamics.size();
        let mut values = vec![0.0; size.values()];
        dynamics.evaluate(Point { time, states, inputs }, &mut values).map_err(Error::at(time))?;
        values.truncate(size.states);
        Ok(values)
    }

    /// States at a time \[s\]: between the knots cubic with the rates there, beyond them by the plant under the inputs
    /// at the end.
    fn state(&mut self, rates: &[Vec<f64>], time: f64) -> Result<Vec<f64>, Error> {
        let Knots { time: knots, states, inputs, .. } = self.knots;
        let last = knots.len() - 1;
        if time < knots[0] || time > knots[last] {
            let end = if time < knots[0] { 0 } else { last };
            return self.beyond((knots[end], &states[end], &inputs[end]), time);
        }
        let k = knots.partition_point(|&knot| knot <= time).clamp(1, last) - 1;
        let length = knots[k + 1] - knots[k];
        let s = (time - knots[k]) / length;
        // Hermite's cubics.
        let (at_a, at_b) = ((1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s), s * s * (3.0 - 2.0 * s));
        let (by_a, by_b) = (length * s * (1.0 - s) * (1.0 - s), length * s * s * (s - 1.0));
        let of = |i: usize| {
            at_a * states[k][i] + at_b * states[k + 1][i] + by_a * rates[k][i] + by_b * rates[k + 1][i]
        };
        Ok((0..states[k].len()).map(of).collect())
    }

    /// The plant from a time on, or back, to another, by classical Runge-Kutta steps of at most a sample.
    fn beyond(&mut self, (from, state, inputs): (f64, &[f64], &[f64]), to: f64) -> Result<Vec<f64>, Error> {
        let steps = ((to - from).abs() / self.plant.sample_time()).ceil().max(1.0);
        let h = (to - from) / steps;
        let mut x = state.to_vec();
        let moved = |x: &[f64], k: &[f64], part: f64| -> Vec<f64> {
            x.iter().zip(k).map(|(x, k)| x + part * h * k).collect()
        };
        for step in 0..steps as usize {
            let t = from + step as f64 * h;
            let k1 = self.rates(t, &x, inputs)?;
            let k2 = self.rates(t + 0.5 * h, &moved(&x, &k1, 0.5), inputs)?;
            let k3 = self.rates(t + 0.5 * h, &moved(&x, &k2, 0.5), inputs)?;
            let k4 = self.rates(t + h, &moved(&x, &k3, 1.0), inputs)?;
            for (i, x) in x.iter_mut().enumerate() {
                *x += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
            }
        }
        Ok(x)
    }
}

#[cfg(test)]
mod tests;
