use fmi_export::{Interface, Model, Table};

use super::*;

/// Outputs for a sequence of samples 1 ms apart, with parameters by name.
fn run(parameters: &[(&str, f64)], u: &[f64]) -> Vec<f64> {
    let (model, table) = Table::of::<SignalEffect>();
    let mut q = table.start_values(Interface::CoSimulation);
    for (name, value) in parameters {
        let handle = table.by_name(name).and_then(|v| v.real()).unwrap_or_else(|| panic!("no {name}"));
        q[handle] = *value;
    }
    model.prepare(&mut q).unwrap();
    let mut found = Vec::new();
    for (k, u) in u.iter().enumerate() {
        (q.time, q.at_sample, q[model.u]) = (k as f64 * 1e-3, true, *u);
        model.equations(&mut q).unwrap();
        let direct = q[model.y];
        model.sample(&mut q);
        q.at_sample = false;
        model.equations(&mut q).unwrap();
        assert_eq!(q[model.y], direct, "what was shown at the sample is held");
        found.push(direct);
    }
    found
}

#[test]
fn nothing_changes_at_the_start_values() {
    assert_eq!(run(&[], &[1.0, -30.0, 7.5]), [1.0, -30.0, 7.5]);
}

#[test]
fn delay_play_dead_band_and_limit_are_as_drawn_by_hand() {
    assert_eq!(run(&[("delay", 1.5e-3)], &[2.0, 4.0, 6.0]), [0.0, 1.0, 3.0]);
    assert_eq!(
        run(&[("hysteresis_width", 1.0)], &[0.0, 2.0, 3.0, 2.0, 1.0, 0.0]),
        [0.0, 1.0, 2.0, 2.0, 2.0, 1.0]
    );
    assert_eq!(run(&[("deadband_width", 1.0)], &[0.5, 2.0, -3.0]), [0.0, 1.0, -2.0]);
    assert_eq!(run(&[("saturation_limit", 2.0), ("gain", 0.5)], &[1.0, 5.0, -9.0]), [1.5, 3.0, -3.0]);
}

#[test]
fn a_critically_damped_mode_has_the_closed_step_response() {
    let found = run(&[("mode_freq", 20.0), ("mode_zeta", 1.0)], &[1.0; 200]);
    let w = std::f64::consts::TAU * 20.0;
    for (k, y) in found.iter().enumerate() {
        let t = k as f64 * 1e-3;
        assert!((y - (1.0 - (1.0 + w * t) * (-w * t).exp())).abs() < 1e-12, "{k}: {y}");
    }
}

#[test]
fn droop_follows_the_clock() {
    let found = run(&[("droop_depth", 0.3), ("droop_tau", 0.05)], &[10.0; 300]);
    assert_eq!(found[0], 10.0);
    assert!((found[299] - 10.0 * (1.0 - 0.3 * (1.0 - (-0.299f64 / 0.05).exp()))).abs() < 1e-12);
}

#[test]
fn a_delay_longer_than_the_memory_is_refused_with_the_numbers() {
    let (model, table) = Table::of::<SignalEffect>();
    let mut q = table.start_values(Interface::CoSimulation);
    q[table.by_name("delay").and_then(|v| v.real()).unwrap()] = 0.3;
    let Err(fmi_export::Refusal::Error(text)) = model.prepare(&mut q) else { panic!("not refused") };
    assert!(text.contains("300.0 samples") && text.contains("255"), "{text}");
}
