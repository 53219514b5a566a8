//! FMI 3.0 through the same calls as 2.0, on `vector.c`: descriptions, types, arrays, events, states, derivatives.
#![cfg(target_os = "linux")]

use std::sync::Arc;

use airloop_fmi::check::{Severity, dynamic_findings, static_findings};
use airloop_fmi::{Causality, Error, Fmu, Instance, Model, Slave, StepStatus, Variability, VariableKind};
use airloop_testing::vector;
use tempfile::TempDir;

fn open(folder: &TempDir) -> Arc<Fmu> {
    Fmu::open(&folder.path().join("vector.fmu")).unwrap()
}

fn references(fmu: &Fmu, names: &[&str]) -> Vec<u32> {
    names.iter().map(|name| fmu.description.variable(name).expect(name).value_reference).collect()
}

fn reals(instance: &mut Instance, names: &[&str]) -> Vec<f64> {
    let mut values = vec![0.0; names.len()];
    let references = references(&Arc::clone(instance.fmu()), names);
    instance.get_real(&references, &mut values).unwrap();
    values
}

fn set_reals(instance: &mut Instance, names: &[&str], values: &[f64]) {
    let references = references(&Arc::clone(instance.fmu()), names);
    instance.set_real(&references, values).unwrap();
}

fn integer(instance: &mut Instance, name: &str) -> i64 {
    let references = references(&Arc::clone(instance.fmu()), &[name]);
    let mut value = [0];
    instance.get_integer(&references, &mut value).unwrap();
    value[0]
}

fn initialize(instance: &mut Instance) {
    instance.setup_experiment(None, 0.0, None).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
}

/// A and x after `steps` steps of ten explicit Euler steps each, typed independently of the FMU.
fn euler(a: &[[f64; 2]; 2], u: [f64; 2], mut x: [f64; 2], h: f64, steps: usize) -> [f64; 2] {
    for _ in 0..10 * steps {
        let rate = [0, 1].map(|i| a[i][0] * x[0] + a[i][1] * x[1] + u[i]);
        x = [x[0] + h / 10.0 * rate[0], x[1] + h / 10.0 * rate[1]];
    }
    x
}

const A: [[f64; 2]; 2] = [[1.0, 2.0], [3.0, 4.0]];

#[test]
fn arrays_aliases_and_types_become_variables() {
    let folder = vector::folder();
    let fmu = open(&folder);
    let description = &fmu.description;
    assert_eq!((description.fmi_version.as_str(), description.guid.as_str()), ("3.0", "vector"));
    let names: Vec<&str> = description.variables.iter().map(|variable| variable.name.as_str()).collect();
    assert_eq!(
        names[..14],
        [
            "time",
            "n",
            "A[1,1]",
            "A[1,2]",
            "A[2,1]",
            "A[2,2]",
            "u[1]",
            "u[2]",
            "x[1]",
            "x[2]",
            "x_mm[1]",
            "x_mm[2]",
            "der(x)[1]",
            "der(x)[2]"
        ]
    );
    let start = |name: &str| match &description.variable(name).unwrap().kind {
        VariableKind::Real(real) => real.start,
        other => panic!("{other:?}"),
    };
    // One value for all elements, one for each, and more than there are.
    assert_eq!((start("u[2]"), start("A[2,1]"), start("x[2]")), (Some(0.0), Some(3.0), Some(-1.0)));
    let (place, alias) = (description.variable("x[2]").unwrap(), description.variable("x_mm[2]").unwrap());
    assert_eq!(place.value_reference, alias.value_reference);
    let VariableKind::Real(real) = &alias.kind else { panic!() };
    assert_eq!((real.unit.as_deref(), real.display_unit.as_deref()), (Some("m"), Some("mm")));
    assert_eq!(description.continuous_states().collect::<Vec<_>>(), [8, 9]);
    assert_eq!(description.number_of_event_indicators, 1);
    let of_y: Vec<&str> = description.outputs[1]
        .dependencies
        .as_ref()
        .unwrap()
        .iter()
        .map(|dependency| names[dependency.variable])
        .collect();
    assert_eq!(of_y, ["u[1]", "u[2]", "x[1]", "x[2]"]);
    let unread: Vec<_> = description.unread.iter().map(|v| (v.name.as_str(), v.kind.as_str())).collect();
    assert_eq!(unread, [("ticks", "Clock")]);
    let default = |name: &str| description.variable(name).unwrap().variability;
    assert_eq!(
        (default("A[1,1]"), default("u[1]"), default("i8_in")),
        (Variability::Fixed, Variability::Continuous, Variability::Discrete)
    );
    assert_eq!(description.variable("n").unwrap().causality, Causality::Parameter);
}

