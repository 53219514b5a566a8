//! Every function in every state, bad arguments, faults of the model, logging, steady-state allocation.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks)]

use fmi_export::state_machine::{Function, Mode, is_allowed};
use fmi_export::{
    Boolean, Identity, Integer, Interface, Model, Outcome, Real, Refusal, Scalar, Table, Text, Values,
};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

#[macro_use]
mod support;

/// Counts allocations of the present thread.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = ALLOCATIONS.try_with(|n| n.set(n.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// One variable of every kind; `fault` chooses what goes wrong in the equations.
struct Everything {
    u: Real,
    gain: Real,
    offset: Real,
    x: Real,
    der_x: Real,
    y: Real,
    count: Integer,
    count_out: Integer,
    fault: Integer,
    on: Boolean,
    on_out: Boolean,
    label: Text,
    label_out: Text,
}

impl Model for Everything {
    const IDENTITY: Identity = Identity {
        model_identifier: "everything",
        model_name: "everything",
        description: "one of each",
        version: "1",
        author: "test",
        generation_tool: "test",
        stop_time: 1.0,
        step_size: 0.1,
    };

    fn declare(t: &mut Table) -> Self {
        let kind = t.enumeration("Fault", &[("none", ""), ("discard", ""), ("error", ""), ("panic", "")]);
        Everything {
            u: t.input("u").real(0.0),
            gain: t.parameter("gain").range(0.5, 2.0).real(1.0),
            offset: t.tunable("offset").range(-1.0, 1.0).real(0.0),
            x: t.state("x").output().real(0.0),
            der_x: {
                let x = t.by_name("x").and_then(fmi_export::Variable::real).unwrap();
                t.derivative("der(x)", x).unit("1/s").computed()
            },
            y: t.output("y").computed(),
            count: t.input("count").range(0.0, 9.0).integer(0),
            count_out: t.output("count_out").computed_integer(),
            fault: t.tunable("fault").enumeration_of(kind, 1),
            on: t.input("on").boolean(false),
            on_out: t.output("on_out").computed_boolean(),
            label: t.input("label").text("start"),
            label_out: t.output("label_out").computed_text(),
        }
    }

    fn equations<S: Scalar>(&self, v: &mut Values<S>) -> Outcome {
        match v[self.fault] {
            2 => return Err(Refusal::Discard("too fast".into())),
            3 => return Err(Refusal::Error("broken, 100 % sure".into())),
            4 => panic!("a bug in the model"),
            _ => {}
        }
        v[self.der_x] = v[self.u] * v[self.gain];
        v[self.y] = v[self.x] + v[self.offset];
        v[self.count_out] = v[self.count];
        v[self.on_out] = v[self.on];
        let label = std::mem::take(&mut v[self.label]);
        v[self.label_out].clone_from(&label);
        v[self.label] = label;
        Ok(())
    }

    fn probe(&self, draw: usize, table: &Table, values: &mut Values<f64>) {
        table.spread(draw, values);
        values[self.fault] = 1;
    }
}

importer!(Everything);

const FAULT: u32 = 2; // third Integer of the table

fn set_fault(fmu: &Fmu, fault: i32) -> Status {
    unsafe { fmi2_functions::fmi2SetInteger(fmu.c, &FAULT, 1, &fault) }
}

/// An instance in the wanted state, `None` where the interface does not have it.
fn in_mode(interface: Interface, mode: Mode) -> Option<Fmu> {
    let kind = i32::from(interface == Interface::CoSimulation);
    let fmu = Fmu::new(kind);
    use fmi2_functions::*;
    let co_simulation = interface == Interface::CoSimulation;
    unsafe {
        match mode {
            Mode::Instantiated => {}
            Mode::InitializationMode => drop(fmi2EnterInitializationMode(fmu.c)),
            Mode::EventMode if !co_simulation => fmu.start(),
            Mode::ContinuousTimeMode if !co_simulation => {
                fmu.start();
                fmi2EnterContinuousTimeMode(fmu.c);
            }
            Mode::StepComplete if co_simulation => fmu.start(),
            Mode::StepFailed if co_simulation => {
                fmu.start();
                assert_eq!(set_fault(&fmu, 2), Status::OK);
                assert_eq!(fmu.step(0.0, 0.1), Status::Discard);
            }
            Mode::Terminated => {
                fmu.start();
                assert_eq!(fmi2Terminate(fmu.c), Status::OK);
            }
            Mode::Error => drop(fmi2ExitInitializationMode(fmu.c)),
            Mode::Fatal => {
                fmu.start();
                set_fault(&fmu, 4);
                let mut y = 0.0;
                assert_eq!(fmi2GetReal(fmu.c, &Fmu::vr("y"), 1, &mut y), Status::Fatal);
            }
            _ => return None,
        }
    }
    fmu.log.lock().unwrap().clear();
    Some(fmu)
}

