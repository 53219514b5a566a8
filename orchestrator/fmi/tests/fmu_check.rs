//! The FMU checker: a sound FMU has no findings, and each planted fault is found by its rule.
#![cfg(target_os = "linux")]

use airloop_fmi::Fmu;
use airloop_fmi::check::{Finding, Severity, dynamic_findings, static_findings};
use airloop_testing::fmu_library::{FIRST_ORDER as SOUND, archive, compiled, save};
use tempfile::TempDir;

fn troubles(findings: Vec<Finding>) -> Vec<Finding> {
    findings.into_iter().filter(|finding| finding.severity > Severity::Note).collect()
}

fn static_troubles(xml: &str) -> Vec<Finding> {
    let folder = TempDir::new().unwrap();
    let files = archive(&[("modelDescription.xml", xml.as_bytes()), ("binaries/linux64/m.so", b"")]);
    troubles(static_findings(&Fmu::open(&save(&folder, "m.fmu", &files)).unwrap()))
}

fn dynamic_troubles(xml: &str, macros: &[&str]) -> Vec<Finding> {
    let folder = TempDir::new().unwrap();
    troubles(dynamic_findings(&Fmu::open(&compiled(&folder, "first_order.c", xml, macros)).unwrap()))
}

#[test]
fn a_sound_fmu_has_no_findings() {
    assert_eq!(static_troubles(SOUND), []);
    assert_eq!(dynamic_troubles(SOUND, &[]), []);
}

