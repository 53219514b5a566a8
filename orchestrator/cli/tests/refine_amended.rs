//! The amended system: FMUs with the effects of an answer move as the equations that the search used.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use airloop_fmi::{Fmu, VariableKind};
use airloop_refine::amend::{self, rig};
use airloop_refine::answer::{Answer, Correction, Effect, Parameter, Verdict};
use airloop_refine::case::Case;
use airloop_refine::engine::System;
use airloop_refine::engine::candidate::Candidate;
use airloop_refine::rig::coupled::Coupled;
use airloop_refine::rig::cylinder::Cylinder;
use airloop_refine::rig::open::open;
use airloop_refine::rig::parameters::{self, TABLE};
use airloop_refine::rig::physical::quantities;
use airloop_refine::study::declaration::File;
use airloop_series::csv;

/// Samples that are compared.
const SAMPLES: usize = 400;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn case() -> Case {
    Case::read(&root().join("data/rig/v05")).unwrap()
}

/// Noticeable values of the parameters of a candidate; what has a value when it is off keeps it.
fn switched_on(candidate: &Candidate, p: &mut [f64]) {
    for free in &candidate.free {
        let definition = &TABLE[free.index];
        let value = match definition.name {
            "act.saturation.limit" => 6.0,
            "act.mode.freq" => 15.0,
            "cart.endstop.pos" => 0.004,
            "cart.endstop.stiffness" => 2000.0,
            "cart.endstop.damping" => 30.0,
            "act.delay.delay" => 0.0024,
            name if name.starts_with("sensor.delay") => 0.0024,
            _ if definition.neutral != 0.0 => definition.neutral,
            _ => 5.0 * definition.scale,
        };
        p[free.index] = value;
    }
}

fn answer(effects: Vec<Effect>, corrections: Vec<Correction>) -> Answer {
    Answer { verdict: Verdict::Effect, effects, corrections, limit: 1.0, ..Answer::default() }
}

fn effect(candidate: &Candidate, p: &[f64]) -> Effect {
    let parameter = |(name, unit, value)| Parameter { name, unit, value, interval: (value, value) };
    Effect {
        id: candidate.id.into(),
        channel: candidate.channel.into(),
        signal: candidate.signal.map(str::to_owned),
        selected: true,
        group: None,
        score: 1.0,
        parameters: quantities(candidate, p).into_iter().map(parameter).collect(),
        reason: String::new(),
        ..Effect::default()
    }
}

/// Runs the amended system of an answer under the command of the first record; outputs by name.
fn run(
    case: &Case,
    answer: &Answer,
    start: [f64; 2],
    samples: usize,
    master: &str,
) -> BTreeMap<String, Vec<f64>> {
    let folder = tempfile::tempdir().unwrap();
    let network = rig::network(&case.declaration, answer);
    amend::write(&network, folder.path(), Some(&root().join("target/fmu"))).unwrap();
    let u = &case.records[0].channel("u").unwrap().values;
    let rows: String = (0..=samples).map(|k| format!("{},{}\n", k as f64 * 1e-3, u[k])).collect();
    let input = folder.path().join("u.csv");
    std::fs::write(&input, "time,u\n".to_owned() + &rows).unwrap();
    let out = folder.path().join("run");
    let output = Command::new(env!("CARGO_BIN_EXE_airloop"))
        .arg("run")
        .arg(folder.path().join("system/system.ssp"))
        .args([
            "--master",
            master,
            "--no-plots",
            "--quiet",
            "--stop",
            &format!("{}", samples as f64 * 1e-3),
            "--input",
        ])
        .arg(&input)
        .args([
            "--set",
            &format!("cart_pole.x={}", start[0]),
            "--set",
            &format!("cart_pole.theta={}", start[1]),
            "-o",
        ])
        .arg(&out)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let result = csv::read(&out.join("result.csv")).unwrap();
    result.channels().iter().map(|c| (c.name.clone(), c.values.clone())).collect()
}

/// Largest differences to the prediction of the search: pressure force, load cell, position, angle.
///
/// In a run the force of the friction is read before the sample of its time: the step of the actuator is added.
fn differences(rig: &Coupled, p: &[f64], run: &BTreeMap<String, Vec<f64>>, start: [f64; 2]) -> [f64; 4] {
    let predicted = rig.predict(0, p, &start);
    let mut expected = predicted.chunks(rig.trials[0].u.len());
    ["F_hat", "F_p", "x", "theta"].map(|name| {
        let expected = expected.next().unwrap();
        let step = |k: usize| {
            let step = run["F_act"][k] - run["F_act"][k - 1];
            if name == "F_p" { (1.0 + p[parameters::SENSOR_GAIN_F_P]) * step } else { 0.0 }
        };
        (1..SAMPLES).map(|k| (run[name][k] + step(k) - expected[k]).abs()).fold(0.0, f64::max)
    })
}