/// Calls one function with arguments that are right in themselves.
fn call(fmu: &Fmu, function: Function) -> Status {
    use fmi2_functions::*;
    let c = fmu.c;
    let (mut real, mut int, mut text, mut status) = (0.0, 0, c"text".as_ptr(), Status::OK);
    let (mut a, mut b, mut info) = (0, 0, EventInfo::default());
    let (u, y, x) = (Fmu::vr("u"), Fmu::vr("y"), Fmu::vr("x"));
    let fresh = Fmu::new(1);
    let other = Fmu::new(0);
    let mut state = if is_model_exchange(fmu) { other.save() } else { fresh.save() };
    let (mut size, one) = (0usize, 1);
    unsafe {
        fmi2SerializedFMUstateSize(fresh.c, state, &mut size);
        let mut bytes = vec![0i8; size];
        fmi2SerializeFMUstate(fresh.c, state, bytes.as_mut_ptr(), size);
        let result = match function {
            Function::fmi2SetDebugLogging => fmi2SetDebugLogging(c, 1, 0, std::ptr::null()),
            Function::fmi2FreeInstance => Status::OK, // returns nothing; every instance here is freed on drop
            Function::fmi2SetupExperiment => fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0),
            Function::fmi2EnterInitializationMode => fmi2EnterInitializationMode(c),
            Function::fmi2ExitInitializationMode => fmi2ExitInitializationMode(c),
            Function::fmi2Terminate => fmi2Terminate(c),
            Function::fmi2Reset => fmi2Reset(c),
            Function::fmi2GetReal => fmi2GetReal(c, &y, 1, &mut real),
            Function::fmi2GetInteger => fmi2GetInteger(c, &0, 1, &mut int),
            Function::fmi2GetBoolean => fmi2GetBoolean(c, &0, 1, &mut int),
            Function::fmi2GetString => fmi2GetString(c, &0, 1, &mut text),
            Function::fmi2SetReal => fmi2SetReal(c, &u, 1, &real),
            Function::fmi2SetInteger => fmi2SetInteger(c, &0, 1, &int),
            Function::fmi2SetBoolean => fmi2SetBoolean(c, &0, 1, &int),
            Function::fmi2SetString => fmi2SetString(c, &0, 1, &text),
            Function::fmi2GetFMUstate => fmi2GetFMUstate(c, &mut state),
            Function::fmi2SetFMUstate => fmi2SetFMUstate(c, state),
            Function::fmi2FreeFMUstate => fmi2FreeFMUstate(c, std::ptr::null_mut()),
            Function::fmi2SerializedFMUstateSize => fmi2SerializedFMUstateSize(c, state, &mut size),
            Function::fmi2SerializeFMUstate => fmi2SerializeFMUstate(c, state, bytes.as_mut_ptr(), size),
            Function::fmi2DeSerializeFMUstate => fmi2DeSerializeFMUstate(c, bytes.as_ptr(), size, &mut state),
            Function::fmi2GetDirectionalDerivative => {
                fmi2GetDirectionalDerivative(c, &y, 1, &x, 1, &1.0, &mut real)
            }
            Function::fmi2EnterEventMode => fmi2EnterEventMode(c),
            Function::fmi2NewDiscreteStates => fmi2NewDiscreteStates(c, &mut info),
            Function::fmi2EnterContinuousTimeMode => fmi2EnterContinuousTimeMode(c),
            Function::fmi2CompletedIntegratorStep => fmi2CompletedIntegratorStep(c, 0, &mut a, &mut b),
            Function::fmi2SetTime => fmi2SetTime(c, 0.0),
            Function::fmi2SetContinuousStates => fmi2SetContinuousStates(c, &real, 1),
            Function::fmi2GetDerivatives => fmi2GetDerivatives(c, &mut real, 1),
            Function::fmi2GetEventIndicators => fmi2GetEventIndicators(c, std::ptr::null_mut(), 0),
            Function::fmi2GetContinuousStates => fmi2GetContinuousStates(c, &mut real, 1),
            Function::fmi2GetNominalsOfContinuousStates => fmi2GetNominalsOfContinuousStates(c, &mut real, 1),
            Function::fmi2SetRealInputDerivatives => fmi2SetRealInputDerivatives(c, &u, 1, &one, &real),
            Function::fmi2GetRealOutputDerivatives => fmi2GetRealOutputDerivatives(c, &y, 1, &one, &mut real),
            Function::fmi2DoStep => fmi2DoStep(c, 0.0, 0.1, 1),
            Function::fmi2CancelStep => fmi2CancelStep(c),
            Function::fmi2GetStatus => fmi2GetStatus(c, 0, &mut status),
            Function::fmi2GetRealStatus => fmi2GetRealStatus(c, 2, &mut real),
            Function::fmi2GetIntegerStatus => fmi2GetIntegerStatus(c, 0, &mut int),
            Function::fmi2GetBooleanStatus => fmi2GetBooleanStatus(c, 3, &mut int),
            Function::fmi2GetStringStatus => fmi2GetStringStatus(c, 1, &mut text),
        };
        fmi2FreeFMUstate(fresh.c, &mut state);
        result
    }
}