#[test]
fn each_static_fault_is_found_by_its_rule() {
    let with = |line: &str| format!("{line}</ModelVariables>");
    let extra = |line: &str| ("</ModelVariables>", with(line));
    let cases: Vec<(&str, String, &str, &str)> = vec![
        ("start=\"0\" min=\"-5\"", "start=\"-6\" min=\"-5\"".into(), "start-range", "variable u (line 10)"),
        ("min=\"-2\" max=\"2\"", "min=\"2\" max=\"-2\"".into(), "min-max", "variable p"),
        ("stopTime=\"1\"", "stopTime=\"-1\"".into(), "default-experiment", "DefaultExperiment"),
        ("stepSize=\"0.01\"", "stepSize=\"0\"".into(), "default-experiment", "DefaultExperiment"),
        (" numberOfEventIndicators=\"0\"", String::new(), "event-indicators", "fmiModelDescription"),
        ("derivative=\"2\"", "derivative=\"5\"".into(), "derivative-of-non-state", "variable der(x)"),
        ("derivative=\"2\"", "derivative=\"3\"".into(), "derivative-of-non-state", "variable der(x)"),
        (" derivative=\"2\"", String::new(), "structure-derivatives", "variable der(x)"),
        (
            "<Derivatives><Unknown index=\"3\" dependencies=\"1 2\" dependenciesKind=\"constant fixed\"/></Derivatives>",
            String::new(),
            "structure-derivatives",
            "variable der(x)",
        ),
        (
            "causality=\"input\"><Real unit=\"m\" start=\"0\"",
            "causality=\"input\"><Real unit=\"m\"".into(),
            "start-missing",
            "variable u",
        ),
        (
            "causality=\"output\"><Real/>",
            "causality=\"output\"><Real start=\"1\"/>".into(),
            "start-forbidden",
            "variable y",
        ),
        ("variability=\"fixed\"", "variability=\"continuous\"".into(), "causality-variability", "variable p"),
        ("causality=\"input\"", "causality=\"input\" initial=\"exact\"".into(), "initial", "variable u"),
        (
            "<Outputs><Unknown index=\"4\"",
            "<Outputs><Unknown index=\"2\"".into(),
            "structure-outputs",
            "variable y",
        ),
        (
            "<Unknown index=\"4\" dependencies=\"1 2\"/>",
            String::new(),
            "structure-initial-unknowns",
            "variable y",
        ),
        (
            "<Unknown index=\"4\" dependencies=\"1 2\"/>",
            "<Unknown index=\"2\"/>".into(),
            "structure-initial-unknowns",
            "variable x",
        ),
        (
            "dependencies=\"1 2\" dependenciesKind=\"dependent constant\"",
            "dependencies=\"3\"".into(),
            "structure-knowns",
            "variable y",
        ),
        (
            "<Real unit=\"m\" start=\"0\"",
            "<Real unit=\"furlong\" start=\"0\"".into(),
            "unit-undeclared",
            "variable u",
        ),
        ("displayUnit=\"mm\"", "displayUnit=\"cm\"".into(), "display-unit", "variable x"),
        ("<BaseUnit m=\"1\"/>", "<BaseUnit m=\"2\"/>".into(), "unit-base", "Unit m"),
        ("nominal=\"1\"", "nominal=\"0\"".into(), "nominal", "variable x"),
        ("name=\"u\"", "name=\"u v\"".into(), "naming-convention", "variable u v"),
        (
            "<Category name=\"logAll\"/>",
            "<Category name=\"logAll\"/><Category name=\"logAll\"/>".into(),
            "duplicate-definition",
            "Category logAll",
        ),
        (
            "<CoSimulation modelIdentifier=\"m\"",
            "<CoSimulation modelIdentifier=\"n\"".into(),
            "binary-missing",
            "binaries/linux64/n.so",
        ),
        (
            "<CoSimulation modelIdentifier=\"m\" canGetAndSetFMUstate=\"true\"",
            "<CoSimulation modelIdentifier=\"m\"".into(),
            "capabilities",
            "Co-Simulation",
        ),
    ];
    let more = [
        (
            extra(
                "<ScalarVariable name=\"e\" valueReference=\"9\" causality=\"parameter\" variability=\"fixed\"><Enumeration declaredType=\"Mode\" start=\"3\"/></ScalarVariable>",
            ),
            ("start-range", "variable e"),
        ),
        (
            extra("<ScalarVariable name=\"a\" valueReference=\"1\"><Real/></ScalarVariable>"),
            ("alias", "variable a"),
        ),
        (
            extra(
                "<ScalarVariable name=\"i\" valueReference=\"9\" variability=\"continuous\"><Integer/></ScalarVariable>",
            ),
            ("causality-variability", "variable i"),
        ),
    ];
    let more = more.into_iter().map(|((from, to), (rule, element))| (from, to, rule, element));
    for (from, to, rule, element) in cases.into_iter().chain(more) {
        assert!(SOUND.contains(from), "{from}");
        let found = static_troubles(&SOUND.replacen(from, &to, 1));
        assert!(
            found.iter().any(|finding| finding.rule == rule && finding.element.contains(element)),
            "{rule} at {element} is missing for {to:?}: {found:#?}"
        );
    }
}

#[test]
fn each_dynamic_fault_is_found_by_its_rule() {
    let cases = [
        ("ANY_GUID", "guid"),
        ("RESET_KEEPS_X", "reset"),
        ("SHARED_X", "instances"),
        ("STATE_WITHOUT_X", "state"),
        ("WRONG_DERIVATIVE", "directional-derivative"),
        ("NAN_OUTPUT", "non-finite"),
        ("WRONG_START", "start-value"),
        ("ENDLESS_EVENTS", "event-iteration"),
        ("STEP_FAILS", "life-cycle"),
        ("CURVED", "dependency-kind"),
    ];
    for (fault, rule) in cases {
        let found = dynamic_troubles(SOUND, &[&format!("-D{fault}")]);
        assert!(
            found.iter().any(|finding| finding.rule == rule),
            "{rule} is missing for {fault}: {found:#?}"
        );
    }
}

#[test]
fn a_dependency_that_is_not_declared_is_found() {
    let xml =
        SOUND.replace("dependencies=\"1 2\" dependenciesKind=\"dependent constant\"", "dependencies=\"2\"");
    let found = dynamic_troubles(&xml, &[]);
    assert!(
        found
            .iter()
            .any(|finding| finding.rule == "dependency-undeclared" && finding.element.contains("y by u")),
        "{found:#?}"
    );
}

