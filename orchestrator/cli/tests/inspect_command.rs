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
        let finding = &value["checks"][0]["findings"][0];
        assert_eq!(finding["rule"], "process-lost", "{fault}");
        assert!(finding["element"].as_str().unwrap().contains("fmi2ExitInitializationMode"), "{finding}");
        assert!(finding["message"].as_str().unwrap().contains(expected), "{finding}");
    }

    compiled(&folder, "first_order.c", &SOUND.replace("stopTime=\"1\"", "stopTime=\"-1\""), &[]);
    let (code, text) = airloop(&["inspect", "--check", "--no-run", "--json", "m.fmu"]);
    assert_eq!(code, Some(1));
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(value["checks"][0]["findings"][0]["severity"], "error");
    assert_eq!(value["checks"][0]["findings"][0]["rule"], "default-experiment");
    assert_eq!(value["model_description"]["variables"][0]["kind"]["unit"], "m");
}