/// A Co-Simulation instance never enters Event Mode, so asking for its interface is enough here.
fn is_model_exchange(fmu: &Fmu) -> bool {
    INTERFACE.get() == Interface::ModelExchange && !fmu.c.is_null()
}

thread_local! {
    static INTERFACE: Cell<Interface> = const { Cell::new(Interface::ModelExchange) };
}

#[test]
fn every_function_in_every_state_follows_the_table() {
    let mut pairs = 0;
    for interface in [Interface::ModelExchange, Interface::CoSimulation] {
        INTERFACE.set(interface);
        for mode in Mode::ALL {
            for function in Function::ALL.iter().copied().filter(|f| *f != Function::fmi2FreeInstance) {
                let Some(fmu) = in_mode(interface, mode) else { continue };
                let status = call(&fmu, function);
                let place = format!("{} in {mode:?} of {interface:?}: {status:?}", function.name());
                let refused = fmu.log.lock().unwrap().iter().any(|m| m.2.contains("not allowed in state"));
                if is_allowed(function, interface, mode) {
                    assert!(!refused && status != Status::Fatal, "{place}");
                    let faulty = matches!(mode, Mode::StepFailed); // its model still discards
                    assert!(
                        status == Status::OK || faulty || function == Function::fmi2GetIntegerStatus,
                        "{place}"
                    );
                } else if mode == Mode::Fatal {
                    assert_eq!(status, Status::Fatal, "{place}");
                } else {
                    assert_eq!(status, Status::Error, "{place}");
                    assert!(refused, "{place}: no log line");
                    assert_eq!(fmu.try_set("u", 1.0), Status::Error, "{place}: not in error afterwards");
                }
                pairs += 1;
            }
        }
    }
    // 40 functions in the 7 states of each interface.
    assert_eq!(pairs, 2 * 40 * 7);
}

#[test]
fn faults_of_the_model_get_their_status_and_a_message() {
    for (fault, status, category, words) in [
        (2, Status::Discard, "logStatusDiscard", "too fast"),
        (3, Status::Error, "logStatusError", "100 %% sure"), // the message is a printf format
        (4, Status::Fatal, "logStatusFatal", "a bug in the model"),
    ] {
        let fmu = Fmu::started(1);
        assert_eq!(set_fault(&fmu, fault), Status::OK);
        assert_eq!(fmu.step(0.0, 0.1), status);
        let log = fmu.log.lock().unwrap();
        let (logged, named, message) = log.last().unwrap();
        assert_eq!((*logged, named.as_str()), (status, category));
        assert!(message.contains("fmi2DoStep") && message.contains(words), "{message}");
    }
}

