//! FMUs that crash, exit, hang and lie, in processes of their own: each run ends with the right words, keeps what it
//! has, and leaves nothing behind.
#![cfg(target_os = "linux")]

mod isolated;

use airloop_testing::hostile::Version;
use isolated::Place;

fn summary(place: &Place) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(place.path("out/summary.json")).unwrap()).unwrap()
}

const FAULTS: [(&str, &str); 12] = [
    ("segv", "signal 11 (SIGSEGV)"),
    ("abort", "signal 6 (SIGABRT)"),
    ("exit0", "exit code 0"),
    ("exit3", "exit code 3"),
    ("_exit", "exit code 0"),
    ("loop", "did not return within 0.3 s"),
    ("kill", "signal 9 (SIGKILL)"),
    ("term", "signal 15 (SIGTERM)"),
    ("trap", "signal 4 (SIGILL)"),
    ("fpe", "signal 8 (SIGFPE)"),
    ("stack", "signal 11 (SIGSEGV)"),
    ("memory", "signal 11 (SIGSEGV)"),
];

#[test]
fn a_fault_in_any_call_of_co_simulation_names_component_call_and_cause() {
    let place = Place::new(Version::Two);
    let begin =
        ["load", "fmi2Instantiate", "fmi2SetupExperiment", "fmi2EnterInitializationMode", "fmi2SetReal"];
    for function in begin {
        for (fault, cause) in &FAULTS[..6] {
            let (code, said) = place.isolated(&format!("{function}:{fault}"), &[]);
            let function = if function == "load" { "the loading of its library" } else { function };
            assert_eq!(code, Some(1), "{function} {fault}: {said}");
            assert!(
                said.contains(&format!("m: the FMU m.fmu was lost in {function}")),
                "{function} {fault}: {said}"
            );
            assert!(said.contains(cause), "{function} {fault}: {said}");
            assert!(!place.path("out/result.csv").exists(), "{function} {fault}");
        }
    }
    for function in ["fmi2DoStep", "fmi2GetReal", "fmi2SetReal"] {
        for (fault, cause) in FAULTS {
            let (code, said) = place.isolated(&format!("{function}:{fault}:0.5"), &[]);
            assert_eq!(code, Some(1), "{function} {fault}: {said}");
            assert!(
                said.contains(&format!("m: the FMU m.fmu was lost in {function} at t = ")),
                "{fault}: {said}"
            );
            assert!(said.contains(cause), "{function} {fault}: {said}");
            let summary = summary(&place);
            assert_eq!(summary["outcome"]["status"], "failed", "{function} {fault}");
            assert!(summary["outcome"]["end_time"].as_f64().unwrap() > 0.45, "{function} {fault}");
            let rows = std::fs::read_to_string(place.path("out/result.csv")).unwrap();
            assert!(rows.lines().count() > 45 && rows.ends_with('\n'), "{function} {fault}");
        }
    }
}

#[test]
fn a_fault_in_any_call_of_model_exchange_is_named() {
    let place = Place::new(Version::Two);
    for function in [
        "fmi2SetTime",
        "fmi2SetContinuousStates",
        "fmi2GetDerivatives",
        "fmi2GetContinuousStates",
        "fmi2NewDiscreteStates",
        "fmi2EnterContinuousTimeMode",
        "fmi2GetNominalsOfContinuousStates",
        "fmi2CompletedIntegratorStep",
    ] {
        for (fault, cause) in [FAULTS[0], FAULTS[2]] {
            let (code, said) = place.isolated(&format!("{function}:{fault}"), &["--master", "monolithic"]);
            assert_eq!(code, Some(1), "{function} {fault}: {said}");
            assert!(
                said.contains(&format!("was lost in {function}")) && said.contains(cause),
                "{function}: {said}"
            );
        }
    }
}

#[test]
fn other_faults_end_with_their_own_words_or_do_no_harm() {
    let place = Place::new(Version::Two);
    for (hostile, expected) in [
        ("fmi2DoStep:stop", "did not return within"),
        ("fmi2DoStep:sleep", "did not return within"),
        ("fmi2DoStep:alarm", "did not return within"),
        ("fmi2DoStep:free", "signal 6 (SIGABRT)"),
        ("fmi2DoStep:says", "FMU: printed: the valve is stuck"),
        ("fmi2DoStep:shared", "lost in"),
        ("fmi2GetReal:over", "signal"),
        ("fmi2GetReal:nan", "output `y` is NaN"),
        ("fmi2GetReal:inf", "output `y` is inf"),
        ("fmi2DoStep:discard", "fmi2DoStep returned fmi2Discard"),
        ("fmi2DoStep:error", "fmi2DoStep returned fmi2Error"),
        ("fmi2DoStep:fatal", "fmi2DoStep returned fmi2Fatal"),
        ("fmi2DoStep:pending", "fmi2DoStep returned fmi2Pending"),
        ("fmi2DoStep:strange", "fmi2DoStep returned the unknown status 77"),
        ("fmi2SetReal:error:0.5", "fmi2SetReal returned fmi2Error"),
        ("fmi2SetReal:discard:0.5", "fmi2SetReal returned fmi2Discard"),
        ("fmi2Instantiate:error", "fmi2Instantiate of m.fmu returned NULL"),
    ] {
        let (code, said) = place.isolated(hostile, &[]);
        assert_eq!(code, Some(1), "{hostile}: {said}");
        assert!(said.contains(expected), "{hostile}: {said}");
    }
    for (hostile, expected) in [
        ("none:none", ""),
        ("fmi2SetupExperiment:flood", ""),
        ("fmi2DoStep:round", ""),
        ("fmi2SetupExperiment:thread", ""),
        ("fmi2SetupExperiment:fork", ""),
        ("fmi2SetupExperiment:file", ""),
        ("fmi2SetupExperiment:close", ""),
        ("fmi2DoStep:logn", ""),
        ("fmi2DoStep:logs", ""),
        ("fmi2DoStep:lognull", ""),
        ("fmi2SetupExperiment:logflood", ""),
        ("unload:segv", "ended by signal 11 (SIGSEGV) when the library was unloaded"),
        ("unload:exit3", "ended by exit code 3 when the library was unloaded"),
        ("unload:loop", "was not unloaded within 2 s"),
        ("fmi2Terminate:segv", "lost in fmi2Terminate: its process ended by signal 11"),
        ("fmi2FreeInstance:segv", "lost in fmi2FreeInstance: its process ended by signal 11"),
        ("fmi2FreeInstance:exit0", "lost in fmi2FreeInstance: its process ended by exit code 0"),
    ] {
        let (code, said) = place.isolated(hostile, &[]);
        assert_eq!(code, Some(0), "{hostile}: {said}");
        assert!(said.contains(expected), "{hostile}: {said}");
        assert_eq!(summary(&place)["outcome"]["status"], "completed", "{hostile}");
    }
}

