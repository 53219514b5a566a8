//! FMUs that misbehave by FMI 3.0, in Model Exchange, in events, texts and saved states, and without a process of their
//! own; and what other commands than `run` make of them.
#![cfg(target_os = "linux")]

mod isolated;

use airloop_testing::hostile::Version;
use isolated::{Place, names};

/// A fault, the exit code, and a part of what is said.
type Case = (&'static str, i32, &'static str);

fn check(place: &Place, words: &[&str], cases: &[Case]) {
    for (hostile, expected, part) in cases {
        let (code, said) = place.isolated(hostile, words);
        assert_eq!(code, Some(*expected), "{hostile} {words:?}: {said}");
        assert!(said.contains(part), "{hostile} {words:?}: {said}");
        assert!(!said.contains('\u{1b}') && !said.contains("panicked"), "{hostile} {words:?}: {said}");
    }
}

#[test]
fn faults_of_fmi_3_name_the_functions_of_fmi_3() {
    let place = Place::new(Version::Three);
    check(
        &place,
        &[],
        &[
            ("none:none", 0, ""),
            ("load:segv", 1, "lost in the loading of its library: its process ended by signal 11"),
            (
                "fmi3GetVersion:null",
                1,
                "fmi3GetVersion of the library answers \"NULL\" where \"3.0\" is needed",
            ),
            ("fmi3Instantiate:exit0", 1, "lost in fmi3Instantiate: its process ended by exit code 0"),
            ("fmi3EnterInitializationMode:kill", 1, "lost in fmi3EnterInitializationMode"),
            ("fmi3EnterInitializationMode:discard", 1, "fmi3EnterInitializationMode returned fmi3Discard"),
            ("fmi3DoStep:segv:0.5", 1, "lost in fmi3DoStep at t = 0.5 s: its process ended by signal 11"),
            ("fmi3DoStep:abort:0.5", 1, "lost in fmi3DoStep at t = 0.5 s: its process ended by signal 6"),
            ("fmi3DoStep:_exit:0.5", 1, "lost in fmi3DoStep at t = 0.5 s: its process ended by exit code 0"),
            ("fmi3DoStep:loop:0.5", 1, "lost in fmi3DoStep at t = 0.5 s: it did not return within 0.3 s"),
            ("fmi3DoStep:memory:0.5", 1, "lost in fmi3DoStep at t = 0.5 s: its process ended by signal 11"),
            ("fmi3DoStep:heap:0.5", 1, "lost in fmi3DoStep"),
            ("fmi3DoStep:shared:0.5", 1, "lost in"),
            ("fmi3DoStep:shrink:0.5", 0, ""),
            ("fmi3DoStep:grow:0.5", 0, ""),
            ("fmi3DoStep:close:0.5", 0, ""),
            ("fmi3DoStep:flood", 0, ""),
            ("fmi3DoStep:logn", 0, ""),
            ("fmi3DoStep:lognull", 0, ""),
            ("fmi3DoStep:logbytes:0.5", 1, "fmi3DoStep returned fmi3Error at t = 0.5 s"),
            ("fmi3DoStep:discard:0.5", 1, "fmi3DoStep returned fmi3Discard at t = 0.5 s"),
            ("fmi3DoStep:fatal:0.5", 1, "fmi3DoStep returned fmi3Fatal at t = 0.5 s"),
            ("fmi3DoStep:strange:0.5", 1, "fmi3DoStep returned the unknown status 77"),
            ("fmi3DoStep:early:0.5", 1, "returns early again and again and does not get on"),
            ("fmi3DoStep:back:0.5", 1, "returns early again and again and does not get on"),
            ("fmi3DoStep:crumbs:0.5", 1, "returns early again and again and does not get on"),
            ("fmi3DoStep:nanlast:0.5", 1, ""),
            ("fmi3DoStep:flags:0.5", 0, ""),
            ("fmi3DoStep:update:0.5", 0, ""),
            ("fmi3DoStep:updatenull:0.5", 0, ""),
            ("fmi3GetFloat64:over:0.5", 1, "lost in fmi3GetFloat64 at t = 0."),
            ("fmi3GetFloat64:nan:0.5", 1, "output `y` is NaN"),
            ("fmi3GetFloat64:inf:0.5", 1, "output `y` is inf"),
            ("fmi3GetString:null", 0, ""),
            ("fmi3GetString:bytes", 0, ""),
            ("fmi3GetString:wild", 1, "lost in fmi3GetString"),
            ("fmi3Terminate:segv", 0, "lost in fmi3Terminate: its process ended by signal 11"),
            ("fmi3FreeInstance:exit0", 0, "lost in fmi3FreeInstance: its process ended by exit code 0"),
            ("unload:segv", 0, "ended by signal 11 (SIGSEGV) when the library was unloaded"),
        ],
    );
}

