//! `airloop inspect`: description and checks of one FMU, as text and as JSON.
#![cfg(target_os = "linux")]

use airloop_testing::fmu_library::{FIRST_ORDER as SOUND, compiled};
use tempfile::TempDir;

#[test]
fn the_command_fails_for_errors_and_prints_json() {
    let folder = TempDir::new().unwrap();
    let airloop = |words: &[&str]| {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_airloop"))
            .args(words)
            .current_dir(folder.path())
            .output()
            .unwrap();
        (output.status.code(), String::from_utf8(output.stdout).unwrap())
    };
    compiled(&folder, "first_order.c", SOUND, &[]);
    let (code, text) = airloop(&["inspect", "m.fmu"]);
    assert_eq!(code, Some(0));
    assert!(text.contains("der(x)  <- u (constant factor), x (fixed factor)"), "{text}");
    assert!(text.contains("y  <- u\n"), "{text}");
    let (code, text) = airloop(&["inspect", "--check", "m.fmu"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("0 errors, 0 warnings"), "{text}");

    // What an FMU prints goes to the standard error, and a crash, an exit and an endless call are findings.
    let json = |words: &[&str]| {
        let (code, text) = airloop(&[&["inspect", "--check", "--json", "m.fmu"], words].concat());
        (code, serde_json::from_str::<serde_json::Value>(&text).expect(&text))
    };
    compiled(&folder, "first_order.c", SOUND, &["-DPRINTS"]);
    assert_eq!(json(&[]).0, Some(0));
    for (fault, words, expected) in [
        ("-DCRASHES", &[][..], "signal"),
        ("-DEXITS", &[][..], "exit code 0"),
        ("-DHANGS", &["--time-limit", "1"][..], "1 s"),
    ] {
        compiled(&folder, "first_order.c", SOUND, &[fault]);
        let (code, value) = json(words);
        assert_eq!(code, Some(1), "{fault}");
        let findings = value["checks"][0]["findings"].as_array().unwrap();
        let finding = findings.iter().find(|finding| finding["rule"] == "process-lost").expect(fault);
        assert!(finding["element"].as_str().unwrap().contains("fmi2ExitInitializationMode"), "{finding}");
        assert!(finding["message"].as_str().unwrap().contains(expected), "{finding}");
    }

    // An exit writes what the C library has buffered, and the last of it stands in the finding.
    compiled(&folder, "first_order.c", SOUND, &["-DPRINTS", "-DEXITS"]);
    let (_, value) = json(&[]);
    assert!(value.to_string().contains("printed last: this is not JSON {"), "{value}");

    compiled(&folder, "first_order.c", &SOUND.replace("stopTime=\"1\"", "stopTime=\"-1\""), &[]);
    let (code, text) = airloop(&["inspect", "--check", "--no-run", "--json", "m.fmu"]);
    assert_eq!(code, Some(1));
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(value["checks"][0]["findings"][0]["severity"], "error");
    assert_eq!(value["checks"][0]["findings"][0]["rule"], "default-experiment");
    assert_eq!(value["model_description"]["variables"][0]["kind"]["unit"], "m");
}

#[test]
fn ctrl_c_ends_a_check_and_what_was_found_is_printed() {
    let folder = TempDir::new().unwrap();
    compiled(&folder, "first_order.c", SOUND, &["-DHANGS"]);
    let child = std::process::Command::new(env!("CARGO_BIN_EXE_airloop"))
        .args(["inspect", "--check", "m.fmu"])
        .current_dir(folder.path())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_secs(2));
    let began = std::time::Instant::now();
    let interrupt = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(interrupt.unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert!(began.elapsed().as_secs() < 10);
    assert_eq!(output.status.code(), Some(130));
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("[interrupted] call of fmi2ExitInitializationMode"), "{text}");
    assert!(text.contains("what comes after it was not looked at"), "{text}");
}

#[test]
fn findings_are_written_for_ci_as_sarif_and_junit() {
    let folder = TempDir::new().unwrap();
    let check = |report: &str| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_airloop"));
        command.args(["inspect", "--check", "m.fmu", "--report", report]).current_dir(folder.path());
        let output = command.output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    let wrong = SOUND.replace("nominal=\"1\"", "nominal=\"0\"").replace("name=\"p\"", "name=\"p&lt;q\"");
    compiled(&folder, "first_order.c", &wrong, &[]);
    assert_eq!(check("found.sarif").0, Some(1));
    let sarif: serde_json::Value = serde_json::from_str(&read("found.sarif")).unwrap();
    let results = sarif["runs"][0]["results"].as_array().unwrap();
    let nominal = results.iter().find(|result| result["ruleId"] == "nominal").unwrap();
    assert_eq!(nominal["level"], "error");
    let place = &nominal["locations"][0]["physicalLocation"];
    assert_eq!(place["region"]["startLine"], 11);
    let artifact =
        &sarif["runs"][0]["artifacts"][place["artifactLocation"]["index"].as_u64().unwrap() as usize];
    assert_eq!(artifact["location"]["uri"], "/modelDescription.xml");
    assert_eq!(
        sarif["runs"][0]["artifacts"][artifact["parentIndex"].as_u64().unwrap() as usize]["location"]["uri"],
        "m.fmu"
    );

    assert_eq!(check("found.xml").0, Some(1));
    let junit = airloop_fmi::xml::parse(read("found.xml").as_bytes()).unwrap();
    let suite = &junit.children[0];
    let failed: Vec<_> = suite.children("testcase").filter(|case| case.child("failure").is_some()).collect();
    assert_eq!(suite.attribute("failures"), Some(failed.len().to_string().as_str()));
    assert!(failed.iter().any(|case| case.attribute("name").unwrap().contains("variable p<q")));

    // A report is replaced by the next one; anything else stays.
    compiled(&folder, "first_order.c", SOUND, &[]);
    assert_eq!(check("found.xml").0, Some(0));
    assert!(read("found.xml").contains("failures=\"0\""));
    std::fs::write(folder.path().join("mine.xml"), "<mine/>").unwrap();
    let (code, text) = check("mine.xml");
    assert!(code == Some(1) && text.contains("mine.xml"), "{text}");
    assert_eq!(read("mine.xml"), "<mine/>");
    assert_eq!(check("found.txt").0, Some(2));
}
