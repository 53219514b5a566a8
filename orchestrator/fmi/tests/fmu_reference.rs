//! The Modelica Reference FMUs, from the folder in `AIRLOOP_REFERENCE_FMUS`, through the import of airloop.

use std::path::PathBuf;
use std::sync::Arc;

use airloop_fmi::{Fmu, Model, Slave, StepStatus};

/// The opened FMU, or `None` with a line that says why the test has nothing to do.
fn reference(name: &str) -> Option<Arc<Fmu>> {
    let Some(folder) = std::env::var_os("AIRLOOP_REFERENCE_FMUS") else {
        eprintln!("skipped: AIRLOOP_REFERENCE_FMUS does not name the folder of the Reference FMUs");
        return None;
    };
    Some(
        Fmu::open(&PathBuf::from(folder).join(format!("{name}.fmu")))
            .unwrap_or_else(|error| panic!("{error}")),
    )
}

fn initialized_slave(fmu: &Arc<Fmu>) -> Slave {
    let mut slave = Slave::instantiate(fmu, "it", false).unwrap();
    slave.setup_experiment(None, 0.0, None).unwrap();
    slave.enter_initialization_mode().unwrap();
    slave.exit_initialization_mode().unwrap();
    slave
}

fn references(fmu: &Fmu, names: &[&str]) -> Vec<u32> {
    names.iter().map(|name| fmu.description.variable(name).expect(name).value_reference).collect()
}

#[test]
fn dahlquist_decays_as_its_explicit_euler_formula() {
    let Some(fmu) = reference("Dahlquist") else { return };
    let mut slave = initialized_slave(&fmu);
    for step in 0..10 {
        let status = slave.do_step(f64::from(step) * 0.1, 0.1, true).unwrap();
        assert_eq!(status, StepStatus::Complete);
    }
    let mut x = [0.0];
    slave.get_real(&references(&fmu, &["x"]), &mut x).unwrap();
    // der(x) = -x with the FMU's fixed Euler step of 0.1 s.
    assert!((x[0] - 0.9_f64.powi(10)).abs() < 1e-12, "{}", x[0]);
}

#[test]
fn every_type_passes_through_feedthrough() {
    let Some(fmu) = reference("Feedthrough") else { return };
    let mut slave = initialized_slave(&fmu);
    slave.set_real(&references(&fmu, &["Float64_continuous_input"]), &[0.1]).unwrap();
    slave.set_integer(&references(&fmu, &["Int32_input"]), &[-7]).unwrap();
    slave.set_boolean(&references(&fmu, &["Boolean_input"]), &[true]).unwrap();
    slave.set_string(&references(&fmu, &["String_input"]), &["grüße 100 %s"]).unwrap();
    slave.set_integer(&references(&fmu, &["Enumeration_input"]), &[2]).unwrap();
    slave.do_step(0.0, 0.1, true).unwrap();
    let (mut real, mut integers, mut boolean) = ([0.0], [0, 0], [false]);
    slave.get_real(&references(&fmu, &["Float64_continuous_output"]), &mut real).unwrap();
    slave.get_integer(&references(&fmu, &["Int32_output", "Enumeration_output"]), &mut integers).unwrap();
    slave.get_boolean(&references(&fmu, &["Boolean_output"]), &mut boolean).unwrap();
    let strings = slave.get_string(&references(&fmu, &["String_output"])).unwrap();
    assert_eq!((real, integers, boolean, strings[0].as_str()), ([0.1], [-7, 2], [true], "grüße 100 %s"));
}

#[test]
fn resource_reads_the_first_byte_of_its_file() {
    let Some(fmu) = reference("Resource") else { return };
    let mut slave = initialized_slave(&fmu);
    let mut y = [0];
    slave.get_integer(&references(&fmu, &["y"]), &mut y).unwrap();
    assert_eq!(y[0], i64::from(std::fs::read(fmu.resources().join("y.txt")).unwrap()[0]));
}

#[test]
fn stair_ends_the_run_by_a_discarded_step_that_says_terminated() {
    let Some(fmu) = reference("Stair") else { return };
    let mut slave = initialized_slave(&fmu);
    let mut last = StepStatus::Complete;
    let mut time = 0.0;
    while last == StepStatus::Complete && time < 20.0 {
        last = slave.do_step(time, 0.2, true).unwrap();
        time += 0.2;
    }
    let StepStatus::Discarded { terminated, last_successful_time } = last else {
        panic!("it never ended: {last:?}")
    };
    assert!(terminated);
    assert!((last_successful_time.unwrap() - 9.0).abs() < 0.21, "{last_successful_time:?}");
}