#[test]
fn values_that_are_not_finite_or_out_of_range_are_discarded_and_the_old_value_kept() {
    let fmu = Fmu::started(1);
    fmu.set("u", 0.25);
    for (name, value) in
        [("u", f64::NAN), ("u", f64::INFINITY), ("offset", 1.5), ("offset", f64::NEG_INFINITY)]
    {
        assert_eq!(fmu.try_set(name, value), Status::Discard, "{name} = {value}");
        assert!(fmu.last_message().contains(&format!("`{name}`")), "{}", fmu.last_message());
    }
    assert_eq!((fmu.get("u"), fmu.get("offset")), (0.25, 0.0));
    assert_eq!(unsafe { fmi2_functions::fmi2SetInteger(fmu.c, &0, 1, &10) }, Status::Discard);
    assert!(fmu.last_message().contains("`count`"));
    assert_eq!(set_fault(&fmu, 5), Status::Discard, "the enumeration has four items");
    // A list with one bad value changes nothing.
    let (references, values) = ([Fmu::vr("u"), Fmu::vr("offset")], [7.0, 7.0]);
    let status = unsafe { fmi2_functions::fmi2SetReal(fmu.c, references.as_ptr(), 2, values.as_ptr()) };
    assert_eq!((status, fmu.get("u")), (Status::Discard, 0.25));
    assert_eq!(fmu.step(0.0, 0.1), Status::OK, "the instance goes on");
}

#[test]
fn variables_can_be_set_only_when_the_standard_says() {
    for (interface, mode, name, expected) in [
        (1, Mode::StepComplete, "gain", Status::Error),
        (1, Mode::StepComplete, "offset", Status::OK),
        (1, Mode::StepComplete, "x", Status::Error),
        (1, Mode::InitializationMode, "x", Status::OK),
        (1, Mode::InitializationMode, "y", Status::Error),
        (0, Mode::ContinuousTimeMode, "x", Status::OK),
        (0, Mode::ContinuousTimeMode, "offset", Status::Error),
        (0, Mode::EventMode, "offset", Status::OK),
        (0, Mode::EventMode, "gain", Status::Error),
    ] {
        let interface = if interface == 1 { Interface::CoSimulation } else { Interface::ModelExchange };
        let fmu = in_mode(interface, mode).unwrap();
        assert_eq!(fmu.try_set(name, 0.75), expected, "{name} in {mode:?} of {interface:?}");
    }
}

#[test]
fn instantiation_refuses_a_wrong_guid_and_survives_missing_arguments() {
    let fmu = Fmu::instantiate_with(1, "{00000000-0000-0000-0000-000000000000}", false);
    assert!(fmu.c.is_null());
    assert!(fmu.last_message().contains("GUID"), "{}", fmu.last_message());
    let fmu = Fmu::instantiate_with(7, &Fmu::guid(), false);
    assert!(fmu.c.is_null() && fmu.last_message().contains('7'));
    let guid = CString::new(Fmu::guid()).unwrap();
    let none = std::ptr::null();
    for name in [none, c"".as_ptr(), c"name".as_ptr()] {
        let no_callbacks = CallbackFunctions {
            logger: None,
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: std::ptr::null_mut(),
        };
        for callbacks in [std::ptr::null(), &raw const no_callbacks] {
            unsafe {
                let c = fmi2_functions::fmi2Instantiate(name, 1, guid.as_ptr(), none, callbacks, 0, 1);
                assert!(!c.is_null());
                assert_eq!(fmi2_functions::fmi2DoStep(c, 0.0, 0.1, 1), Status::Error);
                fmi2_functions::fmi2FreeInstance(c);
            }
        }
    }
    unsafe {
        fmi2_functions::fmi2FreeInstance(std::ptr::null_mut());
        assert_eq!(fmi2_functions::fmi2Reset(std::ptr::null_mut()), Status::Error);
    }
}

