//! The candidates of the rig: every effect of the vocabulary that the records of a case can show.

use std::collections::BTreeSet;

use super::parameters::*;
use crate::case::{Declared, Kind};
use crate::engine::candidate::{Candidate, Start};
use crate::engine::fit::Free;

/// Facts of a case that decide which candidates its records can show.
#[derive(Debug, Clone)]
pub struct Scope<'a> {
    /// Declared parameters, for passivity bounds.
    pub declared: &'a Declared,
    /// Which part of the rig is recorded.
    pub kind: Kind,
    /// Measured signals besides the command.
    pub signals: BTreeSet<&'a str>,
    /// Largest command \[N\] and range of positions \[m\] of the estimation records.
    pub command: f64,
    /// See `command`.
    pub positions: (f64, f64),
}

/// A free parameter with the bounds of the table.
pub fn free(index: usize) -> Free {
    let definition = &TABLE[index];
    Free { index, bounds: definition.bounds, step: 0.01 * definition.scale, prior: None }
}

fn linear(id: &'static str, channel: &'static str, indices: &[usize]) -> Candidate {
    let starts = vec![Start { values: Vec::new(), open: (0..indices.len()).collect(), idle: true }];
    Candidate {
        id,
        channel,
        signal: None,
        free: indices.iter().map(|&i| free(i)).collect(),
        starts,
        place: 0,
        contains: None,
    }
}

/// One shape parameter (the last index) on a grid, the others found by the linear step.
fn shaped(id: &'static str, channel: &'static str, indices: &[usize], grid: &[f64]) -> Candidate {
    let shape = indices[indices.len() - 1];
    let open: Vec<usize> = (0..indices.len() - 1).collect();
    let starts = grid
        .iter()
        .map(|&value| Start { values: vec![(shape, value)], open: open.clone(), idle: true })
        .collect();
    Candidate { starts, ..linear(id, channel, indices) }
}

/// One parameter that has no small value to begin with.
fn searched(id: &'static str, channel: &'static str, index: usize, grid: &[f64]) -> Candidate {
    let starts = grid
        .iter()
        .map(|&value| Start { values: vec![(index, value)], open: vec![0], idle: false })
        .collect();
    Candidate { starts, ..linear(id, channel, &[index]) }
}

/// Sweeps are so slow, and so exact a simulation of them, that shorter displacements show.
fn presliding(scope: &Scope, id: &'static str, channel: &'static str, index: usize) -> Candidate {
    if scope.kind != Kind::Friction {
        return searched(id, channel, index, &[2e-4, 1e-3, 4e-3]);
    }
    let mut found = searched(id, channel, index, &[3e-5, 1e-4, 3e-4, 1e-3, 4e-3]);
    found.free[0].bounds.0 = 1e-5;
    found.free[0].step = 1e-6;
    found
}

fn actuator(scope: &Scope, found: &mut Vec<Candidate>) {
    let channel = "actuator";
    found.push(linear("act.gain", channel, &[GAIN]));
    found.push(searched("act.delay", channel, DELAY, &[0.001, 0.004, 0.01]));
    found.push(searched("act.deadband", channel, DEADBAND, &[0.5, 2.0]));
    let limits = [0.95, 0.8, 0.65, 0.5].map(|part| part * scope.command);
    found.push(searched("act.saturation", channel, LIMIT, &limits));
    found.push(searched("act.hysteresis", channel, HYSTERESIS, &[0.5, 2.0]));
    let mut droop = shaped("act.droop", channel, &[DROOP_DEPTH, DROOP_TAU], &[0.3, 1.0, 3.0]);
    droop.contains = Some("act.gain");
    found.push(droop);
    let mut mode = linear("act.mode", channel, &[MODE_FREQ, MODE_ZETA]);
    mode.starts = [(60.0, 0.7), (25.0, 0.7), (10.0, 0.7), (25.0, 0.2), (10.0, 0.2), (5.0, 0.3)]
        .map(|(f, z)| Start { values: vec![(MODE_FREQ, f), (MODE_ZETA, z)], open: vec![0, 1], idle: false })
        .into();
    found.push(mode);
    if scope.kind == Kind::Cartpole {
        found.push(linear("act.posgain", channel, &[POSGAIN]));
        found.push(linear("act.backpressure", channel, &[BACKPRESSURE]));
    }
}

/// A bound that keeps the declared coefficient plus the correction from changing its sign.
fn passive(mut candidate: Candidate, position: usize, declared: f64) -> Candidate {
    candidate.free[position].bounds.0 = -declared.max(0.0);
    candidate
}

fn piston(scope: &Scope, found: &mut Vec<Candidate>) {
    let channel = "piston_friction";
    let c = scope.declared.piston_friction.clone().unwrap_or_default();
    found.push(passive(linear("pf.viscous", channel, &[PF_VISCOUS]), 0, c.c4));
    found.push(passive(linear("pf.coulomb", channel, &[PF_COULOMB]), 0, c.c1));
    let mut stribeck = shaped("pf.stribeck", channel, &[PF_STRIBECK, PF_STRIBECK_VS], &[0.02, 0.06, 0.2]);
    stribeck.contains = Some("pf.coulomb");
    found.push(stribeck);
    if c.c1 > 0.0 {
        found.push(presliding(scope, "pf.presliding", channel, PF_PRESLIDING));
    }
    if scope.kind == Kind::Cartpole {
        found.push(linear("pf.pressure", channel, &[PF_PRESSURE]));
    }
    found.push(linear("pf.offset", channel, &[PF_OFFSET]));
    let asymmetry = passive(linear("pf.asymmetry", channel, &[PF_ASYM_FORCE, PF_ASYM_COEF]), 0, c.c1);
    found.push(passive(asymmetry, 1, c.c4));
}

