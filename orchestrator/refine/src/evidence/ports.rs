//! Residuals of each part of the rig by itself, driven by the signal measured in front of it.
//!
//! The forces are simulated from the command. Position and angle are predicted from the measured force of the load cell
//! where there is one, so that an error of the actuator does not show as one of the cart.

use crate::answer::Answer;
use crate::case::{Case, Experiment, Kind};
use crate::engine::System;
use crate::engine::goodness::{Null, pooled};
use crate::engine::normal::residuals;
use crate::rig::observer::Observer;
use crate::rig::open::Rig;
use crate::rig::port;

/// Random walk of the actuator force that the load cell corrects \[N per sample\].
const FORCE_WALK_INTENSITY: f64 = 0.1;
/// Draws of the null of the predictions.
const DRAWS: usize = 40;

/// A part of the rig between two measured places.
#[derive(Debug, Clone, PartialEq)]
pub struct Port {
    /// Measured signal that drives the part.
    pub from: &'static str,
    /// Signal measured behind the part.
    pub to: String,
    /// Normalized power of the residual, before and after: about 1 for noise.
    pub left: [f64; 2],
}

/// The ports of a rig, in the order of the way of the force.
pub fn of(kind: Kind, rig: &Rig, answer: &Answer) -> Vec<Port> {
    let from = if kind == Kind::Friction { "motion" } else { "command" };
    let at = |model: usize, name: &str| answer.left[model].iter().find(|(own, _)| own == name).map(|l| l.1);
    let simulated = |name: &String| {
        let after = at(1, name).unwrap_or(f64::NAN);
        let left = [at(0, name).unwrap_or(f64::NAN), after];
        Port { from, to: name.clone(), left }
    };
    let names: Vec<&String> = answer.left[0].iter().map(|(name, _)| name).collect();
    // The observer behind the load cell follows the declared actuator, which a cylinder in its place does not, and
    // knows no law.
    let observed = !answer.cylinder && answer.law.is_none() && names.iter().any(|name| *name == "F_p");
    let Some(coupled) = rig.coupled.as_ref().filter(|_| observed) else {
        return names.into_iter().map(simulated).collect();
    };
    let mut found: Vec<Port> =
        names.into_iter().filter(|name| name.starts_with('F')).map(simulated).collect();
    let records: Vec<usize> = (0..coupled.records()).filter(|&r| coupled.estimation(r)).collect();
    let locals = vec![Vec::new(); records.len()];
    let left = [0, 1].map(|model| {
        let p = &answer.parameters[model];
        let observer = Observer::around(coupled, [FORCE_WALK_INTENSITY, 0.0, 0.0, 0.0], 0.0, p);
        let null = Null::simulate(&observer, &records, p, &locals, DRAWS, 1);
        let residuals: Vec<Vec<f64>> =
            records.iter().map(|&record| observer.residuals(record, p, &[])).collect();
        null.normalized(&pooled(&observer, &records, &residuals))
    });
    for (index, (name, before)) in left[0].iter().enumerate() {
        found.push(Port { from: "load cell", to: name.clone(), left: [*before, left[1][index].1] });
    }
    found
}

/// Inputs where something is left with the corrected model, in multiples of the noise: the largest of what their
/// signals show.
pub fn left_at(case: &Case, rig: &Rig, answer: &Answer, ports: &[Port]) -> Vec<(String, f64)> {
    let kind = case.declaration.kind;
    let shown: Vec<(&str, f64)> = if kind == Kind::Friction {
        of_sweeps(case, rig, &answer.parameters[1])
    } else {
        let own = |port: &Port| Some((port::shown_by(&port.to, kind == Kind::Actuator)?, port.left[1]));
        ports.iter().filter_map(own).collect()
    };
    let mut found: Vec<(String, f64)> = Vec::new();
    for (name, left) in shown.into_iter().filter(|own| own.1.is_finite()) {
        // Normalized powers stand for standard deviations of a sum of squares; the root is about multiples of the
        // noise.
        let floors = left.max(0.0).sqrt();
        match found.iter_mut().find(|own| own.0 == name) {
            Some(own) => own.1 = own.1.max(floors),
            None => found.push((name.to_owned(), floors)),
        }
    }
    found
}

/// Normalized powers of the sweeps of the piston and of those of the cart, at the inputs where their frictions act.
fn of_sweeps(case: &Case, rig: &Rig, p: &[f64]) -> Vec<(&'static str, f64)> {
    let system = rig.system.as_ref();
    let files = &case.declaration.files;
    let both = [(Experiment::SweepPiston, "piston_friction"), (Experiment::SweepCart, "cart_friction")];
    let one = |(experiment, channel): (Experiment, &str)| {
        let records: Vec<usize> =
            (0..files.len()).filter(|&r| files[r].experiment == experiment && system.estimation(r)).collect();
        if records.is_empty() {
            return None;
        }
        let locals = vec![Vec::new(); records.len()];
        let null = Null::simulate(system, &records, p, &locals, DRAWS, 1);
        let own = residuals(system, &records, p, &locals);
        let left = null.normalized(&pooled(system, &records, &own));
        let force = left.iter().find(|(signal, _)| signal == "F_p")?.1;
        Some((port::of_channel(channel)?, force))
    };
    both.into_iter().filter_map(one).collect()
}
