//! `airloop identify state-space` and `identify compare` through the binary: models, files, exit codes, messages.

use std::fmt::Write as _;
use std::process::{Command, Output};

use airloop_ident::model::{Linear, StateSpace, file};
use nalgebra::{DMatrix, DVector};
use serde_json::Value;
use tempfile::TempDir;

fn airloop(folder: &TempDir, words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_airloop")).args(words).current_dir(folder.path()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn summary(folder: &TempDir, output: &str) -> Value {
    let text = std::fs::read_to_string(folder.path().join(output).join("summary.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// Uniform values between -1 and 1.
fn noise(seed: u64, n: usize) -> Vec<f64> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    (0..n).map(|_| next()).collect()
}

/// One input, two outputs, three states: an oscillator and a lag, with direct term.
fn truth() -> StateSpace {
    StateSpace {
        sample_time: 0.02,
        a: DMatrix::from_row_slice(3, 3, &[0.85, 0.3, 0.0, -0.3, 0.85, 0.1, 0.0, 0.0, 0.5]),
        b: DMatrix::from_row_slice(3, 1, &[0.5, 1.0, 1.0]),
        c: DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 0.3, 0.5, -0.7, 1.0]),
        d: DMatrix::from_row_slice(2, 1, &[0.4, 0.0]),
        gain: None,
        input_offset: vec![0.0],
        output_offset: vec![0.0; 2],
    }
}

/// A record of the model from a random initial state, with measurement noise of half width `size`.
fn record(folder: &TempDir, name: &str, model: &StateSpace, n: usize, size: f64, seed: u64) {
    let u = noise(seed, n);
    let x0 = DVector::from_vec(noise(seed + 1, model.order()));
    let y = model.simulate_from(&x0, std::slice::from_ref(&u));
    let e: Vec<Vec<f64>> = (0..2).map(|i| noise(seed + 10 + i, n)).collect();
    let mut table = String::from("time,u,y1 [mm],y2\n");
    for k in 0..n {
        let t = k as f64 * model.sample_time;
        writeln!(table, "{t:.4},{},{},{}", u[k], y[0][k] + size * e[0][k], y[1][k] + size * e[1][k]).unwrap();
    }
    std::fs::write(folder.path().join(name), table).unwrap();
}

fn identify(folder: &TempDir, words: &[&str]) -> Output {
    airloop(folder, &[&["identify"], words, &["--inputs", "u", "--outputs", "y1,y2"]].concat())
}

#[test]
fn a_system_comes_back_with_its_order_and_files() {
    let folder = tempfile::tempdir().unwrap();
    for (name, seed) in [("a.csv", 1), ("b.csv", 2), ("check.csv", 3)] {
        record(&folder, name, &truth(), 600, 0.0, 100 * seed);
    }
    let words = ["state-space", "a.csv", "b.csv", "--validate", "check.csv", "--max-order", "5", "-o", "m"];
    let output = identify(&folder, &words);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let printed = text(&output.stdout);
    assert!(printed.contains("order 3 of 1 to 5 is enough"), "{printed}");
    let summary = summary(&folder, "m");
    assert_eq!(summary["structure"]["order"], 3);
    assert_eq!(summary["stable"], true);
    for set in ["estimation", "validation"] {
        for fits in ["fit_simulated", "fit_one_step"] {
            assert!(summary[set][fits]["y1"].as_f64().unwrap() > 99.999, "{set} {fits}: {}", summary[set]);
        }
    }
    let Linear::StateSpace(model) = file::load(&folder.path().join("m/model.toml")).unwrap().model else {
        panic!("no state space")
    };
    for (found, expected) in model.markov_parameters(20).iter().zip(truth().markov_parameters(20)) {
        assert!((found - expected).amax() < 1e-6);
    }
    let listed = summary["files"].as_array().unwrap().iter().chain(summary["figures"].as_array().unwrap());
    for name in listed {
        assert!(folder.path().join("m").join(name.as_str().unwrap()).is_file(), "{name}");
    }
    assert!(folder.path().join("m/index.html").is_file());
}

