//! Third-party FMUs under `airloop run`: the FMI 2.0 set of the Modelica Reference FMUs.
//!
//! The folder with the .fmu files is named in AIRLOOP_REFERENCE_FMUS; without it the test says that it is skipped.

use std::path::PathBuf;
use std::process::Command;

use airloop_cosim::results::summary;
use airloop_series::{TimeSeries, csv};

/// Runs an FMU with its default experiment and returns its result and how it ended.
fn run(name: &str, words: &[&str]) -> Option<(TimeSeries, String)> {
    let Some(folder) = std::env::var_os("AIRLOOP_REFERENCE_FMUS").map(PathBuf::from) else {
        println!("skipped: AIRLOOP_REFERENCE_FMUS does not name a folder with the Reference FMUs");
        return None;
    };
    let output = tempfile::tempdir().unwrap();
    let outcome = Command::new(env!("CARGO_BIN_EXE_airloop"))
        .arg("run")
        .arg(folder.join(format!("{name}.fmu")))
        .args(words)
        .arg("-o")
        .arg(output.path())
        .output()
        .unwrap();
    assert!(outcome.status.success(), "{name}: {}", String::from_utf8_lossy(&outcome.stderr));
    let result = csv::read(&output.path().join("result.csv")).unwrap();
    Some((result, summary::read(&output.path().join("summary.json")).unwrap().outcome.status))
}

#[test]
fn dahlquist_decays_like_its_formula() {
    let Some((result, _)) = run("Dahlquist", &[]) else { return };
    // The FMU integrates x' = -x with Euler steps of its own of 0.1 s: x(10) = 0.9^100.
    let last = *result.channel("x").unwrap().values.last().unwrap();
    assert!((last - 0.9f64.powi(100)).abs() < 1e-9, "{last}");
}

#[test]
fn a_bouncing_ball_stays_above_the_floor_and_comes_to_rest() {
    let Some((result, _)) = run("BouncingBall", &["--step", "10ms"]) else { return };
    let heights = &result.channel("h").unwrap().values;
    assert_eq!(heights[0], 1.0);
    assert!(heights.iter().all(|height| (-1e-2..=1.0).contains(height)));
    assert!(heights.last().unwrap().abs() < 1e-2);
}

#[test]
fn a_stair_ends_the_simulation_itself() {
    let Some((result, status)) = run("Stair", &[]) else { return };
    assert_eq!(status, "terminated");
    assert_eq!(result.time().last(), Some(&9.0));
    // The counter begins at 1 and goes up at 1 s, 2 s, ...; it depends on no input and stands where it is read.
    let counter = &result.channel("counter").unwrap().values;
    for (t, value) in result.time().iter().zip(counter) {
        assert_eq!(*value, 1.0 + (t + 1e-9).floor(), "at {t} s");
    }
}

#[test]
fn a_stair_steps_at_whole_seconds_under_the_monolithic_master_too() {
    let Some((result, _)) = run("Stair", &["--master", "monolithic", "--stop", "5", "--step", "0.2"]) else {
        return;
    };
    let counter = &result.channel("counter").unwrap().values;
    for (t, value) in result.time().iter().zip(counter).take(25) {
        assert_eq!(*value, 1.0 + (t + 1e-9).floor(), "at {t} s");
    }
}

#[test]
fn feedthrough_passes_every_type_on() {
    let words =
        ["--set", "Float64_continuous_input=2.5", "--set", "Int32_input=-7", "--set", "Boolean_input=true"];
    let Some((result, _)) = run("Feedthrough", &words) else { return };
    let last = |name: &str| *result.channel(name).unwrap().values.last().unwrap();
    assert_eq!(last("Float64_continuous_output"), 2.5);
    assert_eq!(last("Int32_output"), -7.0);
    assert_eq!(last("Boolean_output"), 1.0);
}

#[test]
fn resource_reads_its_file() {
    let Some((result, _)) = run("Resource", &[]) else { return };
    // The file holds the letter a.
    assert!(result.channel("y").unwrap().values.iter().all(|value| *value == f64::from(b'a')));
}

#[test]
fn van_der_pol_reaches_its_limit_cycle() {
    let Some((result, status)) = run("VanDerPol", &["--stop", "50"]) else { return };
    assert_eq!(status, "completed");
    let late = &result.channel("x0").unwrap().values[4000..];
    let largest = late.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
    // Amplitude of the limit cycle for mu = 1 is 2.0086; the FMU's Euler steps of 10 ms add about 1 %.
    assert!((largest - 2.0086).abs() < 0.04, "{largest}");
}