#[test]
fn log_categories_are_honored() {
    let events = |fmu: &Fmu| fmu.log.lock().unwrap().iter().filter(|m| m.1 == "logEvents").count();
    let fmu = Fmu::started(1);
    let set = |on: i32, names: &[&CStr]| {
        let names: Vec<_> = names.iter().map(|n| n.as_ptr()).collect();
        unsafe { fmi2_functions::fmi2SetDebugLogging(fmu.c, on, names.len(), names.as_ptr()) }
    };
    assert_eq!(fmu.try_set("u", f64::NAN), Status::Discard);
    assert_eq!(fmu.log.lock().unwrap().len(), 1, "messages about a status come without debug logging");
    assert_eq!(set(1, &[c"logStatusError"]), Status::OK);
    assert_eq!(fmu.try_set("u", f64::NAN), Status::Discard);
    assert_eq!(fmu.log.lock().unwrap().len(), 1, "only errors were asked for");
    assert_eq!(set(1, &[c"logAll"]), Status::OK);
    assert_eq!(fmu.try_set("u", f64::NAN), Status::Discard);
    assert_eq!(fmu.log.lock().unwrap().len(), 2);
    assert_eq!(set(1, &[c"noSuchCategory"]), Status::Warning);
    assert_eq!(set(0, &[]), Status::OK);
    let before = fmu.log.lock().unwrap().len();
    assert_eq!(fmu.try_set("u", f64::NAN), Status::Discard);
    assert_eq!(fmu.log.lock().unwrap().len(), before, "everything is off");
    assert_eq!(events(&fmu), 0, "this model has no events");
}

#[test]
fn reset_equals_a_fresh_instance_bit_for_bit() {
    let bytes = |fmu: &Fmu| {
        let mut state = fmu.save();
        let mut size = 0;
        unsafe {
            fmi2_functions::fmi2SerializedFMUstateSize(fmu.c, state, &mut size);
            let mut bytes = vec![0i8; size];
            fmi2_functions::fmi2SerializeFMUstate(fmu.c, state, bytes.as_mut_ptr(), size);
            fmi2_functions::fmi2FreeFMUstate(fmu.c, &mut state);
            bytes
        }
    };
    for kind in [0, 1] {
        let used = Fmu::new(kind);
        used.set("gain", 1.7);
        used.set("x", 3.0);
        unsafe {
            fmi2_functions::fmi2SetupExperiment(used.c, 1, 1e-3, 2.0, 1, 9.0);
            fmi2_functions::fmi2EnterInitializationMode(used.c);
            fmi2_functions::fmi2ExitInitializationMode(used.c);
        }
        used.set("u", 1.0);
        if kind == 1 {
            used.ramp("u", 2, 0.3);
            assert_eq!(used.step(2.0, 0.1), Status::OK);
        }
        let fresh = Fmu::new(kind);
        assert_ne!(bytes(&used), bytes(&fresh));
        assert_eq!(unsafe { fmi2_functions::fmi2Reset(used.c) }, Status::OK);
        assert_eq!(bytes(&used), bytes(&fresh));
    }
}

#[test]
fn strings_are_copied_in_and_stay_valid_until_the_next_call() {
    let fmu = Fmu::started(1);
    let mut text = std::ptr::null();
    unsafe {
        let given = CString::new("grüße").unwrap();
        let pointer = given.as_ptr();
        assert_eq!(fmi2_functions::fmi2SetString(fmu.c, &0, 1, &pointer), Status::OK);
        drop(given);
        assert_eq!(fmi2_functions::fmi2GetString(fmu.c, &1, 1, &mut text), Status::OK);
        assert_eq!(CStr::from_ptr(text).to_str(), Ok("grüße"));
        let nothing = std::ptr::null();
        assert_eq!(fmi2_functions::fmi2SetString(fmu.c, &0, 1, &nothing), Status::Discard);
        assert!(fmu.last_message().contains("`label`"));
        assert_eq!(fmi2_functions::fmi2GetString(fmu.c, &9, 1, &mut text), Status::Error);
    }
}

