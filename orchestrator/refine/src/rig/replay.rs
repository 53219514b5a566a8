//! The actuator and the piston alone: pressure force and load cell from the command and the measured motion.
//!
//! The rig is a series, so the forces need no model of cart and pole where the motion is measured. Effects of the
//! actuator and of the friction of the piston are found here without those behind them, and proposed to the search over
//! the whole rig. The motion is smoothed from the positions, which blunts reversals; so nothing is decided here.

use super::coupled::{Coupled, Running, sensed};
use super::lanes::Lanes;
use super::motion::{Motion, MotionProcess, intensity, smooth};
use super::parameters::neutral;
use super::plant::{actuator, mechanics};
use super::record::{Measured, spans, values, whitened};
use crate::engine::candidate::Candidate;
use crate::engine::goodness::{Null, pooled};
use crate::engine::noise::Noise;
use crate::engine::normal::residuals;
use crate::engine::search::{Model, Rules, Search};
use crate::engine::select::{Proposal, attempt};
use crate::engine::system::Span;
use crate::engine::{System, parallel};

/// Normalized power of the load cell up to which the friction of the piston may be as declared: smoothing blunts
/// reversals, which leaves some hundred, while a force of three times the noise of the load cell leaves some thousands.
pub const MAX_FALL_AT_REVERSALS: f64 = 400.0;
/// Draws of the null, which only ranks.
const DRAWS: usize = 40;
/// Candidates that are fitted alone, those of them that get a second one, and how many each of these gets.
const FITTED: (usize, usize, usize) = (8, 3, 4);
/// A pair is proposed if it leaves less than this share of what the best single candidate leaves.
const MAX_LEFT_BY_PAIR: f64 = 0.7;

/// One trial.
struct Trial {
    u: Vec<f64>,
    motion: Motion,
    forces: Vec<Measured>,
    estimation: bool,
}

/// The part of the rig in front of the cart.
struct Replay<'a> {
    rig: &'a Coupled,
    trials: Vec<Trial>,
}

impl<'a> Replay<'a> {
    fn new(rig: &'a Coupled) -> Replay<'a> {
        let dt = rig.actuator.sample_time;
        let plant = mechanics(&rig.declared, [&neutral()[..]]);
        let friction = |v: f64| {
            plant.piston.force(Lanes([v]), Lanes::default(), Lanes::default(), Lanes::default()).0[0]
        };
        let trials = parallel::map(rig.trials.len(), |i| {
            let trial = &rig.trials[i];
            let position = trial.measured.iter().find(|m| m.name == "x");
            let record = position.map(|m| (&m.values[..], m.noise));
            let motion = smooth(
                record,
                None,
                MotionProcess { dt, intensity: intensity(record, None, dt), late: [0.0; 2] },
            );
            let mut forces: Vec<Measured> = trial
                .measured
                .iter()
                .filter(|m| matches!(m.name.as_str(), "F_hat" | "F_p"))
                .cloned()
                .collect();
            for m in forces.iter_mut().filter(|m| m.name == "F_p") {
                for (k, weight) in m.weights.iter_mut().enumerate() {
                    let step = 1e-5;
                    let slope = (friction(motion.v[k] + step) - friction(motion.v[k] - step)) / (2.0 * step);
                    *weight = (weight.powi(-2) + slope * slope * motion.variance_v[k]).powf(-0.5);
                }
            }
            Trial { u: trial.u.clone(), motion, forces, estimation: trial.estimation }
        });
        Replay { rig, trials }
    }
}

impl System for Replay<'_> {
    fn records(&self) -> usize {
        self.trials.len()
    }

    fn estimation(&self, record: usize) -> bool {
        self.trials[record].estimation
    }

    fn locals(&self, _: usize) -> Vec<(f64, f64)> {
        Vec::new()
    }

    fn signals(&self, record: usize) -> Vec<Span> {
        spans(&self.trials[record].forces)
    }

    fn predict(&self, record: usize, p: &[f64], _: &[f64]) -> Vec<f64> {
        let (trial, dt) = (&self.trials[record], self.rig.actuator.sample_time);
        let terms = actuator(&self.rig.actuator, p);
        let plant = mechanics(&self.rig.declared, [p]);
        let mut running = Running::new(&terms, &trial.u);
        let n = trial.u.len();
        let (mut pressure, mut cell, mut z) = (Vec::with_capacity(n), Vec::with_capacity(n), Lanes([0.0]));
        for k in 0..n {
            let (x, v) = (trial.motion.x[k], trial.motion.v[k]);
            let [f_hat, f_act] = running.sample(k, k as f64 * dt, x, v);
            let friction = plant.piston.force(Lanes([v]), Lanes([x]), Lanes([f_hat.abs()]), z).0[0];
            pressure.push(f_hat);
            cell.push(f_act - friction);
            z = plant.piston.presliding_after(Lanes([v]), z, dt);
        }
        let (mut seen, mut out) = (Vec::new(), Vec::with_capacity(2 * n));
        for m in &trial.forces {
            let truth = if m.name == "F_hat" { &pressure } else { &cell };
            sensed(&m.name, truth, p, dt, 0.0, &mut seen);
            out.extend_from_slice(&seen);
        }
        out
    }

    fn measured(&self, record: usize) -> Vec<f64> {
        values(&self.trials[record].forces)
    }

    fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
        whitened(&self.trials[record].forces, predicted)
    }

    fn redraw(&self, _: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        predicted.iter().map(|_| noise.normal()).collect()
    }
}

