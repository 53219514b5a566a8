//! Some mutated inputs for every reader, and every input that once was too much for one.

use std::path::Path;
use std::process::Command;

fn fuzz(words: &[&str]) {
    let output = Command::new(env!("CARGO_BIN_EXE_airloop-fuzz")).args(words).output().unwrap();
    let said = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{words:?}\n{}{}", said(&output.stdout), said(&output.stderr));
}

#[test]
fn no_reader_is_killed_by_a_mutated_file() {
    let keep = tempfile::tempdir().unwrap();
    fuzz(&["run", "--inputs", "100", "--seed", "2026", "--keep", &keep.path().display().to_string()]);
}

#[test]
fn inputs_that_were_faults_are_read_or_refused() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("regressions");
    let mut count = 0;
    for target in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let name = target.file_name().unwrap().to_string_lossy().into_owned();
        for file in std::fs::read_dir(&target).unwrap().map(|entry| entry.unwrap().path()) {
            fuzz(&["replay", &name, &file.display().to_string()]);
            count += 1;
        }
    }
    assert!(count > 0, "the regressions are gone");
}