fn cart_friction(scope: &Scope, found: &mut Vec<Candidate>) {
    let channel = "cart_friction";
    let c = scope.declared.cart_friction.clone().unwrap_or_default();
    found.push(passive(linear("cf.viscous", channel, &[CF_VISCOUS]), 0, c.c4));
    found.push(passive(linear("cf.coulomb", channel, &[CF_COULOMB]), 0, c.c1));
    let mut stribeck = shaped("cf.stribeck", channel, &[CF_STRIBECK, CF_STRIBECK_VS], &[0.02, 0.06, 0.2]);
    stribeck.contains = Some("cf.coulomb");
    found.push(stribeck);
    if c.c1 > 0.0 {
        found.push(presliding(scope, "cf.presliding", channel, CF_PRESLIDING));
    }
    found.push(linear("cf.offset", channel, &[CF_OFFSET]));
    found.push(passive(linear("cf.asymmetry", channel, &[CF_ASYM_FORCE, CF_ASYM_COEF]), 0, c.c1));
    found.push(linear("cf.poscoulomb", channel, &[CF_POSCOULOMB]));
}

/// A force that is periodic along the guide, its period on a grid.
fn cogging(scope: &Scope) -> Candidate {
    let (low, high) = scope.positions;
    let mut period = 0.2;
    let mut grid = Vec::new();
    // Neighbors differ by half a turn over the stroke; a fit finds its way over a whole one.
    while period > 0.006 {
        grid.push(period);
        period = 1.0 / (1.0 / period + 0.5 / (high - low));
    }
    shaped("cart.cogging", "cart", &[COG_SIN, COG_COS, COG_PERIOD], &grid)
}

fn cart(scope: &Scope, found: &mut Vec<Candidate>) {
    let channel = "cart";
    found.push(linear("cart.mass", channel, &[MASS]));
    let swept = scope.positions.1 - scope.positions.0;
    if scope.kind != Kind::Cartpole {
        // A drive leads the cart along the guide: a spring, a wall or a slope would be felt by the drive, and so would
        // cogging.
        if swept > 0.0 && swept.is_finite() {
            found.push(cogging(scope));
        }
        return;
    }
    found.push(linear("cart.spring", channel, &[SPRING, SPRING_FORCE]));
    let (low, high) = scope.positions;
    let mut stop = linear("cart.endstop", channel, &[STOP_STIFFNESS, STOP_DAMPING, STOP_POS]);
    stop.starts = [0.4, 0.55, 0.65, 0.75, 0.82, 0.88, 0.94]
        .map(|part| Start {
            values: vec![(STOP_POS, low + part * (high - low)), (STOP_STIFFNESS, 1.0)],
            open: vec![0],
            idle: false,
        })
        .into();
    found.push(stop);
    found.push(cogging(scope));
    found.push(linear("cart.tilt", channel, &[TILT]));
}

fn pole(scope: &Scope, found: &mut Vec<Candidate>) {
    let channel = "pole";
    let b_p = scope.declared.cart_pole.as_ref().map_or(0.0, |body| body.b_p);
    found.push(passive(linear("pole.viscous", channel, &[POLE_VISCOUS]), 0, b_p));
    found.push(linear("pole.coulomb", channel, &[POLE_COULOMB]));
    found.push(linear("pole.quaddrag", channel, &[POLE_DRAG]));
    found.push(linear("pole.payload", channel, &[PAYLOAD]));
    found.push(linear("pole.length", channel, &[LENGTH]));
}

fn sensors(scope: &Scope, found: &mut Vec<Candidate>) {
    let channel = "sensor";
    let all = [
        ("F_hat", OFFSET_F_HAT, SENSOR_DELAY_F_HAT, SENSOR_GAIN_F_HAT),
        ("F_p", OFFSET_F_P, SENSOR_DELAY_F_P, SENSOR_GAIN_F_P),
        ("x", OFFSET_X, SENSOR_DELAY_X, SENSOR_GAIN_X),
        ("theta", OFFSET_THETA, SENSOR_DELAY_THETA, SENSOR_GAIN_THETA),
        ("v", OFFSET_V, SENSOR_DELAY_V, SENSOR_GAIN_V),
    ];
    for (signal, offset, delay, gain) in all.into_iter().filter(|entry| scope.signals.contains(entry.0)) {
        let mut push =
            |id, index| found.push(Candidate { signal: Some(signal), ..linear(id, channel, &[index]) });
        if signal != "x" {
            // An offset of a position goes into its unknown initial value.
            push("sensor.offset", offset);
        }
        push("sensor.gain", gain);
        let delayed = searched("sensor.delay", channel, delay, &[0.001, 0.006]);
        found.push(Candidate { signal: Some(signal), ..delayed });
    }
}

/// All candidates of a case.
pub fn candidates(scope: &Scope) -> Vec<Candidate> {
    let mut found = Vec::new();
    if scope.kind != Kind::Friction {
        actuator(scope, &mut found);
    }
    if scope.kind != Kind::Actuator {
        piston(scope, &mut found);
        cart_friction(scope, &mut found);
        cart(scope, &mut found);
    }
    if scope.kind == Kind::Cartpole {
        pole(scope, &mut found);
    }
    sensors(scope, &mut found);
    found
}
