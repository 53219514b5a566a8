//! Libraries that cannot be loaded or misbehave: what the user is told, and what is still called.
#![cfg(target_os = "linux")]

use airloop_fmi::{Error, Fmu, Model, Slave, Status};
use airloop_testing::c_fmu::PLATFORM;
use airloop_testing::fmu_library::{FIRST_ORDER, INPUT, archive, compiled, description, save};
use tempfile::TempDir;

fn with_trace() -> String {
    let trace = "<ScalarVariable name=\"trace\" valueReference=\"0\" causality=\"parameter\" variability=\"fixed\">\
                 <String start=\"\"/></ScalarVariable>";
    description(&format!("{INPUT}{trace}"))
}

/// An instance that writes its calls into `trace` of the folder.
fn traced(folder: &TempDir, macros: &[&str]) -> Slave {
    let fmu = Fmu::open(&compiled(folder, "library.c", &with_trace(), macros)).unwrap();
    let mut slave = Slave::instantiate(&fmu, "it", false).unwrap();
    slave.set_string(&[0], &[folder.path().join("trace").to_str().unwrap()]).unwrap();
    slave.setup_experiment(None, 0.0, None).unwrap();
    slave.enter_initialization_mode().unwrap();
    slave
}

fn trace(folder: &TempDir) -> Vec<String> {
    std::fs::read_to_string(folder.path().join("trace")).unwrap().lines().map(str::to_owned).collect()
}

fn instantiation_error(xml: &str, macros: &[&str]) -> String {
    let folder = TempDir::new().unwrap();
    let fmu = Fmu::open(&compiled(&folder, "library.c", xml, macros)).unwrap();
    let message = Slave::instantiate(&fmu, "it", false).map(|_| ()).unwrap_err().to_string();
    assert!(message.contains("m.fmu"), "{message}");
    message
}

#[test]
fn a_dropped_instance_is_terminated_and_then_freed() {
    let folder = TempDir::new().unwrap();
    let mut slave = traced(&folder, &[]);
    slave.exit_initialization_mode().unwrap();
    drop(slave);
    let calls = trace(&folder);
    assert_eq!(calls[calls.len() - 2..], ["fmi2Terminate", "fmi2FreeInstance"]);
}

#[test]
fn an_instance_dropped_during_initialization_is_only_freed() {
    let folder = TempDir::new().unwrap();
    drop(traced(&folder, &[]));
    let calls = trace(&folder);
    assert_eq!(calls[calls.len() - 2..], ["fmi2EnterInitializationMode", "fmi2FreeInstance"]);
}

#[test]
fn nothing_is_called_after_fmi2_fatal() {
    let folder = TempDir::new().unwrap();
    let mut slave = traced(&folder, &["-DSTATUS_OF_STEP=4"]);
    slave.exit_initialization_mode().unwrap();
    let error = slave.do_step(0.25, 0.5, true).unwrap_err();
    let message = error.to_string();
    let Error::Call(call) = error else { panic!("{message}") };
    assert_eq!((call.status, call.time, call.step), (Status::Fatal, Some(0.25), Some(0.5)));
    let message = slave.set_real(&[0], &[1.0]).unwrap_err().to_string();
    assert!(message.contains("fmi2SetReal not called") && message.contains("fmi2DoStep"), "{message}");
    drop(slave);
    assert_eq!(trace(&folder).last().unwrap(), "fmi2DoStep");
}

#[test]
fn fmi2_pending_is_an_error_that_says_what_to_try() {
    let folder = TempDir::new().unwrap();
    let mut slave = traced(&folder, &["-DSTATUS_OF_STEP=5"]);
    slave.exit_initialization_mode().unwrap();
    let message = slave.do_step(0.0, 0.5, true).unwrap_err().to_string();
    assert!(message.contains("fmi2Pending") && message.contains("canRunAsynchronuously"), "{message}");
}

#[test]
fn a_refused_value_is_named_with_its_variable() {
    let folder = TempDir::new().unwrap();
    let mut slave = traced(&folder, &["-DSTATUS_OF_SET=2"]);
    let message = slave.set_real(&[0], &[-3.5]).unwrap_err().to_string();
    assert!(message.starts_with("it: fmi2SetReal returned fmi2Discard for u = -3.5 at t = 0 s"), "{message}");
}

#[test]
fn the_log_keeps_the_last_messages() {
    let folder = TempDir::new().unwrap();
    let mut slave = traced(&folder, &["-DSTATUS_OF_STEP=3"]);
    slave.exit_initialization_mode().unwrap();
    let message = slave.do_step(0.0, 0.5, true).unwrap_err().to_string();
    assert!(message.contains("message 299 of step 0.5"), "{message}");
    let log = slave.log();
    assert_eq!((log.len(), log[0].text.as_str()), (256, "message 44 of step 0.5"));
    assert!(slave.log().is_empty());
}