#[test]
fn copies_of_the_process_that_a_library_makes_change_nothing() {
    let place = Place::new(Version::Two);
    let rows = || std::fs::read(place.path("out/result.csv")).unwrap();
    assert!(place.run("", &[]).status.success());
    let alone = rows();
    for fault in ["fmi2DoStep:copy:0.2", "fmi2GetReal:copy:0.5", "fmi2Instantiate:copy", "load:copy"] {
        let (code, said) = place.isolated(fault, &[]);
        assert_eq!((code, rows() == alone), (Some(0), true), "{fault}: {said}");
        let output = place.run(fault, &[]);
        assert_eq!((output.status.code(), rows() == alone), (Some(0), true), "{fault}, in the program");
    }
    let findings = |fault: &str| {
        let output = place.airloop(fault, &["inspect", "--check", "m.fmu"]);
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    assert_eq!(findings("fmi2DoStep:copy"), findings(""));
    let lost = findings("fmi2DoStep:nowhere");
    assert!(lost.contains("[findings-lost]") && lost.contains(": 0 of"), "{lost}");
}

#[test]
fn an_fmu_in_a_worker_gives_the_same_bytes() {
    let place = Place::new(Version::Two);
    for master in ["gauss-seidel", "jacobi", "monolithic"] {
        let mut results = Vec::new();
        for words in [&[][..], &["--isolate"], &["--isolate=third-party"]] {
            let output = place.run("", &[&["--master", master], words].concat());
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            results.push(std::fs::read(place.path("out/result.csv")).unwrap());
        }
        assert_eq!(results[0], results[1], "{master}");
        assert_eq!(results[0], results[2], "{master}");
    }
}

/// A study of `m.fmu`: the estimation record is 1.5 s long, that of validation 2.5 s.
const STUDY: &str = r#"
name = "hostile"
system = "m.fmu"
inputs.u = { column = "u" }
outputs.y = { column = "y" }
segment = [
    { file = "record.csv", role = "estimation", to_s = 1.5, initial = "fit" },
    { file = "record.csv", role = "validation", from_s = 1.5, initial = "fit" },
]
"#;

#[test]
fn a_fault_in_a_search_names_component_call_and_cause() {
    let place = Place::new(Version::Two);
    let row = |k: u32| {
        let t = f64::from(k) * 0.01;
        // Somewhat more than noise is left by dy/dt = u - y.
        let (u, y) = ((2.0 * t).sin(), 0.3 * (2.0 * t - 1.2).sin() + 1e-3 * f64::from(k * 7919 % 17));
        format!("{t},{u},{y}\n")
    };
    let rows: String = (0..400).map(row).collect();
    std::fs::write(place.path("record.csv"), format!("time,u,y\n{rows}")).unwrap();
    std::fs::write(place.path("study.toml"), STUDY).unwrap();
    let refine = ["refine", "study.toml", "-o", "out"];
    let isolated = [&refine[..], &["--isolate", "--call-limit", "300ms"]].concat();
    for (hostile, words, expected) in [
        ("load:segv", &isolated[..], ["the loading of its library", "signal 11 (SIGSEGV)"]),
        ("fmi2Instantiate:exit0", &isolated[..], ["lost in fmi2Instantiate", "exit code 0"]),
        ("fmi2GetDerivatives:segv", &isolated[..], ["lost in fmi2GetDerivatives", "signal 11 (SIGSEGV)"]),
        (
            "fmi2GetDerivatives:segv:1.2",
            &isolated[..],
            ["lost in fmi2GetDerivatives at t = 1.2", "signal 11 (SIGSEGV)"],
        ),
        ("fmi2SetReal:exit3:1", &isolated[..], ["lost in fmi2SetReal at t = 1", "exit code 3"]),
        (
            "fmi2GetDerivatives:loop:2",
            &isolated[..],
            ["lost in fmi2GetDerivatives at t = 2", "did not return within 0.3 s"],
        ),
        ("fmi2GetDerivatives:error:1.2", &refine[..], ["fmi2GetDerivatives returned fmi2Error", "t = 1.2"]),
    ] {
        let output = place.airloop(hostile, words);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{hostile}: {said}");
        assert!(expected.iter().all(|text| said.contains(text)), "{hostile}: {said}");
        assert_eq!(isolated::names(&place.path("tmp")), [] as [String; 0], "{hostile}");
        assert_eq!(isolated::names(&place.path("out")), [] as [String; 0], "{hostile}");
    }
}
