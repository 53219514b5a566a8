use fmi_export::{Interface, Model, Real, Table, Values};

use super::*;

struct Block {
    model: PortEffect,
    table: Table,
    q: Values<f64>,
}

impl Block {
    fn new(given: &[(&str, f64)]) -> Block {
        let (model, table) = Table::of::<PortEffect>();
        let q = table.start_values(Interface::ModelExchange);
        let mut block = Block { model, table, q };
        given.iter().for_each(|(name, value)| block.set(name, *value));
        block.model.initialize(&mut block.q).unwrap();
        block
    }

    fn real(&self, name: &str) -> Real {
        self.table.by_name(name).and_then(|v| v.real()).unwrap_or_else(|| panic!("no {name}"))
    }

    fn set(&mut self, name: &str, value: f64) {
        let handle = self.real(name);
        self.q[handle] = value;
    }

    fn get(&mut self, name: &str) -> f64 {
        self.model.equations(&mut self.q).unwrap();
        self.q[self.real(name)]
    }

    /// Values of `y` after each of `n` midpoint steps of `h`.
    fn run(&mut self, h: f64, n: usize) -> Vec<f64> {
        let states = ["lag", "mode", "mode_rate", "z"];
        let mut found = Vec::new();
        for _ in 0..n {
            let start = states.map(|name| self.q[self.real(name)]);
            let slope = states.map(|name| self.get(&format!("der({name})")));
            (0..4).for_each(|i| self.set(states[i], start[i] + 0.5 * h * slope[i]));
            self.q.time += 0.5 * h;
            let slope = states.map(|name| self.get(&format!("der({name})")));
            (0..4).for_each(|i| self.set(states[i], start[i] + h * slope[i]));
            self.q.time += 0.5 * h;
            found.push(self.get("y"));
        }
        found
    }
}

#[test]
fn nothing_is_changed_at_the_start_values() {
    let mut block = Block::new(&[("u", 3.0), ("x", 0.4), ("v", -2.0), ("load", 7.0), ("p", 1e5)]);
    assert_eq!((block.get("y"), block.get("f")), (3.0, 0.0));
    assert!(block.run(0.01, 10).iter().all(|y| *y == 3.0));
}

#[test]
fn a_lag_rises_and_falls_with_its_own_time_constants() {
    let mut block = Block::new(&[("u", 1.0), ("lag_up", 0.2), ("lag_down", 0.5)]);
    assert_eq!(block.get("y"), 1.0);
    block.set("u", 3.0);
    let up = block.run(1e-3, 300);
    assert!((up[299] - (3.0 - 2.0 * (-1.5f64).exp())).abs() < 1e-5, "{}", up[299]);
    block.set("u", 0.0);
    let down = block.run(1e-3, 300);
    assert!((down[299] - up[299] * (-0.6f64).exp()).abs() < 1e-5, "{}", down[299]);
}

#[test]
fn a_limited_rate_is_a_ramp() {
    let given = [("u", 0.0), ("lag_up", 1e-3), ("lag_down", 1e-3), ("rate_limit", 4.0)];
    let mut block = Block::new(&given);
    block.set("u", 10.0);
    let y = block.run(1e-4, 10_000);
    assert!((y[4999] - 2.0).abs() < 1e-9 && (y[9999] - 4.0).abs() < 1e-9);
}

#[test]
fn a_mode_answers_a_step_as_the_closed_form() {
    let (f, zeta): (f64, f64) = (5.0, 0.3);
    let mut block = Block::new(&[("u", 2.0), ("mode_freq", f), ("mode_zeta", zeta)]);
    block.set("u", 3.0);
    let y = block.run(1e-4, 1500);
    let (w, t) = (std::f64::consts::TAU * f, 0.15);
    let wd = w * (1.0 - zeta * zeta).sqrt();
    let expected = 3.0 - (-zeta * w * t).exp() * ((wd * t).cos() + zeta * w / wd * (wd * t).sin());
    assert!((y[1499] - expected).abs() < 1e-5, "{} {expected}", y[1499]);
}

#[test]
fn terms_of_the_force_have_their_closed_forms() {
    let at = |given: &[(&str, f64)]| Block::new(given).get("f");
    assert!((at(&[("cubic_stiffness", 8.0), ("cubic_rest", 0.5), ("x", 1.0)]) - 1.0).abs() < 1e-12);
    assert!((at(&[("outlet_coef", 3.0), ("x", 4.0)]) - 6.0).abs() < 1e-12);
    assert_eq!(at(&[("outlet_coef", 3.0), ("x", -4.0)]), 0.0);
    assert!((at(&[("drag_coef", 2.0), ("v", -3.0)]) + 18.0).abs() < 1e-12);
    let wall = [("endstop_pos", 0.1), ("endstop_stiffness", 1000.0), ("endstop_damping", 20.0)];
    let pushed = |x: f64, v: f64| at(&[&wall[..], &[("x", x), ("v", v)]].concat());
    assert_eq!((pushed(0.09, 0.5), pushed(0.11, -0.8)), (0.0, 0.0));
    assert!((pushed(0.11, 0.5) - 20.0).abs() < 1e-12);
    let stribeck = [("stribeck_level", 2.0), ("stribeck_vs", 0.1), ("vt", 1e-3), ("v", -0.1)];
    assert!((at(&stribeck) + 2.0 / std::f64::consts::E).abs() < 1e-12);
    // The same from a velocity of the sign change.
    let moved = [&stribeck[..3], &[("v0", 0.3), ("v", 0.2)]].concat();
    assert!((at(&moved) + 2.0 / std::f64::consts::E).abs() < 1e-12);
}

#[test]
fn presliding_ends_in_the_coulomb_level() {
    let friction = [("presliding_level", 5.0), ("presliding_disp", 1e-3), ("vt", 0.01), ("v", 0.1)];
    let mut block = Block::new(&friction);
    block.run(1e-4, 2000);
    assert!((block.get("f") - 5.0 * (1.0 - 10.0f64.tanh())).abs() < 1e-6);
}