#[test]
fn every_type_passes_through_with_its_range() {
    let folder = vector::folder();
    let fmu = open(&folder);
    let mut slave = Slave::instantiate(&fmu, "it", false).unwrap();
    initialize(&mut slave);
    let kinds = [
        ("i8", i64::from(i8::MIN), 128),
        ("u8", 255, 256),
        ("i16", i64::from(i16::MIN), 32_768),
        ("u16", 65_535, 65_536),
        ("i32", i64::from(i32::MIN), 1 << 31),
        ("u32", i64::from(u32::MAX), 1 << 32),
        // Not a number that f64 has.
        ("i64", -(1 << 53) - 1, 0),
        ("u64", i64::MAX, -1),
    ];
    // All at once, so that types alternate within a call.
    let names: Vec<String> = kinds.iter().map(|(name, _, _)| format!("{name}_in")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    slave.set_integer(&references(&fmu, &names), &kinds.map(|(_, value, _)| value)).unwrap();
    for (name, value, beyond) in kinds {
        assert_eq!(integer(&mut slave, &format!("{name}_out")), value, "{name}");
        if name == "i64" {
            continue;
        }
        let error = slave.set_integer(&references(&fmu, &[&format!("{name}_in")]), &[beyond]).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("fmi3Discard") && text.contains(&format!("{name}_in takes")), "{text}");
    }
    slave.set_integer(&references(&fmu, &["choice_in"]), &[2]).unwrap();
    assert_eq!(integer(&mut slave, "choice_out"), 2);
    set_reals(&mut slave, &["f32_in"], &[0.1]);
    assert_eq!(reals(&mut slave, &["f32_out"]), [f64::from(0.1_f32)]);
    slave.set_string(&references(&fmu, &["text_in"]), &["grüße 100 %s"]).unwrap();
    assert_eq!(slave.get_string(&references(&fmu, &["text_out"])).unwrap(), ["grüße 100 %s"]);
    slave.set_boolean(&references(&fmu, &["flag_in"]), &[true]).unwrap();
    let mut flag = [false];
    slave.get_boolean(&references(&fmu, &["flag_out"]), &mut flag).unwrap();
    assert_eq!(flag, [true]);
    let bytes = references(&fmu, &["bytes_out", "bytes_in"]);
    assert_eq!(slave.get_string(&bytes).unwrap(), ["00ff10", "00ff10"]);
    for text in ["", "7F00", "0123456789abcdef"] {
        slave.set_string(&bytes[1..], &[text]).unwrap();
        assert_eq!(slave.get_string(&bytes[..1]).unwrap(), [text.to_lowercase()]);
    }
    let error = slave.set_string(&bytes[1..], &["0g"]).unwrap_err().to_string();
    assert!(error.contains("bytes_in takes bytes as pairs of hexadecimal digits"), "{error}");
    // The output is 2^40 larger now.
    let error = slave.get_integer(&references(&fmu, &["u64_out"]), &mut [0]).unwrap_err().to_string();
    assert!(
        error.contains("u64_out is 9223373136366403583: integers are carried with 64 bits and a sign"),
        "{error}"
    );
}

#[test]
fn elements_of_an_array_are_set_one_by_one_or_together() {
    let folder = vector::folder();
    let fmu = open(&folder);
    let mut slave = Slave::instantiate(&fmu, "it", false).unwrap();
    set_reals(&mut slave, &["A[2,1]"], &[-3.0]);
    set_reals(&mut slave, &["A[1,2]", "A[1,1]", "u[2]"], &[5.0, -1.0, 0.25]);
    initialize(&mut slave);
    set_reals(&mut slave, &["u[1]", "u[2]"], &[0.5, -0.25]);
    set_reals(&mut slave, &["u[1]"], &[1.5]);
    assert_eq!(reals(&mut slave, &["A[1,1]", "A[1,2]", "A[2,1]", "A[2,2]"]), [-1.0, 5.0, -3.0, 4.0]);
    assert_eq!(reals(&mut slave, &["u[2]", "u[1]", "y[2]", "x_mm[1]"]), [-0.25, 1.5, -2.25, 1.0]);
    // der(x) = A x + u with x = (1, -1).
    assert_eq!(reals(&mut slave, &["der(x)[1]", "der(x)[2]"]), [-1.0 - 5.0 + 1.5, -3.0 - 4.0 - 0.25]);
    // What was set is not believed any more after a reset.
    slave.reset().unwrap();
    set_reals(&mut slave, &["A[2,2]"], &[7.0]);
    assert_eq!(reals(&mut slave, &["A[1,1]", "A[1,2]", "A[2,1]", "A[2,2]"]), [1.0, 2.0, 3.0, 7.0]);
}