#[test]
fn derivatives_with_respect_to_several_knowns_add_up() {
    let fmu = Fmu::started(1);
    fmu.set("u", 2.0);
    let known = [Fmu::vr("x"), Fmu::vr("offset"), Fmu::vr("gain"), Fmu::vr("u")];
    let unknown = [Fmu::vr("y"), Fmu::vr("der(x)")];
    let (seed, mut out) = ([1.0, 10.0, 100.0, 1000.0], [f64::NAN; 2]);
    let status = unsafe {
        fmi2_functions::fmi2GetDirectionalDerivative(
            fmu.c,
            unknown.as_ptr(),
            2,
            known.as_ptr(),
            4,
            seed.as_ptr(),
            out.as_mut_ptr(),
        )
    };
    assert_eq!(status, Status::OK);
    // y = x + offset; der(x) = u gain with u = 2, gain = 1
    assert_eq!(out, [1.0 + 10.0, 2.0 * 100.0 + 1000.0]);
}

#[test]
fn steady_state_calls_do_not_allocate() {
    let fmu = Fmu::started(1);
    let (u, y, x, mut out, order) = (Fmu::vr("u"), Fmu::vr("y"), Fmu::vr("x"), 0.0, 1);
    let mut state = fmu.save();
    let run = |from: usize, to: usize, out: &mut f64, state: &mut FmuState| unsafe {
        use fmi2_functions::*;
        for i in from..to {
            let t = i as f64 * 0.01;
            assert_eq!(fmi2SetReal(fmu.c, &u, 1, &t), Status::OK);
            assert_eq!(fmi2SetRealInputDerivatives(fmu.c, &u, 1, &order, &1.0), Status::OK);
            assert_eq!(fmi2DoStep(fmu.c, t, 0.01, 0), Status::OK);
            assert_eq!(fmi2GetReal(fmu.c, &y, 1, out), Status::OK);
            assert_eq!(fmi2GetRealOutputDerivatives(fmu.c, &y, 1, &order, out), Status::OK);
            assert_eq!(fmi2GetDirectionalDerivative(fmu.c, &y, 1, &x, 1, &1.0, out), Status::OK);
            assert_eq!(fmi2GetFMUstate(fmu.c, state), Status::OK);
            assert_eq!(fmi2SetFMUstate(fmu.c, *state), Status::OK);
        }
    };
    run(0, 2, &mut out, &mut state);
    let before = ALLOCATIONS.get();
    run(2, 100, &mut out, &mut state);
    assert_eq!(ALLOCATIONS.get() - before, 0, "Co-Simulation");

    let me = Fmu::started(0);
    let step = |i: usize, out: &mut f64| unsafe {
        use fmi2_functions::*;
        let (mut a, mut b, mut info) = (0, 0, EventInfo::default());
        assert_eq!(fmi2NewDiscreteStates(me.c, &mut info), Status::OK);
        assert_eq!(fmi2EnterContinuousTimeMode(me.c), Status::OK);
        assert_eq!(fmi2SetTime(me.c, i as f64), Status::OK);
        assert_eq!(fmi2SetContinuousStates(me.c, &0.5, 1), Status::OK);
        assert_eq!(fmi2SetReal(me.c, &u, 1, &0.1), Status::OK);
        assert_eq!(fmi2GetDerivatives(me.c, out, 1), Status::OK);
        assert_eq!(fmi2CompletedIntegratorStep(me.c, 1, &mut a, &mut b), Status::OK);
        assert_eq!(fmi2EnterEventMode(me.c), Status::OK);
    };
    step(0, &mut out);
    let before = ALLOCATIONS.get();
    (1..100).for_each(|i| step(i, &mut out));
    assert_eq!(ALLOCATIONS.get() - before, 0, "Model Exchange");
    unsafe { fmi2_functions::fmi2FreeFMUstate(fmu.c, &mut state) };
}

#[test]
fn instances_on_several_threads_do_not_disturb_each_other() {
    let run = |seed: u32| {
        let fmu = Fmu::started(1);
        (0..500)
            .map(|i| {
                fmu.set("u", f64::from((i * seed) % 17));
                assert_eq!(fmu.step(f64::from(i) * 0.01, 0.01), Status::OK);
                fmu.get("y").to_bits()
            })
            .collect::<Vec<_>>()
    };
    let alone: Vec<_> = (1..=4).map(run).collect();
    let threads: Vec<_> = (1..=4).map(|seed| std::thread::spawn(move || run(seed))).collect();
    for (expected, thread) in alone.into_iter().zip(threads) {
        assert_eq!(thread.join().unwrap(), expected);
    }
}
