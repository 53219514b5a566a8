//! State events inside a Co-Simulation step, against the closed form of a bouncing ball.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks)]

use fmi_export::{Event, Identity, Model, Outcome, Real, Scalar, Table, Values};

#[macro_use]
mod support;

const G: f64 = 9.81;
const RESTITUTION: f64 = 0.7;

struct Ball {
    h: Real,
    v: Real,
    der_h: Real,
    der_v: Real,
    stop_below: Real,
}

impl Model for Ball {
    const IDENTITY: Identity = Identity {
        model_identifier: "ball",
        model_name: "ball",
        description: "ball on a floor",
        version: "1",
        author: "test",
        generation_tool: "test",
        stop_time: 3.0,
        step_size: 0.01,
    };

    fn declare(t: &mut Table) -> Self {
        let h = t.state("h").unit("m").output().real(1.0);
        let v = t.state("v").unit("m/s").output().real(0.0);
        let der_h = t.derivative("der(h)", h).unit("m/s").computed();
        let der_v = t.derivative("der(v)", v).unit("m/s2").computed();
        let stop_below = t.parameter("stop_below").unit("m/s").real(0.0);
        t.event_indicators(1);
        Ball { h, v, der_h, der_v, stop_below }
    }

    fn equations<S: Scalar>(&self, v: &mut Values<S>) -> Outcome {
        v[self.der_h] = v[self.v];
        v[self.der_v] = S::from(-G);
        Ok(())
    }

    fn event_indicators(&self, v: &Values<f64>, z: &mut [f64]) {
        z[0] = v[self.h];
    }

    fn event(&self, v: &mut Values<f64>) -> Event {
        if v[self.h] > 0.0 || v[self.v] >= 0.0 {
            return Event::default();
        }
        v[self.h] = 0.0;
        v[self.v] *= -RESTITUTION;
        Event { states_changed: true, iterate: false, terminate: v[self.v] < v[self.stop_below] }
    }
}

importer!(Ball);

/// Height after time `t` from rest at 1 m, by summing the parabolas.
fn closed_form(mut t: f64) -> f64 {
    let fall = (2.0 / G).sqrt();
    if t < fall {
        return 1.0 - G * t * t / 2.0;
    }
    t -= fall;
    let mut speed = RESTITUTION * G * fall;
    while t > 2.0 * speed / G {
        t -= 2.0 * speed / G;
        speed *= RESTITUTION;
    }
    speed * t - G * t * t / 2.0
}

#[test]
fn co_simulation_follows_the_parabolas_for_any_step_size() {
    for (h, method) in [(0.01, 1), (0.37, 1), (0.0123, 2), (1.0, 2)] {
        let fmu = Fmu::new(1);
        let vr = 0; // solver.method is the only Integer
        assert_eq!(unsafe { fmi2_functions::fmi2SetInteger(fmu.c, &vr, 1, &method) }, Status::OK);
        fmu.start();
        let mut t = 0.0;
        for _ in 0..(2.0f64 / h) as usize {
            assert_eq!(fmu.step(t, h), Status::OK, "{}", fmu.last_message());
            t += h;
            let error = (fmu.get("h") - closed_form(t)).abs();
            assert!(error < 1e-9, "h = {h}, method {method}: error {error:e} m at {t} s");
        }
    }
}

#[test]
fn model_exchange_reports_the_bounce_through_its_indicator() {
    let fmu = Fmu::started(0);
    fmu.new_discrete_states();
    let indicator = |fmu: &Fmu| {
        let mut z = f64::NAN;
        assert_eq!(unsafe { fmi2_functions::fmi2GetEventIndicators(fmu.c, &mut z, 1) }, Status::OK);
        z
    };
    unsafe { assert_eq!(fmi2_functions::fmi2EnterContinuousTimeMode(fmu.c), Status::OK) };
    assert!(indicator(&fmu) > 0.0);
    let x = [-1e-9, -4.0];
    unsafe {
        assert_eq!(fmi2_functions::fmi2SetTime(fmu.c, 0.45), Status::OK);
        assert_eq!(fmi2_functions::fmi2SetContinuousStates(fmu.c, x.as_ptr(), 2), Status::OK);
        assert!(indicator(&fmu) <= 0.0);
        assert_eq!(fmi2_functions::fmi2EnterEventMode(fmu.c), Status::OK);
    }
    let info = fmu.new_discrete_states();
    assert_eq!((info.values_of_continuous_states_changed, info.new_discrete_states_needed), (1, 0));
    assert_eq!(fmu.get("v"), 4.0 * RESTITUTION);
}