#[test]
fn a_slave_steps_also_where_it_returns_early_and_gets_its_intermediate_updates_answered() {
    let folder = vector::folder();
    let fmu = open(&folder);
    for early in [false, true] {
        let mut slave = Slave::instantiate(&fmu, "it", false).unwrap();
        slave.set_boolean(&references(&fmu, &["early"]), &[early]).unwrap();
        initialize(&mut slave);
        set_reals(&mut slave, &["u[1]", "u[2]"], &[0.5, -0.25]);
        for step in 0..3 {
            assert_eq!(slave.do_step(f64::from(step) * 0.1, 0.1, true).unwrap(), StepStatus::Complete);
        }
        let (h, parts) = if early { (0.05, 6) } else { (0.1, 3) };
        let expected = euler(&A, [0.5, -0.25], [1.0, -1.0], h, parts);
        let x = reals(&mut slave, &["x[1]", "x[2]"]);
        assert!(
            (x[0] - expected[0]).abs() < 1e-13 && (x[1] - expected[1]).abs() < 1e-13,
            "{x:?} {expected:?}"
        );
        assert_eq!(integer(&mut slave, "updates"), 10 * parts as i64);
        assert_eq!(integer(&mut slave, "count"), 1);
        let mut slope = [0.0];
        slave.get_real_output_derivatives(&references(&fmu, &["y[2]"]), &[1], &mut slope).unwrap();
        assert!((slope[0] - 2.0 * (3.0 * x[0] + 4.0 * x[1] - 0.25)).abs() < 1e-12);
    }
}

#[test]
fn states_are_saved_and_serialized() {
    let folder = vector::folder();
    let fmu = open(&folder);
    let mut slave = Slave::instantiate(&fmu, "it", false).unwrap();
    initialize(&mut slave);
    set_reals(&mut slave, &["u[1]"], &[0.5]);
    slave.do_step(0.0, 0.1, false).unwrap();
    let mut saved = None;
    slave.get_state(&mut saved).unwrap();
    let (saved, names) = (saved.unwrap(), ["x[1]", "x[2]", "u[1]", "u[2]"]);
    let bytes = slave.serialize_state(&saved).unwrap();
    let before = reals(&mut slave, &names);
    set_reals(&mut slave, &["u[1]", "u[2]"], &[7.0, 8.0]);
    slave.do_step(0.1, 0.1, false).unwrap();
    assert_ne!(reals(&mut slave, &names), before);
    slave.set_state(&saved).unwrap();
    assert_eq!(reals(&mut slave, &names), before);
    // Of the other element holds what the state brought back.
    set_reals(&mut slave, &["u[2]"], &[1.0]);
    assert_eq!(reals(&mut slave, &["u[1]", "u[2]"]), [0.5, 1.0]);

    let mut other = Slave::instantiate(&fmu, "other", false).unwrap();
    initialize(&mut other);
    let state = other.deserialize_state(&bytes).unwrap();
    other.set_state(&state).unwrap();
    assert_eq!(reals(&mut other, &names), before);
}

#[test]
fn a_model_has_states_derivatives_events_and_directional_derivatives() {
    let folder = vector::folder();
    let fmu = open(&folder);
    let mut model = Model::instantiate(&fmu, "it", false).unwrap();
    initialize(&mut model);
    let info = model.new_discrete_states().unwrap();
    assert_eq!((info.new_discrete_states_needed, info.next_event_time), (false, Some(0.25)));
    model.enter_continuous_time_mode().unwrap();
    let (mut x, mut rate, mut z, mut nominals) = ([0.0; 2], [0.0; 2], [0.0], [0.0; 2]);
    model.get_continuous_states(&mut x).unwrap();
    model.get_derivatives(&mut rate).unwrap();
    model.get_nominals(&mut nominals).unwrap();
    assert_eq!((x, rate, nominals), ([1.0, -1.0], [-1.0, -1.0], [1.0, 1.0]));
    // Single elements of arrays: the rest has no seed.
    let (unknown, known) =
        (references(&fmu, &["der(x)[2]", "y[1]", "y[2]"]), references(&fmu, &["x[1]", "u[2]", "x[2]"]));
    let mut out = [0.0; 3];
    model.directional_derivative(&unknown, &known, &[1.0, 10.0, 100.0], &mut out).unwrap();
    assert_eq!(out, [3.0 + 10.0 + 400.0, 2.0, 10.0 + 200.0]);

    model.set_time(0.25).unwrap();
    model.set_continuous_states(&[0.25, 3.0]).unwrap();
    model.get_event_indicators(&mut z).unwrap();
    assert_eq!(z, [-0.25]);
    model.enter_event_mode().unwrap();
    assert_eq!(model.new_discrete_states().unwrap().next_event_time, Some(0.5));
    assert_eq!(integer(&mut model, "count"), 1);
    let mut below = [false];
    model.get_boolean(&references(&fmu, &["below"]), &mut below).unwrap();
    assert_eq!(below, [true]);
}