#[test]
fn the_ball_bounces_where_its_indicator_changes_sign() {
    let Some(fmu) = reference("BouncingBall") else { return };
    let mut ball = Model::instantiate(&fmu, "ball", false).unwrap();
    ball.setup_experiment(None, 0.0, None).unwrap();
    ball.enter_initialization_mode().unwrap();
    ball.exit_initialization_mode().unwrap();
    while ball.new_discrete_states().unwrap().new_discrete_states_needed {}
    ball.enter_continuous_time_mode().unwrap();
    let (mut states, mut derivatives, mut indicator) = ([0.0; 2], [0.0; 2], [0.0; 1]);
    let (mut time, step) = (0.0, 1e-5);
    loop {
        ball.get_continuous_states(&mut states).unwrap();
        ball.get_derivatives(&mut derivatives).unwrap();
        for (state, derivative) in states.iter_mut().zip(derivatives) {
            *state += step * derivative;
        }
        time += step;
        ball.set_time(time).unwrap();
        ball.set_continuous_states(&states).unwrap();
        ball.get_event_indicators(&mut indicator).unwrap();
        if indicator[0] <= 0.0 {
            break;
        }
    }
    // A fall from 1 m takes sqrt(2 h / g); Euler at 1e-5 s is off by less than one step.
    assert!((time - (2.0_f64 / 9.81).sqrt()).abs() < 2.0 * step, "{time}");
    ball.enter_event_mode().unwrap();
    let info = ball.new_discrete_states().unwrap();
    assert!(info.values_of_continuous_states_changed);
    let before = states[1];
    ball.get_continuous_states(&mut states).unwrap();
    assert!((states[1] + 0.7 * before).abs() < 1e-12, "{} {before}", states[1]);
}

#[test]
fn a_restored_state_continues_bit_for_bit_also_after_serialization() {
    let Some(fmu) = reference("VanDerPol") else { return };
    let mut slave = initialized_slave(&fmu);
    let x = references(&fmu, &["x0", "x1"]);
    let advance = |slave: &mut Slave, from: i32| {
        let mut values = [0.0; 2];
        (from..from + 50).for_each(|k| assert!(slave.do_step(f64::from(k) * 0.01, 0.01, false).is_ok()));
        slave.get_real(&x, &mut values).unwrap();
        values.map(f64::to_bits)
    };
    advance(&mut slave, 0);
    let mut slot = None;
    slave.get_state(&mut slot).unwrap();
    slave.get_state(&mut slot).unwrap();
    let bytes = slave.serialize_state(slot.as_ref().unwrap()).unwrap();
    let first = advance(&mut slave, 50);
    slave.set_state(slot.as_ref().unwrap()).unwrap();
    assert_eq!(advance(&mut slave, 50), first);

    let mut other = initialized_slave(&fmu);
    assert!(other.set_state(slot.as_ref().unwrap()).unwrap_err().to_string().contains("another instance"));
    let state = other.deserialize_state(&bytes).unwrap();
    other.set_state(&state).unwrap();
    other.free_state(state).unwrap();
    assert_eq!(advance(&mut other, 50), first);
}

#[test]
fn directional_derivatives_match_the_closed_form() {
    let Some(fmu) = reference("VanDerPol") else { return };
    let mut model = Model::instantiate(&fmu, "vdp", false).unwrap();
    model.setup_experiment(None, 0.0, None).unwrap();
    model.enter_initialization_mode().unwrap();
    model.exit_initialization_mode().unwrap();
    while model.new_discrete_states().unwrap().new_discrete_states_needed {}
    model.enter_continuous_time_mode().unwrap();
    let (x0, x1, mu) = (0.3, -1.2, 1.0);
    model.set_continuous_states(&[x0, x1]).unwrap();
    let mut out = [0.0];
    let unknown = references(&fmu, &["der(x1)"]);
    model.directional_derivative(&unknown, &references(&fmu, &["x0", "x1"]), &[2.0, 3.0], &mut out).unwrap();
    let expected = 2.0 * (-2.0 * mu * x0 * x1 - 1.0) + 3.0 * mu * (1.0 - x0 * x0);
    assert!((out[0] - expected).abs() < 1e-12, "{} {expected}", out[0]);
}

#[test]
fn a_refused_call_names_function_variable_and_log() {
    let Some(fmu) = reference("BouncingBall") else { return };
    let mut slave = Slave::instantiate(&fmu, "ball", false).unwrap();
    let error = slave
        .set_real(&references(&fmu, &["h"]), &[1.0])
        .and_then(|()| slave.do_step(0.0, 0.1, true).map(drop));
    let message = error.unwrap_err().to_string();
    assert!(message.starts_with("ball: fmi2DoStep returned fmi2Error"), "{message}");
    let mut values = [0.0];
    let message = slave.get_real(&[4711], &mut values).unwrap_err().to_string();
    assert!(message.contains("value reference 4711") && message.contains("FMU log"), "{message}");
}

#[test]
fn instances_work_in_different_threads() {
    let Some(fmu) = reference("Dahlquist") else { return };
    let run = |mut slave: Slave| {
        (0..100).for_each(|k| assert!(slave.do_step(f64::from(k) * 0.1, 0.1, true).is_ok()));
        let mut x = [0.0];
        let reference = references(slave.fmu(), &["x"]);
        slave.get_real(&reference, &mut x).unwrap();
        x[0].to_bits()
    };
    let threads: Vec<_> =
        (0..4).map(|_| initialized_slave(&fmu)).map(|slave| std::thread::spawn(move || run(slave))).collect();
    let results: Vec<_> = threads.into_iter().map(|thread| thread.join().unwrap()).collect();
    assert!(results.iter().all(|&result| result == results[0]), "{results:?}");
}