#[test]
fn events_states_and_indicators_that_make_no_sense_end_the_run_or_do_no_harm() {
    let cases: [Case; 18] = [
        ("NewDiscreteStates:segv", 1, "lost in"),
        ("NewDiscreteStates:again", 1, "does not end in 100 rounds"),
        ("NewDiscreteStates:past", 1, "a time event of component `m` that does not move on"),
        ("NewDiscreteStates:dense", 1, "a time event of component `m` that does not move on"),
        ("NewDiscreteStates:nantime", 0, ""),
        ("NewDiscreteStates:inftime", 0, ""),
        ("NewDiscreteStates:end", 0, ""),
        ("CompletedIntegratorStep:end:0.5", 0, ""),
        ("GetDerivatives:nan:0.5", 1, "stays too large"),
        ("GetDerivatives:over", 1, "lost in"),
        ("GetDerivatives:discard:0.5", 1, "Discard at t = "),
        ("GetContinuousStates:nan", 1, "is NaN"),
        ("GetContinuousStates:over", 1, "lost in"),
        ("GetEventIndicators:over", 1, "lost in"),
        ("GetEventIndicators:nan:0.5", 1, "stays too large"),
        ("GetNominalsOfContinuousStates:zero", 0, ""),
        ("SetContinuousStates:error:0.5", 1, "Error at t = "),
        ("SetTime:fatal:0.5", 1, "Fatal at t = "),
    ];
    for version in [Version::Two, Version::Three] {
        let place = Place::new(version);
        for (hostile, code, part) in cases {
            let hostile = match version {
                Version::Two => format!("fmi2{hostile}"),
                Version::Three => format!("fmi3{hostile}")
                    .replace("NewDiscrete", "UpdateDiscrete")
                    .replace("GetDerivatives", "GetContinuousStateDerivatives"),
            };
            let (ended, said) = place.isolated(&hostile, &["--master", "monolithic"]);
            assert!(ended == Some(code) && said.contains(part), "{hostile}: {ended:?} {said}");
        }
    }
}

#[test]
fn faults_in_saved_states_name_the_function() {
    for (version, [get, size, serialize]) in [
        (Version::Two, ["fmi2GetFMUstate", "fmi2SerializedFMUstateSize", "fmi2SerializeFMUstate"]),
        (Version::Three, ["fmi3GetFMUState", "fmi3SerializedFMUStateSize", "fmi3SerializeFMUState"]),
    ] {
        let place = Place::new(version);
        for (fault, expected) in [
            (format!("{get}:segv"), format!("lost in {get}")),
            (format!("{size}:endless"), format!("{size} says that a saved state has {} bytes", u64::MAX)),
            (format!("{size}:wide"), format!("{size} says that a saved state has {} bytes", 1_u64 << 40)),
            (format!("{serialize}:over"), format!("lost in {serialize}")),
            (format!("{serialize}:error"), format!("{serialize} returned fmi")),
        ] {
            let (code, said) = place.isolated(&fault, &["--save-states", "1us"]);
            assert!(code == Some(1) && said.contains(&expected), "{fault}: {code:?} {said}");
        }
    }
}

#[test]
fn without_a_process_of_its_own_no_end_of_the_program_looks_like_success() {
    let place = Place::new(Version::Two);
    for (function, shown) in [
        ("load", "the FMU m.fmu ended the program in the loading of its library"),
        ("fmi2GetVersion", "the FMU m.fmu ended the program in the loading of its library"),
        ("fmi2Instantiate", "m: the FMU m.fmu ended the program in fmi2Instantiate"),
        ("fmi2SetReal", "m: the FMU m.fmu ended the program in fmi2SetReal"),
        ("fmi2DoStep", "m: the FMU m.fmu ended the program in fmi2DoStep"),
        ("fmi2Terminate", "m: the FMU m.fmu ended the program in fmi2Terminate"),
        ("fmi2FreeInstance", "m: the FMU m.fmu ended the program in fmi2FreeInstance"),
        ("unload", "the FMU m.fmu ended the program in the unloading of its library"),
    ] {
        for (fault, cause) in [
            ("segv", "by signal 11 (SIGSEGV)"),
            ("abort", "by signal 6 (SIGABRT)"),
            ("sigtrap", "by signal 5 (SIGTRAP)"),
            ("exit0", "by exit, which"),
            ("quick", "by exit, which"),
        ] {
            let output = place.run(&format!("{function}:{fault}"), &[]);
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(!output.status.success(), "{function} {fault}: {said}");
            assert!(said.contains(&format!("{shown} {cause}")), "{function} {fault}: {said}");
        }
    }
    let three = Place::new(Version::Three);
    let said = three.run("fmi3DoStep:segv:0.5", &[]).stderr;
    assert!(String::from_utf8_lossy(&said).contains("m: the FMU m.fmu ended the program in fmi3DoStep"));
}

