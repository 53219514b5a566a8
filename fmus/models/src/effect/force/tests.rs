use fmi_export::{Interface, Model, Table};

use super::*;

/// Force and rate of `z` at a motion, with parameters and inputs by name.
fn at(given: &[(&str, f64)]) -> (f64, f64) {
    let (model, table) = Table::of::<ForceEffect>();
    let mut q = table.start_values(Interface::ModelExchange);
    for (name, value) in given {
        let handle = table.by_name(name).and_then(|v| v.real()).unwrap_or_else(|| panic!("no {name}"));
        q[handle] = *value;
    }
    q[model.F_in] = 3.0;
    model.equations(&mut q).unwrap();
    assert!((q[model.F_out] - (3.0 - q[model.f])).abs() < 1e-15);
    let rate = table.by_name("der(z)").and_then(|v| v.real()).unwrap();
    (q[model.f], q[rate])
}

#[test]
fn nothing_is_added_at_the_start_values() {
    assert_eq!(at(&[("x", 0.3), ("v", -0.7), ("F_hat", 20.0), ("p", 5e5)]), (0.0, 0.0));
}

#[test]
fn the_wall_pushes_but_never_pulls() {
    let wall = [("endstop_pos", 0.1), ("endstop_stiffness", 1000.0), ("endstop_damping", 20.0)];
    let force = |x: f64, v: f64| at(&[&wall[..], &[("x", x), ("v", v)]].concat()).0;
    assert_eq!(force(0.09, 0.5), 0.0);
    assert!((force(0.11, 0.5) - 20.0).abs() < 1e-12);
    assert_eq!(force(0.11, -0.8), 0.0);
}

#[test]
fn presliding_ends_in_the_declared_coulomb_level() {
    let friction = [("c1", 5.791), ("c2", 63.7045), ("c3", 0.0064), ("presliding_disp", 1e-3), ("v", 0.1064)];
    let (force, rate) = at(&[&friction[..], &[("z", 1e-3)]].concat());
    // The deflection has reached its limit: it rests, and the force is that of full Coulomb friction.
    assert!(rate.abs() < 1e-15);
    let s = f64::tanh(63.7045 * 0.1);
    assert!((force - 5.791 * (1.0 - s)).abs() < 1e-12);
    let (force, rate) = at(&friction);
    assert!((rate - 0.1).abs() < 1e-15 && (force + 5.791 * s).abs() < 1e-12);
}

#[test]
fn forward_motion_alone_has_the_asymmetric_friction() {
    let terms = [("asymmetry_force", 2.0), ("asymmetry_coef", 3.0), ("c2", 1e6)];
    let force = |v: f64| at(&[&terms[..], &[("v", v)]].concat()).0;
    assert!((force(0.5) - 3.5).abs() < 1e-12);
    assert_eq!(force(-0.5), 0.0);
}