/// Distance of the measured forces from noise, given the motion, with the parameters `p`: normalized powers by signal.
/// Nothing where no force is measured.
pub fn left(rig: &Coupled, p: &[f64]) -> Vec<(String, f64)> {
    let replay = Replay::new(rig);
    let records: Vec<usize> = (0..rig.records()).filter(|&r| rig.estimation(r)).collect();
    let locals = vec![Vec::new(); records.len()];
    let null = Null::simulate(&replay, &records, p, &locals, DRAWS, 1);
    let residuals = residuals(&replay, &records, p, &locals);
    null.normalized(&pooled(&replay, &records, &residuals))
}

/// Candidates that explain the forces best, given the motion: the best single one, and the best pair if it is much
/// better. None where no force is measured, or where the forces are as declared.
pub fn proposals(rig: &Coupled, candidates: &[Candidate], groups: &[usize], limit: f64) -> Vec<Proposal> {
    let replay = Replay::new(rig);
    let measured = |trial: &Trial| trial.forces.iter().any(|m| m.name == "F_p");
    if !replay.trials.iter().all(measured) {
        return Vec::new();
    }
    let upstream = |c: &Candidate| {
        ["actuator", "piston_friction"].contains(&c.channel) || matches!(c.signal, Some("F_hat" | "F_p"))
    };
    let places: Vec<usize> = (0..candidates.len()).filter(|&c| upstream(&candidates[c])).collect();
    let own: Vec<Candidate> = places.iter().map(|&c| candidates[c].clone()).collect();
    let records: Vec<usize> = (0..rig.records()).filter(|&r| rig.estimation(r)).collect();
    let screened = (0..records.len()).filter(|&i| i == 0 || groups[records[i]] != groups[records[i - 1]]);
    let (screened, locals) = (screened.collect(), vec![Vec::new(); records.len()]);
    let null = Null::simulate(&replay, &records, &neutral(), &locals, DRAWS, 1);
    let search =
        Search { system: &replay, candidates: &own, records, screened, null, rules: Rules::default() };
    let declared = search.fit(&[], &[], &neutral(), &locals, 1);
    if declared.worst() < limit {
        return Vec::new();
    }
    let (singles, bases, seconds) = FITTED;
    let singles = attempt(&search, &declared, &search.screen(&declared), singles, limit);
    let pairs = singles
        .iter()
        .take(bases)
        .flat_map(|single| attempt(&search, single, &search.screen(single), seconds, limit))
        .min_by(|a, b| a.fit.chi2.total_cmp(&b.fit.chi2));
    let samples = search.penalty().exp();
    let beyond = |model: &Model| model.fit.chi2 - samples;
    let proposal = |model: &Model| Proposal {
        added: model.added.iter().map(|&c| places[c]).collect(),
        parameters: model.fit.parameters.clone(),
    };
    let mut found: Vec<Proposal> = singles.first().map(proposal).into_iter().collect();
    if let (Some(pair), Some(single)) = (&pairs, singles.first())
        && beyond(pair) < MAX_LEFT_BY_PAIR * beyond(single)
    {
        found.push(proposal(pair));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::{Actuator, Kind};
    use crate::rig::catalog::{Scope, candidates};
    use crate::rig::parameters::{CF_COULOMB, GAIN, PF_COULOMB};
    use crate::rig::testing;

    /// A rig whose records show the effects of `values`, with the sensors of the cases.
    fn rig(values: &[(usize, f64)]) -> Coupled {
        let actuator =
            Actuator { sample_time: 1e-3, A1: [[-0.9, 0.0], [0.0, -0.95]], B0: [0.1, 0.05], B1: [0.0; 2] };
        let noises = [("F_hat", 0.3), ("F_p", 0.3), ("x", 1e-4), ("theta", 5e-4)];
        testing::rig(actuator, 1500, &noises, values)
    }

    fn named(rig: &Coupled) -> Vec<Vec<&'static str>> {
        let signals = ["F_hat", "F_p", "x", "theta"].into();
        let scope = Scope {
            declared: &rig.declared,
            kind: Kind::Cartpole,
            signals,
            command: 40.0,
            positions: (-0.05, 0.05),
        };
        let all = candidates(&scope);
        let found = proposals(rig, &all, &[0, 1], 12.0);
        found.iter().map(|proposal| proposal.added.iter().map(|&c| all[c].id).collect()).collect()
    }

    #[test]
    fn two_effects_in_front_of_the_cart_are_proposed_together() {
        let mut found = named(&rig(&[(GAIN, 0.06), (PF_COULOMB, 1.0), (CF_COULOMB, 1.0)]));
        let mut pair = found.pop().unwrap();
        pair.sort_unstable();
        assert_eq!(pair, ["act.gain", "pf.coulomb"]);
    }

    #[test]
    fn the_forces_tell_the_actuator_the_piston_and_the_cart_apart() {
        let of = |values: &[(usize, f64)]| -> [f64; 2] {
            let left = left(&rig(values), &neutral());
            ["F_hat", "F_p"].map(|name| left.iter().find(|(own, _)| own == name).unwrap().1)
        };
        let [hat, cell] = of(&[(CF_COULOMB, 1.0)]);
        assert!(hat < 12.0 && cell < MAX_FALL_AT_REVERSALS, "{hat} {cell}");
        let [hat, cell] = of(&[(PF_COULOMB, 1.0)]);
        assert!(hat < 12.0 && cell > MAX_FALL_AT_REVERSALS, "{hat} {cell}");
        assert!(of(&[(GAIN, 0.06)])[0] > 12.0);
    }
}