#[test]
fn a_derivative_of_a_non_state_before_a_state_is_a_finding() {
    // States are counted among all derivatives, of which the first is that of a parameter.
    let extra = "<ScalarVariable name=\"der(p)\" valueReference=\"2\"><Real derivative=\"5\"/></ScalarVariable></ModelVariables>";
    let xml = SOUND.replace("</ModelVariables>", extra);
    let xml = xml.replace("<Derivatives>", "<Derivatives><Unknown index=\"6\"/>");
    assert!(static_troubles(&xml).iter().any(|finding| finding.rule == "derivative-of-non-state"));
    // The library has one state and refuses two.
    assert!(dynamic_troubles(&xml, &[]).iter().any(|finding| finding.severity == Severity::Error));
}

#[test]
fn an_absurd_number_of_event_indicators_is_refused_by_name() {
    let xml = SOUND.replace("numberOfEventIndicators=\"0\"", "numberOfEventIndicators=\"4294967295\"");
    let folder = TempDir::new().unwrap();
    let files = archive(&[("modelDescription.xml", xml.as_bytes())]);
    let message = Fmu::open(&save(&folder, "m.fmu", &files)).unwrap_err().to_string();
    assert!(
        message.contains("numberOfEventIndicators=\"4294967295\"") && message.contains("1000000"),
        "{message}"
    );
}

#[test]
fn descriptions_that_are_not_utf_8_are_refused_with_what_fmi_asks_for() {
    let folder = TempDir::new().unwrap();
    let message = |bytes: &[u8]| {
        let files = archive(&[("modelDescription.xml", bytes)]);
        Fmu::open(&save(&folder, "m.fmu", &files)).unwrap_err().to_string()
    };
    let latin: Vec<u8> = SOUND
        .replace("UTF-8", "ISO-8859-1")
        .replace("modelName=\"m\"", "modelName=\"\u{e4}\"")
        .chars()
        .map(|c| c as u8)
        .collect();
    let found = message(&latin);
    assert!(found.contains("written in ISO-8859-1") && found.contains("FMI 2.0 asks for UTF-8"), "{found}");
    let wide: Vec<u8> = SOUND.encode_utf16().flat_map(u16::to_le_bytes).collect();
    assert!(message(&wide).contains("UTF-16"));
}

#[test]
fn reference_fmus_have_no_errors() {
    let Some(folder) = std::env::var_os("AIRLOOP_REFERENCE_FMUS") else {
        eprintln!("skipped: AIRLOOP_REFERENCE_FMUS does not name the folder of the Reference FMUs");
        return;
    };
    for name in ["BouncingBall", "Dahlquist", "Feedthrough", "Resource", "Stair", "VanDerPol"] {
        let fmu = Fmu::open(&std::path::Path::new(&folder).join(format!("{name}.fmu"))).unwrap();
        let findings = static_findings(&fmu).into_iter().chain(dynamic_findings(&fmu));
        let errors: Vec<_> = findings.filter(|finding| finding.severity == Severity::Error).collect();
        assert_eq!(errors, [], "{name}");
    }
}

#[test]
fn hostile_model_descriptions_are_judged_without_panic() {
    let folder = TempDir::new().unwrap();
    // A small linear congruential generator: the same damage in every run.
    let mut random = 12345_u64;
    let mut next = |below: usize| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 33) as usize % below
    };
    let mut judged = 0;
    for _ in 0..400 {
        let mut xml = SOUND.as_bytes().to_vec();
        // Digits for digits keep the file well-formed and hit indices, bounds and references.
        let digits: Vec<_> = (0..xml.len()).filter(|&at| xml[at].is_ascii_digit()).collect();
        for _ in 0..1 + next(4) {
            xml[digits[next(digits.len())]] = b'0' + next(10) as u8;
        }
        let Ok(xml) = String::from_utf8(xml) else { continue };
        let files = archive(&[("modelDescription.xml", xml.as_bytes())]);
        if let Ok(fmu) = Fmu::open(&save(&folder, "m.fmu", &files)) {
            static_findings(&fmu);
            judged += 1;
        }
    }
    assert!(judged > 100, "{judged} of 400 files could be opened");
}