#[test]
fn a_wrong_guid_is_reported_with_the_messages_of_the_fmu() {
    let message = instantiation_error(&with_trace().replace("guid=\"right\"", "guid=\"wrong\""), &[]);
    assert!(message.contains("returned NULL") && message.contains("guid \"wrong\""), "{message}");
    assert!(message.contains("[Error, logStatusError] guid wrong, wanted right (100%)"), "{message}");
}

#[test]
fn a_needed_tool_is_named_as_the_reason() {
    let xml = with_trace()
        .replace("guid=\"right\"", "guid=\"wrong\"")
        .replace("modelIdentifier=\"m\"", "modelIdentifier=\"m\" needsExecutionTool=\"true\"");
    let message = instantiation_error(&xml, &[]);
    assert!(message.contains("needsExecutionTool"), "{message}");
}

#[test]
fn a_missing_function_is_named() {
    let message = instantiation_error(&with_trace(), &["-DNO_FREE_INSTANCE"]);
    assert!(message.contains("does not export fmi2FreeInstance"), "{message}");
}

#[test]
fn a_library_of_another_fmi_version_is_named() {
    let message = instantiation_error(&with_trace(), &["-DVERSION=\"1.0\""]);
    assert!(message.contains("fmi2GetVersion") && message.contains("\"1.0\""), "{message}");
}

#[test]
fn a_second_instance_is_refused_where_only_one_is_allowed() {
    let folder = TempDir::new().unwrap();
    let xml = with_trace().replace(
        "modelIdentifier=\"m\"",
        "modelIdentifier=\"m\" canBeInstantiatedOnlyOncePerProcess=\"true\"",
    );
    let fmu = Fmu::open(&compiled(&folder, "library.c", &xml, &[])).unwrap();
    let first = Slave::instantiate(&fmu, "first", false).unwrap();
    let message = Slave::instantiate(&fmu, "second", false).unwrap_err().to_string();
    assert!(message.contains("second") && message.contains("OnlyOncePerProcess"), "{message}");
    drop(first);
    Slave::instantiate(&fmu, "third", false).unwrap();
}

#[test]
fn an_absent_interface_platform_or_library_is_named() {
    let folder = TempDir::new().unwrap();
    let xml = with_trace();
    let open = |files: &[(&str, &[u8])]| Fmu::open(&save(&folder, "x.fmu", &archive(files))).unwrap();
    let description = ("modelDescription.xml", xml.as_bytes());

    let fmu = open(&[description, ("binaries/win64/m.dll", b""), ("binaries/darwin64/m.dylib", b"")]);
    let message = Slave::instantiate(&fmu, "it", false).unwrap_err().to_string();
    assert!(message.contains("binaries/linux64/m.so") && message.contains("darwin64, win64"), "{message}");
    let message = Model::instantiate(&fmu, "it", false).unwrap_err().to_string();
    assert!(message.contains("no Model Exchange") && message.contains("Co-Simulation"), "{message}");

    let inner = format!("binaries/{PLATFORM}/m.so");
    let fmu = open(&[description, (&inner, b"this is not a library")]);
    let message = Slave::instantiate(&fmu, "it", false).unwrap_err().to_string();
    assert!(message.contains(&inner) && message.contains("cannot be loaded"), "{message}");
    assert!(!message.contains("airloop-"), "the temporary folder is no help: {message}");
}

#[test]
fn wrong_lengths_are_refused_before_the_call() {
    let folder = TempDir::new().unwrap();
    let mut slave = traced(&folder, &[]);
    let message = slave.set_real(&[0], &[1.0, 2.0]).unwrap_err().to_string();
    assert!(message.contains("2 values where 1"), "{message}");
    assert!(!trace(&folder).contains(&"fmi2SetReal".to_owned()));
}

fn first_order(folder: &TempDir) -> std::sync::Arc<Fmu> {
    Fmu::open(&compiled(folder, "first_order.c", FIRST_ORDER, &[])).unwrap()
}

#[test]
fn a_state_belongs_to_the_instance_that_made_it() {
    let folder = TempDir::new().unwrap();
    let fmu = first_order(&folder);
    let mut first = Slave::instantiate(&fmu, "first", false).unwrap();
    let mut second = Slave::instantiate(&fmu, "second", false).unwrap();
    let mut slot = None;
    first.get_state(&mut slot).unwrap();
    let message = second.get_state(&mut slot).unwrap_err().to_string();
    assert!(message.contains("second: fmi2GetFMUstate") && message.contains("another instance"), "{message}");
    assert!(second.set_state(slot.as_ref().unwrap()).is_err());
    let bytes = first.serialize_state(slot.as_ref().unwrap()).unwrap();
    assert!(second.free_state(slot.unwrap()).is_err());
    let copy = second.deserialize_state(&bytes).unwrap();
    second.set_state(&copy).unwrap();
    second.free_state(copy).unwrap();
}
