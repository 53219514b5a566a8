//! Answer of a system to a push at each place where something may be missing: it shows the velocity and the position
//! along a force without any statement.
//!
//! States of equations answer at once, in their rates. A slave only shows outputs: a simulation with pushed inputs
//! takes their place.

use std::cell::Cell;

use super::instance::PartInstance;
use super::{Plant, Problem};

/// Dependence of what moves in a system on the attachments, for the detection of ports.
#[derive(Debug, Clone, Default)]
pub struct Sense {
    /// Names of all that moves: the states, `[nx]`, then the outputs of slaves.
    pub names: Vec<String>,
    /// Whether its rates are exact: those of outputs are difference quotients.
    pub exact: Vec<bool>,
    /// Values and their rates at some points.
    pub points: Vec<(Vec<f64>, Vec<f64>)>,
    /// Change of each rate with the value at each attachment, `[attachments][names]`; only its proportions count.
    pub influence: Vec<Vec<f64>>,
    /// Derivative of the rate of each state by the value at each attachment, the largest of the points,
    /// `[attachments][nx]`.
    pub slopes: Vec<Vec<f64>>,
    /// Change of each measured signal at the same instant, `[attachments][measured]`.
    pub shown: Vec<Vec<f64>>,
    /// Change of the rate of each state with each state, `[nx][nx]`: state that is moved, then rate; only signs and
    /// proportions count. Empty for more than [`MAX_COUPLED_STATES`].
    pub coupling: Vec<Vec<f64>>,
}

/// States up to which it is seen how each depends on each.
pub const MAX_COUPLED_STATES: usize = 100;
/// Communication steps after a push.
const STEPS: usize = 60;
/// Steps after which values are compared with rates: late enough that half a step hardly counts.
const COMPARED: [usize; 2] = [40, 55];

impl Plant {
    /// Dependence of the rates: the system at some points, and the influence of every attachment, also on the signals
    /// `measured`.
    ///
    /// # Errors
    /// An FMU that fails.
    pub fn sense(&mut self, measured: &[&str]) -> Result<Sense, Problem> {
        let mut found = self.sense_states(measured)?;
        if !self.slaves().is_empty() {
            self.sense_slaves(measured, &mut found)?;
        }
        Ok(found)
    }

    /// The same for the states of equations.
    fn sense_states(&mut self, measured: &[&str]) -> Result<Sense, Problem> {
        let pass = |_: usize, value: f64, _: &[f64]| value;
        let (mut x, nx) = (vec![0.0; self.nx], self.nx);
        self.initialize(&[], &[], 0.0, &mut x, &pass)?;
        let start = x.clone();
        let attachments = self.parts.iter().flat_map(|part| &part.feeds).flat_map(|feed| &feed.blocks);
        let count = attachments.max().map_or(0, |last| last + 1);
        let places: Vec<usize> = measured.iter().filter_map(|name| self.slot(name)).collect();
        let none = |size: usize| vec![vec![0.0; size]; count];
        let mut found = Sense {
            names: self.states_by_place(),
            exact: vec![true; nx],
            points: Vec::new(),
            influence: none(nx),
            slopes: none(nx),
            shown: none(places.len()),
            coupling: if nx <= MAX_COUPLED_STATES { vec![vec![0.0; nx]; nx] } else { Vec::new() },
        };
        for round in 1..=3 {
            // Somewhere else, in no relation that a system could have by itself.
            for (i, value) in x.iter_mut().enumerate() {
                // Levels and pressures are not below zero.
                let odd = ((7 * i + 3 * round) as f64).sin().abs();
                *value = start[i] + odd * if start[i] == 0.0 { 0.1 } else { 0.05 * start[i].abs() };
            }
            let mut dx = vec![0.0; nx];
            self.evaluate(0.0, &x, &mut dx, &pass).map_err(Problem::fmu)?;
            if dx.iter().any(|rate| !rate.is_finite()) {
                continue;
            }
            let before: Vec<f64> = places.iter().map(|&slot| self.slots[slot]).collect();
            let ports = found.influence.iter_mut().zip(&mut found.slopes).zip(&mut found.shown);
            for (port, ((influence, slopes), shown)) in ports.enumerate() {
                let mut moved = vec![0.0; nx];
                let size = Cell::new(1.0);
                let push = |own: usize, value: f64, _: &[f64]| {
                    if own != port {
                        return value;
                    }
                    size.set(0.01 * value.abs().max(1.0));
                    value + size.get()
                };
                self.evaluate(0.0, &x, &mut moved, &push).map_err(Problem::fmu)?;
                let sums = influence.iter_mut().zip(slopes);
                for ((influence, slope), change) in sums.zip(moved.iter().zip(&dx).map(|(a, b)| a - b)) {
                    let change = if change.is_finite() { change } else { 0.0 };
                    *influence += change;
                    let own = change / size.get();
                    *slope = if own.abs() > slope.abs() { own } else { *slope };
                }
                let changes = places.iter().zip(&before).map(|(&slot, before)| self.slots[slot] - before);
                shown.iter_mut().zip(changes).for_each(|(sum, change)| {
                    *sum += if change.is_finite() { change } else { 0.0 };
                });
            }
            let mut moved = vec![0.0; nx];
            for (state, coupling) in found.coupling.iter_mut().enumerate() {
                let mut beside = x.clone();
                beside[state] += 0.01 * x[state].abs();
                // Nothing but an effect between two levels is lost without it.
                if self.evaluate(0.0, &beside, &mut moved, &pass).is_err() {
                    continue;
                }
                let changes = moved.iter().zip(&dx).map(|(a, b)| a - b);
                coupling.iter_mut().zip(changes).for_each(|(sum, change)| {
                    *sum += if change.is_finite() { change } else { 0.0 };
                });
            }
            found.points.push((x.clone(), dx));
        }
        self.initialized = true;
        Ok(found)
    }

