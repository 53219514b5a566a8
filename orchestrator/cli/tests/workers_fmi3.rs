//! FMUs of FMI 3.0 in processes of their own: arrays, all types, events, lengths that differ from those of the file,
//! and a library that cannot be loaded.
#![cfg(target_os = "linux")]

use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use airloop_testing::{c_fmu, vector};

fn run(folder: &Path, words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_airloop"))
        .args(["run", "vector.fmu", "--stop", "1", "--step", "10ms", "--no-plots", "-o", "out"])
        .args(words)
        .current_dir(folder)
        .output()
        .unwrap()
}

#[test]
fn an_fmu_of_fmi_3_in_a_worker_gives_the_same_bytes() {
    let folder = vector::folder();
    let rows = (0..=100).map(|k| {
        let t = f64::from(k) / 100.0;
        format!("{t},{},{},{},{}\n", t.sin(), -t, (1_i64 << 40) * i64::from(k % 7), k % 2)
    });
    let text = "time,u[1],u[2],i64_in,f32_in\n".to_owned() + &rows.collect::<String>();
    std::fs::write(folder.path().join("input.csv"), text).unwrap();
    for words in [
        &["--master", "gauss-seidel"][..],
        &["--master", "jacobi"],
        &["--master", "monolithic"],
        &["--set", "n=3"],
        &["--set", "bytes_in=0a0b", "--set", "u64_in=9223372036854775807"],
        &["--set", "A[1,2]=-0.5", "--set", "early=true"],
    ] {
        let mut results = Vec::new();
        for isolate in [&[][..], &["--isolate"]] {
            let output = run(folder.path(), &[&["--input", "input.csv"], words, isolate].concat());
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{words:?} {isolate:?}: {said}");
            results.push(std::fs::read_to_string(folder.path().join("out/result.csv")).unwrap());
        }
        assert!(results[0].lines().count() > 100, "{words:?}: {}", results[0]);
        assert!(results[0] == results[1], "{words:?}");
        // What a column says reaches the input of its name, also where there are more inputs than in the file.
        let mut lines = results[0].lines();
        let names: Vec<&str> = lines.next().unwrap().split(',').collect();
        let column = |name: &str| names.iter().position(|column| *column == name).unwrap();
        let (given, passed) = (column("i64_in"), column("i64_out"));
        let number = |text: &str| text.parse::<f64>().unwrap();
        let rows: Vec<Vec<f64>> = lines.map(|line| line.split(',').map(number).collect()).collect();
        // No step begins in the last row.
        assert!(rows[..rows.len() - 1].iter().all(|row| row[given] == row[passed]), "{words:?}");
        assert!(rows.iter().any(|row| row[passed] == 6.0 * (1_i64 << 40) as f64), "{words:?}");
    }
}

#[test]
fn a_killed_run_of_an_fmu_of_fmi_3_with_arrays_goes_on_as_if_it_had_not_been() {
    let folder = vector::folder();
    let path = |name: &str| folder.path().join(name);
    let rows = |name: &str| std::fs::read(path(name).join("result.csv")).unwrap();
    for isolate in [&[][..], &["--isolate"]] {
        let words = [&["--stop", "100", "--step", "10ms", "--no-plots", "-q"], isolate].concat();
        let airloop = |more: &[&str]| {
            let mut command = Command::new(env!("CARGO_BIN_EXE_airloop"));
            command.args(["run", "vector.fmu"]).args(&words).args(more).current_dir(folder.path());
            command
        };
        assert!(airloop(&["-o", "whole"]).status().unwrap().success());
        let mut killed = airloop(&["-o", "killed", "--save-states", "1us"]).spawn().unwrap();
        let states = path("killed/result.partial.states.json");
        let began = Instant::now();
        while !states.exists() && began.elapsed() < Duration::from_secs(30) {
            assert!(killed.try_wait().unwrap().is_none(), "the run was through before it could be killed");
        }
        killed.kill().unwrap();
        killed.wait().unwrap();
        let output = airloop(&["-o", "other", "--restart-from", "killed"]).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(rows("other") == rows("whole"), "{isolate:?}");
        std::fs::remove_dir_all(path("killed")).unwrap();
    }
}

#[test]
fn a_library_of_fmi_3_that_lacks_its_functions_is_named_from_the_worker() {
    let folder = vector::folder();
    let library = folder.path().join("other.so");
    c_fmu::compile("hostile.c", &library, &["-pthread"]);
    let description = vector::description();
    let path = folder.path().join("vector.fmu");
    c_fmu::pack_for(&path, &description, Some(("vector", &library)), "x86_64-linux");
    let mut said = Vec::new();
    for isolate in [&[][..], &["--isolate"]] {
        let output = run(folder.path(), isolate);
        assert_eq!(output.status.code(), Some(1));
        said.push(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    for text in &said {
        assert!(text.contains("vector.fmu") && text.contains("fmi3"), "{text}");
    }
}