#[test]
fn lengths_of_arrays_are_set_before_anything_else() {
    let folder = vector::folder();
    let fmu = open(&folder).resized(&[("n".to_owned(), 3)]).unwrap();
    let description = &fmu.description;
    assert!(description.variable("A[3,3]").is_some() && description.variable("x[4]").is_none());
    assert_eq!(description.derivatives.len(), 3);
    let mut slave = Slave::instantiate(&fmu, "it", false).unwrap();
    set_reals(&mut slave, &["A[3,3]"], &[-1.0]);
    initialize(&mut slave);
    assert_eq!(reals(&mut slave, &["A[3,3]", "x[1]", "x[2]", "x[3]"]), [-1.0, 1.0, -1.0, 1.0]);
    slave.reset().unwrap();
    initialize(&mut slave);
    assert_eq!(reals(&mut slave, &["x[3]"]), [1.0]);
    // The value that it has may be set, another one may not.
    let n = references(&fmu, &["n"]);
    slave.reset().unwrap();
    slave.set_integer(&n, &[3]).unwrap();
    let error = slave.set_integer(&n, &[2]).unwrap_err().to_string();
    assert!(error.contains("it is the length of an array"), "{error}");
}

#[test]
fn a_structural_parameter_that_the_fmu_refuses_is_named() {
    let folder = vector::folder();
    let fmu = open(&folder).resized(&[("n".to_owned(), 5)]).unwrap();
    let error = Slave::instantiate(&fmu, "it", false).unwrap_err().to_string();
    for part in ["until a structural parameter is set", "n is too large", "valueReference 1 = 5"] {
        assert!(error.contains(part), "{error}");
    }
}

/// The FMU unpacked, with a file of terminals.
fn with_terminals(folder: &TempDir, terminals: &str) -> Arc<Fmu> {
    let path = folder.path().join("unpacked");
    if !path.exists() {
        let file = std::fs::File::open(folder.path().join("vector.fmu")).unwrap();
        zip::ZipArchive::new(file).unwrap().extract(&path).unwrap();
        std::fs::create_dir(path.join("terminalsAndIcons")).unwrap();
    }
    let text = format!("<fmiTerminalsAndIcons fmiVersion=\"3.0\">{terminals}</fmiTerminalsAndIcons>");
    std::fs::write(path.join("terminalsAndIcons/terminalsAndIcons.xml"), text).unwrap();
    Fmu::open(&path).unwrap()
}

#[test]
fn terminals_are_read_and_held_against_the_variables() {
    let folder = vector::folder();
    assert!(open(&folder).terminals().is_none());
    let good = "<Terminals><Terminal name=\"plug\" matchingRule=\"plug\" terminalKind=\"org.example.force\">\
                <TerminalMemberVariable variableName=\"u\" memberName=\"force\" variableKind=\"signal\"/>\
                <TerminalStreamMemberVariable inStreamVariableName=\"f32_in\" outStreamVariableName=\"f32_out\" memberName=\"h\"/>\
                <Terminal name=\"inner\" matchingRule=\"sequence\"><TerminalMemberVariable variableName=\"ticks\"/></Terminal>\
                </Terminal></Terminals>";
    let fmu = with_terminals(&folder, good);
    let all = fmu.terminals().unwrap().unwrap();
    let names: Vec<&str> = all.terminals.iter().map(|terminal| terminal.name.as_str()).collect();
    assert_eq!(names, ["plug", "plug.inner"]);
    let members = &all.terminals[0].members;
    let of = |i: usize| (members[i].variable.as_str(), members[i].role.as_deref());
    assert_eq!(
        [of(0), of(1), of(2)],
        [("u", Some("signal")), ("f32_in", Some("inStream")), ("f32_out", Some("outStream"))]
    );
    let found = |fmu: &Fmu| -> Vec<String> {
        let findings = static_findings(fmu).into_iter().filter(|finding| finding.rule == "terminals");
        findings.map(|finding| format!("{}: {}", finding.element, finding.message)).collect()
    };
    assert_eq!(found(&fmu), [""; 0]);
    let cases: [(&str, &str, &[&str]); 5] = [
        (
            "variableName=\"u\"",
            "variableName=\"nothing\"",
            &["terminal plug (line 1)", "no variable nothing"],
        ),
        ("matchingRule=\"plug\"", "matchingRule=\"plugs\"", &["plugs", "none of plug, bus, sequence"]),
        (" matchingRule=\"sequence\"", "", &["Terminal: the attribute matchingRule is missing"]),
        (
            "memberName=\"h\"/>",
            "memberName=\"h\"/><TerminalGraphicalRepresentation iconBaseName=\"p\"/>",
            &["p.png"],
        ),
        ("</Terminal></Terminals>", "</Terminals>", &["line 1"]),
    ];
    for (from, to, parts) in cases {
        let all = found(&with_terminals(&folder, &good.replace(from, to)));
        assert!(all.len() == 1 && parts.iter().all(|part| all[0].contains(part)), "{to}: {all:?}");
    }
}

