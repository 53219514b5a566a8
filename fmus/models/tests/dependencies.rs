//! The declared dependencies against plain differences at points that the search for them has not seen.
//!
//! An unknown that changes when one known is moved must list that known. Points are drawn at random over all orders and
//! both realizations, not from the models' own choice.

use airloop_models::testing::{AllTypes, BouncingBall, Copy};
use airloop_models::{
    ArxActuator, CartPole, CompassGait, Friction, LinearStateSpace, PneumaticCylinder, TvlqrController,
};
use fmi_export::structure::Unknown;
use fmi_export::{Causality, Definition, Interface, Kind, Model, Values, Variable};

/// Points per model; enough that arx-actuator meets each of its orders several times.
const POINTS: usize = 400;

/// Numbers in 0..1 from a linear congruence (Knuth, MMIX).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

fn move_variable(variable: &Variable, items: usize, random: &mut Random, q: &mut Values<f64>) {
    let r = random.next();
    match &variable.kind {
        Kind::Real { handle, start, min, max, .. } => {
            let start = start.unwrap_or(0.0);
            let moved = start + (r - 0.5) * if start == 0.0 { 0.8 } else { start.abs() };
            q[*handle] = moved.clamp(min.unwrap_or(f64::MIN), max.unwrap_or(f64::MAX));
        }
        Kind::Integer { handle, min, max, .. } => {
            let (low, high) = (min.unwrap_or(-9), max.unwrap_or(9).min(9));
            q[*handle] = low + (r * f64::from(high - low + 1)) as i32;
        }
        Kind::Enumeration { handle, .. } => q[*handle] = 1 + (r * items as f64) as i32,
        Kind::Boolean { handle, .. } => q[*handle] = r < 0.5,
        Kind::Text { handle, .. } => q[*handle] = format!("{r}"),
    }
}

/// Moves a state from where it stands by a part of its value and of its nominal value.
fn move_state(variable: &Variable, random: &mut Random, q: &mut Values<f64>) {
    if let Kind::Real { handle, nominal, .. } = variable.kind {
        q[handle] += 0.4 * (random.next() - 0.5) * (q[handle].abs() + nominal.unwrap_or(1.0));
    }
}

fn differs(variable: &Variable, a: &Values<f64>, b: &Values<f64>) -> bool {
    match &variable.kind {
        Kind::Real { handle, .. } => {
            let (a, b) = (a[*handle], b[*handle]);
            // Rounding of what cancels is not a dependency.
            (a - b).abs() > 1e-9 * a.abs().max(b.abs()).max(1e-3)
        }
        Kind::Integer { handle, .. } | Kind::Enumeration { handle, .. } => a[*handle] != b[*handle],
        Kind::Boolean { handle, .. } => a[*handle] != b[*handle],
        Kind::Text { handle, .. } => a[*handle] != b[*handle],
    }
}

/// Moves every known at random points; gives the number of changes seen.
fn check<M: Model>(allowed: impl Fn(&Variable) -> bool) -> usize {
    let definition = Definition::<M>::new();
    let (model, table) = (&definition.model, &definition.table);
    let structure = definition.structure();
    let variables = table.variables();
    let items = |v: &Variable| match v.kind {
        Kind::Enumeration { enumeration, .. } => table.enumerations()[enumeration].items.len(),
        _ => 0,
    };
    let mut random = Random(7);
    let mut changes = 0;
    for point in 0..POINTS {
        let interface = [Interface::ModelExchange, Interface::CoSimulation][point % 2];
        let mut base = table.start_values(interface);
        for v in variables.iter().filter(|v| !v.is_computed() && allowed(v)) {
            move_variable(v, items(v), &mut random, &mut base);
        }
        if model.prepare(&mut base).is_err() || model.initialize(&mut base).is_err() {
            continue;
        }
        // Some way from the computed initial states.
        for v in variables.iter().filter(|v| v.is_computed() && v.is_state) {
            move_state(v, &mut random, &mut base);
        }
        let initial = |q: &mut Values<f64>| {
            model.prepare(q).is_ok() && model.initialize(q).is_ok() && model.equations(q).is_ok()
        };
        let running = |q: &mut Values<f64>| model.prepare(q).is_ok() && model.equations(q).is_ok();
        let evaluated = |at: &Values<f64>, evaluate: &dyn Fn(&mut Values<f64>) -> bool| {
            let mut q = at.clone();
            evaluate(&mut q).then_some(q)
        };
        let known = |v: &Variable| allowed(v) && (v.is_state || !v.is_computed());
        for (k, known) in variables.iter().enumerate().filter(|(_, v)| known(v)) {
            let mut moved = base.clone();
            if known.is_computed() {
                move_state(known, &mut random, &mut moved);
            } else {
                move_variable(known, items(known), &mut random, &mut moved);
            }
            let mut compare = |unknowns: &[Unknown], evaluate: &dyn Fn(&mut Values<f64>) -> bool| {
                let pair = evaluated(&base, evaluate).zip(evaluated(&moved, evaluate));
                let Some((value, moved)) = pair else { return };
                for unknown in unknowns {
                    let variable = &variables[unknown.variable];
                    if differs(variable, &value, &moved) {
                        changes += 1;
                        assert!(
                            unknown.dependencies.iter().any(|(i, _)| *i == k),
                            "{}: {} depends on {}, point {point}",
                            M::IDENTITY.model_name,
                            variable.name,
                            known.name
                        );
                    }
                }
            };
            compare(&structure.initial_unknowns, &initial);
            if known.causality != Causality::Parameter {
                compare(&structure.outputs, &running);
                compare(&structure.derivatives, &running);
            }
        }
    }
    changes
}

#[test]
fn whatever_changes_lists_what_was_moved() {
    let all = |_: &Variable| true;
    assert!(check::<Friction>(all) > POINTS);
    assert!(check::<CartPole>(all) > POINTS);
    assert!(check::<CompassGait>(all) > 100 * POINTS);
    assert!(check::<ArxActuator>(all) > 10 * POINTS);
    assert!(check::<LinearStateSpace>(all) > 10 * POINTS);
    assert!(check::<PneumaticCylinder>(all) > 10 * POINTS);
    assert!(check::<TvlqrController>(all) > 10 * POINTS);
    assert!(check::<Copy>(all) > 0);
    assert!(check::<BouncingBall>(all) > POINTS);
    // A fault that panics on demand has no value to compare.
    assert!(check::<AllTypes>(|v| !v.name.starts_with("fault")) > POINTS);
}