#[test]
fn a_terminating_model_discards_the_step_and_tells_when() {
    let fmu = Fmu::new(1);
    fmu.set("stop_below", 4.0);
    fmu.start();
    let fall = (2.0 / G).sqrt();
    assert_eq!(fmu.step(0.0, 1.0), Status::Discard);
    let (mut terminated, mut until, mut ignored) = (0, 0.0, 0);
    unsafe {
        assert_eq!(fmi2_functions::fmi2GetBooleanStatus(fmu.c, 3, &mut terminated), Status::OK);
        assert_eq!(fmi2_functions::fmi2GetRealStatus(fmu.c, 2, &mut until), Status::OK);
        assert_eq!(fmi2_functions::fmi2GetIntegerStatus(fmu.c, 2, &mut ignored), Status::Discard);
        assert_eq!(fmi2_functions::fmi2DoStep(fmu.c, 1.0, 0.1, 1), Status::Error);
    }
    assert_eq!(terminated, 1);
    assert!((until - fall).abs() < 1e-12, "{until}");
}

#[test]
fn bad_steps_are_refused_with_a_reason() {
    for (t, h, why) in [
        (0.0, 0.0, "must be positive"),
        (0.0, -0.1, "must be positive"),
        (0.0, f64::NAN, "must be positive"),
        (0.5, 0.1, "not the present time"),
        (f64::NAN, 0.1, "not the present time"),
        (0.0, 2.0, "past the stop time"),
    ] {
        let fmu = Fmu::new(1);
        unsafe {
            assert_eq!(fmi2_functions::fmi2SetupExperiment(fmu.c, 0, 0.0, 0.0, 1, 1.5), Status::OK);
            assert_eq!(fmi2_functions::fmi2EnterInitializationMode(fmu.c), Status::OK);
            assert_eq!(fmi2_functions::fmi2ExitInitializationMode(fmu.c), Status::OK);
        }
        assert_eq!(fmu.step(t, h), Status::Error);
        assert!(fmu.last_message().contains(why), "{}", fmu.last_message());
        assert_eq!(fmu.try_set("stop_below", 1.0), Status::Error, "the instance is in error");
    }
}

#[test]
fn a_restored_state_replays_bit_for_bit() {
    let fmu = Fmu::started(1);
    assert_eq!(fmu.step(0.0, 0.4), Status::OK);
    let mut state = fmu.save();
    let run = |fmu: &Fmu| {
        (0..20)
            .map(|i| {
                assert_eq!(fmu.step(0.4 + 0.05 * f64::from(i), 0.05), Status::OK);
                fmu.get("h").to_bits()
            })
            .collect::<Vec<_>>()
    };
    let first = run(&fmu);
    let mut size = 0;
    let mut other = Fmu::new(1);
    unsafe {
        assert_eq!(fmi2_functions::fmi2SetFMUstate(fmu.c, state), Status::OK);
        assert_eq!(run(&fmu), first);
        // Through bytes into another instance.
        assert_eq!(fmi2_functions::fmi2SerializedFMUstateSize(fmu.c, state, &mut size), Status::OK);
        let mut bytes = vec![0i8; size];
        assert_eq!(fmi2_functions::fmi2SerializeFMUstate(fmu.c, state, bytes.as_mut_ptr(), size), Status::OK);
        let mut copy: FmuState = std::ptr::null_mut();
        let read = fmi2_functions::fmi2DeSerializeFMUstate(other.c, bytes.as_ptr(), size, &mut copy);
        assert_eq!(read, Status::OK);
        assert_eq!(fmi2_functions::fmi2SetFMUstate(other.c, copy), Status::OK);
        assert_eq!(run(&other), first);
        assert_eq!(fmi2_functions::fmi2FreeFMUstate(other.c, &mut copy), Status::OK);
        assert!(copy.is_null());
        assert_eq!(fmi2_functions::fmi2FreeFMUstate(fmu.c, &mut state), Status::OK);
        assert_eq!(fmi2_functions::fmi2FreeFMUstate(fmu.c, std::ptr::null_mut()), Status::OK);
        // Every damaged byte and every shorter text is noticed.
        for at in 0..size {
            other = Fmu::new(1);
            bytes[at] ^= 0x55;
            let read = fmi2_functions::fmi2DeSerializeFMUstate(other.c, bytes.as_ptr(), size, &mut copy);
            assert_eq!(read, Status::Error, "byte {at}");
            bytes[at] ^= 0x55;
            other = Fmu::new(1);
            let read = fmi2_functions::fmi2DeSerializeFMUstate(other.c, bytes.as_ptr(), at, &mut copy);
            assert_eq!(read, Status::Error, "length {at}");
        }
    }
}