#[test]
fn a_check_and_a_run_end_the_processes_that_a_library_started() {
    let place = Place::new(Version::Two);
    let folder = place.path("").display().to_string();
    let is_here = |entry: &std::fs::DirEntry| {
        let read = |file: &str| std::fs::read(entry.path().join(file)).unwrap_or_default();
        String::from_utf8_lossy(&[read("cmdline"), read("environ")].concat()).contains(&folder)
    };
    let alive = || std::fs::read_dir("/proc").unwrap().flatten().filter(is_here).count();
    for words in
        [&["inspect", "--check", "m.fmu"][..], &["run", "m.fmu", "--stop", "1", "--isolate", "-o", "out"]]
    {
        for fault in ["fork", "session"] {
            let output = place.airloop(&format!("fmi2Instantiate:{fault}"), words);
            assert!(output.status.code().is_some(), "{words:?} {fault}: {:?}", output.status);
            // Their end takes a moment.
            let ended = (0..100).any(|_| {
                std::thread::sleep(std::time::Duration::from_millis(20));
                alive() == 0
            });
            assert!(ended, "{words:?} {fault}: {} processes are left", alive());
        }
    }
}

#[test]
fn what_a_library_changes_for_the_whole_program_is_set_back() {
    let place = Place::new(Version::Two);
    let result = || std::fs::read(place.path("out/result.csv")).unwrap();
    let input = ["--input", "u.csv"];
    std::fs::write(place.path("u.csv"), "time,u\n0,0.1\n0.3,0.7\n1,0.2\n").unwrap();
    assert!(place.run("", &input).status.success());
    let undisturbed = result();
    for (hostile, note) in [
        ("load:round", "changed how the whole program rounds numbers"),
        ("load:flush", "changed how the whole program rounds numbers"),
        ("fmi2Instantiate:trapping", "changed how the whole program rounds numbers"),
        ("fmi2Instantiate:chdir", "changed the working directory"),
        ("fmi2ExitInitializationMode:chdir", "changed the working directory"),
        ("fmi2ExitInitializationMode:locale", ""),
        ("fmi2Instantiate:thread", ""),
        ("fmi2Instantiate:threads", ""),
    ] {
        let output = place.run(hostile, &input);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success() && said.contains(note), "{hostile}: {:?} {said}", output.status);
        assert!(result() == undisturbed, "{hostile}");
    }
    let said = place.run("fmi2DoStep:round:0.5", &input).stderr;
    assert!(
        String::from_utf8_lossy(&said).contains("m.fmu: the library changed how the whole program rounds")
    );
}

#[test]
fn checks_and_sweeps_survive_what_an_fmu_does() {
    let plan = "kind = \"simulate\"\nsystem = \"m.fmu\"\n[run]\nstep = 0.01\n[[factors]]\nname = \"run.stop\"\nvalues = [0.1, 0.3]\n\
                [[quantities]]\nname = \"end\"\nsignal = \"y\"\nof = \"final\"\n";
    for (version, step, get) in
        [(Version::Two, "fmi2DoStep", "fmi2GetReal"), (Version::Three, "fmi3DoStep", "fmi3GetFloat64")]
    {
        let place = Place::new(version);
        std::fs::write(place.path("plan.toml"), plan).unwrap();
        for (fault, part) in [
            (format!("{step}:segv"), "SIGSEGV"),
            (format!("{step}:exit0"), "exit"),
            (format!("{get}:abort"), "SIGABRT"),
            ("load:segv".into(), "SIGSEGV"),
            (format!("{step}:loop"), "did not return within 2 s"),
        ] {
            let output = place.airloop(&fault, &["inspect", "--check", "--time-limit", "2", "m.fmu"]);
            let said = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(1), "{fault}: {said}");
            assert!(said.contains(part), "{fault}: {said}");
            assert_eq!(names(&place.path("tmp")), [] as [String; 0], "{fault}");
        }
        let output = place.airloop("", &["sweep", "plan", "plan.toml", "-o", "sweep"]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        for (fault, cause) in [
            (format!("{step}:segv:0.2"), format!("lost in {step} at t = 0.2 s")),
            (format!("{step}:loop:0.2"), "did not return within 0.3 s".to_owned()),
            (format!("{get}:nan:0.2"), "is NaN".to_owned()),
        ] {
            let _ = std::fs::remove_dir_all(place.path("done"));
            let planned = place.airloop("", &["sweep", "plan", "plan.toml", "-o", "done", "-q"]);
            assert!(planned.status.success());
            let run = ["sweep", "run", "done", "--isolate", "--call-limit", "300ms", "-q"];
            assert!(place.airloop(&fault, &run).status.success(), "{fault}");
            assert!(place.airloop("", &["sweep", "merge", "done", "-q"]).status.success(), "{fault}");
            let rows = std::fs::read_to_string(place.path("done/results.csv")).unwrap();
            let rows: Vec<&str> = rows.lines().skip(1).collect();
            // The shorter task ends before the fault.
            assert!(rows[0].contains(",ok,"), "{fault}: {rows:?}");
            assert!(rows[1].contains(",failed,") && rows[1].contains(&cause), "{fault}: {rows:?}");
            assert_eq!(names(&place.path("tmp")), [] as [String; 0], "{fault}");
        }
    }
}