fn check(case: &Case, rig: &Coupled, p: &[f64], answer: &Answer, name: &str) {
    let start = [0.012, 0.03];
    let found = run(case, answer, start, SAMPLES, "monolithic");
    let errors = differences(rig, p, &found, start);
    // Two Runge-Kutta steps of 0.5 ms per sample against an integrator of 1e-9: after the release from rest, speeds
    // differ by some 1e-5 m/s, which the slope of the piston's friction (111 N s/m and more) turns into some 1e-3 N.
    let mut limits = [1e-4, 4e-3, 5e-7, 2e-6];
    if name == "pf.pressure" || name == "sensor.delay(F_p)" {
        // The load cell reads another pressure force, or a past value, before the sample than behind it.
        limits[1] = f64::INFINITY;
    }
    assert!(errors.iter().zip(limits).all(|(error, limit)| *error < limit), "{name}: {errors:?}");
}

fn all_of(channel: &str) {
    let case = case();
    let opened = open(&case).unwrap();
    let rig = opened.coupled.as_ref().unwrap();
    let own: Vec<&Candidate> = opened.candidates.iter().filter(|c| c.channel == channel).collect();
    assert!(!own.is_empty());
    for candidate in own {
        let mut p = parameters::neutral();
        switched_on(candidate, &mut p);
        let answer = answer(vec![effect(candidate, &p)], Vec::new());
        check(&case, rig, &p, &answer, &candidate.name());
    }
}

#[test]
fn every_effect_of_the_actuator_moves_as_in_the_search() {
    all_of("actuator");
}

#[test]
fn every_effect_of_the_piston_moves_as_in_the_search() {
    all_of("piston_friction");
}

#[test]
fn every_effect_of_the_cart_friction_moves_as_in_the_search() {
    all_of("cart_friction");
}

#[test]
fn every_effect_of_the_cart_moves_as_in_the_search() {
    all_of("cart");
}

#[test]
fn every_effect_of_the_pole_moves_as_in_the_search() {
    all_of("pole");
}

#[test]
fn every_effect_of_the_sensors_shows_as_in_the_search() {
    all_of("sensor");
}

#[test]
fn corrections_of_declared_parameters_move_as_in_the_search() {
    let case = case();
    let opened = open(&case).unwrap();
    let rig = opened.coupled.as_ref().unwrap();
    let mut p = parameters::neutral();
    let mut corrections = Vec::new();
    for (k, own) in opened.corrections.iter().enumerate() {
        let size = if own.absolute() { 1e-4 } else { 0.01 };
        let moved = size * (1.0 + 0.1 * k as f64) * if k % 2 == 0 { 1.0 } else { -1.0 };
        p[own.entry.index] = moved;
        corrections.push(Correction::new(own, moved, 1e-3));
    }
    // Effects that count from corrected values: presliding replaces the corrected Coulomb friction, a payload is added
    // to the corrected pole.
    let own = ["cf.presliding", "pole.payload", "cart.tilt"];
    let own = own.map(|id| opened.candidates.iter().find(|c| c.id == id).unwrap());
    own.iter().for_each(|candidate| switched_on(candidate, &mut p));
    let effects = own.iter().map(|candidate| effect(candidate, &p)).collect();
    check(&case, rig, &p, &answer(effects, corrections), "corrections");
}

#[test]
fn a_cylinder_in_place_of_the_actuator_moves_as_in_the_search() {
    let case = case();
    let opened = open(&case).unwrap();
    let mut rig = opened.coupled.clone().unwrap();
    let mut p = parameters::neutral();
    p[parameters::CYLINDER] = 1.0;
    let own = opened.candidates.iter().find(|c| c.id == "pf.viscous").unwrap();
    switched_on(own, &mut p);
    let mut answer = answer(vec![effect(own, &p)], Vec::new());
    answer.cylinder = true;
    for (parameter, index, moved) in [
        ("bore", parameters::D_CYL_BORE, 0.1),
        ("Vt", parameters::D_CYL_VT, -0.2),
        ("At", parameters::D_CYL_AT, 0.3),
    ] {
        p[index] = moved;
        let own = opened.corrections.iter().find(|own| own.entry.index == index).unwrap();
        answer.corrections.push(Correction::new(own, moved, 0.0));
        assert_eq!(own.parameter(), parameter);
    }
    // The monolithic master couples all the time. The FMU holds what leaves a tube over its substeps of 0.1 ms.
    rig.cylinder = Cylinder { tdelay: 0.003_05, ..Cylinder::default() };
    rig.exchange = 0.0;
    let start = [0.012, 0.03];
    let found = run(&case, &answer, start, 200, "monolithic");
    let predicted = rig.predict(0, &p, &start);
    let samples = rig.trials[0].u.len();
    for (expected, (name, limit)) in
        predicted.chunks(samples).zip([("F_hat", 1e-2), ("F_p", 1e-2), ("x", 1e-6), ("theta", 5e-6)])
    {
        let error = (0..200).map(|k| (found[name][k] - expected[k]).abs()).fold(0.0, f64::max);
        assert!(error < limit, "{name}: {error}");
    }
}