#[test]
fn what_cannot_be_imported_is_named() {
    let folder = TempDir::new().unwrap();
    let refused = |from: &str, to: &str| {
        let text = vector::description();
        assert!(text.contains(from), "{from}");
        let path = vector::fmu(folder.path(), "changed.fmu", &text.replace(from, to));
        Fmu::open(&path).and_then(|fmu| Slave::instantiate(&fmu, "it", false)).unwrap_err().to_string()
    };
    let cases: [(&str, &str, &[&str]); 8] = [
        ("fmiVersion=\"3.0\"", "fmiVersion=\"3.0-rc.1\"", &["3.0-rc.1", "2.0 and 3.0"]),
        (
            "<Clock name=\"ticks\" valueReference=\"51\" causality=\"output\"",
            "<Clock name=\"ticks\" valueReference=\"51\" causality=\"input\"",
            &["Clock \"ticks\"", "input clock"],
        ),
        (
            "instantiationToken=\"vector\"",
            "instantiationToken=\"other\"",
            &["fmi3Instantiate", "returned NULL", "wrong token"],
        ),
        ("derivative=\"4\"", "derivative=\"49\"", &["der(x)", "derivative=\"49\""]),
        ("derivative=\"4\"", "derivative=\"1\"", &["der(x)", "2 elements", "derivative 1"]),
        ("<Output valueReference=\"6\"", "<Output valueReference=\"60\"", &["value reference 60"]),
        (
            "<Float64 name=\"u\" valueReference=\"3\" causality=\"input\" start=\"0\"><Dimension valueReference=\"1\"/>",
            "<Float64 name=\"u\" valueReference=\"3\" causality=\"input\" start=\"0\"><Dimension start=\"9000000\"/>",
            &["Float64 \"u\"", "1000000 elements"],
        ),
        (
            "name=\"early\" valueReference=\"40\"",
            "name=\"early\" valueReference=\"6\"",
            &["Boolean \"early\"", "another variable has the valueReference 6"],
        ),
    ];
    for (from, to, expected) in cases {
        let message = refused(from, to);
        assert!(expected.iter().all(|part| message.contains(part)), "{to}: {message}");
    }
    let text = vector::description();
    let from = text.find("<ModelExchange").unwrap();
    let to = text.find("<UnitDefinitions").unwrap();
    let scheduled = text.replace(&text[from..to], "<ScheduledExecution modelIdentifier=\"vector\"/>");
    let error = Fmu::open(&vector::fmu(folder.path(), "scheduled.fmu", &scheduled)).unwrap_err();
    assert!(matches!(error, Error::Description { .. }) && error.to_string().contains("ScheduledExecution"));
}

#[test]
fn the_checker_finds_nothing_wrong_and_names_what_is() {
    let folder = vector::folder();
    let fmu = open(&folder);
    let mut findings = static_findings(&fmu);
    findings.extend(dynamic_findings(&fmu));
    findings.retain(|finding| finding.severity > Severity::Note);
    assert_eq!(findings, []);
    // A wrong dependency of an element is found by the same rules as in FMI 2.0.
    let text = vector::description().replace(
        "<Output valueReference=\"6\" dependencies=\"3 4\" dependenciesKind=\"constant constant\"/>",
        "<Output valueReference=\"6\" dependencies=\"3\"/>",
    );
    let fmu = Fmu::open(&vector::fmu(folder.path(), "wrong.fmu", &text)).unwrap();
    let findings = dynamic_findings(&fmu);
    assert!(findings.iter().any(|f| f.rule == "dependency-undeclared" && f.element.contains("y[1] by x[1]")));
}