#[test]
fn with_noisy_sensors_fresh_data_are_fitted_as_well_as_by_the_true_model() {
    let folder = tempfile::tempdir().unwrap();
    for (name, seed) in [("a.csv", 1), ("b.csv", 2), ("check.csv", 3)] {
        record(&folder, name, &truth(), 1500, 0.4, 100 * seed);
    }
    let words = ["state-space", "a.csv", "b.csv", "--validate", "check.csv", "--order", "3", "-o", "m"];
    let output = identify(&folder, &words);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let summary = summary(&folder, "m");
    let noise_free = summary["validation"]["rms_simulated"]["y1"].as_f64().unwrap();
    // Uniform noise of half width 0.4 has an RMS of 0.4 / sqrt(3): what the true model leaves.
    assert!(noise_free < 0.4 / 3f64.sqrt() * 1.02, "{noise_free}");
}

#[test]
fn the_comparison_finds_the_order_and_writes_its_table() {
    let folder = tempfile::tempdir().unwrap();
    for (name, seed) in [("a.csv", 1), ("b.csv", 2), ("check.csv", 3)] {
        record(&folder, name, &truth(), 800, 0.1, 100 * seed);
    }
    let words =
        ["compare", "a.csv", "b.csv", "--validate", "check.csv", "--arx", "1..3", "--state-space", "1..4"];
    let output = identify(&folder, &[&words[..], &["-o", "c"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let printed = text(&output.stdout);
    assert!(printed.contains("state space: order 3 is enough"), "{printed}");
    let summary = summary(&folder, "c");
    assert_eq!(summary["enough"]["state_space"], 3);
    let table = std::fs::read_to_string(folder.path().join("c/compare.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + 3 + 4);
    assert!(table.starts_with("model,order,coefficients,stable,validation_simulated_mean,"), "{table}");
    // Order 1 of the ARX family has A1, B0 and B1 for both outputs.
    assert!(table.contains("\narx,1,8,true,"), "{table}");
    for name in summary["figures"].as_array().unwrap() {
        assert!(folder.path().join("c").join(name.as_str().unwrap()).is_file(), "{name}");
    }
}

#[test]
fn an_unstable_model_has_no_number_that_looks_like_a_fit() {
    let folder = tempfile::tempdir().unwrap();
    let mut growing = truth();
    growing.a[(2, 2)] = 1.02;
    for (name, seed) in [("a.csv", 1), ("check.csv", 3)] {
        record(&folder, name, &growing, 300, 0.0, 100 * seed);
    }
    let words = ["a.csv", "--validate", "check.csv", "-o", "m", "--refine", "none"];
    let output = identify(&folder, &[&["state-space", "--order", "3"], &words[..]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("UNSTABLE"));
    let found = summary(&folder, "m");
    assert_eq!(found["stable"], false);
    assert!(found["validation"]["fit_simulated"]["y1"].is_null());
    let output = identify(&folder, &[&["compare", "--arx", "3", "--state-space", "3"], &words[..]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let printed = text(&output.stdout);
    assert!(printed.contains("unstable, and therefore without a simulated fit: "), "{printed}");
    assert!(summary(&folder, "m")["models"][1]["validation"]["mean_fit_simulated"].is_null());
}

#[test]
fn without_validation_files_a_part_is_held_out_and_said_so() {
    let folder = tempfile::tempdir().unwrap();
    record(&folder, "a.csv", &truth(), 900, 0.1, 100);
    let output = identify(&folder, &["compare", "a.csv", "--arx", "2", "--state-space", "2..3", "-o", "c"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("the last third of each file is held out"));
}

#[test]
fn what_cannot_be_done_is_said_with_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    record(&folder, "a.csv", &truth(), 100, 0.1, 100);
    let failed = |words: &[&str], code: i32, message: &str| {
        let output = identify(&folder, words);
        let error = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{error}");
        assert!(error.contains(message), "{error}");
    };
    failed(&["state-space", "a.csv", "--order", "30"], 1, "record more, or lower the order");
    failed(&["state-space", "a.csv", "--order", "4", "--horizon", "2"], 1, "choose a longer horizon");
    failed(&["state-space", "a.csv", "--order", "0"], 2, "write a number from 1 to 40, or auto");
    failed(&["compare", "a.csv", "--arx", "3..1"], 2, "write orders from 1 to 40");
    failed(&["compare", "a.csv", "--fmu", "m"], 2, "unexpected argument '--fmu'");
}