#[test]
fn co_simulation_shows_a_delayed_position_late_by_the_delay() {
    let case = case();
    let opened = open(&case).unwrap();
    let mut p = parameters::neutral();
    let own = ["cart.spring", "sensor.delay(x)"];
    let own = own.map(|name| opened.candidates.iter().find(|c| c.name() == name).unwrap());
    own.iter().for_each(|candidate| switched_on(candidate, &mut p));
    let [spring, delay] = own.map(|candidate| effect(candidate, &p));
    let x = |effects: Vec<Effect>| {
        run(&case, &answer(effects, Vec::new()), [0.012, 0.03], SAMPLES, "gauss-seidel").remove("x").unwrap()
    };
    let (prompt, late) = (x(vec![spring.clone()]), x(vec![spring, delay]));
    // 2.4 samples, linear between them.
    for k in 3..SAMPLES {
        let expected = 0.6 * prompt[k - 2] + 0.4 * prompt[k - 3];
        assert!((late[k] - expected).abs() < 1e-12, "{k}: {} {expected}", late[k]);
    }
}

fn chosen(id: &str, channel: &str, parameters: &[(&str, f64)]) -> Effect {
    let parameter = |&(name, value): &(&str, f64)| Parameter {
        name: name.into(),
        unit: String::new(),
        value,
        interval: (value, value),
    };
    Effect {
        id: id.into(),
        channel: channel.into(),
        signal: None,
        selected: true,
        group: None,
        score: 1.0,
        parameters: parameters.iter().map(parameter).collect(),
        reason: String::new(),
        ..Effect::default()
    }
}

#[test]
fn a_study_of_a_pendulum_gets_its_friction_and_its_drag_at_the_joint() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = root().join("target/fmu/pendulum.fmu").canonicalize().unwrap();
    let text = format!(
        "system = {:?}\n[parameters]\nm = 0.3\n[outputs]\ntheta = {{ column = \"theta\" }}\n[[segment]]\nfile = \"a.csv\"\nrole = \"train\"\n[[free]]\nparameter = \"I\"\n[[attachment]]\ninput = \"tau_ext\"\nchannels = [\"pole\"]\nvelocity = \"omega\"\nposition = \"theta\"\n",
        fmu.to_str().unwrap()
    );
    let path = folder.path().join("study.toml");
    std::fs::write(&path, text).unwrap();
    let file = File::read(&path).unwrap();
    let mut answer = answer(
        vec![
            chosen("pole.coulomb", "pole", &[("torque", 4e-3)]),
            chosen("pole.quaddrag", "pole", &[("coef", 2e-3)]),
        ],
        Vec::new(),
    );
    answer.fitted = vec![("I".into(), 0.02)];
    let network = amend::study::network(&file, &answer, folder.path()).unwrap();
    amend::write(&network, folder.path(), Some(&root().join("target/fmu"))).unwrap();
    let out = folder.path().join("run");
    let output = Command::new(env!("CARGO_BIN_EXE_airloop"))
        .arg("run")
        .arg(folder.path().join("system/system.ssp"))
        .args(["--master", "monolithic", "--no-plots", "--quiet", "--stop", "3", "--step", "0.01"])
        .args(["--set", "pendulum.theta=1.2", "-o"])
        .arg(&out)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let result = csv::read(&out.join("result.csv")).unwrap();
    let theta = &result.channel("theta").unwrap().values;
    let opened = Fmu::open(&fmu).unwrap();
    let description = &opened.description;
    let start = |name: &str| match &description.variables[description.index_of(name).unwrap()].kind {
        VariableKind::Real(real) => real.start.unwrap(),
        _ => f64::NAN,
    };
    let (m, l, g, b, inertia) = (0.3, start("l"), start("g"), start("b"), 0.02);
    let rate = |[th, om]: [f64; 2]| {
        let torque = -b * om - m * g * l * th.sin() - 4e-3 * (om / 0.05).tanh() - 2e-3 * om.abs() * om;
        [om, torque / inertia]
    };
    let (mut s, h) = ([1.2, 0.0], 1e-4);
    for (k, found) in theta.iter().enumerate() {
        assert!((found - s[0]).abs() < 1e-6, "{k}: {found} {}", s[0]);
        for _ in 0..100 {
            let ahead = |k: [f64; 2], f: f64| [s[0] + f * k[0], s[1] + f * k[1]];
            let k1 = rate(s);
            let k2 = rate(ahead(k1, 0.5 * h));
            let k3 = rate(ahead(k2, 0.5 * h));
            let k4 = rate(ahead(k3, h));
            s = std::array::from_fn(|i| s[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        }
    }
    assert!(theta.len() > 290);
}
