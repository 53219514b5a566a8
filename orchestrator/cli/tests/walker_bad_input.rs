//! Half steps that cannot be done, through the binary: what is said names the phase and the constraint.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Exit code and error message for the problem of example 04 with texts replaced by others; none without FMUs.
fn error_message(changes: &[(&str, &str)]) -> Option<(i32, String)> {
    if !project().join("target/fmu/compass-gait.fmu").exists() {
        eprintln!("skipped: target/fmu/compass-gait.fmu is not built (make fmu)");
        return None;
    }
    let example = project().join("examples/04_half_step").canonicalize().unwrap();
    let mut text = std::fs::read_to_string(example.join("problem.toml")).unwrap();
    let here = |name: &str| (format!("\"{name}\""), format!("{:?}", example.join(name)));
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    for (name, path) in ["walker.ssd", "toe.ssd", "../../target/fmu/compass-gait.fmu"].map(here) {
        text = text.replace(&name, &path);
    }
    let folder = TempDir::new().unwrap();
    let problem = folder.path().join("problem.toml");
    std::fs::write(&problem, text).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_airloop"))
        .args(["optimize", "problem.toml", "-o", "out", "--no-plots", "--quiet", "--threads", "1"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    Some((output.status.code().unwrap(), String::from_utf8_lossy(&output.stderr).into_owned()))
}

fn says(from: &str, to: &str, code: i32, parts: &[&str]) {
    all_say(&[(from, to)], code, parts);
}

fn all_say(changes: &[(&str, &str)], code: i32, parts: &[&str]) {
    let Some((found, message)) = error_message(changes) else { return };
    assert_eq!(found, code, "{message}");
    for part in parts {
        assert!(message.contains(part), "{part}: {message}");
    }
}

const DOUBLE_SUPPORT: &str = "parameters = { \"walker.contact_mode\" = 5 }";
const IMPACT: &str = "\"walker.impact_map\" = 4";

#[test]
fn a_step_that_is_too_long_is_named_with_the_length_that_lacks() {
    // Legs of 1.05 m and 0.8 rad between them reach 2 * 1.05 sin(0.4) = 0.82 m at most while both feet stand; it may be
    // more for the moment of touch-down alone, with another hip, but never 1.9 m.
    let parts = ["infeasible", "phase `swing of leg 2`", "walker.foot2.x = 1.9 m", "violated by"];
    says("\"walker.foot2.x\" = 0.25", "\"walker.foot2.x\" = 1.9", 20, &parts);
}

#[test]
fn the_release_of_a_foot_that_is_not_on_the_ground_is_refused() {
    let parts = ["phase `double support`, final `walker.foot1.ft`", "0 N whatever the motion", "line"];
    says(DOUBLE_SUPPORT, "parameters = { \"walker.contact_mode\" = 4 }", 1, &parts);
    says(DOUBLE_SUPPORT, "parameters = { \"walker.contact_mode\" = 2 }", 1, &parts);
}

#[test]
fn an_impact_without_the_landing_foot_is_refused() {
    let parts = ["phase `double support`, reset `impulse forwards", "0 N.s whatever the motion"];
    says(IMPACT, "\"walker.impact_map\" = 2", 1, &parts);
    let parts = ["phase `double support`, reset `walker.after.foot1.Lt`", "0 N.s whatever the motion"];
    says(IMPACT, "\"walker.impact_map\" = 1", 1, &parts);
}

#[test]
fn phases_that_no_event_leads_to_are_named() {
    // Nothing sets foot 2 down; the second phase holds it where it is.
    let parts = ["does not go through the phases", "phase `double support`"];
    says("\"walker.foot2.x\" = 0.25\n\"walker.foot2.y\" = 0\n", "", 20, &parts);
    // Foot 1 is let go under load: the plan waits for a force on foot 2 to vanish.
    let parts = ["does not go through the phases", "phase `swing of leg 1`"];
    let (from, to) = (
        "\"walker.foot1.ft\" = 0\n\"walker.foot1.fn\" = 0",
        "\"walker.foot2.ft\" = 0\n\"walker.foot2.fn\" = 0",
    );
    says(from, to, 20, &parts);
}

#[test]
fn a_foot_in_the_ground_at_the_start_is_refused() {
    let parts = ["phase `swing of leg 2`, initial states", "foot 2", "below the ground"];
    says("\"walker.l2\" = 1.0\n\"walker.vx\"", "\"walker.l2\" = 1.05\n\"walker.vx\"", 1, &parts);
}

#[test]
fn legs_without_length_on_the_ground_are_a_singular_contact_set() {
    let bounds = |l: &str| format!("[phase.bounds]\n\"walker.{l}\" = {{ min = 0.9");
    let changes = [
        ("\"walker.y\" = 1.045", "\"walker.y\" = 0"),
        ("\"walker.l1\" = 1.045", "\"walker.l1\" = 0"),
        ("\"walker.l2\" = 1.0", "\"walker.l2\" = 0"),
        (&bounds("l1"), "[phase.bounds]\n\"walker.l1\" = { min = 0"),
        ("\"walker.l2\" = { min = 0.9", "\"walker.l2\" = { min = 0"),
    ];
    let parts = ["phase `swing of leg 2`, initial states", "both feet is singular at l1 = 0 m, l2 = 0 m"];
    all_say(&changes, 1, &parts);
}

#[test]
fn an_event_that_the_plan_does_not_have_is_named() {
    // Without an impact foot 2 goes on at its velocity, into the ground.
    let example = project().join("examples/04_half_step/problem.toml");
    let text = std::fs::read_to_string(example).unwrap();
    let from = text.find("[phase.reset]").unwrap();
    let reset = &text[from..from + text[from..].find("[phase.final]").unwrap()];
    says(reset, "", 20, &["does not go through the phases", "phase `double support`", "after an event"]);
}