    /// Adds the outputs of slaves, whose influences are seen after one communication step.
    fn sense_slaves(&mut self, measured: &[&str], found: &mut Sense) -> Result<(), Problem> {
        let mut slots: Vec<usize> = Vec::new();
        for part in self.parts.iter().filter(|part| matches!(part.instance, PartInstance::Stepped(_))) {
            slots.extend(part.early.1.clone());
        }
        let places: Vec<usize> = measured.iter().filter_map(|name| self.slot(name)).collect();
        let watched: Vec<usize> = slots.iter().chain(&places).copied().collect();
        let Some(step) = self.communication_step() else { return Ok(()) };
        let ports = found.influence.len();
        let rest = self.pushed(&watched, step, 1, &|_| 0.0)?;
        for port in 0..ports {
            let moved = self.pushed(&watched, step, 1, &|own| f64::from(u8::from(own == port)))?;
            let change = |i: usize| {
                let change = moved[1][i] - rest[1][i];
                if change.is_finite() { change } else { 0.0 }
            };
            found.influence[port].extend((0..slots.len()).map(|i| change(i) / step));
            for (i, shown) in found.shown[port].iter_mut().enumerate() {
                *shown += change(slots.len() + i);
            }
        }
        // All at once, in no proportion that a system could have by itself.
        let all = self.pushed(&slots, step, STEPS, &|own| 1.0 + (3.0 * own as f64).sin().abs())?;
        let points = COMPARED.map(|k| {
            let rate = |i: usize| (all[k + 1][i] - all[k - 1][i]) / (2.0 * step);
            (all[k].clone(), (0..slots.len()).map(rate).collect::<Vec<f64>>())
        });
        // States rest at the points of slaves, and slaves at those of states: neither is the rate of the other.
        let still = |count: usize| vec![f64::NAN; count];
        let states = found.names.len();
        for (x, dx) in &mut found.points {
            x.extend(still(slots.len()));
            dx.extend(still(slots.len()));
        }
        for (x, dx) in points {
            let (mut values, mut rates) = (still(states), still(states));
            values.extend(x);
            rates.extend(dx);
            found.points.push((values, rates));
        }
        let name = |slot: &usize| self.names.iter().find(|own| own.1 == slot).map(|own| own.0.clone());
        found.names.extend(slots.iter().map(|slot| name(slot).unwrap_or_default()));
        found.exact.extend(slots.iter().map(|_| false));
        Ok(())
    }

    /// Values of `slots` at the start and after each of some communication steps, with a push at the attachments in
    /// units of one percent.
    fn pushed(
        &mut self,
        slots: &[usize],
        step: f64,
        count: usize,
        push: &dyn Fn(usize) -> f64,
    ) -> Result<Vec<Vec<f64>>, Problem> {
        let block = |own: usize, value: f64, _: &[f64]| value + 0.01 * push(own) * value.abs().max(1.0);
        let (mut x, mut dx) = (vec![0.0; self.nx], vec![0.0; self.nx]);
        self.initialize(&[], &[], 0.0, &mut x, &block)?;
        let mut found = Vec::with_capacity(count + 1);
        for k in 0..=count {
            let time = k as f64 * step;
            if k > 0 {
                x.iter_mut().zip(&dx).for_each(|(x, dx)| *x += step * dx);
                self.event((time + 1e-9 * step, false), &mut x, &block).map_err(Problem::fmu)?;
            }
            self.evaluate(time, &x, &mut dx, &block).map_err(Problem::fmu)?;
            found.push(slots.iter().map(|&slot| self.slots[slot]).collect());
        }
        Ok(found)
    }
}
